// Path error and time difference of a follower on a leader's path, as `compare_paths` of vrs/comparison.py has them.
// Points are in arrays of x, y, z, x, y, z, …; both are known at the same even times.

/** Points of the leader that are kept in a cell, at most, beside its ends. */
const POINTS = 50;
const at = (p, k) => [p[3 * k], p[3 * k + 1], p[3 * k + 2]];
const squared = ([a, b, c], [d, e, f]) => (a - d) ** 2 + (b - e) ** 2 + (c - f) ** 2;
const clamp = (x, low, high) => Math.max(low, Math.min(high, x));

/** How many of ascending numbers are smaller than one; with `equal` those that are as large count, too. */
function countBelow(x, value, equal = false) {
  let [low, high] = [0, x.length];
  while (low < high) {
    const middle = (low + high) >> 1;
    if (x[middle] < value || (equal && x[middle] === value)) low = middle + 1;
    else high = middle;
  }
  return low;
}

/** Points on lines between known ones, at new times. */
export function resample(t, points, times) {
  const found = new Float64Array(3 * times.length);
  for (let k = 0; k < times.length; k++) {
    const high = clamp(countBelow(t, times[k]), 1, t.length - 1);
    const share = clamp((times[k] - t[high - 1]) / (t[high] - t[high - 1]), 0, 1);
    for (let i = 0; i < 3; i++)
      found[3 * k + i] = points[3 * high - 3 + i] + share * (points[3 * high + i] - points[3 * high - 3 + i]);
  }
  return found;
}

/** When a path length that never falls reaches each of some lengths first. */
function firstArrival(t, lengths, wanted) {
  return Float64Array.from(wanted, (s) => {
    const i = clamp(countBelow(lengths, s), 0, t.length - 1);
    const low = Math.max(i - 1, 0);
    const rise = lengths[i] - lengths[low];
    const share = rise > 0 ? (s - lengths[low]) / rise : 1;
    return t[low] + clamp(share, 0, 1) * (t[i] - t[low]);
  });
}

/** The best matched cell at every time. */
function matched(t, follower, reached, path, advance) {
  const cells = reached.length;
  const cost = new Float64Array(cells).fill(Infinity);
  cost[0] = 0;
  const steps = new Uint8Array(t.length * cells);
  const before = new Float64Array(cells);
  for (let k = 0; k < t.length; k++) {
    const known = countBelow(reached, t[k] + 1e-9, true);
    const [x, y, z] = at(follower, k);
    before.set(cost);
    for (let j = 0; j < known; j++) {
      let best = before[j];
      let step = 0;
      const most = k > 0 ? Math.min(advance, j) : 0;
      for (let a = 1; a <= most; a++) {
        if (before[j - a] < best) {
          best = before[j - a];
          step = a;
        }
      }
      cost[j] = best + (path[3 * j] - x) ** 2 + (path[3 * j + 1] - y) ** 2 + (path[3 * j + 2] - z) ** 2;
      steps[k * cells + j] = step;
    }
  }
  const match = new Int32Array(t.length);
  let best = 0;
  for (let j = 1; j < cells; j++) if (cost[j] < cost[best]) best = j;
  match[t.length - 1] = best;
  for (let k = t.length - 1; k > 0; k--) match[k - 1] = match[k] - steps[k * cells + match[k]];
  return match;
}

/** The leader's path with what was recorded between its cells: lengths, ascending, and points. */
function polyline(s, path, lengths, leader) {
  const [along, points] = [[], []];
  const put = (length, point) => {
    if (length === along.at(-1)) return;
    along.push(length);
    points.push(point);
  };
  let [cell, bin] = [0, -1];
  for (let k = 0; k < lengths.length; k++) {
    const [before, last] = [bin, k === lengths.length - 1];
    bin = Math.floor(lengths[k] * (POINTS / s[1]));
    if (bin === before && !last) continue;
    for (; cell < s.length && s[cell] <= lengths[k]; cell++) put(s[cell], at(path, cell));
    put(lengths[k], at(leader, k));
  }
  for (; cell < s.length; cell++) put(s[cell], at(path, cell));
  return [along, points];
}

/** Distance to the path from the neighbour before a matched cell to the one after, and the length up to the nearest
 * point. */
function projected(point, along, points, s, cell) {
  const end = along.at(-1);
  const first = countBelow(along, s[Math.max(cell - 1, 0)]);
  const last = Math.max(countBelow(along, cell + 1 < s.length ? s[cell + 1] : end) - 1, first);
  let [distance, length] = [Infinity, 0];
  for (let low = first; low <= last; low++) {
    const [from, to] = [points[low], points[low + 1]];
    const piece = to.map((x, i) => x - from[i]);
    const size = Math.max(squared(to, from), 1e-300);
    const share = clamp(piece.reduce((sum, x, i) => sum + (point[i] - from[i]) * x, 0) / size, 0, 1);
    const gap = Math.sqrt(squared(point, from.map((x, i) => x + share * piece[i])));
    if (gap < distance) [distance, length] = [gap, along[low] + share * (along[low + 1] - along[low])];
  }
  return [distance, length];
}

const mean = (x) => (x.length ? x.reduce((sum, one) => sum + one, 0) / x.length : null);
const largest = (x) => x.reduce((most, one) => Math.max(most, one), -Infinity);

function quantile(x, share) {
  const sorted = Float64Array.from(x).sort();
  const place = share * (sorted.length - 1);
  const low = Math.floor(place);
  return sorted[low] + (place - low) * (sorted[Math.min(low + 1, sorted.length - 1)] - sorted[low]);
}

/**
 * @param {Float64Array} t even times [s], two or more
 * @param {Float64Array} leader points at these times [m]
 * @param {Float64Array} follower points at these times [m]
 * @param {{vMax: number, cell: number, vMin?: number}} options as `compare_paths` has them [m/s, m, m/s]
 * @returns {{arrival: number[], late: number[]}} and what `compare_paths` finds, null where it's undefined: time
 *   differences [s] where the leader moves, and when the follower came there [s]
 */
export function comparePaths(t, leader, follower, { vMax, cell, vMin = 0.02 }) {
  const dt = (t.at(-1) - t[0]) / (t.length - 1);
  const lengths = new Float64Array(t.length);
  for (let k = 1; k < t.length; k++)
    lengths[k] = lengths[k - 1] + Math.sqrt(squared(at(leader, k), at(leader, k - 1)));
  const cells = Math.floor(lengths.at(-1) / cell + 1e-9) + 1;
  const s = Float64Array.from({ length: cells }, (_, k) => cell * k);
  const reachedAt = firstArrival(t, lengths, s);
  const path = resample(t, leader, reachedAt);
  const nothing = { arrival: [], late: [], mean: null, sd: null, max: null, bound: null, progress: null };
  if (cells < 3) {
    const away = Array.from(t, (_, k) => Math.sqrt(squared(at(follower, k), at(path, 0))));
    return { ...nothing, pathError: [mean(away), quantile(away, 0.95), largest(away)] };
  }
  const advance = clamp(Math.round((2 * vMax * dt) / cell), 1, 255);
  const match = matched(t, follower, reachedAt, path, advance);
  const [lengthsAlong, points] = polyline(s, path, lengths, leader);
  const away = [];
  const along = Array.from(t, (_, k) => {
    const [distance, length] = projected(at(follower, k), lengthsAlong, points, s, match[k]);
    away.push(distance);
    return length;
  });
  const reached = match.at(-1) + 1;
  // The mean of both monotone envelopes is unbiased under noise.
  const upper = Float64Array.from(along);
  const lower = Float64Array.from(along);
  for (let k = 1; k < upper.length; k++) upper[k] = Math.max(upper[k], upper[k - 1]);
  for (let k = lower.length - 2; k >= 0; k--) lower[k] = Math.min(lower[k], lower[k + 1]);
  const crossing = firstArrival(t, upper.map((x, k) => (x + lower[k]) / 2), s.subarray(0, reached));
  const [arrival, late, bounded] = [[], [], []];
  for (let j = 1; j < cells - 1; j++) {
    if (2 * cell <= vMin * (reachedAt[j + 1] - reachedAt[j - 1])) continue;
    if (j >= reached) {
      bounded.push(t.at(-1) - reachedAt[j]);
      continue;
    }
    const first = t[countBelow(match, j)];
    const there = clamp(crossing[j], first - dt, first + dt + (0.5 * cell) / vMin);
    arrival.push(there);
    late.push(there - reachedAt[j]);
  }
  const average = mean(late);
  return {
    arrival,
    late,
    mean: average,
    sd: late.length ? Math.sqrt(mean(late.map((x) => (x - average) ** 2))) : null,
    max: late.length ? largest(late) : null,
    bound: mean([...late, ...bounded]),
    progress: match.at(-1) / (cells - 1),
    pathError: [mean(away), quantile(away, 0.95), largest(away)],
  };
}
