// Steering: as long as a hand holds something, its input is sent; when it lets go, the robot comes to rest.
import { effect, untracked } from "./ui.js";

/** Time between two inputs [ms]; each holds for 0.2 s at the engine. */
const PERIOD = 40;
/** By how much stamps lie behind this page's idea of the session's time, so that none comes before its time [s]. */
const BEHIND = 0.004;
const BLIND = "You look at another time: press Live to steer.";

/** What the strip calls steering, by what is held; of the rest by what is asked for. */
const BY = { drag: "tool dragged", stick: "tool by stick", pad: "tool by gamepad" };

const AXES = ["tool x", "tool y", "tool z", "turn x", "turn y", "turn z"];

/** What an input moves, in a word or two. */
function steered({ rates, twist }) {
  const asked = rates ?? twist ?? [];
  const k = asked.findIndex((speed) => speed !== 0);
  return k < 0 ? "" : `${rates ? `J${k + 1}` : AXES[k]} ${asked[k] < 0 ? "−" : "+"}`;
}

export class Steer {
  constructor(station) {
    this.station = station;
    this.session = station.session;
    /** What is held, by who holds it; the newest one counts. */
    this.inputs = new Map();
    this.timer = null;
    /** The newest input. */
    this.last = null;
    for (const type of ["blur", "pagehide"]) window.addEventListener(type, () => this.releaseAll());
    document.addEventListener("visibilitychange", () => document.hidden && this.releaseAll());
    station.addEventListener("stopping", () => this.releaseAll({ silently: true }));
    station.on("lease", () => this.session.holds || this.releaseAll());
    station.on("link", (link) => link === "live" || this.releaseAll());
    effect(() => this.blind && untracked(() => this.releaseAll()));
  }

  /** Whether the picture shows another time than now: nobody steers by that. */
  get blind() {
    return this.station.cursor !== null;
  }

  /** Why nobody can steer now; "" where somebody can. */
  get idle() {
    return this.station.idle || (this.blind ? BLIND : "");
  }

  /**
   * Hold an input until it's released.
   * @param {string} who "jog", "keys", "stick", "pad", "drag": an older one of the same is replaced
   * @param {() => ?object} input {rates} or {twist, frame}, or {type: "drive", v, w, duration} of a mobile robot; asked
   * for each time, null is as good as released
   * @param {() => void} released called when it ends for another reason than `release`
   */
  hold(who, input, released = () => {}) {
    const session = this.session;
    if (!session.holds || session.link !== "live") {
      session.order({ type: "steer" });
      released();
      return false;
    }
    if (this.blind) {
      this.station.refuse(BLIND);
      released();
      return false;
    }
    this.inputs.delete(who);
    this.inputs.set(who, { input, released });
    if (this.timer === null) {
      this.timer = setInterval(() => this.send(), PERIOD);
      this.send();
    }
    return true;
  }

  release(who, { silently = false } = {}) {
    if (!this.inputs.delete(who) || this.inputs.size) return;
    clearInterval(this.timer);
    this.timer = null;
    if (!silently && this.last) this.give(stillAs(this.last), this.label);
  }

  releaseAll(how) {
    for (const [who, { released }] of [...this.inputs]) {
      this.release(who, how);
      released();
    }
  }

  send() {
    const [who, { input, released }] = [...this.inputs].at(-1);
    const wanted = input();
    if (wanted !== null) this.give((this.last = wanted), BY[who] ?? steered(wanted));
    else {
      this.release(who);
      released();
    }
  }

  give(wanted, label) {
    this.label = label;
    const session = this.session;
    if (!session.holds || session.link !== "live" || session.orders.congested) return;
    const behind = Math.min(session.sync.uncertainty(performance.now() / 1000), 0.05) + BEHIND;
    session.order({ type: "steer", ...wanted, issued_at: session.now - behind }, label);
  }
}

/** An input of the same kind, that asks for rest. */
function stillAs({ rates, twist, frame, ...other }) {
  if (other.type === "drive") return { ...other, v: 0, w: 0 };
  return rates ? { rates: rates.map(() => 0) } : { twist: twist.map(() => 0), frame };
}
