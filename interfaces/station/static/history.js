// Where the real robot was, as far as this page has heard: the newest quarter of an hour.

/** Measurements that are kept [number]; twenty a second come at most, and as many that are late. */
const KEPT = 36000;
/** A measurement stands for so long [s]. */
const LASTS = 1;

/** How many rows aren't later than t [s], of rows by time. */
export function placeAfter(t, rows) {
  let [low, high] = [0, rows.length];
  while (low < high) {
    const middle = (low + high) >> 1;
    if (rows[middle].t <= t) low = middle + 1;
    else high = middle;
  }
  return low;
}

/** Take a row to the place of its time, and forget the oldest where there are too many. */
export function keep(rows, row) {
  rows.splice(placeAfter(row.t, rows), 0, row);
  if (rows.length > KEPT + 1000) rows.splice(0, 1000);
}

export class History {
  constructor(station) {
    this.rows = [];
    /** How the hand was, and where things: {t, opening, things by number}. */
    this.hands = [];
    let run = null;
    station.on("welcome", ({ instance }) => {
      if (instance !== run) [this.rows, this.hands] = [[], []];
      run = instance;
    });
    station.on("state", ({ t, q, late, hand }) => {
      for (const [then, joints] of [...late, [t, q]]) this.put(then, joints);
      if (hand) this.feel(t, hand);
    });
  }

  /** Take how the hand was measured, and where things were that had moved. */
  feel(t, { opening, things }) {
    const last = this.hands.at(-1) ?? { t: -Infinity, things: new Map() };
    if (t <= last.t) return;
    keep(this.hands, { t, opening, things: things.length ? new Map([...last.things, ...things]) : last.things });
  }

  /** Take a measurement to its place; what came late may come twice. */
  put(t, q) {
    if (this.rows[placeAfter(t, this.rows) - 1]?.t !== t) keep(this.rows, { t, q });
  }

  /** Joints that were measured last before t [s]; null where that's too long ago. */
  at(t) {
    const row = this.rows[placeAfter(t, this.rows) - 1];
    return row && t - row.t <= LASTS ? row.q : null;
  }

  /** The hand and the things before t [s], at first as they were known first; null where none are known. */
  grasp(t) {
    return this.hands[Math.max(placeAfter(t, this.hands) - 1, 0)] ?? null;
  }
}
