// The strip's scale, and marks of what happened.
import { clockText, h, icon } from "./dom.js";

/** Marks that are kept [number]. */
const KEPT = 200;
/** Ticks are at least so far apart [px]. */
const APART = 64;
const STEPS = [0.5, 1, 2, 5, 10, 30, 60, 120, 300];

export class Marks {
  constructor(station, world, view) {
    this.session = station.session;
    this.view = view;
    this.box = h("div.marks", { "aria-hidden": "true" });
    world.append(this.box);
    this.events = [];
    let corrections = null;
    let halted = "";
    station.on("state", (state) => {
      const count = state.corrections;
      if (corrections !== null && count > corrections) this.note("sync_problem", "The virtual robot was put right");
      if (state.halted && state.halted !== halted) this.note("pause_circle", state.halted, "warn");
      corrections = count;
      halted = state.halted;
    });
    station.on("outcome", ({ command, outcome }) => {
      if (outcome.revision) return;
      if (command?.type === "stop" && !outcome.refusal) this.note("front_hand", "STOP", "bad");
      else if (command?.type !== "steer" && (outcome.refusal || outcome.receipt?.status === "rejected"))
        this.note("block", outcome.refusal || outcome.receipt.reason, "bad");
    });
    station.on("rerouted", ({ changed_by: by, forward, backward }) => {
      const back = backward.delay === forward.delay ? "" : `, back ${backward.delay}`;
      this.note("network_check", `${by} changed the way to the robot: ${forward.delay}${back}`, "warn");
    });
    station.on("link", (link) => link === "lost" && this.note("wifi_off", "Connection lost", "bad"));
    station.on("welcome", ({ resumed }) => {
      if (!resumed) corrections = null;
    });
  }

  note(symbol, text, tone = "none") {
    const t = this.session.now;
    if (t === null) return;
    this.events.push({ t, symbol, text, tone });
    if (this.events.length > KEPT) this.events.shift();
    if (this.view.drawn) this.draw();
  }

  draw() {
    const [from, until] = this.view.drawn;
    const step = STEPS.find((seconds) => seconds * this.view.scale >= APART) ?? STEPS.at(-1);
    const parts = [];
    for (let k = Math.ceil(from / step); k * step <= until; k++) {
      if (k < 0) continue;
      const tick = h("span.tick", {}, clockText(k * step).replace(/\.0$/, ""));
      tick.style.left = `${this.view.left(k * step).toFixed(1)}px`;
      parts.push(tick);
    }
    for (const { t, symbol, text, tone } of this.events) {
      if (t < from || t > until) continue;
      const event = h("i.event", { title: `${clockText(t)} ${text}`, "data-tone": tone }, icon(symbol));
      event.style.left = `${this.view.left(t).toFixed(1)}px`;
      parts.push(event);
    }
    this.box.replaceChildren(...parts);
  }
}
