// What jogging asks for: by how much and how fast, joint by joint or along and about the tool's axes, held or in steps.
import { anglesOf, exponential, multiply, turned } from "./chain.js";
import { Speed } from "./handling.js";
import { computed, figure, observed } from "./ui.js";

const SPEED = "vrs-speed";
/** What one may ask for of x, y, z [mm] and of the angles O, A, T [deg], either way. */
const [FARTHEST, FULL_TURN] = [100000, 360];
const LONGEST_NAME = 24;
const INSERTIONS = { now: "replace", append: "append" };
/** Names of a pose's numbers: where the tool's point is in the base frame, and how it's turned. */
export const POSE = ["x", "y", "z", "O", "A", "T"];

export class Jogging {
  constructor(station) {
    this.station = station;
    this.session = station.session;
    this.speed = new Speed(SPEED, "30");
    /** The last step: its order, and where it leads. */
    this.last = null;
    observed(this, {
      /** Frame of the tool's axes: "base" or "tool". */
      frame: "base",
      /** A press is a step of so many degrees or millimetres; 0: it goes on for as long as it's held. */
      step: 0,
      /** When a move begins: "now", "append" (after the plan) or "later", in so many seconds. */
      begin: "now",
      later: 5,
      /** Joints that are shown; null before anything is known. */
      q: null,
      /** What was typed and isn't done yet, by the name of its field, and the one that can't be taken. */
      typed: {},
      wrong: "",
      /** Saved poses, which the server keeps: joints by name. */
      saved: {},
    });
    const shown = (kind) => computed(() => this.q && this.values(kind, this.q));
    /** Values of the fields at the joints that are shown, see `fields`. */
    this.shown = { joints: shown("joints"), pose: shown("pose") };
    station.on("welcome", () => this.poses());
  }

  get share() {
    return this.speed.share;
  }

  /** Units of a joint for people: how many of them a radian or a metre is, and their sign. */
  unit(k) {
    return this.station.chain.slides(k) ? { scale: 1000, sign: "mm" } : { scale: 180 / Math.PI, sign: "°" };
  }

  /** A twist of a share of the full speed along, or about, an axis of the tool's frame. */
  twist(parts) {
    const { tool_speed: along, tool_turn_speed: about } = this.station.config.robot;
    return { twist: parts.map((part, k) => part * this.share * (k < 3 ? along : about)), frame: this.frame };
  }

  /**
   * What a button or a key asks for while it's held.
   * @param {[string, number, number]} what "joint" or "tool", which joint or axis, and the sign
   */
  held([kind, which, sign]) {
    if (kind === "tool") return this.twist(POSE.map((_, k) => (k === which ? sign : 0)));
    return { rates: this.session.welcome.limits.qd_max.map((rate, k) => (k === which ? sign * this.share * rate : 0)) };
  }

  /** Do a step; false where steps aren't chosen. */
  once(what) {
    if (this.step === 0) return false;
    if (this.station.steer.blind) this.station.refuse(this.station.steer.idle);
    else if (what[0] === "joint") this.stepJoint(what);
    else this.stepTool(what);
    return true;
  }

  /** A step as it's written. */
  stepped(sign, unit) {
    return `${sign < 0 ? "−" : "+"}${this.step}${unit === "°" ? "" : "\u00a0"}${unit}`;
  }

  stepJoint([, which, sign]) {
    const q = this.from().q.map((x, k) => x + (k === which ? (sign * this.step) / this.unit(k).scale : 0));
    const target = { type: "joints", q };
    this.last = { q, entry: this.order({ target }, `J${which + 1} ${this.stepped(sign, this.unit(which).sign)}`) };
  }

  stepTool([, which, sign]) {
    const { chain } = this.station;
    const { X } = this.from();
    const along = which < 3;
    const column = which % 3;
    const axis = this.frame === "tool" ? X.slice(4 * column, 4 * column + 3) : [0, 1, 2].map((row) => (row === column ? 1 : 0));
    const amount = (sign * this.step) / (along ? 1000 : 180 / Math.PI);
    const place = chain.toolOf(X).map((x, k) => (along ? x + amount * axis[k] : x));
    const turn = along ? X : multiply(exponential([...axis, 0, 0, 0], amount), [...X.slice(0, 12), 0, 0, 0, 1]);
    const next = chain.linkAt(place, turn);
    const label = `tool ${along ? "" : "about "}${POSE[column]} ${this.stepped(sign, along ? "mm" : "°")}`;
    this.last = { X: next, entry: this.order(this.posed(next, "line"), label) };
  }

  /** Where the next step begins: where the last one leads as long as that's on its way, else where the robot is. */
  from() {
    const { now, timeline } = this.session;
    const { chain } = this.station;
    const { entry, q, X } = this.last ?? {};
    const receipt = entry?.outcome?.receipt;
    const stands = receipt?.end > now && receipt.superseded_by == null && !receipt.undone;
    const goes = entry && !entry.forgotten && (entry.outcome === null || stands);
    const reached = (goes && (q ?? receipt?.q)) || timeline.joints(now);
    return { q: reached, X: (goes && X) || chain.links(reached).at(-1) };
  }

  /** What of a move leads the last link to a pose. */
  posed(X, motion) {
    const rows = (columns) => [0, 1, 2, 3].map((row) => [0, 1, 2, 3].map((column) => columns[row + 4 * column]));
    const [a, b, c] = this.station.chain.tool;
    return { target: { type: "pose", X: rows(X) }, motion, tool: [[1, 0, 0, a], [0, 1, 0, b], [0, 0, 1, c], [0, 0, 0, 1]] };
  }

  order(parts, label) {
    return this.session.order({ type: "move", speed: this.share, ...parts }, label);
  }

  /** Move when it's to begin. */
  go(parts, label) {
    const { begin, session } = this;
    const when = begin === "later" ? { execute_at: session.now + this.delay } : { insertion: INSERTIONS[begin] };
    return this.order({ ...parts, ...when }, label);
  }

  get delay() {
    return Math.max(0.5, Number(this.later) || 0.5);
  }

  /** Joints where such a move begins. */
  get start() {
    const { now, timeline } = this.session;
    return timeline.joints(this.begin === "append" ? timeline.end : this.begin === "later" ? now + this.delay : now);
  }

  /** Fields of the joints, or of the tool's pose: name, what the robot calls it, unit, lowest and highest value. */
  fields(kind) {
    if (kind === "pose") {
      return POSE.map((name, k) => ({ name, ...(k < 3 ? { sign: "mm", high: FARTHEST } : { sign: "°", high: FULL_TURN }) }))
        .map((field) => ({ ...field, low: -field.high }));
    }
    const { q_min: low, q_max: high } = this.session.welcome.limits;
    const { joints } = this.station.config.robot;
    return low.map((_, k) => {
      const { scale, sign } = this.unit(k);
      return { name: `J${k + 1}`, called: joints[k] ?? "", sign, low: low[k] * scale, high: high[k] * scale };
    });
  }

  /** Values of such fields at joints. */
  values(kind, q) {
    if (kind === "joints") return q.map((x, k) => x * this.unit(k).scale);
    const X = this.station.chain.links(q).at(-1);
    return [...this.station.chain.toolOf(X).map((x) => 1000 * x), ...anglesOf(X)];
  }

  /** What is typed in such fields, the others as they'd be at the move's start; null where a field says what it takes. */
  read(kind) {
    const values = this.values(kind, this.start);
    for (const [k, { name, sign, low, high }] of this.fields(kind).entries()) {
      const text = this.typed[name];
      if (text === undefined) continue;
      const value = text.trim() === "" ? NaN : Number(text.trim().replace("−", "-").replace(",", "."));
      // What is shown has one decimal place: a limit may be typed as it's shown.
      if (!(value >= low - 0.05 && value <= high + 0.05)) {
        this.wrong = name;
        const [from, to] = [low, high].map((x) => figure(x, kind === "pose" ? 0 : 1));
        this.station.notices.use(document.getElementById(`jog-${name}`));
        this.station.refuse(`${name} takes a number from ${from} to ${to} ${sign}`);
        return null;
      }
      values[k] = Math.max(low, Math.min(high, value));
    }
    return values;
  }

  /** Go to what is typed; the order, null where none was given. */
  goTyped(kind, motion = "joint") {
    this.wrong = "";
    const values = this.read(kind);
    if (values === null) return null;
    const q = values.map((x, k) => x / this.unit(k).scale);
    if (kind === "joints") return this.go({ target: { type: "joints", q } }, "joints");
    const X = this.station.chain.linkAt(values.slice(0, 3).map((x) => x / 1000), turned(values.slice(3)));
    return this.go(this.posed(X, motion), "a pose");
  }

  /** Write into a field; undefined takes back what was written. */
  type(name, text) {
    this.typed = { ...this.typed, [name]: text };
    if (this.wrong === name) this.wrong = "";
  }

  /** What was typed in such fields is done. */
  settle(kind) {
    const names = new Set(this.fields(kind).map(({ name }) => name));
    this.typed = Object.fromEntries(Object.entries(this.typed).filter(([name]) => !names.has(name)));
  }

  /** Save the joints that are shown under a name; why not, "" where it's done. */
  async save(name) {
    const taken = name in this.session.welcome.poses || name in this.saved;
    if (!name || name.length > LONGEST_NAME) return `a pose's name has 1 to ${LONGEST_NAME} characters`;
    if (taken) return `there's a pose ${name}: delete it first, or take another name`;
    return this.poses({ name, q: this.q });
  }

  /** Ask the server for the saved poses, perhaps after a change: {name, q}, or {name} to delete one; why not, "" where it's done. */
  async poses(change) {
    // A relay keeps none: poses are for who commands.
    if (this.session.relays) return "";
    const given = change && { method: "POST", body: JSON.stringify(change) };
    const { poses, problem = "" } = await this.session.ask("/poses", given);
    if (poses && JSON.stringify(poses) !== JSON.stringify(this.saved)) this.saved = poses;
    return problem;
  }
}
