// What couldn't be done, and what stands in the way, said in a few words at the control that was used.
import { h, mark, write } from "./dom.js";

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
    this.element = h("p.notice", { id: "notice", hidden: true });
    this.box = h("div", { role: "status", "aria-live": "assertive" }, this.element);
    /** The control that was used last, and where it was. */
    this.control = this.place = null;
    /** The one that is spoken of, and until when. */
    this.about = this.timer = null;
    /** The controls of requests that wait for their answers. */
    this.asked = new Map();
    const use = (event) => this.use(event.target.closest?.(CONTROLS) ?? null);
    window.addEventListener("pointerdown", use, { capture: true });
    window.addEventListener("keydown", (event) => {
      if (event.key === "Escape") this.clear();
      else use(event);
    }, { capture: true });
    window.addEventListener("resize", () => this.put());
    const on = (type, listener) => session.addEventListener(type, ({ detail }) => listener(detail));
    on("order", (entry) => (entry.control = this.used()));
    on("wish", ({ number, type }) => this.ask(number, type));
    on("outcome", (entry) => this.judge(entry));
    on("problem", ({ number, text }) => {
      const control = this.asked.has(number) ? this.asked.get(number) : this.used();
      this.asked.delete(number);
      if (control) this.say(text, control);
    });
    for (const type of ["lease", "network", "tasks"]) {
      on(type, ({ answers }) => {
        if (this.asked.get(answers)) this.clear();
        this.asked.delete(answers);
      });
    }
  }

  /** Let a control be the one that was used; null where what was used isn't on the page. */
  use(control) {
    this.control = control;
    this.place = control && control.getBoundingClientRect();
  }

  used() {
    return { control: this.control, place: this.place };
  }

  /** Nobody's hand asks how the way to the robot is. */
  ask(number, type) {
    this.asked.set(number, type === "survey" ? null : this.used());
    if (this.asked.size > 50) this.asked.delete(this.asked.keys().next().value);
  }

  /** What became of an order. */
  judge({ command, outcome, control }) {
    // STOP has a note of its own, and later changes of a receipt aren't of this hand's doing.
    if (command?.type === "stop" || outcome.revision) return;
    const { refusal, receipt } = outcome;
    const why = refusal || (receipt?.status === "rejected" ? receipt.reason : "");
    // Why it waits stands across the picture.
    const waits = outcome.code === "not-following" && this.session.state?.halted;
    if (waits) this.say("the robot doesn't follow: press Resume", control);
    else if (why) this.say(why, control);
    else if (command === null && !receipt) this.say("there's nothing to take back", control);
    else if (receipt?.hindrance) this.say(receipt.hindrance, control);
    else if (command === null || !rests(command)) this.clear();
  }

  /** Say something at the control that was used last, or at another one. */
  say(text, used = this.used()) {
    if (!text) return;
    this.mark(null);
    this.about = used;
    this.mark("");
    this.element.hidden = false;
    write(this.element, sentence(text));
    this.put();
    clearTimeout(this.timer);
    this.timer = setTimeout(() => this.clear(), SHOWN);
  }

  clear() {
    if (!this.about) return;
    clearTimeout(this.timer);
    this.mark(null);
    this.about = null;
    this.element.hidden = true;
    write(this.element, "");
  }

  mark(value) {
    if (this.about?.control) mark(this.about.control, "data-refused", value);
  }

  /** Below the control, or above it where there's no room; over the picture where the control isn't to be seen. */
  put() {
    if (!this.about) return;
    const { control, place } = this.about;
    const seen = control?.isConnected && control.getClientRects().length ? control.getBoundingClientRect() : place;
    const pane = document.getElementById("pane-box").getBoundingClientRect();
    const { offsetWidth: width, offsetHeight: height } = this.element;
    const at = seen?.width ? seen : new DOMRect(pane.left, pane.bottom - height - 64, pane.width, 0);
    const fits = at.bottom + GAP + height <= window.innerHeight - EDGE;
    const x = at.left + at.width / 2 - width / 2;
    const y = fits ? at.bottom + GAP : at.top - GAP - height;
    this.element.style.left = `${Math.round(Math.max(EDGE, Math.min(x, window.innerWidth - width - EDGE)))}px`;
    this.element.style.top = `${Math.round(Math.max(EDGE, y))}px`;
  }
}
