// The 2D map: walls, both robots, what the laser sees, how sure the place is, the route; a click sends the robot there.
import { Needs } from "./handling.js";
import { FloorPlan } from "./plan.js";
import { ask, goalText } from "./tasks.js";
import { barred, DEGREES, figure, html, useEffect, useEvery, useLayoutEffect, useMemo, useRef, useState } from "./ui.js";

const PERIOD = 100;
/** Words for how a journey is. */
const STATES = {
  idle: "No goal yet.",
  driving: "On its way",
  waiting: "Waits",
  arrived: "Arrived",
  failed: "Couldn't get there",
  ended: "Ended",
};
const FIELDS = [["x", "x", "m"], ["y", "y", "m"], ["heading", "Heading", "°"]];
/** What the map's lines, colours and marks mean: of which class each is, and its words. */
const LEGEND = [
  ["real", "Real robot, as it takes itself to be"],
  ["virtual", "Virtual robot"],
  ["doubt", "How surely it knows its place (2σ)"],
  ["things", "Walls and things on the map"],
  ["seen", "What its laser sees"],
  ["route", "Way that it drives"],
  ["goal", "Goal"],
  ["places", "Named place"],
  ["vias", "Point that ways lead over"],
];

export function Panel({ station }) {
  const { session } = station;
  const { tasks } = session;
  const [fault, setFault] = useState("");
  const go = (goal) => ask(station, { go: goal }, setFault);
  const why = station.idle;
  const places = Object.entries(tasks?.jobs.places ?? {});
  return html`<link rel="stylesheet" href="/station/tasks.css" />
    <${Needs} station=${station} id="map-needs" />
    <${Chart} station=${station} go=${go} />
    <p class="hint">Click where the robot is to go; drag to say how it's to stand there. Escape takes it back.</p>
    <p class="refused" id="goal-fault">${fault}</p>
    <${JourneyLine} station=${station} />
    <div class="places" role="group" aria-label="Places">${places.map(([name, goal]) =>
      html`<button type="button" ...${barred(why, goalText(goal))} onClick=${() => go(goal)}>${name}</button>`)}</div>
    <${GoalForm} why=${why} go=${go} />
    <details class="map-legend" open><summary>Legend</summary><ul>${LEGEND.map(([name, words]) =>
      html`<li><svg class="key" viewBox="-0.3 -0.2 0.6 0.4" aria-hidden="true"><${Key} name=${name} /></svg>${words}</li>`)}</ul></details>`;
}

/** A mark of the map, as the legend shows it. */
function Key({ name }) {
  const of = `plan-${name}`;
  if (name === "seen") return html`<path class=${of} d="M-0.2 0h0M-0.07 0h0M0.07 0h0M0.2 0h0" />`;
  if (name === "route") return html`<path class=${of} d="M-0.25 0H0.25" />`;
  if (name === "goal") return html`<path class=${of} d="M-0.12 -0.12L0.12 0.12M-0.12 0.12L0.12 -0.12" />`;
  if (name === "doubt") return html`<ellipse class=${of} rx="0.25" ry="0.15" />`;
  if (name === "places" || name === "vias") {
    return html`<g class=${of}>${name === "vias" ? html`<circle r="0.06" />` : html`<rect x="-0.08" y="-0.08" width="0.16" height="0.16" />`}</g>`;
  }
  return html`<path class=${of} d="M-0.22 -0.14H0.1L0.22 0L0.1 0.14H-0.22Z" />`;
}

/** The drawing, and where the robot and the pointer are on it. */
function Chart({ station, go }) {
  const { session, layout } = station;
  const box = useRef(null);
  const newest = useRef(go);
  newest.current = go;
  const [pointer, setPointer] = useState(null);
  const [where, setWhere] = useState(["–", "–"]);
  const chart = useMemo(() => new FloorPlan((goal) => newest.current(goal), setPointer), []);
  const { tasks } = session;
  const going = ["driving", "waiting"].includes(tasks?.journey);
  const places = JSON.stringify(tasks?.jobs.places ?? {});
  useLayoutEffect(() => box.current.prepend(chart.element), []);
  useEffect(() => chart.places(JSON.parse(places)), [places]);
  useEffect(() => chart.route(going ? tasks.route : [], going ? tasks.goal : null), [tasks]);
  useEvery(PERIOD, () => {
    const { state, seen, plan } = session;
    if (layout.shown !== "map") return;
    if (plan) chart.plan(plan);
    if (state) chart.robots(state.drawn ?? state.virtual, state.real);
    if (seen) chart.seen(seen, state?.real);
    const doubt = seen?.doubt ? 200 * Math.sqrt(Math.max(seen.doubt[0], seen.doubt[2])) : null;
    setWhere([state?.real ? posture(state.real) : "–", doubt === null ? "–" : `${figure(doubt, 1)} cm (2σ)`]);
  });
  return html`<div class="chart" ref=${box}>
    <dl class="facts"><dt>Robot</dt><dd id="map-robot">${where[0]}</dd><dt>Known to</dt><dd id="map-doubt">${where[1]}</dd>
      <dt>Pointer</dt><dd id="map-pointer">${pointer ? point(pointer) : "–"}</dd></dl></div>`;
}

const point = ([x, y]) => `x ${figure(x, 2)} m, y ${figure(y, 2)} m`;
const posture = ([x, y, turn]) => `${point([x, y])}, θ ${figure(Math.atan2(Math.sin(turn), Math.cos(turn)) * DEGREES, 1)}°`;

function JourneyLine({ station }) {
  const { tasks } = station.session;
  const journey = tasks?.journey ?? "idle";
  const reason = tasks?.reason ? `: ${tasks.reason}` : "";
  const said = useRef(null);
  const news = `${STATES[journey]}${reason}.`;
  useEffect(() => {
    if (said.current && ["arrived", "failed", "waiting"].includes(journey)) station.announce(news);
    said.current = news;
  }, [news]);
  const to = tasks?.goal && journey !== "idle" ? ` (${goalText(tasks.goal)})` : "";
  const left = journey === "driving" && tasks.left ? `, ${figure(tasks.left, 1)} m to go` : "";
  return html`<p class="journey" id="journey" role="status" data-state=${journey}>${STATES[journey]}${to}${reason || left}</p>`;
}

function GoalForm({ why, go }) {
  const typed = useRef({}).current;

  function submit(event) {
    event.preventDefault();
    const { x, y, heading } = typed;
    go({ x: Number(x), y: Number(y), ...(heading ? { heading: Number(heading) / DEGREES } : {}) });
  }

  return html`<form class="goal-form" id="goal-form" onSubmit=${submit}>
    ${FIELDS.map(([name, label, unit]) => html`<label><span>${label}</span>
      <input id=${`goal-${name}`} type="number" step="any" required=${name !== "heading"} autocomplete="off"
        onInput=${({ target }) => (typed[name] = target.value)} /><span class="muted">${unit}</span></label>`)}
    <button class="main" id="goal-go" ...${barred(why, "Send the robot there")}>Go</button></form>`;
}
