// Driving: by buttons that are held, by keys, by the stick on the page and by a gamepad; and how both robots are.
import { DEGREES, figure, h, isTyping, planted, write } from "./dom.js";
import { Held, Needs, Speed, SpeedRow } from "./handling.js";
import { Pad } from "./pad.js";
import { html, Icon } from "./ui.js";

/** Keys, and the shares of the speeds v and w that they ask for. */
const KEYS = {
  ArrowUp: [1, 0], ArrowDown: [-1, 0], ArrowLeft: [0, 1], ArrowRight: [0, -1],
  KeyW: [1, 0], KeyS: [-1, 0], KeyA: [0, 1], KeyD: [0, -1],
};
const BUTTONS = [
  ["Forward left", "north_west", [1, 0.6]], ["Forward", "north", [1, 0]], ["Forward right", "north_east", [1, -0.6]],
  ["Turn left", "rotate_left", [0, 1]], null, ["Turn right", "rotate_right", [0, -1]],
  ["Back left", "south_west", [-1, -0.6]], ["Back", "south", [-1, 0]], ["Back right", "south_east", [-1, 0.6]],
];
const SPEED = "vrs-drive-speed";
const WORDS = {
  stick: "Stick: drag it up to drive, sideways to turn",
  gamepad: "Gamepad: the left stick drives, B stops",
};
const PERIOD = 100;

export function mount(station, box) {
  document.head.append(h("link", { rel: "stylesheet", href: "/station/driving.css" }));
  const { session, steer } = station;
  /** The buttons, by what they ask for. */
  const buttons = new Map();
  /** Keys that are down, by what they ask for. */
  const down = new Map();

  const speed = new Speed(SPEED, "60");

  /** The drive that shares of the full speeds stand for; null before the limits are known. */
  function drive(forward, left) {
    const { welcome } = session;
    if (!welcome) return null;
    const { share } = speed;
    const { v_max, w_max } = welcome.limits;
    const within = (part) => Math.max(-1, Math.min(1, part));
    return { type: "drive", v: within(forward) * share * v_max, w: within(left) * share * w_max, duration: welcome.holds };
  }

  const pressed = () => {
    const sum = [0, 0];
    for (const [forward, left] of down.values()) {
      sum[0] += forward;
      sum[1] += left;
    }
    return drive(...sum);
  };

  const cross = h("div.cross", { role: "group", "aria-label": "Drive" },
    ...BUTTONS.map((entry) => (entry ? button(...entry) : h("span", { "aria-hidden": "true" }))));
  const twist = ([forward, left]) => drive(forward, left);
  const pad = h("div.pad-row", {}, planted(html`<${Pad} station=${station} twist=${twist} words=${WORDS} />`));
  const facts = h("dl.facts.drive-facts");
  const cells = {};
  for (const [name, label, title] of [
    ["virtual", "Virtual robot", "How fast it drives and turns"],
    ["real", "Real robot", "What its motors are told"],
    ["error", "Path error", "How far the real robot is from the virtual one's path"],
    ["later", "Time difference", "How much later it is there"],
    ["offset", "Robot plays", "D: how far behind the operator its architecture plays"],
    ["round", "Round trip", "Of the newest message to the robot and its answer"],
    ["room", "Room", "Where both drive"],
    ["why", "Waits because", "Why the real robot doesn't follow"],
  ]) {
    cells[name] = h("dd", { id: `drive-${name}` }, "–");
    facts.append(h("dt", { title }, label), cells[name]);
  }
  box.append(planted(html`<${Needs} station=${station} id="drive-needs" />`),
    planted(html`<${SpeedRow} speed=${speed} />`),
    h("div.drive-by", {}, cross, pad),
    h("p.hint", {}, "Arrow keys or W A S D drive, two at once make a curve; the space bar stops."),
    facts);

  function button(label, symbol, [forward, left]) {
    const made = planted(html`<${Held} steer=${steer} source="button" aria-label=${label} title=${label}
      input=${() => drive(forward, left)}><${Icon} name=${symbol} /><//>`);
    buttons.set(`${forward} ${left}`, made.firstChild);
    return made;
  }

  window.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.altKey || event.metaKey || isTyping(event)) return;
    if (event.target.closest?.("select, input, dialog")) return;
    const parts = KEYS[event.code];
    if (!parts || !session.holds) return;
    event.preventDefault();
    if (event.repeat) return;
    down.set(event.code, parts);
    station.notices.use(buttons.get(parts.join(" ")));
    if (down.size === 1) steer.hold("keys", pressed, () => down.clear());
  });
  window.addEventListener("keyup", (event) => {
    if (down.delete(event.code) && down.size === 0) steer.release("keys");
  });

  function tell() {
    const { state, welcome } = session;
    if (!state || box.offsetParent === null) return;
    const speeds = (pair) => (pair ? `${figure(pair[0], 2)} m/s, ${figure(pair[1] * DEGREES, 0)} deg/s` : "–");
    const seconds = (x) => (x == null ? "–" : `${figure(x, 2)} s`);
    write(cells.virtual, speeds(state.command));
    write(cells.real, speeds(state.drive));
    write(cells.error, state.path_error == null ? "–" : `${figure(100 * state.path_error, 1)} cm`);
    write(cells.later, seconds(state.time_difference));
    write(cells.offset, state.D == null ? "–" : `${figure(-state.D, 2)} s behind, and what braking needs`);
    write(cells.round, state.round_trip == null ? "–" : `${figure(1000 * state.round_trip, 0)} ms`);
    write(cells.room, welcome?.room || "–");
    write(cells.why, state.halted || "–");
  }

  setInterval(tell, PERIOD);
}
