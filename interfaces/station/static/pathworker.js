// Compares the tools' paths, in a thread of its own: it may take longer than a page can wait.
import { comparePaths, resample } from "./pathtime.js";

/** Cells have 1 cm; a longer path than this many of them has longer ones. */
const MOST_CELLS = 1500;
/** The leader is taken to be at least so quick [m/s]. */
const SLOWEST = 0.5;

onmessage = ({ data: { number, t, leader, times, follower } }) => {
  let [length, quickest] = [0, SLOWEST];
  for (let k = 1; k < t.length; k++) {
    const step = Math.hypot(...[0, 1, 2].map((i) => leader[3 * k + i] - leader[3 * k - 3 + i]));
    length += step;
    quickest = Math.max(quickest, step / (t[k] - t[k - 1]));
  }
  const cell = Math.max(0.01, length / MOST_CELLS);
  const found = comparePaths(t, leader, resample(times, follower, t), { vMax: quickest, cell });
  postMessage({ number, cell, ...found });
};
