// The seek bar: the place in time, marks of what happened, the loop.
import { clockText, html, useEffect, useRef, useSignal } from "./ui.js";

/** Time between two wishes while the bar is dragged [ms]. */
const SEEKING = 33;
/** Within so many pixels a mark is pointed at. */
const NEAR = 7;
/** Times between ticks [s], and pixels at least. */
const STEPS = [0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 30, 60, 120, 300, 600, 1200, 1800, 3600, 7200];
const APART = 90;
/** A loop is at least so long [s]. */
const SHORTEST = 0.02;
/** Kinds of marks: name, and outline in a square of 12. */
export const KINDS = {
  command: ["Command", "M2 6a4 4 0 1 0 8 0 4 4 0 1 0-8 0z"],
  postponed: ["Postponed", "M6 .8 11.2 6 6 11.2 .8 6z"],
  rejected: ["Rejected", "M2.8 1 6 4.2 9.2 1 11 2.8 7.8 6 11 9.2 9.2 11 6 7.8 2.8 11 1 9.2 4.2 6 1 2.8z"],
  falsified: ["Changed a prediction", "M1.5 1.5h9v9h-9zM4 4v4h4V4z"],
  corrected: ["Correction", "M6 1 11.5 10.6H.5z"],
  stopped: ["Robot stopped", "M3.6.3h4.8l3.3 3.3v4.8l-3.3 3.3H3.6L.3 8.4V3.6z"],
  link: ["Link", "M4.4.6h3.2v10.8H4.4z"],
  other: ["Other", "M4.6 1h2.8v3.6H11v2.8H7.4V11H4.6V7.4H1V4.6h3.6z"],
};

export function MarkShape({ kind, lane = "", style }) {
  return html`<svg class=${`mark kind-${kind} ${lane}`} style=${style} viewBox="0 0 12 12"><path d=${KINDS[kind][1]} fill-rule="evenodd" /></svg>`;
}

/** Where times are on the bar. */
function scale([start, end]) {
  const share = (t) => (end > start ? Math.min(1, Math.max(0, (t - start) / (end - start))) : 0);
  return { start, end, share, percent: (t) => `${100 * share(t)}%` };
}

/** What screen readers are told of a place on the bar. */
const valued = ({ start, end }, t) => ({
  role: "slider", "aria-valuemin": start.toFixed(2), "aria-valuemax": end.toFixed(2), "aria-valuenow": t.toFixed(2), "aria-valuetext": clockText(t, 2),
});

/** The bar with the times beside it. @param {object} replay see replay.js */
export function SeekBar({ replay }) {
  const bar = useRef(null);
  const track = useRef(null);
  const handed = useRef({ sent: 0, waiting: 0 });
  const pointed = useSignal(null); // the pointer's event
  const drawn = useSignal(null); // a loop under way [s, s]
  const at = scale(replay.span);

  function timeAt(x) {
    const box = bar.current.getBoundingClientRect();
    return at.start + Math.min(1, Math.max(0, (x - box.left) / box.width)) * (at.end - at.start);
  }

  /** Marks near the pointer, the nearest first. */
  function near(x) {
    const box = bar.current.getBoundingClientRect();
    return replay.marks
      .flatMap((lane, k) => lane.map((mark) => ({ ...mark, k, far: Math.abs(at.share(mark.t) * box.width + box.left - x) })))
      .filter(({ far, kind }) => far <= NEAR && !replay.hidden.has(kind))
      .sort((a, b) => a.far - b.far);
  }

  /** Ask for something at most so often; the last is asked for always. */
  function rarely(ask) {
    const { sent, waiting } = handed.current;
    clearTimeout(waiting);
    const left = sent + SEEKING - performance.now();
    if (left > 0) handed.current.waiting = setTimeout(() => rarely(ask), left);
    else {
      handed.current.sent = performance.now();
      ask();
    }
  }

  function drag(t) {
    replay.dragged = t;
    rarely(() => replay.wish("seek", { t }));
  }

  function press(event) {
    if (event.button) return;
    bar.current.setPointerCapture(event.pointerId);
    const t = timeAt(event.clientX);
    const overMarks = event.clientY < track.current.getBoundingClientRect().top;
    if (event.shiftKey) drawn.value = [t, t];
    else drag((overMarks ? near(event.clientX)[0]?.t : null) ?? t);
  }

  function move(event) {
    pointed.value = event;
    if (drawn.value) drawn.value = [drawn.value[0], timeAt(event.clientX)];
    else if (replay.dragged !== null) drag(timeAt(event.clientX));
  }

  function end() {
    const [start, stop] = (drawn.value ?? [0, 0]).toSorted((x, y) => x - y);
    if (stop - start > 0.01) replay.wish("loop", { start, end: stop });
    drawn.value = replay.dragged = null;
  }

  /** Move an end of the loop. */
  function loopTo(k, t) {
    const loop = [...replay.loop];
    loop[k] = k ? Math.min(at.end, Math.max(t, loop[0] + SHORTEST)) : Math.max(at.start, Math.min(t, loop[1] - SHORTEST));
    rarely(() => replay.wish("loop", { start: loop[0], end: loop[1] }));
  }

  const range = drawn.value?.toSorted((x, y) => x - y) ?? replay.loop;
  return html`<div id="bar-row">
    <${Clock} replay=${replay} />
    <div id="bar-box">
      <${Bar} replay=${replay} at=${at} bar=${bar} onPointerDown=${press} onPointerMove=${move} onPointerUp=${end} onPointerCancel=${end}
        onPointerLeave=${() => (pointed.value = null)}>
        <${Marks} replay=${replay} at=${at} />
        <div id="track" aria-hidden="true" ref=${track}>
          <i id="loop-range" hidden=${!range} style=${range && { left: at.percent(range[0]), width: `${100 * (at.share(range[1]) - at.share(range[0]))}%` }}></i>
          <${Played} replay=${replay} at=${at} />
        </div>
        <${Ticks} at=${at} bar=${bar} />
        <${Pointed} pointed=${pointed} near=${near} timeAt=${timeAt} at=${at} bar=${bar} letter=${replay.letter} />
      <//>
      ${["start", "end"].map((end, k) => html`<${Handle} id=${`loop-${end}`} label=${`${k ? "End" : "Start"} of the loop`} at=${at}
        t=${replay.loop?.[k]} timeAt=${timeAt} move=${(t) => loopTo(k, t)} />`)}
    </div>
    <output id="end" aria-label="Ends at">${replay.known ? clockText(at.end, 2) : "–"}</output>
  </div>`;
}

const Clock = ({ replay }) => html`<output id="clock" aria-label="Time shown">${replay.known ? clockText(replay.shown, 3) : "–"}</output>`;

/** The slider, as screen readers know it: what it says changes with each twentieth of a second. */
function Bar({ replay, at, bar, children, ...hands }) {
  return html`<div id="bar" ref=${bar} tabindex="0" aria-label="Time" ...${valued(at, replay.spoken)} ...${hands}>
    ${children}<${Head} replay=${replay} at=${at} /></div>`;
}

const Head = ({ replay, at }) => html`<i id="head" aria-hidden="true" style=${{ left: at.percent(replay.shown) }}></i>`;
const Played = ({ replay, at }) => html`<i id="played" style=${{ width: at.percent(replay.shown) }}></i>`;

function Marks({ replay: { marks, hidden, items }, at }) {
  return html`<div id="marks" aria-hidden="true" data-lanes=${items.length}>${marks.flatMap((lane, k) =>
    lane.filter(({ kind }) => !hidden.has(kind)).map(({ kind, t }) =>
      html`<${MarkShape} kind=${kind} lane=${`lane-${k}`} style=${{ left: at.percent(t) }} />`))}</div>`;
}

function Ticks({ at: { start, end, percent }, bar }) {
  const width = useSignal(0);
  useEffect(() => {
    const sized = new ResizeObserver(() => (width.value = bar.current.clientWidth));
    sized.observe(bar.current);
    return () => sized.disconnect();
  }, []);
  const step = STEPS.find((s) => s >= ((end - start) * APART) / width.value) ?? 14400;
  const first = Math.ceil(start / step - 1e-9);
  const count = width.value ? Math.floor((end + 1e-9) / step) - first + 1 : 0;
  return html`<div id="ticks" aria-hidden="true">${Array.from({ length: Math.max(count, 0) }, (_, k) => (first + k) * step).map((t) =>
    html`<span style=${{ left: percent(t) }}>${clockText(t).replace(step < 1 ? "" : ".0", "")}</span>`)}</div>`;
}

/** What is under the pointer: the time, the marks, and the part of the timeline that they changed. */
function Pointed({ pointed, near, timeAt, at, bar, letter }) {
  const tip = useRef(null);
  const event = pointed.value;
  useEffect(() => {
    if (!event) return;
    const { offsetWidth, offsetHeight, style } = tip.current;
    style.left = `${Math.min(window.innerWidth - offsetWidth - 8, Math.max(8, event.clientX - offsetWidth / 2))}px`;
    style.top = `${bar.current.getBoundingClientRect().top - offsetHeight - 8}px`;
  });
  if (!event) return null;
  const found = near(event.clientX);
  const spanned = found.find(({ span }) => span)?.span;
  const t = timeAt(event.clientX);
  return html`
    ${spanned && html`<i id="span" style=${{ left: at.percent(spanned[0]), width: `${Math.max(0.15, 100 * (at.share(spanned[1]) - at.share(spanned[0])))}%` }}></i>`}
    <i id="pointer" style=${{ left: at.percent(t) }}></i>
    <div id="tip" role="tooltip" ref=${tip}><p><b>${clockText(t, 2)}</b></p>
      ${found.slice(0, 4).flatMap(({ kind, k, texts }) => texts.map((text) =>
        html`<p><${MarkShape} kind=${kind} /><span>${letter(k)}${text}</span></p>`))}</div>`;
}

/** A handle of the loop: dragged, or moved by arrow keys. */
function Handle({ id, label, at, t, timeAt, move }) {
  const held = useRef(false);

  function grab(event) {
    event.currentTarget.setPointerCapture(event.pointerId);
    event.stopPropagation();
    held.current = true;
  }

  function key(event) {
    const by = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
    if (!by) return;
    event.preventDefault();
    event.stopPropagation();
    move(t + by * (event.shiftKey ? 1 : 0.1));
  }

  return html`<button type="button" class="handle" id=${id} aria-label=${label} hidden=${t === undefined} ...${valued(at, t ?? 0)}
    style=${{ left: at.percent(t ?? 0) }} onPointerDown=${grab} onPointerMove=${(event) => held.current && move(timeAt(event.clientX))}
    onLostPointerCapture=${() => (held.current = false)} onKeyDown=${key}></button>`;
}

/** Which marks are shown. */
export function Kinds({ replay }) {
  const { hidden, marks } = replay;

  function toggle(kind) {
    const next = new Set(hidden);
    if (!next.delete(kind)) next.add(kind);
    replay.hidden = next;
  }

  return html`<div id="kinds" role="group" aria-label="Marks shown">${Object.entries(KINDS).map(([kind, [name]]) => {
    const count = marks.flat().filter((mark) => mark.kind === kind).length;
    return html`<button type="button" data-kind=${kind} hidden=${!count} aria-pressed=${String(!hidden.has(kind))} onClick=${() => toggle(kind)}>
      <${MarkShape} kind=${kind} />${name}<em>${count}</em></button>`;
  })}</div>`;
}
