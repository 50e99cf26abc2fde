// What happened, for marks on the strip and lines across the plots.
import { movesBetween } from "./moves.js";
import { observed } from "./ui.js";

const KEPT = 200;
/** Moves begin so far apart [s], or they're one for the plots; more begins than these say nothing any more. */
const CLOSE = 0.25;
const MOST = 40;

/** Lines across the plots, by what happened: what they mean, colour, dashes. */
export const ACROSS = {
  begin: ["a move begins", "--muted", [2, 4]],
  corrected: ["virtual robot put right", "--committed", []],
  halted: ["real robot stopped, or lost", "--bad", [6, 3]],
};

export class Happenings {
  constructor(station) {
    this.session = station.session;
    /** {t, kind, symbol, text, tone}, the oldest first; some are of no kind that plots show. */
    observed(this, { events: [] });
    let before = null;
    station.on("welcome", ({ resumed }) => {
      if (!resumed && before) before = { ...before, corrections: Infinity };
    });
    station.on("state", (state) => {
      const { corrections, halted, connected } = state;
      if (before !== null && corrections > before.corrections) this.note("corrected", "sync_problem", "The virtual robot was put right");
      if (halted && halted !== before?.halted) this.note("halted", "pause_circle", halted, "warn");
      else if (!connected && before?.connected !== false) this.note("halted", "cloud_off", "The real robot isn't heard", "warn");
      before = state;
    });
    station.on("outcome", ({ command, outcome: { refusal, receipt, revision } }) => {
      if (revision) return;
      if (command?.type === "stop" && !refusal) this.note("stop", "front_hand", "STOP", "bad");
      else if (command?.type !== "steer" && (refusal || receipt?.status === "rejected"))
        this.note("refused", "block", refusal || receipt.reason, "bad");
    });
    station.on("rerouted", ({ changed_by: by, forward, backward }) => {
      const back = backward.delay === forward.delay ? "" : `, back ${backward.delay}`;
      this.note("rerouted", "network_check", `${by} changed the way to the robot: ${forward.delay}${back}`, "warn");
    });
    station.on("link", (link) => link === "lost" && this.note("halted", "wifi_off", "Connection lost", "bad"));
  }

  note(kind, symbol, text, tone = "none") {
    const t = this.session.now;
    if (t !== null) this.events = [...this.events, { t, kind, symbol, text, tone }].slice(-KEPT);
  }

  /** What plots show between two times [s]. */
  between(from, until) {
    const { timeline } = this.session;
    const begins = [];
    let last = -Infinity;
    for (const { start } of timeline ? movesBetween(timeline, from, until) : []) {
      if (start >= from && start - last > CLOSE) begins.push({ t: start, kind: "begin" });
      last = start;
    }
    const lines = this.events.filter(({ t, kind }) => t >= from && t <= until && kind in ACROSS);
    return begins.length > MOST ? lines : [...begins, ...lines];
  }
}
