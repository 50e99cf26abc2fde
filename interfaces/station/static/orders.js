// The orders of a session: numbered without a gap, sent again until they're answered, kept for those who look.

/** Orders that are kept [number]. */
const KEPT = 300;
/** An order that isn't answered is sent again after so long [s]. */
const AGAIN = 1;
/** More orders without an answer than this, and steering waits. */
const MOST_PENDING = 12;

export class Orders {
  /** @param {(message: object) => boolean} send whether it could be sent */
  constructor(send) {
    this.send = send;
    /** Entries {number, command, epoch, label, at, sentAt, outcome, forgotten}, oldest first. */
    this.entries = [];
    this.last = 0;
  }

  /** Orders without an answer. */
  get pending() {
    return this.entries.filter((entry) => entry.outcome === null && !entry.forgotten);
  }

  /** Whether so much is unanswered that nothing more should be said. */
  get congested() {
    return this.pending.length >= MOST_PENDING;
  }

  /** Give an order; `command` null takes back the newest one. */
  give(command, epoch, now, label) {
    const fresh = { at: now, sentAt: now, outcome: null, forgotten: false };
    const entry = { number: ++this.last, command, epoch, label, ...fresh };
    this.entries.push(entry);
    if (this.entries.length > KEPT) this.entries.splice(0, this.entries.length - KEPT);
    this.put(entry, now);
    return entry;
  }

  put(entry, now) {
    entry.sentAt = now;
    const { number, epoch, command, label } = entry;
    this.send({ type: "order", number, epoch, command, label });
  }

  /** Take an outcome; the entry that it's of, or undefined. */
  answer(outcome) {
    const entry = this.entries.find((known) => known.number === outcome.number && !known.forgotten);
    if (!entry || (entry.outcome && outcome.revision < entry.outcome.revision)) return undefined;
    entry.outcome = outcome;
    return entry;
  }

  /** Send again what has no answer. */
  advance(now) {
    for (const entry of this.pending) if (now - entry.sentAt >= AGAIN) this.put(entry, now);
  }

  /** Go on after a lost connection: what has no answer is sent again, or its fate isn't known. */
  renew(resumed, now) {
    if (resumed) {
      // A stop goes first: the server then refuses what was given before it.
      const stops = (entry) => entry.command?.type === "stop";
      for (const entry of this.pending.filter(stops)) this.put(entry, now);
      for (const entry of this.pending.filter((one) => !stops(one))) this.put(entry, now);
      return;
    }
    for (const entry of this.entries) entry.forgotten = true;
    this.last = 0;
  }
}
