// The stick on the page, and a gamepad: both steer the tool, or a mobile robot.
import { html, useEvery, useRef, useState } from "./ui.js";

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

/** The gamepad as it is now: what was asked for before doesn't change in every browser. */
function gamepad() {
  return [...(navigator.getGamepads?.() ?? [])].find((one) => one?.connected);
}

/** What a gamepad asks for, as shares of a twist. */
function partsOf(pad) {
  if (!pad) return [0, 0, 0, 0, 0, 0];
  const [x, y, turnX, turnY] = [0, 1, 2, 3].map((axis) => shaped(pad.axes[axis] ?? 0));
  const lift = shaped((pad.buttons[7]?.value ?? 0) - (pad.buttons[6]?.value ?? 0));
  return [-y, -x, lift, turnX, turnY, 0].map((part) => part || 0);
}

/**
 * @param {object} station
 * @param {(parts: number[]) => object} twist the input that shares of the full speeds stand for
 * @param {{stick: string, gamepad: string}} words what they do
 * @param {string} why the stick can't work now
 */
export function Pad({ station, twist, words = TOOL, why = "" }) {
  const { steer, session } = station;
  const [found, setFound] = useState(false);
  const [stick, knob, lean] = [useRef(null), useRef(null), useRef([0, 0])];
  /** What the gamepad does: whether it steers, and whether its B is down. */
  const held = useRef({ steers: false, stops: false }).current;

  function set(x, y) {
    lean.current = [x, y];
    knob.current.style.transform = `translate(${x * RADIUS}px, ${y * RADIUS}px)`;
  }

  function follow(event) {
    if (!stick.current.hasPointerCapture(event.pointerId)) return;
    const box = stick.current.getBoundingClientRect();
    const x = (event.clientX - box.left - box.width / 2) / RADIUS;
    const y = (event.clientY - box.top - box.height / 2) / RADIUS;
    const length = Math.max(1, Math.hypot(x, y));
    set(x / length, y / length);
  }

  function grab(event) {
    stick.current.setPointerCapture(event.pointerId);
    follow(event);
    const [x, y] = [0, 1];
    steer.hold("stick", () => twist([-shaped(lean.current[y]), -shaped(lean.current[x]), 0, 0, 0, 0]), () => set(0, 0));
  }

  function drop() {
    set(0, 0);
    steer.release("stick");
  }

  useEvery(LOOK, () => {
    const pad = gamepad();
    if (Boolean(pad) !== found) setFound(Boolean(pad));
    const stops = pad?.buttons[1]?.pressed === true;
    if (stops && !held.stops) station.stop.press();
    held.stops = stops;
    const moves = partsOf(pad).some((part) => part !== 0);
    if (moves && !held.steers && session.holds) {
      station.notices.use(null);
      held.steers = steer.hold("pad", () => twist(partsOf(gamepad())), () => (held.steers = false));
    } else if (!moves && held.steers) {
      held.steers = false;
      steer.release("pad");
    }
  });
  return html`<div class="stick" role="img" ref=${stick} aria-label=${words.stick} title=${why || words.stick} data-off=${why ? "" : undefined}
      onPointerDown=${grab} onPointerMove=${follow} onLostPointerCapture=${drop}><i class="knob" ref=${knob}></i></div>
    <p class="hint gamepad" hidden=${!found}>${found ? words.gamepad : ""}</p>`;
}
