// STOP: by button and by the space bar, at any time. What can't be sent yet is sent as soon as it can be.
import { html, Icon, isTyping, observed, useOn } from "./ui.js";

/** A stop waits here for its connection, also while the page loads anew. */
const KEY = "vrs-stop";
/** So long it's worth sending [s]: by then every lease has run out, and every robot has stopped by itself. */
const WAITS = 30;
const SHOWN = 4000;

export class Stop {
  constructor(station) {
    this.station = station;
    this.session = station.session;
    /** The order that waits for its outcome, and the timer of the note. */
    this.order = this.fading = null;
    observed(this, { note: "", waits: Date.now() - Number(sessionStorage.getItem(KEY) ?? NaN) < 1000 * WAITS });
    station.on("lease", () => this.catchUp());
    station.on("outcome", (entry) => {
      if (entry !== this.order) return;
      this.order = null;
      this.settle();
      this.say(entry.outcome.refusal ? `STOP refused: ${entry.outcome.refusal}` : "Stopping");
    });
  }

  /** Who has control and can't be stopped from here; null where nobody is, or it can. */
  get another() {
    const { lease, link, welcome } = this.session;
    const may = link !== "live" || lease.yours || lease.state !== "held" || welcome?.role === "admin";
    return may ? null : lease.holder;
  }

  say(text, lasting = false) {
    this.note = text;
    this.station.announce(text, { urgent: true });
    clearTimeout(this.fading);
    if (!lasting) this.fading = setTimeout(() => (this.note = ""), SHOWN);
  }

  wait(text) {
    sessionStorage.setItem(KEY, String(Date.now()));
    this.waits = true;
    this.say(text, true);
  }

  settle() {
    sessionStorage.removeItem(KEY);
    this.waits = false;
  }

  /** Stop the robot, or say why that isn't possible. */
  press() {
    const { session, another } = this;
    const { link, lease } = session;
    this.station.dispatchEvent(new Event("stopping"));
    if (session.holds) {
      this.order = session.order({ type: "stop" });
      if (link === "live") this.say("STOP sent");
      else this.wait("STOP: no answer from the server. It's sent again as soon as it can be; without word the robot stops");
    } else if (link !== "live" && link !== "locked") {
      this.wait("STOP: no connection. It's sent as soon as it can be; without word the robot stops by itself");
    } else if (session.welcome?.role === "admin" && lease.state === "held") {
      session.wish("take-over");
      this.say(`STOP: taking over from ${lease.holder}, which stops the robot`);
    } else if (another !== null) this.say(`You can't stop the robot: ${another} has control`);
    else this.say("Nobody has control: the robot is at rest, or coming to rest");
  }

  /** Whoever is connected again sends what waited, once it's known who has control. */
  catchUp() {
    if (!this.waits || !this.session.greeted) return;
    this.settle();
    if (this.session.holds) {
      this.order = this.session.order({ type: "stop" });
      this.say("Connected again: STOP sent");
    } else this.say("Connected again: your control has run out, and the robot was stopped");
  }
}

export function Panel({ station: { stop } }) {
  function key(event) {
    if (event.code !== "Space" || isTyping(event)) return;
    event.preventDefault();
    event.stopImmediatePropagation();
    if (event.type === "keydown" && !event.repeat) stop.press();
  }

  function point(event) {
    event.preventDefault();
    stop.press();
  }

  useOn(window, "keydown", key, { capture: true });
  useOn(window, "keyup", key, { capture: true });
  // STOP is there where it works: nobody should rely on one that doesn't. A click without a pointer is the Enter key's or a screen reader's.
  return html`<span class="stop-note" id="stop-note">${stop.note}</span>
    <button class="stop" type="button" id="stop" aria-describedby="stop-note" title="Stop the robot (space bar)"
      hidden=${stop.another !== null} data-waits=${stop.waits ? "" : undefined} onPointerDown=${point}
      onClick=${(event) => event.detail === 0 && stop.press()}><${Icon} name="front_hand" /><span>STOP</span></button>`;
}
