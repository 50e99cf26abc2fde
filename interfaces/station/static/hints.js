// Three hints on the first visit, one at a time, each beside what it's about; they block nothing.
import { h, icon, write } from "./dom.js";

const KEY = "vrs-hints";
/** Distance from what it points at, and from the window's edge [px]. */
const [GAP, EDGE] = [12, 8];

/** Where a hint stands: below, left of or above the first of these that is shown. */
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

export function mount(station) {
  const hints = station.drives ? DRIVING : HINTS;
  const count = h("span.muted");
  const title = h("h2", { id: "hint-title" });
  const text = h("p", { id: "hint-text" });
  const next = h("button.main", { type: "button", id: "hint-next" });
  const close = h("button", { type: "button", id: "hint-close" }, "Close");
  const arrow = h("i.arrow", { "aria-hidden": "true" });
  const bubble = h("section.bubble", { id: "hint", hidden: true, role: "region", "aria-labelledby": "hint-title" },
    arrow, title, text, h("div.row", {}, count, h("span.grow"), close, next));
  const help = h("button.quiet", { type: "button", id: "help", "aria-label": "Show the hints", title: "Show the hints" },
    icon("help_outline"));
  document.getElementById("panel-theme").append(help);
  // After the bar: whoever walks by keys comes by soon.
  document.getElementById("bar").after(bubble);
  let at = null;
  let asked = false;

  function show(number) {
    at = number;
    const hint = hints[at];
    write(title, hint.title);
    write(text, hint.text);
    write(count, `${at + 1} of ${hints.length}`);
    write(next, at + 1 < hints.length ? "Next" : "Done");
    bubble.hidden = false;
    place();
    station.announce(`Hint ${at + 1} of ${hints.length}. ${hint.title}. ${hint.text}`);
  }

  function end() {
    if (at === null) return;
    const inside = bubble.contains(document.activeElement);
    at = null;
    bubble.hidden = true;
    localStorage.setItem(KEY, "seen");
    if (inside) help.focus();
  }

  /** Beside what it's about, inside the window, and below the bar, where STOP is. */
  function place() {
    if (at === null) return;
    const { at: names, side } = hints[at];
    const found = names.map((name) => document.querySelector(name)).find((one) => one && one.getClientRects().length);
    const target = (found ?? document.getElementById("bar")).getBoundingClientRect();
    const { offsetWidth: width, offsetHeight: height } = bubble;
    const bar = document.getElementById("bar").getBoundingClientRect().bottom;
    const middle = [target.left + target.width / 2, target.top + Math.min(target.height / 2, 120)];
    let [x, y] = { below: [middle[0] - width / 2, target.bottom + GAP], left: [target.left - width - GAP, middle[1] - height / 2],
      above: [middle[0] - width / 2, target.top - height - GAP] }[side];
    x = Math.max(EDGE, Math.min(x, window.innerWidth - width - EDGE));
    y = Math.max(bar + EDGE, Math.min(y, window.innerHeight - height - EDGE));
    bubble.style.left = `${Math.round(x)}px`;
    bubble.style.top = `${Math.round(y)}px`;
    bubble.dataset.side = side;
    const along = side === "left" ? middle[1] - y : middle[0] - x;
    arrow.style.setProperty("--along", `${Math.round(Math.max(16, Math.min(along, (side === "left" ? height : width) - 16)))}px`);
  }

  next.addEventListener("click", () => (at + 1 < hints.length ? show(at + 1) : end()));
  close.addEventListener("click", end);
  help.addEventListener("click", () => {
    show(0);
    next.focus();
  });
  window.addEventListener("keydown", (event) => event.key === "Escape" && end(), { capture: true });
  new ResizeObserver(place).observe(document.getElementById("tab-panels"));
  window.addEventListener("resize", place);
  station.on("lease", () => requestAnimationFrame(place));

  station.on("link", first);
  function first() {
    if (asked || station.session.link !== "live") return;
    asked = true;
    if (localStorage.getItem(KEY) === null) show(0);
  }
  first();
}
