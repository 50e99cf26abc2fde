// How the tool follows a hand that drags it; interfaces/station/dragging.py is the same law, and says more.

/** How fast the tool is drawn to the hand, beside the hand's own speed [1/s]. */
export const GAIN = 3;
/** Of what was foreseen wrongly: the share that counts as the hand's place, and as its speed over that time. */
const POSITION = 0.91;
const SPEED = 0.49;
/** After so long without an input the hand's speed isn't known any more [s]. */
const LONGEST = 0.2;

/** An alpha-beta filter of the hand, and feedback; it never looks ahead. */
export class DragLaw {
  t = null;
  /** The hand's place [m] and speed [m/s], as they're taken to be. */
  hand = [0, 0, 0];
  handSpeed = [0, 0, 0];

  /**
   * How fast the tool is to go [m/s].
   * @param {number} t present time [s], growing
   * @param {number[]} hand where the hand is [m]
   * @param {number[]} tool where the tool is [m]
   * @param {number} fastest largest speed [m/s]
   */
  speed(t, hand, tool, fastest) {
    const since = this.t === null ? Infinity : t - this.t;
    if (since > LONGEST) [this.hand, this.handSpeed] = [[...hand], [0, 0, 0]];
    else if (since > 0) {
      const foreseen = this.hand.map((x, k) => x + this.handSpeed[k] * since);
      const wrong = hand.map((x, k) => x - foreseen[k]);
      this.hand = foreseen.map((x, k) => x + POSITION * wrong[k]);
      this.handSpeed = this.handSpeed.map((v, k) => v + (SPEED / since) * wrong[k]);
    }
    this.t = t;
    const wish = this.handSpeed.map((v, k) => v + GAIN * (hand[k] - tool[k]));
    const size = Math.hypot(...wish);
    return size > 0 ? wish.map((v) => v * Math.min(1, fastest / size)) : wish;
  }
}
