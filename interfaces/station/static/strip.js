// The timeline as a strip: what was to the left, what is planned to the right, and what may be changed by hand.
import { clockText, draw, h, icon, mark, write } from "./dom.js";
import { Marks } from "./marks.js";
import { MoveBars } from "./bars.js";
import { View } from "./timeview.js";

/** A step of the cursor by key [s]. */
const STEP = 0.5;
/** Between two drawings, unless something has changed [ms]: each takes the whole page's time without a graphics card. */
const BETWEEN = window.VrsScene.software ? 120 : 16;
const VIAS = [["up", "10 cm higher"], ["down", "10 cm lower"]];

export function mount(station, box) {
  const { session, shared, chain } = station;
  const view = new View();
  const slider = h("div.slider", { id: "slider", role: "slider", tabindex: 0, "aria-label": "Time that is shown",
    "aria-valuemin": 0 });
  const track = h("div.track", { id: "track", role: "group", "aria-label": "Timeline" });
  const world = h("div.world");
  const lines = { real: h("div.at.real"), now: h("div.at.now"), cursor: h("div.at.cursor", { hidden: true }) };
  const ahead = h("div.committed");
  const past = h("div.past");
  track.append(past, slider, world, ...Object.values(lines));
  world.append(ahead);
  lines.now.append(h("span", {}, "now"));
  lines.real.append(h("span", {}, "real"));

  const live = button("live", "Live", "sensors", () => shared.pane.show(null), "Show what is now");
  const undo = button("undo", "Undo", "undo", () => session.order(null), "Take back the newest command");
  const drop = button("delete", "Delete", "delete", () => remove(bars.selected), "Take the chosen move out of the plan");
  const via = button("via", "Via", "alt_route", () => goBy(bars.selected), "Let the chosen move go by another place");
  const place = h("select", { id: "via-place", "aria-label": "Where a via is" },
    ...VIAS.map(([value, text]) => h("option", { value }, text)));
  const less = button("zoom-out", "", "remove", () => zoom(1), "Show more time");
  const more = button("zoom-in", "", "add", () => zoom(-1), "Show less time");
  const span = h("span.muted");
  const readout = h("span.readout", { id: "time" });
  box.append(
    h("div.tools", {}, readout, live, h("span.gap"), undo, drop, via, place, h("span.grow"),
      h("span.muted.wide", {}, "Drag a scheduled move, or the strip to look back"), less, span, more),
    track,
  );

  const bars = new MoveBars(station, world, view, { retime, remove, chosen });
  const marks = new Marks(station, world, view);
  let stale = true;
  let drawnAt = -Infinity;
  let listed = false;

  function button(id, text, symbol, action, title) {
    const does = () => (made.dataset.bar ? station.refuse(made.dataset.bar) : action());
    const made = h("button.tool", { type: "button", id, title, "aria-label": text ? null : title, onclick: does },
      icon(symbol), text || null);
    return made;
  }

  /** Let a button do nothing now but say why; "" where it works. */
  function bar(made, why) {
    mark(made, "data-bar", why || null);
    mark(made, "aria-disabled", why ? "true" : null);
  }

  function zoom(way) {
    view.zoom(way, session.now ?? 0);
    stale = true;
  }

  function retime(id, start) {
    return session.order({ type: "retime", command_id: id, execute_at: start });
  }

  function remove(id) {
    if (id !== null) session.order({ type: "cancel", command_id: id });
  }

  /** Let a move go by a place: a named pose, or over the middle of its way. */
  function goBy(id) {
    const bar = bars.move(id);
    if (!bar) return;
    const named = session.welcome.poses[place.value];
    const command = { type: "via", command_id: id, deviation: 0.05 };
    if (named) command.target = { type: "joints", q: named };
    else {
      const X = chain.links(session.timeline.joints((bar.start + bar.end) / 2)).at(-1);
      const rows = [0, 1, 2, 3].map((row) => [0, 1, 2, 3].map((column) => X[row + 4 * column]));
      rows[2][3] += place.value === "up" ? 0.1 : -0.1;
      command.target = { type: "pose", X: rows };
    }
    session.order(command);
  }

  function chosen(id) {
    const idle = session.link !== "live" ? "there's no connection" : session.holds ? "" : "take control first";
    const move = id === null ? null : bars.move(id);
    const none = move ? "this move is over" : "choose a move on the strip first";
    const why = idle || (move?.end > (session.now ?? 0) ? "" : none);
    bar(undo, idle);
    for (const made of [drop, via]) bar(made, why);
    place.disabled = why !== "";
  }

  /** The time under a pointer becomes what is shown. */
  function scrub(event) {
    const t = view.timeAt(event.clientX - track.getBoundingClientRect().left);
    const { start, end } = session.timeline;
    shared.pane.show(Math.max(start, Math.min(t, Math.max(end, session.now))));
  }

  track.addEventListener("pointerdown", (event) => {
    if (event.button !== 0 || !session.timeline || session.now === null || event.target.closest(".move")) return;
    track.setPointerCapture(event.pointerId);
    view.freeze();
    scrub(event);
  });
  track.addEventListener("pointermove", (event) => track.hasPointerCapture(event.pointerId) && scrub(event));
  track.addEventListener("wheel", (event) => {
    event.preventDefault();
    zoom(Math.sign(event.deltaY));
  });
  slider.addEventListener("keydown", (event) => {
    if (!session.timeline || session.now === null) return;
    const way = { ArrowLeft: -STEP, ArrowRight: STEP, PageUp: -10 * STEP, PageDown: 10 * STEP }[event.key];
    if (event.key === "Escape" || event.key === "End") shared.pane.show(null);
    else if (way !== undefined) {
      view.freeze();
      const t = (shared.pane.cursor ?? session.now) + way;
      shared.pane.show(Math.max(session.timeline.start, Math.min(t, Math.max(session.timeline.end, session.now))));
    } else return;
    event.preventDefault();
    event.stopPropagation();
  });

  station.addEventListener("cursor", ({ detail: t }) => {
    if (t === null) view.follow();
    lines.cursor.hidden = t === null;
    mark(live, "data-off", t === null ? null : "");
    follows();
  });
  station.on("link", follows);
  for (const type of ["edit", "lease", "link"]) {
    station.on(type, () => {
      stale = true;
    });
  }
  station.on("welcome", name);

  /** Whether the picture shows what is now: not while it's old. */
  function follows() {
    const old = session.link !== "live";
    mark(live, "aria-pressed", String((shared.pane.cursor ?? null) === null && !old));
    mark(live, "data-old", old ? "" : null);
    draw(live.firstChild, old ? "sensors_off" : "sensors");
    mark(live, "title", old ? "What you see is old" : "Show what is now");
  }

  /** Named poses may be vias too. */
  function name() {
    if (listed || !session.welcome) return;
    listed = true;
    for (const pose of Object.keys(session.welcome.poses)) place.append(h("option", { value: pose }, "by " + pose));
  }

  function frame(at) {
    requestAnimationFrame(frame);
    const now = session.now;
    if (now === null || !session.timeline || document.hidden || (at - drawnAt < BETWEEN && !stale)) return;
    drawnAt = at;
    const width = track.clientWidth;
    const moved = view.advance(now, width);
    if (stale || moved) {
      stale = false;
      bars.draw(session.timeline, now);
      marks.draw();
    }
    chosen(bars.selected);
    bars.tell(now);
    world.style.transform = `translateX(${view.shift().toFixed(1)}px)`;
    put(lines.now, view.x(now));
    const real = session.state === null ? now : now + session.state.D;
    put(lines.real, view.x(real));
    const end = session.timeline.end;
    ahead.hidden = end <= real;
    ahead.style.left = `${view.left(real).toFixed(1)}px`;
    ahead.style.width = `${(view.left(end) - view.left(real)).toFixed(1)}px`;
    past.style.width = `${Math.max(0, Math.min(width, view.x(now))).toFixed(1)}px`;
    const cursor = shared.pane.cursor;
    if (cursor !== null) put(lines.cursor, view.x(cursor));
    const shown = cursor ?? now;
    write(readout, clockText(shown));
    write(span, `${view.seconds} s`);
    mark(slider, "aria-valuemax", Math.round(Math.max(end, now)));
    mark(slider, "aria-valuenow", Math.round(shown));
    mark(slider, "aria-valuetext", cursor === null ? "live" : clockText(shown));
  }

  function put(line, x) {
    line.style.transform = `translateX(${x.toFixed(1)}px)`;
  }

  follows();
  name();
  chosen(null);
  requestAnimationFrame(frame);
}
