// The way to the robot: what is emulated on it, changed by who has control, and what is measured of it.
import { figure, h, mark, write } from "./dom.js";

const DELAYS = ["none", "constant:0.1", "constant:0.3", "domain", "country", "mon", "tue", "wed", "thu", "fri", "lunar"];
const LOSSES = ["0", "0.01", "0.05", "0.2", "burst:0.05,5"];
const SERVICES = [["datagram", "as they come"], ["in-order", "in order"]];
/** Time between two looks [ms], and between two questions to the server [s]. */
const LOOK = 500;
const ASK = 1;
/** Of fewer packets the share that was lost says little: they are counted instead. */
const ENOUGH = 100;
const WAYS = ["forward", "backward"];
const NAMES = { forward: "to the robot", backward: "back" };

export function mount(station, box) {
  const { session } = station;
  const fields = { forward: {}, backward: {} };
  const same = h("input", { id: "net-same", type: "checkbox" });
  const apply = h("button.main", { id: "net-apply" }, "Apply");
  const reset = h("button", { type: "button", id: "net-reset" }, "Discard");
  const needs = h("p.needs", { id: "net-needs" });
  const fault = h("p.refused", { id: "net-fault" });
  const advice = h("p.advice", { id: "net-advice", role: "status" });
  const by = h("p.muted", { id: "net-by" });
  /** Whether something was written that isn't applied. */
  let edited = false;
  /** Number of the request that waits for its answer. */
  let asked = null;
  let surveyed = -Infinity;

  const table = h("div.ways", {}, h("span"), h("span.head", {}, NAMES.forward), h("span.head", {}, NAMES.backward));
  const row = (label, make) => table.append(h("span", {}, label), ...WAYS.map(make));
  const put = (way, name, element) => (fields[way][name] = element);
  const written = (way, name, list) => put(way, name, h("input", { id: `net-${name}-${way}`, list, maxlength: 200,
    autocomplete: "off", spellcheck: "false", "aria-label": `${name} ${NAMES[way]}`, "aria-describedby": "net-fault" }));
  row("Delay", (way) => written(way, "delay", "net-delays"));
  row("Loss", (way) => written(way, "loss", "net-losses"));
  row("Delivery", (way) => put(way, "service", h("select", { id: `net-service-${way}`,
    "aria-label": `Delivery ${NAMES[way]}` }, ...SERVICES.map(([value, text]) => h("option", { value }, text)))));
  const set = h("fieldset", { "aria-label": "Emulated way" }, table,
    h("div.row", {}, h("label.row", {}, same, "the same both ways"), h("span.grow"), reset, apply));
  const form = h("form", { id: "net-form" }, set, fault);

  const cells = {};
  const cell = (name) => (cells[name] = h("td", { id: "net-" + name }, "–"));
  const measured = h("table.measured", {},
    h("thead", {}, h("tr", {}, h("td"), ...WAYS.map((way) =>
      h("th", { scope: "col" }, NAMES[way], cells["span-" + way] = h("span.span", { id: "net-span-" + way }))))),
    h("tbody", {}, ...[["median", "Delay, median"], ["p95", "Delay, 95 %"], ["lost", "Lost"]].map(([name, label]) =>
      h("tr", {}, h("th", { scope: "row" }, label), ...WAYS.map((way) => cell(name + "-" + way))))));
  const facts = h("dl.facts");
  const fact = (name, label, title) => {
    cells[name] = h("dd", { id: "net-" + name }, "–");
    facts.append(h("dt", { title }, label), cells[name]);
  };
  fact("trip", "Round trip", "Between the two sites, with the network beneath: median, and what 95 % keep within");
  fact("clock", "Clocks", "By how much the robot may err about the session's time, and this page");
  fact("offset", "Robot plays", "D: the robot's timeline less the session's time");
  fact("policy", "Silence", "What the robot does when nothing is heard");
  fact("age", "Newest state", "Age of what is known of the real robot");
  fact("robot", "Robot at", "Where the robot's site listens");
  fact("seed", "Seed", "Of what is random in the emulation");
  const lists = [["net-delays", DELAYS], ["net-losses", LOSSES]].map(([id, values]) =>
    h("datalist", { id }, ...values.map((value) => h("option", { value }))));
  box.append(...lists, needs, form, advice, by, measured, facts);

  /** The way as it's written. */
  function wanted(way) {
    return Object.fromEntries(Object.entries(fields[way]).map(([name, field]) => [name, field.value.trim()]));
  }

  /** Conditions as a message leaves them out where they're usual. */
  function whole({ delay, loss = "0", service = "datagram" }) {
    return { delay, loss, service };
  }

  function mirror() {
    for (const [name, field] of Object.entries(fields.backward)) {
      field.disabled = same.checked;
      if (same.checked) field.value = fields.forward[name].value;
    }
  }

  /** Write what is in force into the fields. */
  function fill() {
    const { network } = session;
    if (!network) return;
    edited = false;
    for (const way of WAYS) {
      for (const [name, value] of Object.entries(whole(network[way]))) fields[way][name].value = value;
    }
    same.checked = JSON.stringify(wanted("forward")) === JSON.stringify(wanted("backward"));
    mirror();
    complain("");
  }

  function complain(text, about = "") {
    write(fault, text);
    for (const way of WAYS) {
      for (const [name, field] of Object.entries(fields[way])) mark(field, "aria-invalid", name === about ? "true" : null);
    }
  }

  form.addEventListener("input", () => {
    edited = true;
    mirror();
    show();
  });
  reset.addEventListener("click", () => {
    fill();
    show();
  });
  form.addEventListener("submit", (event) => {
    event.preventDefault();
    complain("");
    asked = session.wish("impair", { forward: wanted("forward"), backward: wanted("backward") });
    if (!asked) complain("There's no connection: nothing was asked.");
  });

  function answered(network) {
    if (network.answers === asked && asked) {
      asked = null;
      fill();
      station.announce("The way to the robot is changed");
    } else if (!edited) fill();
    show();
  }

  station.on("network", answered);
  station.on("problem", ({ number, text, field }) => {
    if (!asked || number !== asked) return;
    asked = null;
    complain(text, field);
  });
  station.on("welcome", () => {
    asked = null;
    ask();
    show();
  });
  for (const type of ["lease", "link"]) station.on(type, show);

  function ask() {
    if (session.wish("survey")) surveyed = performance.now() / 1000;
  }

  function show() {
    const may = session.holds && session.link === "live" && Boolean(session.network);
    set.disabled = !may;
    reset.disabled = apply.disabled = !edited;
    const { lease, link } = session;
    const who = lease.state === "held" ? `${lease.holder} has control, and may change it.` : "Take control to change it.";
    write(needs, may ? "" : link !== "live" ? "No connection: what is shown is old." : session.mayCommand ? who : "You are here to watch.");
    needs.hidden = may;
    tell();
  }

  /** What is measured, and how the robot's site is. */
  function tell() {
    const { network, state } = session;
    if (!network) return;
    const old = session.link !== "live";
    mark(box, "data-old", old ? "" : null);
    for (const [way, found] of [["forward", network.there], ["backward", network.back]]) {
      for (const name of ["median", "p95"]) write(cells[`${name}-${way}`], time(found[name]));
      write(cells["lost-" + way], losses(found));
      write(cells["span-" + way], found.span == null ? "" : `in the last ${Math.max(1, Math.round(found.span))} s`);
    }
    const trip = network.round_trip;
    write(cells.trip, trip.median == null ? "–" : `${time(trip.median)}, 95 % in ${time(trip.p95)}`);
    const mine = session.sync.uncertainty(performance.now() / 1000);
    write(cells.clock, `robot ± ${time(network.clock)}, page ± ${time(Number.isFinite(mine) ? mine : null)}`);
    const behind = state?.D == null ? "" : `, ${time(Math.max(0, -state.D))} behind`;
    write(cells.offset, !network.link_loss ? "–" : (network.offset == null ? "adaptive" : `fixed, D = ${figure(network.offset, 2)} s`) + behind);
    write(cells.policy, policy(network));
    const age = state?.t != null && session.now !== null ? session.now - state.t : null;
    write(cells.age, age === null ? "–" : time(Math.max(0, age)));
    write(cells.robot, network.problem ? `${network.robot || "not known yet"}: ${network.problem}` : network.robot.replace(/^wss?:\/\//, ""));
    write(cells.seed, String(network.seed));
    write(advice, network.advice ? network.advice[0].toUpperCase() + network.advice.slice(1) : "");
    const when = network.changed_at == null || session.now === null ? null : session.now - network.changed_at;
    write(by, when === null ? "" : `Changed by ${network.changed_by} ${Math.max(0, Math.round(when))} s ago`);
  }

  setInterval(() => {
    if (document.hidden || box.offsetParent === null || session.link !== "live") return;
    if (performance.now() / 1000 - surveyed > ASK) ask();
    tell();
  }, LOOK);
  if (session.welcome) ask();
  mirror();
  show();
}

function policy({ link_loss: loss, timeout, max_age: age }) {
  if (!loss) return "–";
  if (loss !== "halt") return loss === "hold" ? "hold: the robot waits, and goes on by itself" : loss;
  const after = timeout == null ? "" : ` after ${time(timeout)}`;
  return `halt: the robot stops${after}` + (age == null ? "" : `; older than ${time(age)} doesn't count`);
}

/** How many of the packets were lost: their share, once there are enough of them. */
function losses({ packets = 0, lost }) {
  if (lost == null) return "–";
  return packets < ENOUGH ? `${Math.round(lost * packets)} of ${packets}` : `${(100 * lost).toFixed(1)} % of ${packets}`;
}

/** Seconds as people read them. */
function time(seconds) {
  if (seconds == null) return "–";
  return seconds < 0.9995 ? `${(1000 * seconds).toFixed(seconds < 0.00195 ? 1 : 0)} ms` : `${seconds.toFixed(2)} s`;
}
