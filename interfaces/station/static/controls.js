// The buttons and the keys of play-back.
import { html, useEffect, useRef, useState } from "./ui.js";

/** A step [s]. */
const FRAME = 1 / 60;
const RATES = [-8, -4, -2, -1, 0.25, 0.5, 1, 2, 4, 8];
const FASTEST = 8;
/** Buttons: id, title, name, outline in a square of 20. */
const TRANSPORT = [
  ["to-start", "To the start (Home)", "To the start", "M3 4h2.4v12H3zM17 4v12L7 10z"],
  ["mark-back", "To the mark before (P)", "To the mark before", "M11 4v12L3 10zM14 10l3-3.4L20 10l-3 3.4z"],
  ["step-back", "A frame back (←)", "A frame back", "M13 4v12L5 10zM14.6 4H17v12h-2.4z"],
  ["play", "Play or pause (space)", "Play", "M5 3v14l12-7z", "Pause", "M5 3h3.6v14H5zM11.4 3H15v14h-3.6z"],
  ["step", "A frame further (→)", "A frame further", "M7 4v12l8-6zM3 4h2.4v12H3z"],
  ["mark-next", "To the next mark (N)", "To the next mark", "M9 4v12l8-6zM6 10 3 6.6 0 10l3 3.4z"],
  ["to-end", "To the end (End)", "To the end", "M14.6 4H17v12h-2.4zM3 4v12l10-6z"],
];
const KEYS = [
  ["Space K", "play or pause"], ["← →", "a frame back, a frame further"], ["Shift ← →", "a second back, a second further"],
  ["Page_up Page_down", "ten seconds further, ten seconds back"], ["Home End", "to the start, to the end"],
  ["P N", "to the mark before, to the next mark"], ["− +", "slower, faster"], ["R", "the other way"],
  ["A B O", "the loop begins here, ends here, is off"], ["Shift-drag", "loop a range of the bar"],
  ["L", "live, where a recording is being written"], ["G", "show or hide the plots"], ["V", "reset the view"],
];

export const rounded = (rate) => String(Math.round(rate * 1e4) / 1e4);
const minus = (rate) => rounded(rate).replace("-", "−");
const spelled = (rate) => ({ 0.25: "¼", 0.5: "½" })[rate] ?? minus(rate);

/** What the buttons do, by their ids; what they go by is the newest state. */
function actsOf(replay, help) {
  const { wish } = replay;
  const seek = (k) => () => wish("seek", { t: replay.span[k] });
  const step = (by) => () => wish("step", { by });
  return {
    play: () => wish("toggle"),
    step: step(FRAME),
    "step-back": step(-FRAME),
    "to-start": seek(0),
    "to-end": seek(1),
    "mark-back": () => wish("mark", { back: true }),
    "mark-next": () => wish("mark", { back: false }),
    "set-start": () => wish("loop", { start: replay.t, end: replay.loop?.[1] > replay.t ? replay.loop[1] : replay.span[1] }),
    "set-end": () => wish("loop", { start: replay.loop?.[0] < replay.t ? replay.loop[0] : replay.span[0], end: replay.t }),
    unloop: () => wish("unloop"),
    live: () => wish("live"),
    plots: () => (replay.plotted = !replay.plotted),
    home: () => replay.views.forEach((view) => view.scene?.home()),
    help: () => help.current.showModal(),
  };
}

/** The next larger or smaller rate of those that have buttons. */
function shifted(rate, by) {
  const sizes = RATES.filter((one) => one > 0);
  const size = Math.abs(rate);
  const next = by > 0 ? sizes.find((one) => one > size) : sizes.findLast((one) => one < size);
  return Math.sign(rate) * (next ?? size);
}

/** What keys do. */
function keysOf(replay, acts) {
  const setRate = (rate) => replay.wish("rate", { rate });
  const [slower, faster] = [-1, 1].map((by) => () => setRate(shifted(replay.rate, by)));
  const step = (way) => (shift) => replay.wish("step", { by: way * (shift ? 1 : FRAME) });
  return {
    " ": acts.play, k: acts.play, Home: acts["to-start"], End: acts["to-end"],
    PageUp: () => replay.wish("skip", { by: 10 }), PageDown: () => replay.wish("skip", { by: -10 }),
    ArrowRight: step(1), ArrowLeft: step(-1), "+": faster, "=": faster, "-": slower, "−": slower,
    n: acts["mark-next"], p: acts["mark-back"], r: () => setRate(-replay.rate), a: acts["set-start"], b: acts["set-end"],
    o: acts.unloop, l: () => replay.growing && acts.live(), g: acts.plots, v: acts.home, "?": acts.help,
  };
}

/** @param {object} help the dialog that `Help` is */
export function Controls({ replay, help }) {
  const acts = actsOf(replay, help);
  const keys = keysOf(replay, acts);
  const newest = useRef(null);
  newest.current = (event) => {
    const { key, target, ctrlKey, metaKey, altKey, shiftKey } = event;
    if (!replay.known || ctrlKey || metaKey || altKey || help.current.open) return;
    if (target.closest("input, select")) return key === "Escape" && target.blur();
    if ((key === " " || key === "Enter") && target.closest("button, summary")) return;
    const act = keys[key.length === 1 ? key.toLowerCase() : key];
    if (!act) return;
    event.preventDefault();
    act(shiftKey);
  };
  useEffect(() => {
    // A button that was clicked doesn't keep the keys; one that was reached by them does.
    document.addEventListener("click", ({ target, detail }) => detail > 0 && target.closest("button")?.blur());
    document.addEventListener("keydown", (event) => newest.current(event));
  }, []);
  const button = (id, title, text, more = {}) =>
    html`<button type="button" id=${id} title=${title} onClick=${() => replay.known && acts[id]()} ...${more}>${text}</button>`;
  const plays = replay.mode !== "paused";
  return html`<div id="controls">
    <div class="group" role="group" aria-label="Transport">${TRANSPORT.map(([id, title, name, path, other = name, pause = path]) =>
      button(id, title, html`<svg viewBox="0 0 20 20"><path d=${plays ? pause : path} /></svg>`, { "aria-label": plays ? other : name }))}</div>
    <div class="group" role="group" aria-label="Rate" id="rates">${RATES.map((rate) => html`
      ${rate === 0.25 && html`<i class="gap"></i>`}
      <button type="button" data-rate=${rate} title=${`Rate ${spelled(rate)}`} aria-label=${`Rate ${String(rate).replace("-", "minus ")}`}
        aria-pressed=${String(replay.rate === rate)} onClick=${() => replay.wish("rate", { rate })}>${spelled(rate)}</button>`)}</div>
    <${Rate} replay=${replay} />
    <div class="group" role="group" aria-label="Loop" id="loops">
      <span aria-hidden="true">Loop</span>
      ${button("set-start", "The loop begins here (A); or drag on the bar with shift", "from here", { "aria-label": "The loop begins here" })}
      ${button("set-end", "The loop ends here (B)", "to here", { "aria-label": "The loop ends here" })}
      ${button("unloop", "No loop (O)", "off", { "aria-label": "Loop off", disabled: !replay.loop })}
    </div>
    ${button("live", "Live (L)", html`<i></i>Live`, { disabled: !replay.growing, "aria-pressed": String(replay.mode === "live") })}
    <span class="spring"></span>
    <span id="aside" hidden=${!location.search}>The robot goes on: STOP is on the station's page</span>
    ${button("plots", "Show or hide the plots (G)", "Plots", { "aria-pressed": String(replay.plotted), "aria-controls": "side" })}
    ${button("home", "Reset the view (V)", "Reset view")}
    ${button("help", "Keys (?)", "?", { "aria-label": "Keys" })}
  </div>`;
}

/** Any rate, as it's written. */
function Rate({ replay }) {
  const input = useRef(null);
  const [wrong, setWrong] = useState(false);

  function show() {
    setWrong(false);
    input.current.value = minus(replay.rate);
  }

  function change({ target }) {
    const rate = Number(target.value.trim().replace("−", "-").replace(",", "."));
    const valid = Number.isFinite(rate) && rate !== 0 && Math.abs(rate) <= FASTEST;
    setWrong(!valid);
    if (!valid) return replay.say("The rate must be from −8 to 8, but not 0.");
    replay.wish("rate", { rate });
    target.blur();
  }

  useEffect(() => document.activeElement !== input.current && show(), [replay.rate]);
  return html`<label class="group" id="any-rate"><span>Rate</span><input id="rate" ref=${input} type="text" inputmode="decimal"
    autocomplete="off" spellcheck="false" aria-label="Any rate, −8 to 8" title="Any rate, −8 to 8" aria-invalid=${wrong ? "true" : null}
    onChange=${change} /></label>`;
}

export function Help({ dialog }) {
  return html`<dialog id="keys" aria-labelledby="keys-title" ref=${dialog}>
    <h2 id="keys-title">Keys</h2>
    <table>${KEYS.map(([keys, does]) => html`<tr><td>${keys.split(" ").map((key) => html`<kbd>${key.replace("_", " ")}</kbd> `)}</td><td>${does}</td></tr>`)}</table>
    <p>All open pages show and move the same place in time.</p>
    <p>3D view: MeshCat and three.js (MIT), <a href="/replay/licences.txt">licences</a></p>
    <form method="dialog"><button>Close</button></form></dialog>`;
}
