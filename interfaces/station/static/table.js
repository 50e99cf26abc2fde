// Rows of numbers by column, the newest of them: memory is taken once and stays what it is.

export class Table {
  /**
   * @param {string[]} names of the columns; the first ascends
   * @param {number} kept rows that are kept at least
   */
  constructor(names, kept) {
    this.names = names;
    this.kept = kept;
    this.all = new Map(names.map((name) => [name, new Float64Array(2 * kept)]));
    this.clear();
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
}
