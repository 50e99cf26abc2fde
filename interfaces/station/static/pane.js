// The 3D view: both robots, the committed path, what is shown and how far it can be trusted, and the past.
import { clockText, h, write } from "./dom.js";
import { History } from "./history.js";
import { StationScene } from "./twins.js";
import { Viewport } from "./viewport.js";

const PERIOD = 80;
/** How long a change of the time that is looked at is spoken of [s]. */
const CHANGED = 2.5;
const BADGES = {
  predicted: ["auto_awesome", "Predicted", "The server's clock hasn't passed what is shown: a command may still change it"],
  confirmed: ["verified", "Confirmed", "The server's clock has passed what is shown: it came true"],
  falsified: ["update", "Changed", "A command changed what is planned for the time that you look at"],
  none: ["help", "Nothing known", "Nothing has come from the server yet, or nothing comes any more"],
};
const LEGEND = [
  ["virtual", "Virtual", "ghost, as commanded"],
  ["real", "Real", "solid, as measured"],
  ["committed", "Committed path", "where the real tool will go"],
];

export function mount(station, box) {
  const session = station.session;
  const ahead = h("span.ahead", { "aria-hidden": "true" });
  const viewport = new Viewport(station, box, LEGEND, StationScene, ahead);
  const { pane, scene } = viewport;

  const history = new History(station);
  let changedAt = -Infinity;
  let changedBy = null;
  /** The time of the past that is shown [s]; null: now. */
  let cursor = null;

  const shared = (station.shared.pane = {
    pane,
    scene,
    /** Joints of the virtual robot as the picture shows them; null where nothing is known. */
    get shown() {
      const t = cursor ?? session.now;
      return t === null || !session.timeline ? null : session.timeline.joints(t);
    },
    get cursor() { return cursor; },
    /** Show a time of the timeline [s]; null for now, and on with the time. */
    show(t) {
      if (scene && cursor === null && t !== null) scene.leave();
      if (scene && cursor !== null && t === null) scene.resume();
      cursor = t;
      changedAt = -Infinity;
      dress();
      station.dispatchEvent(new CustomEvent("cursor", { detail: t }));
      say();
    },
  });

  /** Put both robots where they were. */
  function dress() {
    const q = shared.shown;
    if (!scene || cursor === null || !q) return;
    const measured = history.at(cursor);
    scene.pose("virtual", station.chain.links(q));
    scene.pose("real", measured ? station.chain.links(measured) : null);
  }

  station.on("edit", ({ before, after, change }) => {
    dress();
    // Who looks at now sees each command at once: only who looks ahead had been shown something else.
    if (cursor === null || !before || !change || cursor <= Math.max(session.now ?? 0, change.segments.length ? change.start : change.end)) return;
    const [then, now] = [before.joints(cursor), after.joints(cursor)];
    if (then.some((x, k) => Math.abs(x - now[k]) > 1e-9)) {
      changedAt = performance.now() / 1000;
      changedBy = change.command_id;
    }
  });

  function standing() {
    if (!session.timeline || session.now === null) return "none";
    if (cursor !== null && cursor <= session.past) return "confirmed";
    if (session.link !== "live") return "none";
    if (performance.now() / 1000 - changedAt < CHANGED) return "falsified";
    return "predicted";
  }

  function say() {
    const status = standing();
    const [symbol, word, meaning] = BADGES[status];
    const by = status === "falsified" && changedBy !== null ? ` by #${changedBy}` : "";
    viewport.stand(status, symbol, word + by + (cursor === null ? "" : ` · ${clockText(cursor)}`));
    viewport.badge.title = meaning;
    const live = session.link === "live";
    const left = live && cursor === null && scene ? scene.ahead : null;
    write(ahead, left === null ? "" : `real robot at rest in ${left.toFixed(1)} s`);
    viewport.cover(cursor === null ? null : ["history", "You look at another time; the robot goes on"]);
  }

  setInterval(say, PERIOD);
  station.on("link", say);
  say();
}
