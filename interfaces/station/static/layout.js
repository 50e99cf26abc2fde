// The page's frame: tabs at the right, and the splitter between them and the 3D view.
import { h, icon } from "./dom.js";

const WIDTH = "vrs-side-width";
const [NARROWEST, WIDEST, USUAL] = [320, 640, 364];
const STEP = 24;

export class Layout {
  constructor(root, panels) {
    this.root = root;
    this.list = document.getElementById("tabs");
    this.list.setAttribute("role", "tablist");
    this.list.setAttribute("aria-label", "Panels");
    this.tabs = new Map();
    for (const panel of panels) if (panel.place === "side") this.add(panel);
    this.list.addEventListener("keydown", (event) => this.walk(event));
    this.split(document.getElementById("splitter"));
  }

  /** Give a panel its tab. */
  add(panel) {
    const card = document.getElementById("card-" + panel.name);
    const tab = h(
      "button.tab",
      { type: "button", role: "tab", id: "tab-" + panel.name, "aria-controls": card.id, tabindex: -1 },
      panel.icon ? icon(panel.icon) : null,
      panel.title,
    );
    card.setAttribute("role", "tabpanel");
    card.setAttribute("aria-labelledby", tab.id);
    card.hidden = true;
    tab.addEventListener("click", () => this.show(panel.name));
    this.tabs.set(panel.name, { tab, card });
    this.list.append(tab);
    if (!this.shown) this.show(panel.name);
  }

  /** Show a panel of the side. */
  show(name) {
    this.shown = name;
    for (const [other, { tab, card }] of this.tabs) {
      const chosen = other === name;
      tab.setAttribute("aria-selected", String(chosen));
      tab.tabIndex = chosen ? 0 : -1;
      card.hidden = !chosen;
    }
  }

  walk(event) {
    const names = [...this.tabs.keys()].filter((name) => this.tabs.get(name).tab.isConnected);
    const at = names.indexOf(this.shown);
    const to = { ArrowRight: at + 1, ArrowLeft: at - 1, Home: 0, End: names.length - 1 }[event.key];
    if (to === undefined) return;
    event.preventDefault();
    event.stopPropagation();
    const name = names[(to + names.length) % names.length];
    this.show(name);
    this.tabs.get(name).tab.focus();
  }

  split(splitter) {
    const set = (width) => {
      const most = Math.min(WIDEST, window.innerWidth - 560);
      const now = Math.round(Math.max(NARROWEST, Math.min(most, width)));
      this.root.style.setProperty("--side", now + "px");
      splitter.setAttribute("aria-valuenow", now);
      localStorage.setItem(WIDTH, now);
      return now;
    };
    const given = { role: "separator", "aria-orientation": "vertical", "aria-label": "Width of the panels" };
    const bounds = { "aria-valuemin": NARROWEST, "aria-valuemax": WIDEST, tabindex: 0 };
    for (const [name, value] of Object.entries({ ...given, ...bounds })) splitter.setAttribute(name, value);
    let width = set(Number(localStorage.getItem(WIDTH)) || USUAL);
    splitter.addEventListener("keydown", (event) => {
      const way = { ArrowLeft: STEP, ArrowRight: -STEP }[event.key];
      if (way === undefined) return;
      event.preventDefault();
      event.stopPropagation();
      width = set(width + way);
    });
    splitter.addEventListener("pointerdown", (event) => {
      splitter.setPointerCapture(event.pointerId);
      const right = width + event.clientX;
      const move = (moved) => (width = set(right - moved.clientX));
      splitter.addEventListener("pointermove", move);
      splitter.addEventListener("lostpointercapture", () => splitter.removeEventListener("pointermove", move), {
        once: true,
      });
    });
  }
}
