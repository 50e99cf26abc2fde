// Where the real robot was, as far as this page has heard: the newest quarter of an hour.

/** Measurements that are kept [number]; twenty a second come at most. */
const KEPT = 18000;
/** A measurement stands for so long [s]. */
const LASTS = 1;

export class History {
  constructor(station) {
    this.rows = [];
    this.instance = null;
    station.on("welcome", ({ instance }) => {
      if (instance !== this.instance) this.rows = [];
      this.instance = instance;
    });
    station.on("state", (state) => this.add(state));
  }

  add({ t, q }) {
    if (this.rows.length && t <= this.rows.at(-1).t) return;
    this.rows.push({ t, q });
    if (this.rows.length > KEPT + 1000) this.rows.splice(0, 1000);
  }

  /** Joints that were measured last before t [s]; null where that's too long ago. */
  at(t) {
    let [low, high] = [0, this.rows.length];
    while (low < high) {
      const middle = (low + high) >> 1;
      if (this.rows[middle].t <= t) low = middle + 1;
      else high = middle;
    }
    const row = this.rows[low - 1];
    return row && t - row.t <= LASTS ? row.q : null;
  }
}
