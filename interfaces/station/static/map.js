// The 2D map: walls, both robots, what the laser sees, how sure the place is, the route; a click sends the robot there.
import { DEGREES, h, planted, write } from "./dom.js";
import { Needs } from "./handling.js";
import { FloorPlan } from "./plan.js";
import { ask, goalText } from "./tasks.js";
import { html } from "./ui.js";

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

export function mount(station, box) {
  document.head.append(h("link", { rel: "stylesheet", href: "/station/tasks.css" }));
  const { session } = station;
  const chart = new FloorPlan((goal) => go(goal));
  const fields = {};
  const number = (name, label, unit, required) => {
    fields[name] = h("input", { id: `goal-${name}`, type: "number", step: "any", required, autocomplete: "off" });
    return h("label", {}, h("span", {}, label), fields[name], h("span.muted", {}, unit));
  };
  const form = h("form.goal-form", { id: "goal-form" },
    number("x", "x", "m", true), number("y", "y", "m", true), number("heading", "Heading", "deg", false),
    h("button.main", { id: "goal-go" }, "Go"));
  const places = h("div.places", { role: "group", "aria-label": "Places" });
  const fault = h("p.refused", { id: "goal-fault" });
  const state = h("p.journey", { id: "journey", role: "status" });
  const doubt = h("p.muted", { id: "map-doubt" });
  box.append(planted(html`<${Needs} station=${station} id="map-needs" />`), chart.element,
    h("p.hint", {}, "Click where the robot is to go; drag to say how it's to stand there. Escape takes it back."),
    state, places, form, fault, doubt);

  function go(goal) {
    ask(station, { go: goal }, (text) => {
      write(fault, text);
    });
  }

  form.addEventListener("submit", (event) => {
    event.preventDefault();
    const goal = { x: Number(fields.x.value), y: Number(fields.y.value) };
    if (fields.heading.value !== "") goal.heading = Number(fields.heading.value) / DEGREES;
    go(goal);
  });

  let named = "";
  function showPlaces() {
    const all = session.tasks?.jobs.places ?? {};
    const text = JSON.stringify(all);
    if (text === named) return;
    named = text;
    chart.places(all);
    places.replaceChildren(...Object.entries(all).map(([name, goal]) =>
      h("button", { type: "button", title: goalText(goal), onclick: () => go(goal) }, name)));
  }

  let said = "";
  function showTasks() {
    const tasks = session.tasks;
    if (!tasks) return;
    showPlaces();
    const journey = tasks.journey;
    const to = tasks.goal && journey !== "idle" ? ` (${goalText(tasks.goal)})` : "";
    const left = journey === "driving" && tasks.left ? `, ${tasks.left.toFixed(1)} m to go` : "";
    write(state, `${STATES[journey]}${to}${tasks.reason ? ": " + tasks.reason : left}`);
    state.dataset.state = journey;
    const going = journey === "driving" || journey === "waiting";
    chart.route(going ? tasks.route : [], going ? tasks.goal : null);
    const news = `${journey} ${tasks.reason}`;
    if (said && news !== said && ["arrived", "failed", "waiting"].includes(journey)) {
      station.announce(`${STATES[journey]}${tasks.reason ? ": " + tasks.reason : ""}.`);
    }
    said = news;
  }

  function draw() {
    if (box.offsetParent === null) return;
    const { state: now, seen, plan } = session;
    if (plan) chart.plan(plan);
    if (now) chart.robots(now.drawn ?? now.virtual, now.real);
    if (seen) chart.seen(seen, now && now.real);
    const centimetres = seen?.doubt ? 200 * Math.sqrt(Math.max(seen.doubt[0], seen.doubt[2])) : null;
    write(doubt, centimetres == null ? "" : `Place known to ${centimetres.toFixed(1)} cm (2σ).`);
  }

  for (const type of ["tasks", "welcome"]) station.on(type, showTasks);
  setInterval(draw, PERIOD);
  showTasks();
}
