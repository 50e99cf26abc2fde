// Driving: by buttons that are held, by keys, by the stick on the page and by a gamepad; and how both robots are.
import { Held, Needs, Speed, SpeedRow } from "./handling.js";
import { Pad } from "./pad.js";
import { DEGREES, figure, html, Icon, isTyping, untracked, useEvery, useMemo, useOn, useRef, useState } from "./ui.js";

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

/** How both robots are: its name, what it stands for, and its words at a state of the session. */
const FACTS = [
  ["virtual", "Virtual robot", "How fast it drives and turns", ({ command }) => speeds(command)],
  ["real", "Real robot", "What its motors are told", ({ drive }) => speeds(drive)],
  ["error", "Path error", "How far the real robot is from the virtual one's path", ({ path_error: e }) => told(e, 100, 1, " cm")],
  ["later", "Time difference", "How much later the real robot is there", ({ time_difference: t }) => told(t, 1, 2, " s")],
  ["offset", "Robot plays", "D: how far behind the operator its architecture plays",
    ({ D }) => (D == null ? "–" : `${figure(-D, 2)} s behind, and what braking needs`)],
  ["round", "Round trip", "Of the newest message to the robot and its answer", ({ round_trip: t }) => told(t, 1000, 0, " ms")],
  ["room", "Room", "Where both drive", (_, welcome) => welcome?.room || "–"],
  ["why", "Waits because", "Why the real robot doesn't follow", ({ halted }) => halted || "–"],
];

const told = (x, scale, digits, unit) => (x == null ? "–" : figure(scale * x, digits) + unit);
const speeds = (pair) => (pair ? `${figure(pair[0], 2)} m/s, ${figure(pair[1] * DEGREES, 0)}°/s` : "–");

export function Panel({ station }) {
  const { session, steer } = station;
  const speed = useMemo(() => new Speed(SPEED, "60"), []);
  /** Keys that are down, by what they ask for. */
  const down = useRef(new Map()).current;

  /** The drive that shares of the full speeds stand for; null before the limits are known. */
  function drive([forward, left]) {
    const { welcome } = session;
    if (!welcome) return null;
    const { v_max, w_max } = welcome.limits;
    const share = (part) => Math.max(-1, Math.min(1, part)) * speed.share;
    return { type: "drive", v: share(forward) * v_max, w: share(left) * w_max, duration: welcome.holds };
  }

  const pressed = () => drive([...down.values()].reduce(([v, w], [forward, left]) => [v + forward, w + left], [0, 0]));

  useOn(window, "keydown", (event) => {
    if (event.ctrlKey || event.altKey || event.metaKey || isTyping(event)) return;
    if (event.target.closest?.("select, input, dialog")) return;
    const parts = KEYS[event.code];
    if (!parts || !session.holds) return;
    event.preventDefault();
    if (event.repeat) return;
    down.set(event.code, parts);
    station.notices.use(document.querySelector(`[data-drive="${parts.join(" ")}"]`));
    if (down.size === 1) steer.hold("keys", pressed, () => down.clear());
  });
  useOn(window, "keyup", (event) => down.delete(event.code) && down.size === 0 && steer.release("keys"));
  const why = steer.idle;
  return html`<link rel="stylesheet" href="/station/driving.css" />
    <${Needs} station=${station} id="drive-needs" />
    <div class="drive-by">
      <div class="cross" role="group" aria-label="Drive">
        ${BUTTONS.map((entry) => (entry ? html`<${Held} steer=${steer} source="button" why=${why} aria-label=${entry[0]} title=${entry[0]}
          data-drive=${entry[2].join(" ")} input=${() => drive(entry[2])}><${Icon} name=${entry[1]} /><//>` : html`<span aria-hidden="true"></span>`))}</div>
      <div class="pad-row"><${Pad} station=${station} twist=${drive} words=${WORDS} why=${why} /></div></div>
    <${SpeedRow} speed=${speed} />
    <p class="hint">Arrow keys or W A S D drive, two at once make a curve; the space bar stops.</p>
    <${Facts} station=${station} />`;
}

function Facts({ station: { session, layout } }) {
  const [, draw] = useState(0);
  useEvery(PERIOD, () => layout.shown === "drive" && draw((count) => count + 1));
  const state = untracked(() => session.state) ?? {};
  return html`<dl class="facts drive-facts">${FACTS.map(([name, label, title, words]) =>
    html`<dt title=${title}>${label}</dt><dd id=${`drive-${name}`}>${words(state, session.welcome)}</dd>`)}</dl>`;
}
