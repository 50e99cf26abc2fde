// Rows of numbers by column: the newest of them, or those of a recording.

/** Samples further apart than this aren't joined by a line [s]. */
const GAP = 1;
const AT_ONCE = 400;

export class Table {
  /**
   * Takes its memory once, and stays what it is.
   * @param {string[]} names of the columns; the first ascends
   * @param {number} kept rows that are kept at least
   */
  constructor(names, kept) {
    this.names = names;
    this.kept = kept;
    this.all = new Map(names.map((name) => [name, new Float64Array(2 * kept)]));
    this.clear();
  }

  /** A table of columns by their names; null is a number that isn't known. */
  static of(columns) {
    const names = Object.keys(columns);
    const table = new Table(names, 0);
    for (const name of names) table.all.set(name, Float64Array.from(columns[name], (x) => x ?? NaN));
    table.end = columns[names[0]].length;
    return table;
  }

  clear() {
    this.begin = this.end = 0;
  }

  get length() {
    return this.end - this.begin;
  }

  /** Add a row, a number a column. */
  push(row) {
    if (this.end === 2 * this.kept) {
      for (const column of this.all.values()) column.copyWithin(0, this.kept);
      [this.begin, this.end] = [0, this.kept];
    }
    let k = 0;
    for (const column of this.all.values()) column[this.end] = row[k++];
    this.end += 1;
    if (this.length > this.kept) this.begin += 1;
  }

  /** A column, not copied: it holds until the next row comes. */
  column(name) {
    return this.all.get(name).subarray(this.begin, this.end);
  }

  get(name, index) {
    return this.all.get(name)[this.begin + index];
  }

  /** The first column's last number; −∞ where there's none. */
  get newest() {
    return this.length ? this.all.get(this.names[0])[this.end - 1] : -Infinity;
  }

  /** How many rows begin before t, by the first column. */
  before(t) {
    const x = this.column(this.names[0]);
    let [low, high] = [0, x.length];
    while (low < high) {
      const middle = (low + high) >> 1;
      if (x[middle] < t) low = middle + 1;
      else high = middle;
    }
    return low;
  }

  /** Indices of the rows between two times, the first one and the one after the last. */
  between(from, until) {
    return [this.before(from), this.before(until)];
  }

  /** Columns between two times as uPlot takes them: times, then each curve, null where nothing is known, and in gaps. */
  curves(names, from, until, factor = 1) {
    const columns = [this.names[0], ...names].map((name) => this.column(name));
    const found = columns.map(() => []);
    const [first, last] = this.between(from, until);
    const [t] = columns;
    for (let k = first; k < last; k++) {
      if (k > first && t[k] - t[k - 1] > GAP) found.forEach((curve, c) => curve.push(c ? null : (t[k] + t[k - 1]) / 2));
      found.forEach((curve, c) => {
        const x = c ? factor * columns[c][k] : t[k];
        curve.push(Number.isNaN(x) ? null : x);
      });
    }
    return found;
  }

  /**
   * All rows as comma-separated values, a piece at a time so that nothing waits for it; what isn't known is left empty.
   * @param {(name: string) => string} headed a column's name with its unit
   */
  async csv(headed) {
    const columns = this.names.map((name) => this.column(name).slice());
    const parts = [this.names.map(headed).join(",") + "\n"];
    const count = columns[0].length;
    for (let from = 0; from < count; from += AT_ONCE) {
      let text = "";
      for (let k = from; k < Math.min(from + AT_ONCE, count); k++)
        text += columns.map((column) => (Number.isNaN(column[k]) ? "" : column[k])).join(",") + "\n";
      parts.push(text);
      await new Promise((resolve) => setTimeout(resolve));
    }
    return parts;
  }
}
