// The buttons and the keys of play-back.
"use strict";

window.VrsControls = class {
  // wish(what, more) asks the server; say(text) tells whoever looks; home() resets the views.
  constructor(wish, say, home) {
    this.wish = wish;
    this.say = say;
    this.state = null; // what the server said last
    this.acts = this.makeActs(home);
    this.keys = this.makeKeys();
    for (const [id, act] of Object.entries(this.acts))
      this.el(id).addEventListener("click", () => this.state && act());
    this.makeRates();
    this.listen();
  }

  el(id) {
    return document.getElementById(id);
  }

  show(next) {
    this.state = next;
    const el = this.el;
    el("unloop").disabled = !next.loop;
    el("play").setAttribute("aria-label", next.mode !== "paused" ? "Pause" : "Play");
    for (const button of el("rates").querySelectorAll("button"))
      button.setAttribute("aria-pressed", String(Number(button.dataset.rate) === next.rate));
    if (document.activeElement !== el("rate")) {
      el("rate").value = VrsControls.rounded(next.rate).replace("-", "−");
      el("rate").removeAttribute("aria-invalid");
    }
    el("live").disabled = !next.growing;
    el("live").setAttribute("aria-pressed", String(next.mode === "live"));
  }

  makeActs(home) {
    const wish = this.wish;
    return {
      play: () => wish("toggle"),
      step: () => wish("step", { by: VrsControls.FRAME }),
      "step-back": () => wish("step", { by: -VrsControls.FRAME }),
      "to-start": () => wish("seek", { t: this.state.span[0] }),
      "to-end": () => wish("seek", { t: this.state.span[1] }),
      "mark-back": () => wish("mark", { back: true }),
      "mark-next": () => wish("mark", { back: false }),
      "set-start": () => this.loopFrom(this.state.t),
      "set-end": () => this.loopTo(this.state.t),
      unloop: () => wish("unloop"),
      live: () => wish("live"),
      home,
      help: () => this.el("keys").showModal(),
    };
  }

  makeKeys() {
    const acts = this.acts;
    const step = (way) => (shift) => this.wish("step", { by: way * (shift ? 1 : VrsControls.FRAME) });
    return {
      " ": acts.play,
      k: acts.play,
      Home: acts["to-start"],
      End: acts["to-end"],
      PageUp: () => this.wish("skip", { by: 10 }),
      PageDown: () => this.wish("skip", { by: -10 }),
      ArrowRight: step(1),
      ArrowLeft: step(-1),
      "+": () => this.shiftRate(1),
      "=": () => this.shiftRate(1),
      "-": () => this.shiftRate(-1),
      "−": () => this.shiftRate(-1),
      n: acts["mark-next"],
      p: acts["mark-back"],
      r: () => this.setRate(-this.state.rate),
      a: acts["set-start"],
      b: acts["set-end"],
      o: acts.unloop,
      l: () => this.state.growing && acts.live(),
      v: acts.home,
      "?": acts.help,
    };
  }

  listen() {
    // A button that was clicked doesn't keep the keys; one that was reached by them does.
    document.addEventListener("click", (event) => {
      const button = event.target.closest("button");
      if (button && event.detail > 0) button.blur();
    });
    document.addEventListener("keydown", (event) => {
      if (!this.state || event.ctrlKey || event.metaKey || event.altKey || this.el("keys").open) return;
      const target = event.target;
      if (target.closest("input")) {
        if (event.key === "Escape") target.blur();
        return;
      }
      if (event.key === " " && target.closest("button")) return;
      const act = this.keys[event.key.length === 1 ? event.key.toLowerCase() : event.key];
      if (!act) return;
      event.preventDefault();
      act(event.shiftKey);
    });
  }

  loopFrom(t) {
    const { loop, span } = this.state;
    this.wish("loop", { start: t, end: loop && loop[1] > t ? loop[1] : span[1] });
  }

  loopTo(t) {
    const { loop, span } = this.state;
    this.wish("loop", { start: loop && loop[0] < t ? loop[0] : span[0], end: t });
  }

  makeRates() {
    const spelled = (rate) => ({ 0.25: "¼", 0.5: "½" })[rate] || String(rate).replace("-", "−");
    for (const rate of VrsControls.RATES) {
      const button = document.createElement("button");
      button.type = "button";
      button.dataset.rate = String(rate);
      button.textContent = spelled(rate);
      button.title = "Rate " + spelled(rate);
      button.setAttribute("aria-label", "Rate " + String(rate).replace("-", "minus "));
      button.addEventListener("click", () => this.setRate(rate));
      if (rate === 0.25) {
        const gap = document.createElement("i");
        gap.className = "gap";
        this.el("rates").append(gap);
      }
      this.el("rates").append(button);
    }
    const field = this.el("rate");
    field.addEventListener("change", () => {
      const rate = Number(field.value.trim().replace("−", "-").replace(",", "."));
      const valid = Number.isFinite(rate) && rate !== 0 && Math.abs(rate) <= VrsControls.FASTEST;
      field.setAttribute("aria-invalid", String(!valid));
      if (valid) {
        this.setRate(rate);
        field.blur();
      } else this.say("The rate must be from −8 to 8, but not 0.");
    });
  }

  setRate(rate) {
    this.wish("rate", { rate });
  }

  shiftRate(by) {
    const sizes = VrsControls.RATES.filter((rate) => rate > 0);
    const size = Math.abs(this.state.rate);
    const next = by > 0 ? sizes.find((s) => s > size) : sizes.filter((s) => s < size).pop();
    if (next) this.setRate(Math.sign(this.state.rate) * next);
  }

  static rounded(rate) {
    return String(Math.round(rate * 1e4) / 1e4);
  }
};
VrsControls.FRAME = 1 / 60; // [s], a step
VrsControls.RATES = [-8, -4, -2, -1, 0.25, 0.5, 1, 2, 4, 8];
VrsControls.FASTEST = 8;
