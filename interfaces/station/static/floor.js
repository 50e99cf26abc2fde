// The 3D view of a mobile robot: both twins in their room, where they drove, what is committed, and how old that is.
import { h, icon, mark, write } from "./dom.js";
import { StationScene } from "./twins.js";

const PERIOD = 100;
const OLD = {
  stale: ["hourglass_empty", "Stale: what you see is old"],
  lost: ["wifi_off", "Lost: what you see is old. Trying again"],
};
const LEGEND = [
  ["virtual", "Virtual", "ghost, as driven"],
  ["real", "Real", "solid, as measured"],
  ["committed", "Committed path", "where the real robot will go"],
  ["driven", "Driven", "where both were"],
];

/** A robot in its room: the server says how far away all of that is seen. */
class FloorScene extends StationScene {
  get further() {
    return 1.0;
  }
}

export function mount(station, box) {
  const session = station.session;
  const pane = h("div.pane", { id: "pane", role: "img", "aria-label": "Both robots in 3D" });
  const labels = h("div.labels", { "aria-hidden": "true" });
  const words = h("span");
  const symbol = icon("help");
  const badge = h("span.badge", { id: "badge", role: "status" }, symbol, words);
  const banner = h("div.banner", { id: "banner", hidden: true });
  const legend = h("ul.legend");
  const home = h("button.quiet", { type: "button", id: "home", title: "Reset the view", "aria-label": "Reset the view" },
    icon("center_focus_strong"));
  box.append(pane, labels, legend, h("div.corner", {}, badge), home, banner);

  let scene = null;
  station.shared.pane = { get scene() { return scene; } };
  for (const [name, title, note] of LEGEND) {
    const button = h("button", { type: "button", "aria-pressed": "true", title: note, "data-path": name },
      h("i.key.key-" + name), title);
    button.addEventListener("click", () => scene && mark(button, "aria-pressed", String(scene.toggle(name))));
    legend.append(h("li", {}, button));
  }
  home.addEventListener("click", () => scene?.home());

  try {
    scene = new FloorScene(pane, labels, () => {});
  } catch {
    pane.replaceChildren(h("p.no-3d", {}, "No 3D view: this browser offers no WebGL."));
    legend.hidden = home.hidden = true;
  }
  if (scene) {
    const connection = new window.VrsLink("/meshcat", ["vrs.meshcat.1"], {
      take: (data) => scene.take(data),
      state: () => {},
    });
    station.addEventListener("theme", (event) => scene.paint(event.detail));
    station.addEventListener("unlocked", () => connection.connect());
    scene.paint(station.shared.theme?.dark ?? document.documentElement.dataset.theme === "dark");
    connection.connect();
  }

  /** How the picture stands: symbol, words, tone. */
  function standing() {
    const { link, state } = session;
    if (link !== "live" || !state) return ["help", "Nothing known", "none"];
    if (!state.connected && state.connected !== undefined) return ["cloud_off", "Real robot not heard", "falsified"];
    if (state.halted) return ["pause_circle", "Real robot waits", "none"];
    if (state.starved) return ["hourglass_empty", "Real robot waits for news", "none"];
    const later = state.time_difference;
    if (later == null || later < 0.02) return ["verified", "Real robot is there too", "confirmed"];
    return ["schedule", `Real robot ${later.toFixed(1)} s behind`, "predicted"];
  }

  function say() {
    const [name, text, tone] = standing();
    mark(badge, "data-status", tone);
    write(symbol, name);
    write(words, text);
    const shown = OLD[session.link];
    banner.hidden = !shown;
    mark(box, "data-link", session.link);
    if (!shown || banner.dataset.kind === session.link) return;
    mark(banner, "data-kind", session.link);
    banner.replaceChildren(icon(shown[0]), h("span", {}, shown[1]));
  }

  setInterval(say, PERIOD);
  station.on("link", () => {
    if (!OLD[session.link]) mark(banner, "data-kind", null);
    say();
  });
  say();
}
