// What panels share by which somebody moves a robot: buttons that are held, how fast, and who may.
import { h, mark, write } from "./dom.js";

/**
 * A button that steers for as long as it's held, by pointer or by Enter.
 * @param {object} steer see steer.js
 * @param {string} source what the steering is known by
 * @param {object} props of the button, its label among them
 * @param {Node|string} content what it shows
 * @param {Function} input gives what it asks for
 */
export function held(steer, source, props, content, input) {
  const button = h("button.held", { type: "button", "aria-pressed": "false", ...props }, content);
  const up = () => mark(button, "aria-pressed", "false");
  const start = () => mark(button, "aria-pressed", String(steer.hold(source, input, up)));
  const end = () => {
    if (button.getAttribute("aria-pressed") !== "true") return;
    up();
    steer.release(source);
  };
  button.addEventListener("pointerdown", (event) => {
    if (event.button !== 0) return;
    button.setPointerCapture(event.pointerId);
    start();
  });
  for (const type of ["pointerup", "pointercancel", "lostpointercapture", "blur"]) button.addEventListener(type, end);
  button.addEventListener("keydown", (event) => event.key === "Enter" && !event.repeat && start());
  button.addEventListener("keyup", (event) => event.key === "Enter" && end());
  button.addEventListener("contextmenu", (event) => event.preventDefault());
  return button;
}

/** How fast: a row with a slider, kept from one visit to the next. */
export class Speed {
  /**
   * @param {string} key what it's kept under
   * @param {string} usual percent
   */
  constructor(key, usual) {
    this.slider = h("input", { id: "speed", type: "range", min: 5, max: 100, step: 5 });
    this.slider.value = localStorage.getItem(key) ?? usual;
    const text = h("output", { for: "speed" });
    const show = () => {
      localStorage.setItem(key, this.slider.value);
      write(text, `${this.slider.value} %`);
    };
    this.slider.addEventListener("input", show);
    show();
    this.row = h("div.row.speed", {}, h("label", { for: "speed" }, "Speed"), this.slider, text);
  }

  /** Of full speed, 0 to 1. */
  get share() {
    return Number(this.slider.value) / 100;
  }
}

/** A line that says what is needed before the robot can be moved; beside it the panel is marked as idle. */
export function needs(station, box, id) {
  const { session } = station;
  const line = h("p.needs", { id });
  function show() {
    const ready = session.holds && session.link === "live";
    box.toggleAttribute("data-idle", !ready);
    const { lease } = session;
    const why = session.link !== "live" ? "No connection." : session.mayCommand ? "" : "You are here to watch.";
    const wait = lease.state === "held" ? `${lease.holder} has control.` : "Take control first, in the bar above.";
    write(line, ready ? "" : why || wait);
    line.hidden = ready;
  }
  for (const type of ["lease", "link", "welcome"]) station.on(type, show);
  show();
  return line;
}
