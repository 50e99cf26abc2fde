// What happened, for lines across the plots: moves that begin, stops of the real robot, corrections, lost connections.
import { movesBetween } from "./moves.js";

const KEPT = 200;
/** Steering begins a move with each input: those that follow each other so closely are one [s]. */
const CLOSE = 0.25;
/** More begins than these say nothing any more. */
const MOST = 40;

export class Happenings {
  constructor(station) {
    this.session = station.session;
    this.events = [];
    let corrections = null;
    let halted = "";
    let heard = true;
    station.on("welcome", ({ resumed }) => {
      if (!resumed) corrections = null;
    });
    station.on("state", (state) => {
      const count = state.corrections;
      if (corrections !== null && count > corrections) this.note("corrected");
      if (state.halted && !halted) this.note("halted");
      if (heard && !state.connected) this.note("halted");
      [corrections, halted, heard] = [count, state.halted, state.connected];
    });
    station.on("link", (link) => link === "lost" && this.note("halted"));
  }

  note(kind) {
    const t = this.session.now;
    if (t === null) return;
    this.events.push({ t, kind });
    if (this.events.length > KEPT) this.events.shift();
  }

  /** Those between two times [s]. */
  between(from, until) {
    const { timeline } = this.session;
    const begins = [];
    let last = -Infinity;
    for (const { start } of timeline ? movesBetween(timeline, from, until, () => false) : []) {
      if (start >= from && start - last > CLOSE) begins.push({ t: start, kind: "begin" });
      last = start;
    }
    const events = this.events.filter(({ t }) => t >= from && t <= until);
    return begins.length > MOST ? events : [...begins, ...events];
  }
}
