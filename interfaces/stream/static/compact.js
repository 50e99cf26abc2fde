// A reader of compact frames, as docs/protocol.md has them: bytes in, joints out. It opens no socket and reads no
// clock. All integers that are taken are below 2 ** 53, so that plain numbers hold them.

/** Steps a radian. */
const STEPS = 65536;
/** Ticks a second. */
const TICKS = 1e6;
const MOST_FRAMES = 16;
const MOST_JOINTS = 64;
const LONGEST_PERIOD = 1e10;
/** Bounds of x, v and a [steps], and of times [ticks]. */
const BOUNDS = [1e9 * STEPS, 2e9 * STEPS, 4e9 * STEPS];
const LATEST = 1e9 * TICKS;
const LONGEST = 18;
const TIMED = 1;
const STILL = 2;
const PREDICTED = 4;

/** The bytes of `q`: an array as it is, base64 (in JSON) as one. */
function bytesOf(q) {
  return typeof q === "string" ? Uint8Array.from(atob(q), (letter) => letter.charCodeAt(0)) : q;
}

/** The integers that bytes stand for. */
function integersOf(bytes) {
  const found = [];
  let value = 0;
  let factor = 1;
  let digits = 0;
  for (const byte of bytes) {
    for (const digit of [byte >> 4, byte & 15]) {
      value += (digit & 7) * factor;
      digits += 1;
      if (digits > LONGEST) throw new RangeError(`an integer of more than ${LONGEST} digits`);
      if (digit & 8) {
        factor *= 8;
      } else {
        found.push(value);
        [value, factor, digits] = [0, 1, 0];
      }
    }
  }
  if (digits) throw new RangeError("the last integer doesn't end");
  return found;
}

/** Takes `compact` messages, and gives back their frames. */
export class CompactReader {
  constructor() {
    /** Whether a frame is missing: send `follow` again, with the same number; a key frame comes. */
    this.lacking = true;
    /** Number of the newest frame. */
    this.number = 0;
    this.since = 1;
    this.times = null;
    this.state = null;
  }

  /**
   * The new frames of a message, oldest first; none where a frame is missing that they build on.
   * @param {{q: string | Uint8Array, since?: number, falsified?: Array}} message
   * @returns {{number: number, t: number, madeAt: number, q: number[], predicted: boolean, since: number,
   *   through: number}[]} times [s], joints [rad]; frames from `since` to `through` are confirmed unless a message
   *   said that they're false
   * @throws {RangeError} if the bytes aren't what they should be
   */
  receive(message) {
    try {
      return this.read(message);
    } catch (error) {
      this.lacking = true;
      throw error;
    }
  }

  read(message) {
    const integers = integersOf(bytesOf(message.q));
    let at = 0;
    const next = () => {
      if (at >= integers.length) throw new RangeError("compact frames end too early");
      return integers[at++];
    };
    const signed = () => {
      const value = next();
      return value % 2 ? -(value + 1) / 2 : value / 2;
    };
    const [first, form, behind] = [next(), next(), next()];
    const key = form % 2 === 1;
    const last = first + (form - (form % 2)) / 2;
    if (first < 1 || last - first >= MOST_FRAMES || last > Number.MAX_SAFE_INTEGER || behind > last) {
      throw new RangeError(`frames from ${first} to ${last}; 1 to ${MOST_FRAMES} of them, numbered from 1`);
    }
    if (last <= this.number) return [];
    if (!key && (this.lacking || first !== this.number + 1)) {
      this.lacking = true;
      return [];
    }
    let { times, state } = this;
    const found = [];
    for (let number = first; number <= last; number++) {
      const begins = key && number === first;
      const flags = next();
      if (flags > (TIMED | STILL | PREDICTED) || (begins && flags & (TIMED | STILL))) {
        throw new RangeError(`flags ${flags} of a frame`);
      }
      if (begins) {
        const dof = next();
        times = { ticks: signed(), period: next(), ahead: signed() };
        if (dof < 1 || dof > MOST_JOINTS) throw new RangeError(`${dof} joints; 1 to ${MOST_JOINTS}`);
        if (times.period < 1 || times.period > LONGEST_PERIOD) throw new RangeError(`a period of ${times.period}`);
        state = BOUNDS.map(() => Array.from({ length: dof }, signed));
      } else {
        const { ticks, period, ahead } = times;
        times = { ticks: ticks + period + (flags & TIMED ? signed() : 0), period, ahead };
        const a = state[2].map((value) => value + (flags & STILL ? 0 : signed()));
        const v = state[1].map((value, joint) => value + a[joint]);
        state = [state[0].map((value, joint) => value + v[joint]), v, a];
      }
      const { ticks, ahead } = times;
      const far = state.some((row, k) => row.some((value) => Math.abs(value) > BOUNDS[k]));
      if (far || Math.abs(ticks) > LATEST || Math.abs(ticks - ahead) > LATEST) {
        throw new RangeError("joints or times beyond 1e9");
      }
      const q = state[0].map((value) => value / STEPS);
      found.push({ number, t: ticks / TICKS, madeAt: (ticks - ahead) / TICKS, q, predicted: flags >= PREDICTED });
    }
    if (integers.length - at > 1 || (at < integers.length && integers[at] !== 0)) {
      throw new RangeError("something comes after the last frame");
    }
    if (key || message.since) this.since = message.since ?? 1;
    const known = this.number;
    Object.assign(this, { lacking: false, number: last, times, state });
    const verdicts = { since: this.since, through: last - behind };
    return found.filter(({ number }) => number > known).map((frame) => ({ ...frame, ...verdicts }));
  }
}
