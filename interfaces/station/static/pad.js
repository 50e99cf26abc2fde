// The stick on the page, and a gamepad: both steer the tool, or a mobile robot.
import { h, write } from "./dom.js";

/** Deflections smaller than this are none. */
const DEAD = 0.12;
const RADIUS = 38;
/** Time between two looks at the gamepad [ms]. */
const LOOK = 40;
const TOOL = {
  stick: "Stick: drag it to move the tool in x and y",
  gamepad: "Gamepad: sticks move and turn the tool, the triggers lift it, B stops",
};

/** A deflection with a dead zone, finer near the middle. */
function shaped(value) {
  const size = Math.max(0, (Math.abs(value) - DEAD) / (1 - DEAD));
  return Math.sign(value) * size ** 1.5;
}

/**
 * @param {object} station
 * @param {Element} box
 * @param {object} steer takes inputs
 * @param {object} jog knows speed and frame
 * @param {{stick: string, gamepad: string}} words what they do
 */
export function mountPad(station, box, steer, jog, words = TOOL) {
  const knob = h("i.knob");
  const stick = h("div.stick", { role: "img", "aria-label": words.stick }, knob);
  const found = h("p.hint.gamepad");
  box.append(stick, found);
  let lean = [0, 0];

  function set(x, y) {
    lean = [x, y];
    knob.style.transform = `translate(${x * RADIUS}px, ${y * RADIUS}px)`;
  }

  stick.addEventListener("pointerdown", (event) => {
    stick.setPointerCapture(event.pointerId);
    follow(event);
    steer.hold("stick", () => jog.twist([-shaped(lean[1]), -shaped(lean[0]), 0, 0, 0, 0]), () => set(0, 0));
  });
  stick.addEventListener("pointermove", (event) => stick.hasPointerCapture(event.pointerId) && follow(event));
  stick.addEventListener("lostpointercapture", () => {
    set(0, 0);
    steer.release("stick");
  });

  function follow(event) {
    const middle = stick.getBoundingClientRect();
    const x = (event.clientX - middle.left - middle.width / 2) / RADIUS;
    const y = (event.clientY - middle.top - middle.height / 2) / RADIUS;
    const length = Math.max(1, Math.hypot(x, y));
    set(x / length, y / length);
  }

  let [held, stopped] = [false, false];
  setInterval(() => {
    const pad = gamepad();
    found.hidden = !pad;
    write(found, pad ? words.gamepad : "");
    if (!pad) {
      if (held) steer.release("pad");
      held = false;
      return;
    }
    const pressed = pad.buttons[1]?.pressed === true;
    if (pressed && !stopped) station.stop.press();
    stopped = pressed;
    const moves = twistOf(pad).some((part) => part !== 0);
    if (moves && !held && station.session.holds) station.notices.use(null);
    if (moves && !held && station.session.holds) held = steer.hold("pad", () => jog.twist(twistOf(gamepad())), () => (held = false));
    else if (!moves && held) {
      held = false;
      steer.release("pad");
    }
  }, LOOK);

  /** The gamepad as it is now: what was asked for before doesn't change in every browser. */
  function gamepad() {
    return [...(navigator.getGamepads?.() ?? [])].find((one) => one && one.connected);
  }

  function twistOf(pad) {
    if (!pad) return [0, 0, 0, 0, 0, 0];
    const [x, y, turnX, turnY] = [0, 1, 2, 3].map((axis) => shaped(pad.axes[axis] ?? 0));
    const lift = shaped((pad.buttons[7]?.value ?? 0) - (pad.buttons[6]?.value ?? 0));
    return [-y, -x, lift, turnX, turnY, 0].map((part) => part || 0);
  }
}
