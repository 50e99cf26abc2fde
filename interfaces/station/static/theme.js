// Light or dark: as the system has it, until somebody chooses.
import { effect, html, Icon, signal } from "./ui.js";

const KEY = "vrs-theme";
const system = window.matchMedia("(prefers-color-scheme: dark)");
const chosen = signal(localStorage.getItem(KEY));
const preferred = signal(system.matches ? "dark" : "light");
system.addEventListener("change", () => (preferred.value = system.matches ? "dark" : "light"));

/** "light" or "dark". */
export const theme = () => chosen.value ?? preferred.value;
effect(() => (document.documentElement.dataset.theme = theme()));

export function Panel() {
  const other = theme() === "dark" ? "light" : "dark";

  function toggle() {
    if (other === preferred.value) localStorage.removeItem(KEY);
    else localStorage.setItem(KEY, other);
    chosen.value = localStorage.getItem(KEY);
  }

  const label = `Use ${other} colours`;
  return html`<button class="quiet" type="button" id="theme" aria-label=${label} title=${label} onClick=${toggle}>
    <${Icon} name=${other + "_mode"} /></button>`;
}
