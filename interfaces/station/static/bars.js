// What stands on the strip: moves as bars that can be chosen, drawn along, deleted; its scale, and marks of what happened.
import { clockText, html, Icon, useRef, useState } from "./ui.js";

/** A move that begins sooner than this can't be drawn along any more [s]. */
const SOON = 0.15;
/** A pointer that moved less was a click [px]. */
const CLICK = 4;
const [NUDGE, FAR] = [0.1, 1];
/** Knots that are drawn of a move, and the width from which it's captioned [px]. */
const KNOTS = 40;
const CAPTIONED = 24;
/** What a command is called that nobody named, and how those look that are no moves. */
const WORDS = { steer: "steering", stop: "STOP", alter: "offset", resume: "resumed" };
const KINDS = { steer: "steering", stop: "stop" };
/** Ticks are at least so far apart [px], at one of these distances [s]. */
const APART = 64;
const STEPS = [0.5, 1, 2, 5, 10, 30, 60, 120, 300];

export function Moves({ strip }) {
  const count = {};
  return strip.moves.map((move) => {
    const nth = (count[move.id] = (count[move.id] ?? 0) + 1);
    return html`<${Move} key=${`${move.id} ${nth}`} strip=${strip} move=${move} />`;
  });
}

function Move({ strip, move }) {
  const { station, session, view, chosen } = strip;
  const { id, start, end, knots, name } = move;
  const [way, setWay] = useState(0);
  /** The newest wish to have it elsewhere. */
  const order = useRef(null);
  const held = useRef(null);
  const now = session.now;
  const stands = now >= end ? "done" : now >= start ? "running" : "scheduled";
  const movable = () => session.holds && session.link === "live" && start > session.now + SOON;

  function put(to) {
    order.current = strip.retime(id, Math.max(to, session.now + SOON));
  }

  function grab(event) {
    if (event.button !== 0) return;
    event.stopPropagation();
    event.currentTarget.setPointerCapture(event.pointerId);
    held.current = { from: event.clientX, free: movable() };
  }

  function follow(event) {
    const by = held.current?.free ? event.clientX - held.current.from : 0;
    if (way || Math.abs(by) >= CLICK) setWay(by);
  }

  function drop() {
    if (!held.current) return;
    held.current = null;
    if (way) put(start + way / view.scale);
    else strip.chosen = id;
    setWay(0);
  }

  /** When it begins: as was asked last, or as the plan has it, which is drawn a little later. */
  function begins() {
    if (order.current?.outcome === null) return order.current.command.execute_at;
    return session.timeline.segments.find(({ commandId }) => commandId === id)?.start ?? start;
  }

  function key(event) {
    const step = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
    if (event.key === "Delete" || event.key === "Backspace") strip.remove(id);
    else if (step !== undefined && movable()) put(begins() + step * (event.shiftKey ? FAR : NUDGE));
    else return;
    event.preventDefault();
    event.stopPropagation();
  }

  const width = Math.max(3, (end - start) * view.scale);
  const stripe = (t) => `linear-gradient(currentColor, currentColor) ${((100 * (t - start)) / (end - start)).toFixed(2)}% 100% / 1px 5px no-repeat`;
  const words = name?.label || (WORDS[name?.kind] ?? "");
  const called = `#${id} ${words}`.trim();
  const caption = name?.kind === "steer" ? words : called;
  const how = name?.kind === "move" ? ` at ${Math.round(100 * name.speed)} %` : "";
  const span = `${clockText(start)} to ${clockText(end)}`;
  return html`<button class=${way ? "move dragged" : "move"} type="button" data-id=${id} data-stands=${stands} data-kind=${KINDS[name?.kind] ?? "move"}
    style=${`left: ${(view.left(start) + way).toFixed(1)}px; width: ${width.toFixed(1)}px`} aria-pressed=${String(chosen === id)}
    aria-label=${`Move ${called}, ${stands}, ${span}`} title=${`${called}${how}\n${span}, ${stands}`} onPointerDown=${grab} onPointerMove=${follow}
    onLostPointerCapture=${drop} onClick=${(event) => event.detail === 0 && (strip.chosen = id)} onKeyDown=${key}>
    <span class="knots" style=${`background: ${(name?.kind === "steer" ? [] : knots).slice(0, KNOTS).map(stripe).join(", ")}`}></span>
    <span class="text">${way ? clockText(start + way / view.scale) : width < CAPTIONED ? "" : caption}</span></button>`;
}

/** Ticks, and marks of what happened. */
export function Marks({ strip }) {
  const { view, moves, station } = strip;
  if (!moves || !view.drawn) return null;
  const [from, until] = view.drawn;
  const step = STEPS.find((seconds) => seconds * view.scale >= APART) ?? STEPS.at(-1);
  const first = Math.max(0, Math.ceil(from / step));
  const ticks = Array.from({ length: Math.max(0, Math.floor(until / step) - first + 1) }, (_, k) => (first + k) * step);
  const left = (t) => `left: ${view.left(t).toFixed(1)}px`;
  return html`<div class="marks" aria-hidden="true">
    ${ticks.map((t) => html`<span class="tick" key=${t} style=${left(t)}>${clockText(t).replace(/\.0$/, "")}</span>`)}
    ${station.happenings.events.filter(({ t }) => t >= from && t <= until).map(({ t, symbol, text, tone }) =>
      html`<i class="event" key=${t + text} style=${left(t)} title=${`${clockText(t)} ${text}`} data-tone=${tone}><${Icon} name=${symbol} /></i>`)}</div>`;
}

/** What the hand was told, and is told yet. */
export function Grips({ strip }) {
  const { view, moves, session } = strip;
  if (!moves || !view.drawn) return null;
  const [from, until] = view.drawn;
  const told = [...session.reader.names.values()].flat().filter(({ kind, t }) => kind === "grip" && t >= from && t <= until);
  return told.map(({ command_id: id, t, label }) => {
    const words = `#${id} ${label || "hand"}, ${clockText(t)}`;
    return html`<i class="event grip" key=${id} role="img" style=${`left: ${view.left(t).toFixed(1)}px`} title=${words} aria-label=${words}>
      <${Icon} name="gripper" />${label.split(" ")[0]}</i>`;
  });
}
