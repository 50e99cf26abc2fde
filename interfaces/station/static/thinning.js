// Curves with as many points as a plot can show: of every bucket the extremes, so that no peak is lost.

/** Samples further apart than this aren't joined [s]. */
const GAP = 1;
/** Buckets of a window. */
const BUCKETS = 320;

const known = (x) => (Number.isNaN(x) ? null : x);

/**
 * Rows between two indices as uPlot takes them: times, then each curve, null where there's none.
 * @param {Float64Array} x ascending times [s]
 * @param {Float64Array[]} curves
 * @param {number} from first index
 * @param {number} until index after the last
 * @param {number} span width of the window [s]
 * @param {number} factor from the curves' unit to the plot's
 */
export function thinned(x, curves, from, until, span, factor = 1) {
  const data = [[], ...curves.map(() => [])];
  const width = until - from > 2 * BUCKETS ? span / BUCKETS : 0;
  const value = (curve, k) => known(curve[k] * factor);
  let k = from;
  while (k < until) {
    if (k > from && x[k] - x[k - 1] > GAP) {
      data[0].push((x[k] + x[k - 1]) / 2);
      for (let c = 1; c < data.length; c++) data[c].push(null);
    }
    let last = k;
    if (width) {
      // Buckets stand still while the window moves over them.
      const bucket = Math.floor(x[k] / width);
      while (last + 1 < until && Math.floor(x[last + 1] / width) === bucket && x[last + 1] - x[last] <= GAP) last++;
    }
    data[0].push(x[k]);
    if (last === k) curves.forEach((curve, c) => data[c + 1].push(value(curve, k)));
    else {
      data[0].push(x[last]);
      curves.forEach((curve, c) =>
        data[c + 1].push(...extremes(curve, k, last).map((index) => value(curve, index))),
      );
    }
    k = last + 1;
  }
  return data;
}

/** Indices of the smallest and the largest, in their order. */
function extremes(curve, first, last) {
  let [low, high] = [first, first];
  for (let k = first + 1; k <= last; k++) {
    if (curve[k] < curve[low]) low = k;
    if (curve[k] > curve[high]) high = k;
  }
  return low < high ? [low, high] : [high, low];
}
