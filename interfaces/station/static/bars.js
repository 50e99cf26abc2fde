// Moves on the strip: bars that can be chosen, drawn along, deleted.
import { clockText, h, mark, write } from "./dom.js";
import { movesBetween } from "./moves.js";

/** A move that begins sooner than this can't be drawn along any more [s]. */
const SOON = 0.15;
/** A pointer that moved less was a click [px]. */
const CLICK = 4;
const [NUDGE, FAR] = [0.1, 1];
const MOST = 300;

export class MoveBars {
  /** @param actions {retime(id, start) (the order, or null), remove(id), chosen(id)} */
  constructor(station, world, view, actions) {
    this.station = station;
    this.world = world;
    this.view = view;
    this.actions = actions;
    this.bars = new Map();
    this.selected = null;
    this.dragged = null;
    this.labels = new Map();
    this.steering = new Set();
    station.on("outcome", (entry) => this.learn(entry));
    let run = null;
    station.on("welcome", ({ instance }) => {
      if (instance !== run) for (const known of [this.steering, this.labels]) known.clear();
      run = instance;
    });
  }

  /** What this page's own commands are called, and which of them are done. */
  learn(entry) {
    const { command, label, outcome } = entry;
    for (const bar of this.bars.values()) if (bar.order === entry) bar.order = null;
    const id = outcome.receipt?.command_id;
    if (id === undefined || command === null) return;
    if (command.type === "steer") this.steering.add(id);
    else if (command.type === "move") this.labels.set(id, label);
    else if (command.type === "stop") this.labels.set(id, "stop");
    for (const known of [this.steering, this.labels]) {
      if (known.size > 2000) known.delete(known.keys().next().value);
    }
  }

  /** A move that is drawn; undefined where there's none. */
  move(id) {
    return this.bars.get(id)?.move;
  }

  draw(timeline, now) {
    const [from, until] = this.view.drawn;
    const moves = movesBetween(timeline, from, until, (id) => this.steering.has(id)).slice(-MOST);
    const there = new Set(moves.map(({ id }) => id));
    for (const [id, bar] of this.bars) {
      if (there.has(id)) continue;
      bar.element.remove();
      this.bars.delete(id);
      if (this.selected === id) this.choose(null);
    }
    for (const move of moves) {
      const bar = this.bars.get(move.id) ?? this.make(move.id);
      bar.move = move;
      if (this.dragged !== bar) bar.element.style.left = `${this.view.left(move.start).toFixed(1)}px`;
      const width = Math.max(3, (move.end - move.start) * this.view.scale);
      bar.element.style.width = `${width.toFixed(1)}px`;
      if (this.dragged !== bar) write(bar.text, width < 24 ? "" : this.caption(move));
      const knots = move.steers ? [] : move.knots;
      const marks = knots.map((t) => `${((100 * (t - move.start)) / (move.end - move.start)).toFixed(2)}%`);
      const stripe = (at) => `linear-gradient(currentColor, currentColor) ${at} 100% / 1px 5px no-repeat`;
      bar.knots.style.background = marks.slice(0, 40).map(stripe).join(", ");
      mark(bar.element, "data-kind", move.steers ? "steering" : this.labels.get(move.id) === "stop" ? "stop" : "move");
    }
    this.tell(now);
  }

  /** What a move is called. */
  caption({ id, steers }) {
    return `#${id} ${steers ? "steering" : (this.labels.get(id) ?? "")}`.trim();
  }

  /** Which moves are over, under way and still to come. */
  tell(now) {
    for (const { element, move } of this.bars.values()) {
      const stands = now >= move.end ? "done" : now >= move.start ? "running" : "scheduled";
      if (element.dataset.stands === stands && element.dataset.named === `${move.start}`) continue;
      element.dataset.stands = stands;
      element.dataset.named = `${move.start}`;
      const name = this.caption(move);
      const span = `${clockText(move.start)} to ${clockText(move.end)}`;
      mark(element, "aria-label", `Move ${name}, ${stands}, ${span}`);
      element.title = `${name}\n${span}, ${stands}`;
    }
  }

  make(id) {
    const [text, knots] = [h("span.text"), h("span.knots")];
    const element = h("button.move", { type: "button", "data-id": id, "aria-pressed": "false" }, knots, text);
    const bar = { element, text, knots, move: null, order: null };
    element.addEventListener("pointerdown", (event) => this.grab(bar, event));
    element.addEventListener("click", (event) => event.detail === 0 && this.choose(id));
    element.addEventListener("keydown", (event) => this.key(bar, event));
    this.bars.set(id, bar);
    this.world.append(element);
    return bar;
  }

  choose(id) {
    const before = this.bars.get(this.selected);
    if (before) mark(before.element, "aria-pressed", "false");
    this.selected = id;
    const bar = this.bars.get(id);
    if (bar) mark(bar.element, "aria-pressed", "true");
    this.actions.chosen(id);
  }

  /** Whether a move may be put elsewhere. */
  movable({ move }) {
    const { session } = this.station;
    return session.holds && session.link === "live" && move.start > session.now + SOON;
  }

  grab(bar, event) {
    if (event.button !== 0) return;
    event.stopPropagation();
    const { element } = bar;
    const from = event.clientX;
    const left = this.view.left(bar.move.start);
    const free = this.movable(bar);
    let way = 0;
    element.setPointerCapture(event.pointerId);
    const follow = (moved) => {
      way = moved.clientX - from;
      if (!free || Math.abs(way) < CLICK) return;
      this.dragged = bar;
      element.classList.add("dragged");
      element.style.left = `${left + way}px`;
      write(bar.text, clockText(bar.move.start + way / this.view.scale));
    };
    element.addEventListener("pointermove", follow);
    element.addEventListener(
      "lostpointercapture",
      () => {
        element.removeEventListener("pointermove", follow);
        element.classList.remove("dragged");
        if (this.dragged === bar) {
          this.dragged = null;
          this.put(bar, bar.move.start + way / this.view.scale);
        } else this.choose(bar.move.id);
      },
      { once: true },
    );
  }

  put(bar, start) {
    const { session } = this.station;
    bar.element.style.left = `${this.view.left(bar.move.start).toFixed(1)}px`;
    write(bar.text, this.caption(bar.move));
    bar.order = this.actions.retime(bar.move.id, Math.max(start, session.now + SOON));
  }

  /** When a move begins: as was asked last, or as the plan has it, which is drawn a little later. */
  startOf({ order, move }) {
    if (order) return order.command.execute_at;
    return this.station.session.timeline.segments.find(({ commandId }) => commandId === move.id)?.start ?? move.start;
  }

  key(bar, event) {
    const way = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
    if (event.key === "Delete" || event.key === "Backspace") this.actions.remove(bar.move.id);
    else if (way !== undefined && this.movable(bar)) this.put(bar, this.startOf(bar) + way * (event.shiftKey ? FAR : NUDGE));
    else return;
    event.preventDefault();
    event.stopPropagation();
  }
}
