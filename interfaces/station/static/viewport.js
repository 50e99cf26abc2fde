// What the 3D views of all robots share: the pane with its scene, a legend that hides parts, a badge, and words across.
import { draw, h, icon, mark, write } from "./dom.js";
import { theme } from "./theme.js";
import { effect } from "./ui.js";

const OLD = {
  stale: ["hourglass_empty", "Stale: what you see is old"],
  lost: ["wifi_off", "Lost: what you see is old. Trying again"],
};

/** So long a robot may wait before it's told why [ms]: for who takes control it goes on by itself. */
const PATIENCE = 1200;

export class Viewport {
  /**
   * @param {object} station
   * @param {Element} box where it goes
   * @param {Array<[string, string, string]>} legend what is drawn: its path in the scene, its name, and what it stands for
   * @param {Function} Scene a StationScene
   * @param {...Element} beside what stands beside the badge
   */
  constructor(station, box, legend, Scene, ...beside) {
    [this.session, this.box] = [station.session, box];
    this.pane = h("div.pane", { id: "pane", role: "img", "aria-label": "Both robots in 3D" });
    const labels = h("div.labels", { "aria-hidden": "true" });
    this.symbol = icon("help");
    this.words = h("span");
    this.badge = h("span.badge", { id: "badge", role: "status" }, this.symbol, this.words);
    this.banner = h("div.banner", { id: "banner", hidden: true });
    this.across = "";
    /** Since when the real robot has been waiting for who has control [ms]; null while it isn't. */
    this.waiting = null;
    const entries = h("ul.legend");
    const home = h("button.quiet", { type: "button", id: "home", title: "Reset the view", "aria-label": "Reset the view" },
      icon("center_focus_strong"));
    box.append(this.pane, labels, entries, h("div.corner", {}, this.badge, ...beside), home, this.banner);

    /** Null where the browser draws nothing in 3D. */
    this.scene = null;
    for (const [name, title, note] of legend) {
      const button = h("button", { type: "button", "aria-pressed": "true", title: note, "data-path": name },
        h("i.key.key-" + name), title);
      button.addEventListener("click", () => this.scene && mark(button, "aria-pressed", String(this.scene.toggle(name))));
      entries.append(h("li", {}, button));
    }
    home.addEventListener("click", () => this.scene?.home());
    try {
      this.scene = new Scene(this.pane, labels, () => {});
    } catch {
      this.pane.replaceChildren(h("p.no-3d", {}, "No 3D view: this browser offers no WebGL."));
      entries.hidden = home.hidden = true;
    }
    if (this.scene) this.connect(station, this.scene);
  }

  connect(station, scene) {
    const connection = new window.VrsLink("/meshcat", ["vrs.meshcat.1"], {
      take: (data) => scene.take(data),
      state: () => {},
    });
    effect(() => scene.paint(theme() === "dark"));
    station.addEventListener("unlocked", () => connection.connect());
    connection.connect();
  }

  /** Why the real robot has been waiting for some time for who has control, [symbol, words]; null where it hasn't. */
  waits() {
    const { state, holds } = this.session;
    const now = performance.now();
    if (!state?.halted || !holds) this.waiting = null;
    else this.waiting ??= now;
    if (this.waiting === null || now - this.waiting < PATIENCE) return null;
    return ["pause_circle", `Real robot waits: ${state.halted}. Resume lets it go on.`];
  }

  /** Say how the picture stands. */
  stand(status, symbol, words) {
    mark(this.badge, "data-status", status);
    draw(this.symbol, symbol);
    write(this.words, words);
  }

  /** Lay words across: that what one sees is old, else others, [symbol, words], else why the real robot waits. */
  cover(otherwise = null) {
    const { link } = this.session;
    const old = OLD[link];
    const waits = this.waits();
    const shown = old ?? otherwise ?? waits;
    mark(this.box, "data-link", link);
    mark(this.banner, "data-kind", old ? link : otherwise ? "past" : "halted");
    this.banner.hidden = !shown;
    if (!shown || shown[1] === this.across) return;
    this.across = shown[1];
    this.banner.replaceChildren(icon(shown[0]), h("span", {}, shown[1]));
  }
}
