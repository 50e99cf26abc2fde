// What stands around live plots: the window that is shown, the file to save, what they show, and their colours.
import { theme } from "./theme.js";
import { effect, untracked } from "./ui.js";
import { h, mark } from "./dom.js";

/** Style sheets of plots. */
export function loadStyles() {
  for (const name of ["uplot", "plots"]) document.head.append(h("link", { rel: "stylesheet", href: `/station/${name}.css` }));
}

/** The choice of a window, and the button that saves. */
export class PlotHead {
  /**
   * @param {Array} spans windows: seconds, name, …; the first is shown
   * @param {{chosen: function(): void, save: function(): void}} does what is done after a choice, and on a click
   */
  constructor(spans, { chosen, save }) {
    this.span = spans[0];
    const buttons = spans.map((span) => {
      const choose = () => {
        this.span = span;
        buttons.forEach((button, k) => mark(button, "aria-pressed", String(spans[k] === span)));
        chosen();
      };
      const pressed = String(span === this.span);
      return h("button", { type: "button", "aria-pressed": pressed, "data-span": span[0], onclick: choose }, span[1]);
    });
    const title = "Save what is kept, ten minutes at most";
    this.element = h(
      "div.row.plots-head",
      {},
      h("div.row.spans", { role: "group", "aria-label": "Time that is shown" }, ...buttons),
      h("span.grow"),
      h("button", { type: "button", id: "plots-save", title, onclick: save }, "CSV"),
    );
  }
}

/**
 * What plots show, folded.
 * @param {Array} graphs each with a title and a note
 * @param {...Node} more behind them
 */
export function notes(graphs, ...more) {
  return h(
    "details.plot",
    {},
    h("summary", {}, h("span.plot-title", {}, "What these show")),
    h("dl.plot-notes", {}, ...graphs.flatMap(({ title, note }) => [h("dt", {}, title), h("dd", {}, note)]), ...more),
  );
}

/**
 * Gives the theme's colours by name, each looked up once a theme.
 * @param {function(): void} changed is called when there's another theme
 */
export function palette(changed) {
  const known = new Map();
  let shown = theme();
  effect(() => {
    if (theme() === shown) return;
    shown = theme();
    known.clear();
    untracked(changed);
  });
  return (name) => {
    if (!known.has(name)) known.set(name, getComputedStyle(document.documentElement).getPropertyValue(name).trim());
    return known.get(name);
  };
}
