// What panels share by which somebody moves a robot: buttons that are held, how fast, and who may.
import { html, observed, useEffect, useRef, useSignal } from "./ui.js";

/**
 * A button that steers for as long as it's held, by pointer or by Enter.
 * @param {object} steer see steer.js
 * @param {string} source what the steering is known by
 * @param {Function} input gives what it asks for
 * @param {() => boolean} once does what's done once at a press, and says whether that was all
 * @param {string} why it can't work now
 */
export function Held({ steer, source, input, once = () => false, why = "", title, children, ...others }) {
  const pressed = useSignal(false);

  function start() {
    if (!once()) pressed.value = steer.hold(source, input, () => (pressed.value = false));
  }

  function end() {
    if (!pressed.value) return;
    pressed.value = false;
    steer.release(source);
  }

  function point(event) {
    if (event.button !== 0) return;
    event.currentTarget.setPointerCapture(event.pointerId);
    start();
  }

  return html`<button class="held" type="button" aria-pressed=${String(pressed.value)} aria-disabled=${why ? "true" : undefined}
    title=${why || title} onPointerDown=${point} onPointerUp=${end} onPointerCancel=${end} onLostPointerCapture=${end} onBlur=${end}
    onKeyDown=${(event) => event.key === "Enter" && !event.repeat && start()} onKeyUp=${(event) => event.key === "Enter" && end()}
    onContextMenu=${(event) => event.preventDefault()} ...${others}>${children}</button>`;
}

/** How fast, kept from one visit to the next. */
export class Speed {
  /**
   * @param {string} key what it's kept under
   * @param {string} usual percent
   */
  constructor(key, usual) {
    this.key = key;
    observed(this, { percent: localStorage.getItem(key) ?? usual });
  }

  set(percent) {
    localStorage.setItem(this.key, percent);
    this.percent = percent;
  }

  /** Of full speed, 0 to 1. */
  get share() {
    return Number(this.percent) / 100;
  }
}

/** Keys move the robot again once the mouse has let go of what takes them too. */
export const letGo = (event) => event.currentTarget.blur();

export function SpeedRow({ speed, children }) {
  return html`<div class="row speed"><label for="speed">Speed</label>
    <input id="speed" type="range" min="5" max="100" step="5" value=${speed.percent} onInput=${({ target }) => speed.set(target.value)}
      onPointerUp=${letGo} /><output for="speed">${speed.percent} %</output>${children}</div>`;
}

/** A line that says what is needed before the robot can be moved; its panel is marked as idle meanwhile. */
export function Needs({ station, id }) {
  const why = station.idle;
  const line = useRef(null);
  useEffect(() => {
    line.current.closest(".panel").toggleAttribute("data-idle", why !== "");
  }, [why]);
  return html`<p class="needs" id=${id} ref=${line} hidden=${!why}>${why}</p>`;
}
