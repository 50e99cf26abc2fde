// What the page hears of the real robot beside what the timeline says of the virtual one: errors, delay, offset.
// Names and definitions are those of docs/summary.md; SI units.
import { Messages } from "./messages.js";
import { Table } from "./table.js";

/** Samples that are kept: ten minutes of them. */
const KEPT = 13000;
/** Samples are so far apart at least [s]. */
const APART = 0.046;
/** States that wait until the timeline is past where they are compared. */
const WAITING = 200;
/** Time between two places of the virtual tool [s]; so many are looked up at once. */
export const STEP = 0.05;
const AT_ONCE = 100;
/** Where a tool error is shorter [m], its parts have no direction. */
const NO_DIRECTION = 1e-12;

/** The two ways of comparing: with the virtual robot at the real one's play time, or at the same moment. */
export const BASES = ["timeline", "user"];

const PLAIN = [
  "t",
  "play",
  "D",
  "pace",
  "age",
  "round_trip",
  "delay",
  "tool_timeline",
  "tool_user",
  "tool_servo",
  "angle_timeline",
  "angle_user",
  "offset",
  "link",
  "servo",
  "x",
  "y",
  "z",
];
const A_JOINT = ["real", "reference", "error_timeline", "error_user"];

const numbered = (name, n) => Array.from({ length: n }, (_, k) => `${name}_${k + 1}`);

function placeOf(X) {
  return [X[12], X[13], X[14]];
}

function less(a, b) {
  return a.map((x, k) => x - b[k]);
}

/** The angle between two poses [rad]; exact near zero. */
export function angleBetween(A, B) {
  let squared = 0;
  for (let column = 0; column < 3; column++)
    for (let row = 0; row < 3; row++) squared += (A[row + 4 * column] - B[row + 4 * column]) ** 2;
  return 2 * Math.asin(Math.min(Math.sqrt(squared / 8), 1));
}

/** What each part of an error is along the whole: they add up to its length. */
export function alongTotal(parts) {
  const total = parts[0].map((_, k) => parts.reduce((sum, part) => sum + part[k], 0));
  const length = Math.hypot(...total);
  if (length < NO_DIRECTION) return parts.map(() => 0);
  return parts.map((part) => part.reduce((sum, x, k) => sum + x * total[k], 0) / length);
}

export class Samples {
  constructor(station) {
    this.session = station.session;
    this.chain = station.chain;
    this.joints = station.chain.screws.length;
    this.table = new Table([...PLAIN, ...A_JOINT.flatMap((name) => numbered(name, this.joints))], KEPT);
    this.messages = new Messages();
    /** Where the virtual tool was. */
    this.path = new Table(["t", "x", "y", "z"], Math.ceil((KEPT * APART) / STEP));
    this.clear();
    station.on("welcome", ({ instance }) => {
      if (this.instance !== instance) this.clear();
      this.instance = instance;
    });
    station.on("state", (state) => this.hear(state));
  }

  /** Messages to the robot that arrived, and lost ones; see `Messages`. */
  get arrived() {
    return this.messages.arrived;
  }

  get lost() {
    return this.messages.lost;
  }

  clear() {
    for (const part of [this.table, this.messages, this.path]) part.clear();
    this.waiting = [];
    this.heard = -Infinity;
    /** Epoch in which the robot stopped by itself last. */
    this.stopped = undefined;
    this.instance ??= null;
  }

  /** Take a state; it counts once what it is compared with can't change any more. */
  hear(state) {
    this.messages.hear(state.messages);
    if (state.t >= this.heard + APART) {
      this.heard = state.t;
      this.waiting.push({ state, age: (this.session.now ?? NaN) - state.t, delay: this.messages.delay });
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
    const { chain } = this;
    const { t, play, q, reference } = state;
    const [matched, shown] = [timeline.joints(play), timeline.joints(t)];
    const last = (joints) => chain.links(joints).at(-1);
    const [real, then, now] = [q, matched, shown].map(last);
    const error = (X) => [Math.hypot(...less(placeOf(real), placeOf(X))), angleBetween(real, X)];
    const [[toolThen, angleThen], [toolNow, angleNow]] = [error(then), error(now)];
    const asked = reference ? placeOf(last(reference)) : placeOf(real);
    const steps = [placeOf(now), placeOf(then), asked, placeOf(real)];
    const parts = alongTotal([1, 2, 3].map((k) => less(steps[k], steps[k - 1])));
    if (!reference) parts.fill(NaN, 1);
    const toolServo = reference ? Math.hypot(...less(placeOf(real), asked)) : NaN;
    // A robot that has stopped by itself plays nothing until it follows a new epoch: it isn't behind.
    if (state.halted) this.stopped = state.epoch;
    const D = state.halted || state.epoch === this.stopped ? NaN : state.D;
    this.table.push([
      t,
      play,
      D,
      state.pace,
      age,
      state.round_trip ?? NaN,
      delay,
      toolThen,
      toolNow,
      toolServo,
      angleThen,
      angleNow,
      ...parts,
      ...placeOf(real),
      ...q,
      ...(reference ?? q.map(() => NaN)),
      ...less(q, matched),
      ...less(q, shown),
    ]);
  }

  /** Go on with the virtual tool's path. */
  follow(timeline, past) {
    if (!this.table.length) return;
    let next = this.path.length ? this.path.newest + STEP : Math.max(timeline.start, this.table.get("t", 0) - 10);
    for (let k = 0; k < AT_ONCE && next <= past; k++, next += STEP)
      this.path.push([next, ...placeOf(this.chain.links(timeline.joints(next)).at(-1))]);
  }
}
