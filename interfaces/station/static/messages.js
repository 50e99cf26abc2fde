// Messages to the robot, one by one, as the emulated link tells of them.
import { Table } from "./table.js";

/** Messages that are kept. */
const KEPT = 24000;

export class Messages {
  constructor() {
    /** Those that arrived: when, and how long they took [s]; when lost ones were sent. */
    this.arrived = new Table(["arrived", "delay"], KEPT);
    this.lost = new Table(["sent"], KEPT);
    this.clear();
  }

  clear() {
    this.arrived.clear();
    this.lost.clear();
    this.told = -Infinity;
    /** How long the newest one took [s]. */
    this.delay = NaN;
  }

  /** @param {?Array<[number, ?number]>} messages when each was sent and arrived [s]; null for a lost one */
  hear(messages) {
    for (const [sent, arrived] of messages) this.take(sent, arrived);
  }

  take(sent, arrived) {
    if (arrived === null) {
      if (sent > this.lost.newest) this.lost.push([sent]);
    } else if (arrived > this.told || sent > this.arrived.newest) {
      // Two may arrive at once; one that was told of before doesn't count again.
      this.told = Math.max(this.told, arrived);
      this.delay = arrived - sent;
      this.arrived.push([Math.max(arrived, this.arrived.newest), this.delay]);
    }
  }
}
