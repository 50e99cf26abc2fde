// Where the real robot was, as far as this page has heard: the newest quarter of an hour.

/** Measurements that are kept [number]; twenty a second come at most, and as many that are late. */
const KEPT = 36000;
/** A measurement stands for so long [s]. */
const LASTS = 1;

export class History {
  constructor(station) {
    this.rows = [];
    let run = null;
    station.on("welcome", ({ instance }) => {
      if (instance !== run) this.rows = [];
      run = instance;
    });
    station.on("state", ({ t, q, late }) => {
      for (const [then, joints] of [...late, [t, q]]) this.put(then, joints);
      if (this.rows.length > KEPT + 1000) this.rows.splice(0, 1000);
    });
  }

  /** Take a measurement to its place; what came late may come twice. */
  put(t, q) {
    const place = this.after(t);
    if (this.rows[place - 1]?.t !== t) this.rows.splice(place, 0, { t, q });
  }

  /** How many measurements aren't later than t [s]. */
  after(t) {
    let [low, high] = [0, this.rows.length];
    while (low < high) {
      const middle = (low + high) >> 1;
      if (this.rows[middle].t <= t) low = middle + 1;
      else high = middle;
    }
    return low;
  }

  /** Joints that were measured last before t [s]; null where that's too long ago. */
  at(t) {
    const row = this.rows[this.after(t) - 1];
    return row && t - row.t <= LASTS ? row.q : null;
  }
}
