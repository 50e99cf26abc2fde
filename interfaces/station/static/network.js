// The way to the robot: what is emulated on it, changed by who has control, and what is measured of it.
import { figure, html, useEffect, useEvery, useOn, useRef, useState, untracked } from "./ui.js";

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
/** What is measured of the robot's site: name, label, what that means, and its text. */
const FACTS = [
  ["trip", "Round trip", "Between the two sites, with the network beneath: median, and what 95 % keep within",
    ({ round_trip: { median, p95 } }) => (median == null ? "–" : `${time(median)}, 95 % in ${time(p95)}`)],
  ["clock", "Clocks", "By how much the robot may err about the session's time, and this page", ({ clock }, { sync }) => {
    const mine = sync.uncertainty(performance.now() / 1000);
    return `robot ± ${time(clock)}, page ± ${time(Number.isFinite(mine) ? mine : null)}`;
  }],
  ["offset", "Robot plays", "D: the robot's timeline less the session's time", ({ link_loss: loss, offset }, { state }) => {
    const behind = state?.D == null ? "" : `, ${time(Math.max(0, -state.D))} behind`;
    return !loss ? "–" : (offset == null ? "adaptive" : `fixed, D = ${figure(offset, 2)} s`) + behind;
  }],
  ["policy", "Silence", "What the robot does when nothing is heard", policy],
  ["age", "Newest state", "Age of what is known of the real robot",
    (_, { state, now }) => (state?.t == null || now === null ? "–" : time(Math.max(0, now - state.t)))],
  ["robot", "Robot at", "Where the robot's site listens",
    ({ robot, problem }) => (problem ? `${robot || "not known yet"}: ${problem}` : robot.replace(/^wss?:\/\//, ""))],
  ["seed", "Seed", "Of what is random in the emulation", ({ seed }) => seed],
];

/** Conditions, with what a message leaves out where it's usual. */
const whole = ({ delay, loss = "0", service = "datagram" }) => ({ delay, loss, service });

export function Panel({ station }) {
  return html`<${Way} station=${station} /><${Figures} session=${station.session} />`;
}

/** What is measured, and how the robot's site is: looked at anew every half second. */
function Figures({ session }) {
  const { network, welcome, link } = session;
  const box = useRef(null);
  const surveyed = useRef(-Infinity);
  const [, drawAnew] = useState(0);

  function ask() {
    if (session.wish("survey")) surveyed.current = performance.now() / 1000;
  }

  useEffect(() => {
    if (welcome) ask();
  }, [welcome]);
  useEvery(LOOK, () => {
    if (document.hidden || box.current.offsetParent === null || session.link !== "live") return;
    if (performance.now() / 1000 - surveyed.current > ASK) ask();
    drawAnew((count) => count + 1);
  });
  const since = network?.changed_at == null || session.now === null ? null : session.now - network.changed_at;
  const changed = since === null ? "" : `Changed by ${network.changed_by} ${Math.max(0, Math.round(since))} s ago`;
  const advice = network?.advice;
  const fact = (text) => (network ? untracked(() => text(network, session)) : "–");
  return html`<div class="figures" ref=${box} data-old=${link === "live" ? undefined : ""}>
    <p class="advice" id="net-advice" role="status">${advice && advice[0].toUpperCase() + advice.slice(1)}</p>
    <p class="muted" id="net-by">${changed}</p>
    <${Measured} network=${network} />
    <dl class="facts">${FACTS.map(([name, label, title, text]) => html`
      <dt title=${title}>${label}</dt><dd id=${`net-${name}`}>${fact(text)}</dd>`)}</dl></div>`;
}

/** What is emulated, to be changed by who has control. */
function Way({ station }) {
  const { session } = station;
  const { network, link, holds, lease, mayCommand, welcome } = session;
  const [edited, setEdited] = useState(null);
  const [same, setSame] = useState(null);
  const [fault, setFault] = useState({ text: "" });
  /** Number of the request that waits for its answer. */
  const asked = useRef(null);
  const inForce = network && { forward: whole(network.forward), backward: whole(network.backward) };
  const shown = edited ?? inForce ?? { forward: {}, backward: {} };
  const alike = same ?? JSON.stringify(shown.forward) === JSON.stringify(shown.backward);
  const may = holds && link === "live" && Boolean(network);

  function discard() {
    setEdited(null);
    setSame(null);
    setFault({ text: "" });
  }

  function change(way, name, value) {
    const next = { ...shown, [way]: { ...shown[way], [name]: value } };
    setEdited(alike ? { forward: next.forward, backward: next.forward } : next);
    setSame(alike);
  }

  function mirror(alike) {
    setSame(alike);
    setEdited(alike ? { forward: shown.forward, backward: shown.forward } : { ...shown });
  }

  function apply(event) {
    event.preventDefault();
    const trimmed = (fields) => Object.fromEntries(Object.entries(fields).map(([name, value]) => [name, value.trim()]));
    asked.current = session.wish("impair", { forward: trimmed(shown.forward), backward: trimmed(shown.backward) });
    setFault({ text: asked.current ? "" : "There's no connection: nothing was asked." });
  }

  useOn(session, "network", ({ answers }) => {
    if (!asked.current || answers !== asked.current) return;
    asked.current = null;
    discard();
    station.announce("The way to the robot is changed");
  });
  useOn(session, "problem", ({ number, text, field }) => {
    if (!asked.current || number !== asked.current) return;
    asked.current = null;
    setFault({ text, field });
  });
  useEffect(() => {
    asked.current = null;
  }, [welcome]);

  const who = lease.state === "held" ? `${lease.holder} has control, and may change it.` : "Take control to change it.";
  const why = may ? "" : link !== "live" ? "No connection: what is shown is old." : mayCommand ? who : "You are here to watch.";
  const unchanged = may && !edited ? "Nothing is changed yet" : undefined;
  const given = (way, name) => ({ id: `net-${name}-${way}`, value: shown[way][name] ?? "", disabled: alike && way === "backward",
    onInput: ({ target }) => change(way, name, target.value), "aria-label": `${name} ${NAMES[way]}` });
  const written = (name, list) => WAYS.map((way) => html`<input ...${given(way, name)} list=${list} maxlength="200"
    autocomplete="off" spellcheck="false" aria-describedby="net-fault"
    aria-invalid=${fault.field === name ? "true" : undefined} />`);
  return html`
    <datalist id="net-delays">${DELAYS.map((value) => html`<option value=${value} />`)}</datalist>
    <datalist id="net-losses">${LOSSES.map((value) => html`<option value=${value} />`)}</datalist>
    <p class="needs" id="net-needs" hidden=${may}>${why}</p>
    <form id="net-form" onSubmit=${apply}>
      <fieldset aria-label="Emulated way" disabled=${!may} title=${why || undefined}>
        <div class="ways"><span></span>${WAYS.map((way) => html`<span class="head">${NAMES[way]}</span>`)}
          <span>Delay</span>${written("delay", "net-delays")}
          <span>Loss</span>${written("loss", "net-losses")}
          <span>Delivery</span>${WAYS.map((way) => html`<select ...${given(way, "service")}>
            ${SERVICES.map(([value, text]) => html`<option value=${value}>${text}</option>`)}</select>`)}</div>
        <div class="row"><label class="row"><input id="net-same" type="checkbox" checked=${alike}
          onInput=${({ target }) => mirror(target.checked)} />the same both ways</label><span class="grow"></span>
          <button type="button" id="net-reset" disabled=${!edited} title=${unchanged} onClick=${discard}>Discard</button>
          <button class="main" id="net-apply" disabled=${!edited} title=${unchanged}>Apply</button></div>
      </fieldset>
      <p class="refused" id="net-fault">${fault.text}</p>
    </form>`;
}

function Measured({ network }) {
  const found = { forward: network?.there, backward: network?.back };
  const row = (name, label, text) => html`<tr><th scope="row">${label}</th>${WAYS.map((way) => html`
    <td id=${`net-${name}-${way}`}>${found[way] ? text(found[way]) : "–"}</td>`)}</tr>`;
  const span = (one) => (one?.span == null ? "" : `in the last ${Math.max(1, Math.round(one.span))} s`);
  return html`<table class="measured">
    <thead><tr><td></td>${WAYS.map((way) => html`<th scope="col">${NAMES[way]}
      <span class="span" id=${`net-span-${way}`}>${span(found[way])}</span></th>`)}</tr></thead>
    <tbody>${row("median", "Delay, median", ({ median }) => time(median))}${row("p95", "Delay, 95 %", ({ p95 }) => time(p95))}
      ${row("lost", "Lost", losses)}</tbody></table>`;
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
