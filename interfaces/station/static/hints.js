// Three hints on the first visit, one at a time, each beside what it's about; they block nothing.
import { html, Icon, useEffect, useLayoutEffect, useOn, useRef, useState } from "./ui.js";

const KEY = "vrs-hints";
/** Distance from what it points at, and from the window's edge [px]. */
const [GAP, EDGE] = [12, 8];

/** Where a hint stands: below, left of (or above, where there's no room) or above the first of these that is shown. */
const HINTS = [
  { at: ["#take", "#give", "#control-pill"], side: "below", title: "Take control",
    text: "Nothing moves before you have it. Others see who has it, and watch." },
  { at: ["#tab-panels", "#side"], side: "left", title: "Move the arm",
    text: "Hold a jog button or a key, or drag the round handle at the tool in the 3D view. The space bar is STOP." },
  { at: ["#live"], side: "above", title: "Look back",
    text: "Drag the strip to another time: the robot goes on meanwhile. Live brings you back to now." },
];

/** The same for a mobile robot. */
const DRIVING = [
  { ...HINTS[0], text: "Nothing drives before you have it. Others see who has it, and watch." },
  { at: ["#tab-panels", "#side"], side: "left", title: "Drive",
    text: "Hold a button, lean the stick, or use the arrow keys or W A S D. The space bar is STOP." },
  { at: ["#badge"], side: "above", title: "Two robots",
    text: "The blue ghost answers at once. The solid robot follows the orange path as soon as the network lets it." },
];

export function Panel({ station }) {
  const { link, lease } = station.session;
  const hints = station.drives ? DRIVING : HINTS;
  const [at, setAt] = useState(null);
  const [bubble, help, next] = [useRef(null), useRef(null), useRef(null)];
  /** Whether somebody asked for them, and walks on by them. */
  const asked = useRef(false);
  const hint = hints[at];

  useEffect(() => {
    if (link === "live" && localStorage.getItem(KEY) === null) setAt((now) => now ?? 0);
  }, [link]);
  useLayoutEffect(() => {
    place();
    if (asked.current) next.current.focus();
    asked.current = false;
    if (hint) station.announce(`Hint ${at + 1} of ${hints.length}. ${hint.title}. ${hint.text}`);
  }, [at]);
  // Who has control changes the bar: what it points at may stand elsewhere then.
  useEffect(() => {
    const later = requestAnimationFrame(place);
    return () => cancelAnimationFrame(later);
  }, [at, lease]);
  useOn(window, "resize", place);
  useOn(window, "keydown", (event) => event.key === "Escape" && end(), { capture: true });

  function ask() {
    asked.current = true;
    setAt(0);
  }

  function end() {
    if (!hint) return;
    if (bubble.current.contains(document.activeElement)) help.current.focus();
    localStorage.setItem(KEY, "seen");
    setAt(null);
  }

  /** Beside what it's about, inside the window, and below the bar, where STOP is. */
  function place() {
    if (!hint) return;
    const found = hint.at.map((name) => document.querySelector(name)).find((one) => one?.getClientRects().length);
    const target = (found ?? document.getElementById("bar")).getBoundingClientRect();
    const { offsetWidth: width, offsetHeight: height, dataset, style } = bubble.current;
    const side = hint.side === "left" && target.left < width + GAP + EDGE ? "above" : hint.side;
    const bar = document.getElementById("bar").getBoundingClientRect().bottom;
    const middle = [target.left + target.width / 2, target.top + Math.min(target.height / 2, 120)];
    let [x, y] = { below: [middle[0] - width / 2, target.bottom + GAP], left: [target.left - width - GAP, middle[1] - height / 2],
      above: [middle[0] - width / 2, target.top - height - GAP] }[side];
    x = Math.max(EDGE, Math.min(x, window.innerWidth - width - EDGE));
    y = Math.max(bar + EDGE, Math.min(y, window.innerHeight - height - EDGE));
    [style.left, style.top, dataset.side] = [`${Math.round(x)}px`, `${Math.round(y)}px`, side];
    const [along, length] = side === "left" ? [middle[1] - y, height] : [middle[0] - x, width];
    style.setProperty("--along", `${Math.round(Math.max(16, Math.min(along, length - 16)))}px`);
  }

  const last = at + 1 === hints.length;
  return html`
    <button class="quiet" type="button" id="help" ref=${help} aria-label="Show the hints" title="Show the hints" onClick=${ask}>
      <${Icon} name="help_outline" /></button>
    <section class="bubble" id="hint" ref=${bubble} hidden=${!hint} role="region" aria-labelledby="hint-title">
      <i class="arrow" aria-hidden="true"></i>
      <h2 id="hint-title">${hint?.title}</h2>
      <p id="hint-text">${hint?.text}</p>
      <div class="row"><span class="muted">${at + 1} of ${hints.length}</span><span class="grow"></span>
        <button type="button" id="hint-close" onClick=${end}>Close</button>
        <button class="main" type="button" id="hint-next" ref=${next} onClick=${() => (last ? end() : setAt(at + 1))}>
          ${last ? "Done" : "Next"}</button>
      </div></section>`;
}
