// What the 3D views of all robots share: the picture, a legend that hides parts, a badge, and words across.
import { theme } from "./theme.js";
import { effect, html, Icon, useEvery, useLayoutEffect, useRef, useState } from "./ui.js";

const OLD = {
  stale: ["hourglass_empty", "Stale: what you see is old"],
  lost: ["wifi_off", "Lost: what you see is old. Trying again"],
};
/** So long a robot may wait before it's told why [ms]: for who takes control it goes on by itself. */
const PATIENCE = 1200;
/** A browser that is busy may offer no WebGL at first: it's tried so often, so long after each other [ms]. */
const [MOST_TRIES, AGAIN] = [4, 1500];
/** Between two looks at what changes with the time [ms]. */
const PERIOD = 80;

/**
 * @param {Function} Scene a StationScene
 * @param {Array<[string, string, string]>} legend what is drawn: its path in the scene, its name, and what it stands for
 * @param {() => object} standing says how the picture stands: {status, symbol, words, title, ahead, across}
 */
export function Viewport({ station, Scene, legend, standing }) {
  const [pane, labels] = [useRef(null), useRef(null)];
  const [flat, setFlat] = useState(false);
  const [tries, setTries] = useState(1);
  useLayoutEffect(() => {
    try {
      station.scene = new Scene(pane.current, labels.current, () => station.session.now);
    } catch {
      pane.current.querySelector("canvas")?.remove();
      setFlat(true);
      const timer = tries < MOST_TRIES ? setTimeout(() => setTries(tries + 1), AGAIN) : 0;
      return () => clearTimeout(timer);
    }
    setFlat(false);
    const { scene } = station;
    const link = new window.VrsLink("/meshcat", ["vrs.meshcat.1"], { take: (data) => scene.take(data), state: () => {} });
    station.on("unlocked", () => link.connect());
    link.connect();
    return effect(() => scene.paint(theme() === "dark"));
  }, [tries]);
  return html`<div class="view" data-link=${station.session.link}>
    <div class="pane" id="pane" role="img" aria-label="Both robots in 3D" ref=${pane}>
      ${flat && html`<p class="no-3d">No 3D view: this browser offers no WebGL.</p>`}</div>
    <div class="labels" aria-hidden="true" ref=${labels}></div>
    <ul class="legend" hidden=${flat}>${legend.map((entry) => html`<${Entry} station=${station} entry=${entry} />`)}</ul>
    <button class="quiet" type="button" id="home" title="Reset the view" aria-label="Reset the view" hidden=${flat}
      onClick=${() => station.scene?.home()}><${Icon} name="center_focus_strong" /></button>
    <${Standing} session=${station.session} standing=${standing} /></div>`;
}

function Entry({ station, entry: [path, name, note] }) {
  const [shown, setShown] = useState(true);
  return html`<li><button type="button" aria-pressed=${String(shown)} title=${note} data-path=${path}
    onClick=${() => station.scene && setShown(station.scene.toggle(path))}><i class=${"key key-" + path}></i>${name}</button></li>`;
}

/** How the picture stands: a badge, how far the real robot is behind, and words across where something is in the way. */
function Standing({ session, standing }) {
  const [, look] = useState(0);
  useEvery(PERIOD, () => look((count) => count + 1));
  const { status, symbol, words, title, ahead, across } = standing();
  const { link, state, holds } = session;
  const waiting = useRef(null);
  if (!state?.halted || !holds) waiting.current = null;
  else waiting.current ??= performance.now();
  const waits = waiting.current !== null && performance.now() - waiting.current >= PATIENCE;
  const why = waits ? ["pause_circle", `Real robot waits: ${state.halted}. Resume lets it go on.`] : null;
  const [mark, text] = OLD[link] ?? across ?? why ?? [];
  return html`<div class="corner">
      <span class="badge" id="badge" role="status" data-status=${status} title=${title}><${Icon} name=${symbol} /><span>${words}</span></span>
      <span class="ahead" aria-hidden="true">${ahead}</span></div>
    <div class="banner" id="banner" hidden=${!text} data-kind=${OLD[link] ? link : across ? "past" : "halted"}>
      ${text && html`<${Icon} name=${mark} /><span>${text}</span>`}</div>`;
}
