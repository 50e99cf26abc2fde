// The seek bar: the place in time, marks of what happened, the loop.
"use strict";

window.VrsSeekBar = class {
  // wish(what, more) asks the server; name(k) is what stands before what recording k tells.
  constructor(wish, name) {
    this.wish = wish;
    this.name = name;
    this.state = null; // what the server said last
    this.marks = [[], []];
    this.hidden = new Set();
    this.dragged = null; // time under the pointer while the bar is dragged [s]
    this.range = null; // loop under way: where the drag began [s]
    this.ticked = "";
    this.spoken = "";
    this.sent = 0;
    this.waiting = null;
    this.listen();
    this.makeHandle("loop-start", 0);
    this.makeHandle("loop-end", 1);
    this.makeKinds();
    new ResizeObserver(() => {
      this.drawTicks();
      if (this.state) this.draw();
    }).observe(this.el("bar"));
  }

  el(id) {
    return document.getElementById(id);
  }

  bounds() {
    return this.state ? this.state.span : [0, 1];
  }

  share(t) {
    const [start, end] = this.bounds();
    return end > start ? Math.min(1, Math.max(0, (t - start) / (end - start))) : 0;
  }

  percent(t) {
    return 100 * this.share(t) + "%";
  }

  timeAt(x) {
    const box = this.el("bar").getBoundingClientRect();
    const [start, end] = this.bounds();
    return start + Math.min(1, Math.max(0, (x - box.left) / box.width)) * (end - start);
  }

  // What the server says.
  setLanes(count) {
    this.el("marks").dataset.lanes = String(count);
  }

  takeMarks(message) {
    this.marks[message.index] = message.marks.filter((mark) => mark.kind in VrsSeekBar.KINDS);
    this.drawMarks();
  }

  show(next) {
    const before = this.state;
    this.state = next;
    if (!before || before.span[0] !== next.span[0] || before.span[1] !== next.span[1]) this.drawMarks();
    this.draw();
  }

  draw() {
    const el = this.el;
    const { seconds } = VrsSeekBar;
    const { loop, mode, span } = this.state;
    const t = this.dragged === null ? this.state.t : this.dragged;
    VrsScene.write(el("clock"), seconds(t, 3));
    VrsScene.write(el("end"), seconds(span[1]));
    el("head").style.left = el("played").style.width = this.percent(t);
    for (const id of ["loop-range", "loop-start", "loop-end"]) el(id).hidden = !loop;
    if (loop) {
      this.drawRange(...loop);
      this.setSlider(el("loop-start"), loop[0]);
      this.setSlider(el("loop-end"), loop[1]);
      el("loop-start").style.left = this.percent(loop[0]);
      el("loop-end").style.left = this.percent(loop[1]);
    }
    const spoken = loop + " " + Math.round(20 * t) + " " + mode + " " + span;
    if (spoken !== this.spoken) {
      this.spoken = spoken;
      this.setSlider(el("bar"), t);
    }
  }

  setSlider(element, t) {
    const [start, end] = this.bounds();
    element.setAttribute("aria-valuemin", start.toFixed(2));
    element.setAttribute("aria-valuemax", end.toFixed(2));
    element.setAttribute("aria-valuenow", t.toFixed(2));
    element.setAttribute("aria-valuetext", VrsSeekBar.seconds(t));
  }

  drawRange(a, b) {
    const range = this.el("loop-range");
    range.hidden = false;
    range.style.left = this.percent(Math.min(a, b));
    range.style.width = 100 * Math.abs(this.share(b) - this.share(a)) + "%";
  }

  drawMarks() {
    const found = [];
    const counts = {};
    this.marks.forEach((lane, k) => {
      for (const mark of lane) {
        counts[mark.kind] = (counts[mark.kind] || 0) + 1;
        if (this.hidden.has(mark.kind)) continue;
        const shape = VrsSeekBar.makeMark(mark.kind);
        shape.classList.add("lane-" + k);
        shape.style.left = this.percent(mark.t);
        found.push(shape);
      }
    });
    this.el("marks").replaceChildren(...found);
    for (const button of this.el("kinds").children) {
      const count = counts[button.dataset.kind] || 0;
      button.hidden = !count;
      VrsScene.write(button.querySelector("em"), String(count));
    }
    this.drawTicks();
  }

  drawTicks() {
    const [start, end] = this.bounds();
    const width = this.el("bar").clientWidth;
    const key = start + " " + end + " " + width;
    if (key === this.ticked || !width) return;
    this.ticked = key;
    const least = ((end - start) * 90) / width;
    const step = VrsSeekBar.STEPS.find((s) => s >= least) || 14400;
    const found = [];
    for (let k = Math.ceil(start / step - 1e-9); k * step <= end + 1e-9; k++) {
      const tick = document.createElement("span");
      tick.textContent = step < 1 ? (k * step).toFixed(1) : String(Math.round(k * step));
      tick.style.left = this.percent(k * step);
      found.push(tick);
    }
    this.el("ticks").replaceChildren(...found);
  }

  // Which marks are shown.
  makeKinds() {
    for (const [kind, name] of Object.entries(VrsSeekBar.KINDS)) {
      const button = document.createElement("button");
      button.type = "button";
      button.dataset.kind = kind;
      button.hidden = true;
      button.setAttribute("aria-pressed", "true");
      button.append(VrsSeekBar.makeMark(kind), name, document.createElement("em"));
      button.addEventListener("click", () => {
        if (!this.hidden.delete(kind)) this.hidden.add(kind);
        button.setAttribute("aria-pressed", String(!this.hidden.has(kind)));
        this.drawMarks();
      });
      this.el("kinds").append(button);
    }
  }

  // Seeking: at most so often, and the last place always.
  seek(t) {
    clearTimeout(this.waiting);
    const left = this.sent + VrsSeekBar.SEEKING - performance.now();
    if (left <= 0) {
      this.sent = performance.now();
      this.wish("seek", { t });
    } else this.waiting = setTimeout(() => this.seek(t), left);
  }

  drag(t) {
    this.dragged = t;
    this.seek(t);
    this.draw();
  }

  listen() {
    const bar = this.el("bar");
    bar.addEventListener("pointerdown", (event) => {
      if (event.button || !this.state) return;
      bar.setPointerCapture(event.pointerId);
      const t = this.timeAt(event.clientX);
      if (event.shiftKey) this.range = t;
      else this.drag(this.snapped(event) ?? t);
    });
    bar.addEventListener("pointermove", (event) => {
      this.point(event);
      if (this.range !== null) this.drawRange(this.range, this.timeAt(event.clientX));
      else if (this.dragged !== null) this.drag(this.timeAt(event.clientX));
    });
    const end = (event) => {
      if (this.range !== null) {
        const [a, b] = [this.range, this.timeAt(event.clientX)].sort((x, y) => x - y);
        this.range = null;
        this.el("loop-range").hidden = true;
        if (b - a > 0.01) this.wish("loop", { start: a, end: b });
      }
      this.dragged = null;
    };
    bar.addEventListener("pointerup", end);
    bar.addEventListener("pointercancel", end);
    bar.addEventListener("pointerleave", () => {
      for (const id of ["pointer", "tip", "span"]) this.el(id).hidden = true;
    });
  }

  // Marks near the pointer, the nearest first.
  near(event) {
    const box = this.el("bar").getBoundingClientRect();
    const x = event.clientX - box.left;
    const found = [];
    this.marks.forEach((lane, k) => {
      for (const mark of lane) {
        const far = Math.abs(this.share(mark.t) * box.width - x);
        if (far <= VrsSeekBar.NEAR && !this.hidden.has(mark.kind)) found.push({ ...mark, k, far });
      }
    });
    return found.sort((a, b) => a.far - b.far);
  }

  snapped(event) {
    const overMarks = event.clientY < this.el("track").getBoundingClientRect().top;
    const found = overMarks ? this.near(event) : [];
    return found.length ? found[0].t : null;
  }

  point(event) {
    if (!this.state) return;
    const el = this.el;
    const found = this.near(event);
    const t = this.timeAt(event.clientX);
    el("pointer").hidden = false;
    el("pointer").style.left = this.percent(t);
    const line = (...parts) => {
      const p = document.createElement("p");
      p.append(...parts);
      return p;
    };
    const head = document.createElement("b");
    head.textContent = VrsSeekBar.seconds(t);
    const lines = [line(head)];
    for (const mark of found.slice(0, 4))
      for (const text of mark.texts) {
        const span = document.createElement("span");
        span.textContent = this.name(mark.k) + text;
        lines.push(line(VrsSeekBar.makeMark(mark.kind), span));
      }
    const spanned = found.find((mark) => mark.span);
    el("span").hidden = !spanned;
    if (spanned) {
      const [first, last] = spanned.span;
      el("span").style.left = this.percent(first);
      el("span").style.width = Math.max(0.15, 100 * (this.share(last) - this.share(first))) + "%";
    }
    const tip = el("tip");
    tip.replaceChildren(...lines);
    tip.hidden = false;
    const box = el("bar").getBoundingClientRect();
    const left = Math.min(window.innerWidth - tip.offsetWidth - 8, Math.max(8, event.clientX - tip.offsetWidth / 2));
    tip.style.left = left + "px";
    tip.style.top = box.top - tip.offsetHeight - 8 + "px";
  }

  // A handle of the loop: dragged, or moved by arrow keys.
  makeHandle(id, k) {
    const handle = this.el(id);
    const move = (t) => {
      if (!this.state || !this.state.loop) return;
      const loop = [...this.state.loop];
      const [start, end] = this.bounds();
      loop[k] = k ? Math.min(end, Math.max(t, loop[0] + 0.02)) : Math.max(start, Math.min(t, loop[1] - 0.02));
      this.wish("loop", { start: loop[0], end: loop[1] });
    };
    let last = 0;
    handle.addEventListener("pointerdown", (event) => {
      handle.setPointerCapture(event.pointerId);
      event.stopPropagation();
    });
    handle.addEventListener("pointermove", (event) => {
      if (!handle.hasPointerCapture(event.pointerId) || performance.now() - last < VrsSeekBar.SEEKING) return;
      last = performance.now();
      move(this.timeAt(event.clientX));
    });
    handle.addEventListener("pointerup", (event) => move(this.timeAt(event.clientX)));
    handle.addEventListener("keydown", (event) => {
      const by = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
      if (!by) return;
      event.preventDefault();
      event.stopPropagation();
      move(this.state.loop[k] + by * (event.shiftKey ? 1 : 0.1));
    });
  }

  static makeMark(kind) {
    const svg = document.createElementNS("http://www.w3.org/2000/svg", "svg");
    svg.setAttribute("class", "mark kind-" + kind);
    svg.setAttribute("viewBox", "0 0 12 12");
    const use = document.createElementNS("http://www.w3.org/2000/svg", "use");
    use.setAttribute("href", "#m-" + kind);
    svg.append(use);
    return svg;
  }

  static seconds(t, digits = 2) {
    return t.toFixed(digits) + " s";
  }
};
VrsSeekBar.SEEKING = 33; // [ms] between two wishes while the bar is dragged
VrsSeekBar.NEAR = 7; // [px] within which a mark is pointed at
VrsSeekBar.STEPS = [0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 30, 60, 120, 300, 600, 1200, 1800, 3600, 7200]; // [s] between ticks
VrsSeekBar.KINDS = {
  command: "Command",
  postponed: "Postponed",
  rejected: "Rejected",
  falsified: "Changed a prediction",
  corrected: "Correction",
  stopped: "Robot stopped",
  link: "Link",
  other: "Other",
};
