// The timeline as a strip: what was to the left, what is planned to the right, and what may be changed by hand.
import { Grips, Marks, Moves } from "./bars.js";
import { movesBetween } from "./moves.js";
import { isPlanned, Loader, savePlan } from "./planfile.js";
import { View } from "./timeview.js";
import { clockText, html, Icon, isTyping, observed, useComputed, useEffect, useMemo, useOn, useRef, useState } from "./ui.js";

/** A step of the cursor by key [s]. */
const STEP = 0.5;
/** Between two drawings, unless something has changed [ms]: each takes the whole page's time without a graphics card. */
const BETWEEN = window.VrsScene.software ? 120 : 16;
/** Moves that are drawn, at most. */
const MOST = 300;
/** How fast the past is played. */
const RATES = [0.5, 1, 2];
/** Key that plays and pauses, here as in replay: the space bar is STOP's. */
const PLAY = "KeyK";
/** A page that was held up for longer than this doesn't make up for it [s]. */
const HELD_UP = 0.5;

/** What the strip shows, and what is done from it. */
class Strip {
  constructor(station) {
    [this.station, this.session] = [station, station.session];
    this.view = new View();
    observed(this, {
      /** The move that was chosen, by its command; it stays that whatever becomes of the plan. */
      chosen: null,
      /** What is drawn, see moves.js: anew when the plan or the window changes. */
      moves: [],
      /** Whether the time that is looked at goes on, and how fast. */
      plays: false,
      rate: 1,
      seconds: this.view.seconds,
    });
    this.stale = true;
    /** When it was drawn last [ms], and whether the time that was looked at went on then. */
    this.drawnAt = -Infinity;
    this.played = false;
    /** When the next of the moves begins or ends [s]. */
    this.due = Infinity;
  }

  /** The chosen move, wherever it stands in the plan; undefined where it's in it no more. */
  get move() {
    if (this.chosen === null) return undefined;
    const parts = this.session.timeline?.segments.filter(({ commandId }) => commandId === this.chosen) ?? [];
    const last = parts.at(-1);
    return last ? { id: this.chosen, start: parts[0].start, end: last.start + last.duration } : undefined;
  }

  /** Why nothing can be commanded from here now; "" where it can. */
  get idle() {
    if (this.session.link !== "live") return "there's no connection";
    return this.session.holds ? "" : "take control first";
  }

  retime(id, start) {
    return this.session.order({ type: "retime", command_id: id, execute_at: start });
  }

  remove(id) {
    this.session.order({ type: "cancel", command_id: id });
  }

  /** Let the chosen move go by a place: a named pose, or over the middle of its way. */
  goBy(place) {
    const { session, station, move } = this;
    const q = session.welcome.poses[place];
    const command = { type: "via", command_id: move.id, deviation: 0.05 };
    if (q) command.target = { type: "joints", q };
    else {
      const X = station.chain.links(session.timeline.joints((move.start + move.end) / 2)).at(-1);
      const rows = [0, 1, 2, 3].map((row) => [0, 1, 2, 3].map((column) => X[row + 4 * column]));
      rows[2][3] += place === "up" ? 0.1 : -0.1;
      command.target = { type: "pose", X: rows };
    }
    session.order(command);
  }

  zoom(way) {
    this.view.zoom(way, this.session.now ?? 0);
    this.seconds = this.view.seconds;
    this.stale = true;
  }

  /** Look at a time of the timeline. */
  look(t) {
    const { timeline, now } = this.session;
    this.view.follows = false;
    this.station.cursor = Math.max(timeline.start, Math.min(t, Math.max(timeline.end, now)));
  }

  /** Show what is now, and go on with it. */
  live() {
    this.plays = false;
    this.view.follows = true;
    this.station.cursor = null;
  }

  /** Let the time that is looked at go on by a while [s]: up to now, or to the end of what is planned. */
  play(dt) {
    const { station: { cursor }, session: { now, timeline }, view } = this;
    if (cursor === null) this.live();
    if (!this.plays) return;
    const t = cursor + this.rate * Math.min(dt, HELD_UP);
    if (cursor <= now && t > now) this.live();
    else {
      this.plays = t < timeline.end || t < now;
      this.look(t);
      view.reveal(t);
    }
  }

  /** Go on with the time; whether something is to be put in its place. */
  advance(at, track) {
    const { session, view } = this;
    const { now, timeline } = session;
    if (now === null || !timeline || document.hidden || (at - this.drawnAt < BETWEEN && !this.stale)) return false;
    this.play(this.played ? (at - this.drawnAt) / 1000 : 0);
    [this.drawnAt, this.played] = [at, this.plays];
    if (view.advance(now, track.clientWidth) || this.stale || now >= this.due) this.draw(timeline, now);
    return true;
  }

  draw(timeline, now) {
    this.stale = false;
    const [from, until] = this.view.drawn;
    this.moves = movesBetween(timeline, from, until, (id, t) => this.session.reader.nameOf(id, t)).slice(-MOST);
    this.due = Math.min(...this.moves.flatMap(({ start, end }) => [start, end]).filter((t) => t > now));
  }
}

export function Panel({ station }) {
  const strip = useMemo(() => new Strip(station), []);
  useOn(station.session, "edit", () => (strip.stale = true));
  useEffect(() => {
    function key(event) {
      if (event.code !== PLAY || station.cursor === null || event.ctrlKey || event.altKey || event.metaKey || isTyping(event)) return;
      event.stopImmediatePropagation();
      event.preventDefault();
      if (!event.repeat) strip.plays = !strip.plays;
    }

    window.addEventListener("keydown", key, { capture: true });
    return () => window.removeEventListener("keydown", key, { capture: true });
  }, []);
  return html`<div class="tools"><${Tools} strip=${strip} /></div><${Track} strip=${strip} />`;
}

/** A button that does something, or says why it can't now. */
function Tool({ station, id, icon, title, why = "", does, children, ...others }) {
  return html`<button class="tool" type="button" id=${id} title=${title} aria-label=${children ?? title} aria-disabled=${why ? "true" : null}
    onClick=${() => (why ? station.refuse(why) : does())} ...${others}><${Icon} name=${icon} />${children && html`<span>${children}</span>`}</button>`;
}

function Tools({ strip }) {
  const { station, session, idle, chosen, moves, plays } = strip;
  const [place, setPlace] = useState("up");
  const old = session.link !== "live";
  // It's drawn anew where it begins and ends, not for each time between.
  const past = useComputed(() => station.cursor !== null).value;
  const over = moves && chosen !== null && !(strip.move?.end > (session.now ?? 0));
  const none = strip.move ? "this move is over" : "the chosen move isn't in the plan any more";
  const why = idle || (chosen === null ? "choose a move on the strip first" : over ? none : "");
  const poses = Object.keys(session.welcome?.poses ?? {});
  const tool = (id, icon, title, does, children, others) =>
    html`<${Tool} station=${station} id=${id} icon=${icon} title=${title} does=${does} ...${others}>${children}<//>`;
  return html`<span class="readout" id="time"></span>
    ${tool("live", old ? "sensors_off" : "sensors", old ? "What you see is old" : "Show what is now", () => strip.live(), "Live",
      { "aria-pressed": String(!past && !old), "data-off": past ? "" : null, "data-old": old ? "" : null })}
    ${tool("play", plays ? "pause" : "play_arrow", plays ? "Pause (K)" : "Play what is looked at (K)", () => (strip.plays = !plays), null,
      { why: past ? "" : "look back first: drag the strip", "aria-label": plays ? "Pause" : "Play" })}
    <select id="rate" aria-label="How fast it plays" value=${strip.rate} onChange=${(event) => (strip.rate = Number(event.target.value))}>
      ${RATES.map((rate) => html`<option value=${rate}>×${rate}</option>`)}</select>
    <span class="gap"></span>
    ${tool("undo", "undo", "Take back the newest command", () => session.order(null), "Undo", { why: idle })}
    ${tool("redo", "redo", "Take back the newest undo", () => session.order({ type: "redo" }), "Redo", { why: idle })}
    <span class="gap"></span>
    ${tool("save", "download", "Save what is planned to a plan file", () => savePlan(station), "Save",
      { why: session.relays ? idle : isPlanned(session) ? "" : "nothing is planned that could be saved" })}
    <${Loader} strip=${strip} tool=${tool} />
    <span class="gap"></span>
    ${tool("delete", "delete", "Take the chosen move out of the plan", () => strip.remove(chosen), "Delete", { why })}
    ${tool("via", "alt_route", "Let the chosen move go by another place", () => strip.goBy(place), "Via", { why })}
    <select id="via-place" aria-label="Where a via is" disabled=${why !== ""} value=${place} onChange=${(event) => setPlace(event.target.value)}>
      <option value="up">10 cm higher</option><option value="down">10 cm lower</option>
      ${poses.map((pose) => html`<option value=${pose}>by ${pose}</option>`)}</select>
    <span class="grow"></span>
    <span class="muted wide">Drag a scheduled move, or the strip to look back</span>
    ${tool("zoom-out", "remove", "Show more time", () => strip.zoom(1))}
    <span class="muted">${strip.seconds} s</span>
    ${tool("zoom-in", "add", "Show less time", () => strip.zoom(-1))}`;
}

/** The strip itself. Its lines are put in their places by hand, as often as the screen is drawn. */
function Track({ strip }) {
  const { station, session, view } = strip;
  const track = useRef(null);
  const [slider, world, past, ahead, real, now, cursor] = [0, 0, 0, 0, 0, 0, 0].map(() => useRef(null));

  useEffect(() => {
    let frame = requestAnimationFrame(function next(at) {
      frame = requestAnimationFrame(next);
      if (strip.advance(at, track.current)) place();
    });
    return () => cancelAnimationFrame(frame);
  }, []);

  function place() {
    const { now: t, timeline: { end }, state } = session;
    const at = (line, time) => (line.current.style.transform = `translateX(${view.x(time).toFixed(1)}px)`);
    const playing = state === null ? t : t + state.D;
    world.current.style.transform = `translateX(${view.shift.toFixed(1)}px)`;
    at(now, t);
    at(real, playing);
    set(ahead.current, "hidden", end <= playing);
    ahead.current.style.left = `${view.left(playing).toFixed(1)}px`;
    ahead.current.style.width = `${Math.max(0, view.left(end) - view.left(playing)).toFixed(1)}px`;
    past.current.style.width = `${Math.max(0, Math.min(view.width, view.x(t))).toFixed(1)}px`;
    const { cursor: looked } = station;
    set(cursor.current, "hidden", looked === null);
    if (looked !== null) at(cursor, looked);
    const shown = looked ?? t;
    set(document.getElementById("time"), "textContent", clockText(shown));
    set(slider.current, "ariaValueMax", String(Math.round(Math.max(end, t))));
    set(slider.current, "ariaValueNow", String(Math.round(shown)));
    set(slider.current, "ariaValueText", looked === null ? "live" : clockText(shown));
  }

  const known = () => session.timeline && session.now !== null;

  function scrub(event) {
    strip.plays = false;
    strip.look(view.timeAt(event.clientX - track.current.getBoundingClientRect().left));
  }

  function press(event) {
    if (event.button !== 0 || !known() || event.target.closest(".move")) return;
    track.current.setPointerCapture(event.pointerId);
    scrub(event);
  }

  function turn(event) {
    event.preventDefault();
    strip.zoom(Math.sign(event.deltaY));
  }

  function key(event) {
    const way = { ArrowLeft: -STEP, ArrowRight: STEP, PageUp: -10 * STEP, PageDown: 10 * STEP }[event.key];
    if (!known()) return;
    if (event.key === "Escape" || event.key === "End") strip.live();
    else if (way !== undefined) strip.look((station.cursor ?? session.now) + way);
    else return;
    event.preventDefault();
    event.stopPropagation();
  }

  return html`<div class="track" id="track" role="group" aria-label="Timeline" ref=${track} onWheel=${turn} onPointerDown=${press}
    onPointerMove=${(event) => track.current.hasPointerCapture(event.pointerId) && scrub(event)}>
    <div class="past" ref=${past}></div>
    <div class="slider" id="slider" role="slider" tabindex="0" aria-label="Time that is shown" aria-valuemin="0"
      aria-valuenow="0" ref=${slider} onKeyDown=${key}></div>
    <div class="world" ref=${world}><div class="committed" ref=${ahead}></div><${Marks} strip=${strip} /><${Grips} strip=${strip} />
      <${Moves} strip=${strip} /></div>
    <div class="at real" ref=${real}><span>real</span></div><div class="at now" ref=${now}><span>now</span></div>
    <div class="at cursor" hidden ref=${cursor}></div></div>`;
}

/** Set what an element is or says, but touch nothing if it's so already. */
function set(element, name, value) {
  if (element[name] !== value) element[name] = value;
}
