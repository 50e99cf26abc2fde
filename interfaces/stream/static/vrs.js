// A reader of the stream of segments: the timeline's copy, its evaluation at any time, and the session's clock.
// It speaks the JSON form of docs/protocol.md, opens no socket and reads no clock: whoever uses it does both.
import { decode } from "./protocol.js";

export { decode };

/** Requests of history are answered by so many segments; then the next are to be asked for. */
const PORTION = 256;
/** Edits that came before the one that they build on, at most. */
const HELD = 64;
/** Commands whose names are kept. */
const NAMED = 2000;
/** Times that differ by less are the same [s]. */
const SAME = 1e-9;

/**
 * Joints of a segment, or a time derivative of them, by Horner's rule: the same operations in the same order as
 * `PolynomialSegment.value`, and so the same bits.
 * @param {{coefficients: number[][]}} segment rows by ascending power of u, [rad / s^power]
 * @param {number} u time since the segment's start [s]
 * @param {number} derivative 0 to 3
 * @returns {number[]} [rad / s^derivative]
 */
export function evaluate(segment, u, derivative = 0) {
  const rows = segment.coefficients;
  const value = new Array(rows[0].length).fill(0);
  for (let power = rows.length - 1; power >= derivative; power--) {
    let factor = 1;
    for (let i = 0; i < derivative; i++) factor *= power - i;
    const row = rows[power];
    for (let j = 0; j < value.length; j++) {
      value[j] = value[j] * u + (derivative ? row[j] * factor : row[j]);
    }
  }
  return value;
}

/** The segments of a `history`, a `change` or a plan, with the start of each [s]. */
export function segmentsOf(message) {
  let start = message.start;
  return message.segments.map(([duration, commandId, coefficients, own]) => {
    const segment = { start: own ?? start, duration, commandId, coefficients };
    start = segment.start + duration;
    return segment;
  });
}

/** A timeline as a value: an edit makes another one. */
export class Timeline {
  /**
   * @param {number[]} initial joints before the start [rad]
   * @param {number} start origin [s]
   * @param {{start: number, duration: number, commandId: ?number, coefficients: number[][]}[]} segments
   */
  constructor(initial, start, segments) {
    this.initial = initial;
    this.start = start;
    this.segments = segments;
  }

  /** End of what is planned [s]. */
  get end() {
    const last = this.segments.at(-1);
    return last ? last.start + last.duration : this.start;
  }

  /** Start of a segment [s]; of one after the last, the end. */
  startOf(index) {
    return index < this.segments.length ? this.segments[index].start : this.end;
  }

  /** Index of the segment that holds at t [s]; -1 before the first, at a knot the later one. */
  indexAt(t) {
    let low = 0;
    let high = this.segments.length;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (this.segments[middle].start <= t) low = middle + 1;
      else high = middle;
    }
    return low - 1;
  }

  /** g(t): joints at t [s], [rad / s^derivative]. Before the start and after the end the arm stands. */
  joints(t, derivative = 0) {
    const index = this.indexAt(t);
    if (index < 0) return derivative ? this.initial.map(() => 0) : [...this.initial];
    const segment = this.segments[index];
    if (index === this.segments.length - 1 && t >= this.end) {
      const final = evaluate(segment, segment.duration);
      return derivative ? final.map(() => 0) : final;
    }
    return evaluate(segment, t - segment.start, derivative);
  }

  /** The timeline that a `change` makes of this one; null if it doesn't fit. */
  changed(change) {
    const { first, tail, end } = change;
    if (first > this.segments.length || (tail !== null && tail > this.segments.length)) return null;
    const segments = this.segments.slice(0, first).concat(segmentsOf(change));
    if (tail !== null) {
      const from = this.startOf(tail);
      const to = change.tail_start;
      for (const segment of this.segments.slice(tail)) {
        segments.push({ ...segment, start: to + (segment.start - from) });
      }
    }
    const timeline = new Timeline(this.initial, this.start, segments);
    return Math.abs(timeline.end - end) <= SAME * Math.max(1, Math.abs(end)) ? timeline : null;
  }
}

/** Keeps a copy of the timeline: fetches what there is, follows the edits, and asks again for what is lost. */
export class Reader {
  /**
   * @param {(message: object) => void} send takes what is to be sent
   * @param {{number?: number, resend?: number}} options number of the first `follow`; seconds until something
   *   is asked for again
   */
  constructor(send, { number = 1, resend = 1 } = {}) {
    this.send = send;
    this.resend = resend;
    this.number = number;
    /** The copy; null until all of it has come. */
    this.timeline = null;
    /** Number of the newest edit in it. */
    this.edit = 0;
    /** Up to this time [s] the copy is what happened. */
    this.past = -Infinity;
    /** What commands are called, by their ids: {t, kind, label, speed, motion, profile}, each from its time on. */
    this.names = new Map();
    /** What it began with. */
    this.scene = null;
    this.fetching = null;
    this.asked = 0;
    this.held = new Map();
    this.behind = false;
    this.due = Infinity;
  }

  /** Begin, or begin again, by any clock that doesn't run back [s]. */
  follow(now) {
    this.scene = this.timeline = this.fetching = null;
    this.behind = false;
    this.ask(now);
  }

  /** Take a message, as text or as `decode` gives it; those of other kinds are passed over. */
  receive(data, now) {
    const message = typeof data === "string" ? decode(data) : data;
    if (message === null) return null;
    if (message.type === "scene") this.begin(message, now);
    else if (message.type === "history") this.add(message, now);
    else if (message.type === "change") this.hold(message, now);
    else if (message.type === "pulse" && this.timeline) this.beat(message, now);
    return message;
  }

  /** Ask again for what hasn't come. */
  advance(now) {
    const waits = !this.timeline || this.fetching || this.behind;
    if (waits && now >= this.due) this.ask(now);
  }

  /** g(t) [rad / s^derivative]; null until the copy is whole. */
  joints(t, derivative = 0) {
    return this.timeline ? this.timeline.joints(t, derivative) : null;
  }

  begin(scene, now) {
    const known = this.timeline ? this.edit : this.scene?.edit;
    if (scene.number !== this.number || (this.scene && scene.edit <= known)) return;
    this.scene = scene;
    this.names.clear();
    scene.names.forEach((name) => this.call(name));
    this.fetching = this.timeline ? this.timeline.segments.slice(0, this.passed()) : [];
    if (this.fetching.length < scene.segments) this.ask(now);
    else this.complete(now);
  }

  call(name) {
    const known = this.names.get(name.command_id);
    if (known?.at(-1).t < name.t) known.push(name);
    else if (!known) this.names.set(name.command_id, [name]);
    if (this.names.size > NAMED) this.names.delete(this.names.keys().next().value);
  }

  /** What a command is called at a time [s]; null where nobody said. */
  nameOf(id, t) {
    const names = this.names.get(id);
    return names ? (names.findLast((name) => name.t <= t + SAME) ?? names[0]) : null;
  }

  /** How many segments have passed: those never change. */
  passed() {
    const index = this.timeline.indexAt(this.past);
    const last = this.timeline.segments[index];
    return last && last.start + last.duration <= this.past ? index + 1 : Math.max(index, 0);
  }

  add(part, now) {
    const fetching = this.fetching;
    if (!fetching || part.edit !== this.scene.edit || part.index !== fetching.length) return;
    for (const segment of segmentsOf(part)) fetching.push(segment);
    this.due = now + this.resend;
    if (fetching.length >= this.scene.segments) this.complete(now);
    else if (fetching.length - this.asked >= PORTION) this.ask(now);
  }

  complete(now) {
    const { initial, start, edit } = this.scene;
    this.timeline = new Timeline(initial, start, this.fetching);
    this.fetching = null;
    this.advanceTo(this.timeline, edit);
    this.ask(now);
    this.apply(now);
  }

  hold(change, now) {
    if (this.timeline && change.edit <= this.edit) return;
    this.held.set(change.base, change);
    if (this.held.size > HELD) this.held.delete(Math.min(...this.held.keys()));
    this.apply(now);
    if (this.timeline && this.held.size) this.lack(now);
  }

  apply(now) {
    while (this.timeline && this.held.has(this.edit)) {
      const change = this.held.get(this.edit);
      this.held.delete(this.edit);
      if (change.name) this.call(change.name);
      const timeline = this.timeline.changed(change);
      if (!timeline) {
        this.number += 1;
        this.follow(now);
        return;
      }
      this.advanceTo(timeline, change.edit);
    }
  }

  advanceTo(timeline, edit) {
    this.timeline = timeline;
    this.edit = edit;
    this.behind = false;
    for (const base of this.held.keys()) if (base < edit) this.held.delete(base);
  }

  beat(pulse, now) {
    if (pulse.edit > this.edit) {
      this.lack(now);
      return;
    }
    if (pulse.past !== null) this.past = Math.max(this.past, pulse.past);
  }

  lack(now) {
    if (this.behind || !this.timeline) return;
    this.behind = true;
    this.ask(now);
  }

  ask(now) {
    this.due = now + this.resend;
    if (!this.scene) {
      this.send({ type: "follow", number: this.number, form: "segments" });
    } else if (this.fetching) {
      this.asked = this.fetching.length;
      this.send({ type: "want", edit: this.scene.edit, index: this.asked });
    } else {
      this.send({ type: "want", edit: this.edit });
    }
  }
}

/**
 * Follows the other side's clock by `ping` and `pong`: bounds on the offset from every round trip, intersected;
 * a map of local time that never runs back, slewed towards the middle. See docs/clocks.md.
 */
export class ClockSync {
  /**
   * @param {{maxDrift?: number, resolution?: number, slew?: number}} options largest difference of the clocks'
   *   rates, as a share; rounding of the other side's stamps [s]; largest rate at which the map is corrected
   */
  constructor({ maxDrift = 200e-6, resolution = 1e-6, slew = 0.05 } = {}) {
    this.maxDrift = maxDrift;
    this.resolution = resolution;
    this.slew = slew;
    this.bounds = null;
    this.map = null;
    this.settled = -Infinity;
  }

  /**
   * Take a round trip into account.
   * @param {number} sent when the ping left, local [s]
   * @param {number} received when it arrived, by the other clock [s]
   * @param {number} answered when the pong left, by the other clock [s]
   * @param {number} arrived when that arrived, local [s]
   */
  receive(sent, received, answered, arrived) {
    const echo = {
      upper: [sent, received - sent + this.resolution],
      lower: [arrived, answered - arrived - this.resolution],
    };
    const [low, high] = this.at(echo, arrived);
    if (!(low <= high) || !(received <= answered) || !(sent <= arrived)) return;
    const [least, most] = this.bounds ? this.at(this.bounds, arrived) : [-Infinity, Infinity];
    if (low > most || high < least) {
      // A probe sent before the last evidence came may be the older one.
      if (sent < this.settled) return;
      this.bounds = echo;
    } else {
      this.bounds = {
        upper: high < most ? echo.upper : this.bounds.upper,
        lower: low > least ? echo.lower : this.bounds.lower,
      };
    }
    this.settled = arrived;
    this.steer(arrived, this.estimate(arrived).offset);
  }

  /** The other clock's reading less the local one's [s], and the bound on its error; null before the first. */
  estimate(now) {
    if (!this.bounds) return null;
    const [low, high] = this.at(this.bounds, now);
    return { offset: (low + high) / 2, uncertainty: (high - low) / 2 };
  }

  /** Bound on the error of `time(now)` [s], what is still to be slewed included. */
  uncertainty(now) {
    if (!this.bounds) return Infinity;
    const [low, high] = this.at(this.bounds, now);
    const offset = this.time(now) - now;
    return Math.max(high - offset, offset - low);
  }

  /** The other clock's time at a local time [s], not before the last arrival; null before the first round trip. */
  time(now) {
    if (!this.map) return null;
    const { local, remote, rate, until } = this.map;
    const slewed = Math.min(now, until) - local;
    return remote + slewed * rate + Math.max(now - until, 0);
  }

  at({ upper, lower }, t) {
    return [lower[1] - this.maxDrift * (t - lower[0]), upper[1] + this.maxDrift * (t - upper[0])];
  }

  steer(now, offset) {
    const here = this.map ? this.time(now) : now + offset;
    const gap = now + offset - here;
    const rate = 1 + Math.sign(gap) * this.slew;
    this.map = { local: now, remote: here, rate, until: now + Math.abs(gap) / this.slew };
  }
}
