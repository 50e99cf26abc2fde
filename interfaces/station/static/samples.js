// What the page hears of the real robot beside what is known of the virtual one: errors, delay, offset.
// Names and definitions are those of docs/summary.md; SI units.
import { BASES } from "./graphs.js";
import { Table } from "./table.js";
import { DEGREES } from "./ui.js";

/** Samples that are kept: ten minutes of them; and messages. */
const KEPT = 13000;
const MESSAGES = 24000;
/** Samples are so far apart at least [s]. */
const APART = 0.046;
/** States that wait until the timeline is past where they are compared. */
const WAITING = 200;
/** Time between two places of the virtual tool [s]; so many are looked up at once. */
export const STEP = 0.05;
const AT_ONCE = 100;
/** Where a tool error is shorter [m], its parts have no direction. */
const NO_DIRECTION = 1e-12;

const PLAIN = ["t", "play", "D", "pace", "age", "round_trip", "delay", "tool_timeline", "tool_user", "tool_servo",
  "angle_timeline", "angle_user", "offset", "link", "servo", "x", "y", "z"];
const A_JOINT = ["real", "reference", "error_timeline", "error_user"];
const UNITS = [
  [/^(t|play|D|behind|age|round_trip|delay|time_difference)$/, "_s"],
  [/^(tool_.*|offset|link|servo|x|y|z|path_error)$/, "_m"],
  [/^(angle|real|reference|error)_/, "_rad"],
];

const numbered = (name, n) => Array.from({ length: n }, (_, k) => `${name}_${k + 1}`);
const placeOf = (X) => [X[12], X[13], X[14]];
const less = (a, b) => a.map((x, k) => x - b[k]);

/** The angle between two poses [rad]; exact near zero. */
function angleBetween(A, B) {
  let squared = 0;
  for (let column = 0; column < 3; column++)
    for (let row = 0; row < 3; row++) squared += (A[row + 4 * column] - B[row + 4 * column]) ** 2;
  return 2 * Math.asin(Math.min(Math.sqrt(squared / 8), 1));
}

/** What each part of an error is along the whole: they add up to its length. */
function alongTotal(parts) {
  const total = parts[0].map((_, k) => parts.reduce((sum, part) => sum + part[k], 0));
  const length = Math.hypot(...total);
  if (length < NO_DIRECTION) return parts.map(() => 0);
  return parts.map((part) => part.reduce((sum, x, k) => sum + x * total[k], 0) / length);
}

/** Mean, rms, largest and 95 % quantile of what is known; NaN where nothing is. */
function spread(values) {
  const known = values.filter((x) => !Number.isNaN(x)).sort();
  const of = (power) => known.reduce((sum, x) => sum + x ** power, 0) / known.length;
  const p95 = known[Math.round(0.95 * (known.length - 1))] ?? NaN;
  return { mean: of(1), rms: Math.sqrt(of(2)), max: Math.max(Math.abs(known[0] ?? NaN), Math.abs(known.at(-1) ?? NaN)), p95 };
}

/** What is heard, of any robot: its samples, and messages to it one by one, as the emulated link tells of them. */
class Heard {
  constructor(station, columns) {
    this.session = station.session;
    this.table = new Table(columns, KEPT);
    /** Messages that arrived: when, and how long they took [s]; when lost ones were sent. */
    this.arrived = new Table(["arrived", "delay"], MESSAGES);
    this.lost = new Table(["sent", "none"], MESSAGES);
    this.clear();
    station.on("welcome", ({ instance }) => {
      if (this.instance !== instance) this.clear();
      this.instance = instance;
    });
    station.on("state", (state) => this.hear(state));
  }

  clear() {
    for (const part of [this.table, this.arrived, this.lost]) part.clear();
    this.told = -Infinity;
    /** How long the newest message took [s]. */
    this.delay = NaN;
    this.instance ??= null;
  }

  /** @param {Array<[number, ?number]>} messages when each was sent and arrived [s]; null for a lost one */
  take(messages) {
    for (const [sent, arrived] of messages) {
      if (arrived === null) {
        if (sent > this.lost.newest) this.lost.push([sent, 0]);
      } else if (arrived > this.told || sent > this.arrived.newest) {
        // Two may arrive at once; one that was told of before doesn't count again.
        this.told = Math.max(this.told, arrived);
        this.delay = arrived - sent;
        this.arrived.push([Math.max(arrived, this.arrived.newest), this.delay]);
      }
    }
  }

  /** Whether a joint is prismatic, from 0. */
  slides() {
    return false;
  }

  /** A column's name with its unit. */
  headed(name) {
    const joint = /^(?:real|reference|error_[a-z]+)_(\d+)$/.exec(name);
    if (joint && this.slides(joint[1] - 1)) return name + "_m";
    return name + (UNITS.find(([pattern]) => pattern.test(name))?.[1] ?? "");
  }

  /** The spread of a column between two times [s]. */
  spread(from, until, column, table = this.table, factor = 1) {
    return spread(table.column(column).slice(...table.between(from, until)).map((x) => factor * x));
  }

  /** What is known of a window of messages, as a summary has it. */
  delays(from, until) {
    const delay = this.spread(from, until, "delay", this.arrived);
    const [first, last] = this.lost.between(from, until);
    return { lost: last - first, delay_mean_s: delay.mean, delay_p95_s: delay.p95, delay_max_s: delay.max };
  }
}

/** An arm's. */
export class Samples extends Heard {
  constructor(station) {
    const joints = station.chain.screws.length;
    super(station, [...PLAIN, ...A_JOINT.flatMap((name) => numbered(name, joints))]);
    this.chain = station.chain;
    this.joints = joints;
  }

  clear() {
    super.clear();
    /** Where the virtual tool was. */
    this.path ??= new Table(["t", "x", "y", "z"], Math.ceil((KEPT * APART) / STEP));
    this.path.clear();
    this.waiting = [];
    this.heard = -Infinity;
    /** Epoch in which the robot stopped by itself last. */
    this.stopped = undefined;
    /** What the comparison of the paths found, and when the real tool came how late. */
    this.compared = this.paths = null;
  }

  slides(joint) {
    return this.chain.slides(joint);
  }

  /** Take a state; it counts once what it is compared with can't change any more. */
  hear(state) {
    this.take(state.messages);
    if (state.t >= this.heard + APART) {
      this.heard = state.t;
      this.waiting.push({ state, age: (this.session.now ?? NaN) - state.t, delay: this.delay });
      if (this.waiting.length > WAITING) this.waiting.shift();
    }
    this.advance();
  }

  advance() {
    const { timeline, past } = this.session;
    if (!timeline) return;
    while (this.waiting.length && Math.max(this.waiting[0].state.t, this.waiting[0].state.play) <= past)
      this.settle(this.waiting.shift(), timeline);
    this.follow(timeline, past);
  }

  settle({ state, age, delay }, timeline) {
    const { t, play, q, reference } = state;
    const [matched, shown] = [timeline.joints(play), timeline.joints(t)];
    const last = (joints) => this.chain.links(joints).at(-1);
    const [real, then, now] = [q, matched, shown].map(last);
    const [place, ...places] = [real, then, now].map(placeOf);
    const asked = reference ? placeOf(last(reference)) : place;
    const steps = [places[1], places[0], asked, place];
    const parts = alongTotal([1, 2, 3].map((k) => less(steps[k], steps[k - 1])));
    if (!reference) parts.fill(NaN, 1);
    const distance = (from) => Math.hypot(...less(place, from));
    // A robot that has stopped by itself plays nothing until it follows a new epoch: it isn't behind.
    if (state.halted) this.stopped = state.epoch;
    const D = state.halted || state.epoch === this.stopped ? NaN : state.D;
    this.table.push([
      t, play, D, state.pace, age, state.round_trip ?? NaN, delay,
      ...places.map(distance), reference ? distance(asked) : NaN, angleBetween(real, then), angleBetween(real, now),
      ...parts, ...place, ...q, ...(reference ?? q.map(() => NaN)), ...less(q, matched), ...less(q, shown),
    ]);
  }

  /** Go on with the virtual tool's path. */
  follow(timeline, past) {
    if (!this.table.length) return;
    let next = this.path.length ? this.path.newest + STEP : Math.max(timeline.start, this.table.get("t", 0) - 10);
    for (let k = 0; k < AT_ONCE && next <= past; k++, next += STEP)
      this.path.push([next, ...placeOf(this.chain.links(timeline.joints(next)).at(-1))]);
  }

  /** The window's figures, as a summary has them. */
  summary(from, until) {
    const of = (column) => this.spread(from, until, column);
    const errors = (basis) => {
      const [tool, angle] = [of(`tool_${basis}`), of(`angle_${basis}`)];
      const joints = numbered(`error_${basis}`, this.joints).map(of);
      const found = { tool_rms_m: tool.rms, tool_max_m: tool.max, angle_rms_deg: DEGREES * angle.rms, angle_max_deg: DEGREES * angle.max };
      for (const kind of ["rms", "max"]) {
        found[`joint_${kind}_m`] = joints.map((joint) => joint[kind]);
        found[`joint_${kind}_deg`] = joints.map((joint) => DEGREES * joint[kind]);
      }
      return found;
    };
    const behind = this.spread(from, until, "D", this.table, -1);
    return {
      errors: { ...Object.fromEntries(BASES.map((basis) => [`${basis}_time`, errors(basis)])), servo: { tool_rms_m: of("tool_servo").rms } },
      behind: { mean_s: behind.mean, p95_s: behind.p95, max_s: behind.max },
      messages: this.delays(from, until),
      round_trip_s: of("round_trip").mean,
      path: this.compared ?? {},
    };
  }
}

/** A mobile robot's. */
export class DriveSamples extends Heard {
  constructor(station) {
    super(station, ["t", "path_error", "time_difference", "behind", "delay", "round_trip", "age"]);
  }

  hear(state) {
    this.take(state.messages);
    const { now } = this.session;
    if (state.t == null || now === null || state.now <= this.table.newest) return;
    const behind = state.halted || state.D == null ? NaN : -state.D;
    this.table.push([state.now, state.path_error ?? NaN, state.time_difference ?? NaN, behind, this.delay, state.round_trip ?? NaN,
      Math.max(0, now - state.t)]);
  }

  advance() {}

  summary(from, until) {
    const [error, difference] = ["path_error", "time_difference"].map((name) => this.spread(from, until, name));
    return {
      path_error_mean: error.mean, path_error_p95: error.p95, path_error_max: error.max,
      time_difference_mean: difference.mean, time_difference_max: difference.max,
      longest_delay: this.delays(from, until).delay_max_s,
      round_trip_s: this.spread(from, until, "round_trip").mean,
    };
  }
}
