// Which part of the time the strip shows.

/** Seconds that fit, as one may choose. */
const SPANS = [5, 10, 20, 30, 60, 120, 300, 600];
/** Where now stands while the strip goes with the time, as a share of the width. */
const NOW = 0.4;
/** What plays is kept left of this share of the width. */
const RIGHTMOST = 0.85;
/** The drawn part reaches so many widths to either side. */
const BESIDE = 1;

export class View {
  constructor() {
    this.choice = 3;
    this.width = 1;
    /** Time at the left edge [s]; and whether it goes with the time. */
    this.begin = 0;
    this.follows = true;
    /** Time at which drawn things have 0 [s], and how far they reach. */
    this.origin = 0;
    this.drawn = null;
  }

  get seconds() {
    return SPANS[this.choice];
  }

  /** Pixels a second. */
  get scale() {
    return this.width / this.seconds;
  }

  /** Show more time (1) or less (−1), with a time where it is. */
  zoom(way, t) {
    const share = (t - this.begin) / this.seconds;
    this.choice = Math.max(0, Math.min(SPANS.length - 1, this.choice + way));
    this.begin = t - share * this.seconds;
    this.drawn = null;
  }

  /** Go on; whether things are to be drawn anew. */
  advance(now, width) {
    const resized = width !== this.width;
    this.width = Math.max(1, width);
    if (this.follows) this.begin = now - NOW * this.seconds;
    const end = this.begin + this.seconds;
    if (!resized && this.drawn && this.drawn[0] <= this.begin && end <= this.drawn[1]) return false;
    this.origin = this.begin;
    this.drawn = [this.begin - BESIDE * this.seconds, end + BESIDE * this.seconds];
    return true;
  }

  /** Let a time be seen: it's drawn no further to the right than this. */
  reveal(t) {
    this.begin = Math.max(this.begin, t - RIGHTMOST * this.seconds);
  }

  /** Where a time is in the strip [px], and the time of a place. */
  x(t) {
    return (t - this.begin) * this.scale;
  }

  timeAt(x) {
    return this.begin + x / this.scale;
  }

  /** Where a time is among the drawn things [px], and how far those are shifted. */
  left(t) {
    return (t - this.origin) * this.scale;
  }

  get shift() {
    return (this.origin - this.begin) * this.scale;
  }
}
