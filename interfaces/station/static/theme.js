// Light or dark: as the system has it, until somebody chooses.
import { draw, h, icon } from "./dom.js";

const KEY = "vrs-theme";

export function mount(station, box) {
  const system = window.matchMedia("(prefers-color-scheme: dark)");
  const symbol = icon("dark_mode");
  const button = h("button.quiet", { type: "button", id: "theme", onclick: toggle }, symbol);
  box.append(button);

  function dark() {
    const chosen = localStorage.getItem(KEY);
    return chosen === null ? system.matches : chosen === "dark";
  }

  function toggle() {
    const wanted = dark() ? "light" : "dark";
    if ((wanted === "dark") === system.matches) localStorage.removeItem(KEY);
    else localStorage.setItem(KEY, wanted);
    show();
  }

  function show() {
    const is = dark();
    document.documentElement.dataset.theme = is ? "dark" : "light";
    draw(symbol, is ? "light_mode" : "dark_mode");
    const label = is ? "Use light colours" : "Use dark colours";
    button.setAttribute("aria-label", label);
    button.title = label;
    station.dispatchEvent(new CustomEvent("theme", { detail: is }));
  }

  station.shared.theme = { get dark() { return dark(); } };
  system.addEventListener("change", show);
  show();
}
