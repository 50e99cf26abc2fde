// What couldn't be done, and what stands in the way, said in a few words at the control that was used.
import { html, observed, useLayoutEffect, useOn, useRef } from "./ui.js";

/** What people use to give orders. */
const CONTROLS = "button, input, select, textarea, summary, a, [role=slider], .stick, .plan";
/** So long it's shown [ms]. */
const SHOWN = 7000;
/** Distance from the control, and from the window's edge [px]. */
const [GAP, EDGE] = [6, 8];

/** Words of the server as a sentence. */
function sentence(text) {
  const words = text.trim();
  return words[0].toUpperCase() + words.slice(1) + (/[.!?…]$/.test(words) ? "" : ".");
}

/** Whether an order asks for rest alone, as the hand that lets go does. */
function rests({ type, rates, twist, v, w }) {
  const speeds = type === "steer" ? (rates ?? twist ?? []) : type === "drive" ? [v, w] : [1];
  return speeds.every((speed) => speed === 0);
}

export class Notices {
  constructor(session) {
    this.session = session;
    /** The control that was used last, and where it was; null where what was used isn't on the page. */
    this.used = { control: null, place: null };
    /** The controls of requests that wait for their answers. */
    this.asked = new Map();
    this.timer = null;
    // What is said, {text, control, place}; null for nothing.
    observed(this, { said: null });
    const use = (event) => this.use(event.target.closest?.(CONTROLS) ?? null);
    window.addEventListener("pointerdown", use, { capture: true });
    window.addEventListener("keydown", (event) => (event.key === "Escape" ? this.clear() : use(event)), { capture: true });
    const on = (type, listener) => session.addEventListener(type, ({ detail }) => listener(detail));
    on("order", (entry) => (entry.used = this.used));
    on("wish", ({ number, type }) => this.ask(number, type));
    on("outcome", (entry) => this.judge(entry));
    on("problem", ({ number, text }) => {
      const used = this.asked.has(number) ? this.asked.get(number) : this.used;
      this.asked.delete(number);
      if (used) this.say(text, used);
    });
    for (const type of ["lease", "network", "tasks"]) {
      on(type, ({ answers }) => {
        if (this.asked.get(answers)) this.clear();
        this.asked.delete(answers);
      });
    }
  }

  /** Let a control be the one that was used. */
  use(control) {
    this.used = { control, place: control && control.getBoundingClientRect() };
  }

  /** Nobody's hand asks how the way to the robot is. */
  ask(number, type) {
    this.asked.set(number, type === "survey" ? null : this.used);
    if (this.asked.size > 50) this.asked.delete(this.asked.keys().next().value);
  }

  /** What became of an order. */
  judge({ command, outcome, used }) {
    // STOP has a note of its own, and later changes of a receipt aren't of this hand's doing.
    if (command?.type === "stop" || outcome.revision) return;
    const { refusal, receipt } = outcome;
    const why = refusal || (receipt?.status === "rejected" ? receipt.reason : "");
    // Why it waits stands across the picture.
    const waits = outcome.code === "not-following" && this.session.state?.halted;
    if (waits) this.say("the robot doesn't follow: press Resume", used);
    else if (why) this.say(why, used);
    else if (command === null && !receipt) this.say("there's nothing to take back", used);
    else if (receipt?.hindrance) this.say(receipt.hindrance, used);
    else if (command === null || !rests(command)) this.clear();
  }

  /** Say something at the control that was used last, or at another one; nothing of "". */
  say(text, used = this.used) {
    if (!text) return;
    const words = sentence(text);
    if (this.said?.text !== words || this.said.control !== used.control) this.said = { text: words, ...used };
    clearTimeout(this.timer);
    this.timer = setTimeout(() => this.clear(), SHOWN);
  }

  clear() {
    clearTimeout(this.timer);
    this.said = null;
  }
}

export function Notice({ notices: { said } }) {
  const element = useRef(null);

  /** Below the control, or above it where there's no room; over the picture where the control isn't to be seen. */
  function put() {
    if (!said) return;
    const { control, place } = said;
    const seen = control?.isConnected && control.getClientRects().length ? control.getBoundingClientRect() : place;
    const pane = document.getElementById("pane-box").getBoundingClientRect();
    const { offsetWidth: width, offsetHeight: height, style } = element.current;
    const at = seen?.width ? seen : new DOMRect(pane.left, pane.bottom - height - 64, pane.width, 0);
    const fits = at.bottom + GAP + height <= window.innerHeight - EDGE;
    const x = at.left + at.width / 2 - width / 2;
    const y = fits ? at.bottom + GAP : at.top - GAP - height;
    style.left = `${Math.round(Math.max(EDGE, Math.min(x, window.innerWidth - width - EDGE)))}px`;
    style.top = `${Math.round(Math.max(EDGE, y))}px`;
  }

  useOn(window, "resize", put);
  useLayoutEffect(() => {
    put();
    said?.control?.setAttribute("data-refused", "");
    return () => said?.control?.removeAttribute("data-refused");
  }, [said]);
  return html`<div role="status" aria-live="assertive">
    <p class="notice" id="notice" ref=${element} hidden=${!said}>${said?.text ?? ""}</p></div>`;
}
