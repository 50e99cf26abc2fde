// The 3D view of an arm: both robots, the committed path, what is shown and how far it can be trusted, and the past.
import { History } from "./history.js";
import { StationScene } from "./twins.js";
import { clockText, html, useMemo, useOn, useRef, useSignalEffect } from "./ui.js";
import { Viewport } from "./viewport.js";

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
const PAST = ["history", "You look at another time; the robot goes on"];

export function Panel({ station }) {
  const { session, chain } = station;
  const history = useMemo(() => new History(station), []);
  const changed = useRef({ at: -Infinity, by: null }).current;

  /** Put both robots where they were. */
  function dress() {
    const { cursor, scene, shown } = station;
    if (!scene || cursor === null || !shown) return;
    const measured = history.at(cursor);
    scene.pose("virtual", chain.links(shown));
    scene.pose("real", measured && chain.links(measured));
    scene.grasp(cursor, history.grasp(cursor), station.config.robot.hand);
  }

  useSignalEffect(() => {
    const { cursor, scene } = station;
    if (cursor !== null) scene?.leave();
    else scene?.resume();
    changed.at = -Infinity;
    dress();
  });
  useOn(session, "edit", ({ before, after, change }) => {
    dress();
    const { cursor } = station;
    // Who looks at now sees each command at once: only who looks ahead had been shown something else.
    if (cursor === null || !before || !change || cursor <= Math.max(session.now ?? 0, change.segments.length ? change.start : change.end)) return;
    const [then, now] = [before.joints(cursor), after.joints(cursor)];
    if (then.some((x, k) => Math.abs(x - now[k]) > 1e-9)) Object.assign(changed, { at: performance.now() / 1000, by: change.command_id });
  });

  function trust() {
    const { cursor } = station;
    if (!session.timeline || session.now === null) return "none";
    if (cursor !== null && cursor <= session.past) return "confirmed";
    if (session.link !== "live") return "none";
    return performance.now() / 1000 - changed.at < CHANGED ? "falsified" : "predicted";
  }

  function standing() {
    const { cursor, scene } = station;
    const status = trust();
    const [symbol, word, title] = BADGES[status];
    const by = status === "falsified" && changed.by !== null ? ` by #${changed.by}` : "";
    const left = session.link === "live" && cursor === null ? (scene?.ahead ?? null) : null;
    return {
      status, symbol, title, words: word + by + (cursor === null ? "" : ` · ${clockText(cursor)}`),
      ahead: left === null ? "" : `real robot at rest in ${left.toFixed(1)} s`, across: cursor === null ? null : PAST,
    };
  }

  return html`<${Viewport} station=${station} Scene=${StationScene} legend=${LEGEND} standing=${standing} />`;
}
