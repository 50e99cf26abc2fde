// Turning the robot's camera: by buttons that are held, by keys, and by dragging its picture. Who has control may.
import { isTyping } from "./ui.js";

/** Time between two messages [ms], and how fast a button or key turns the camera [rad/s]. */
const PERIOD = 100;
const SPEED = 0.7;

export class Gaze {
  /**
   * @param {object} session knows who has control
   * @param {Function} facts what the server says of the camera; null before
   * @param {Function} send takes a message to the server
   * @param {Function} refuse says why it isn't done
   */
  constructor(session, facts, send, refuse) {
    this.session = session;
    this.facts = facts;
    this.send = send;
    this.refuse = refuse;
    /** Where it's to look, while somebody turns it; null otherwise. */
    this.target = null;
    this.inputs = new Map();
    this.timer = null;
    this.sent = 0;
  }

  /** Turn as an input says until it's released; whether that's begun. */
  hold(source, input, ended) {
    if (!this.may()) {
      ended();
      return false;
    }
    this.inputs.set(source, input);
    this.target ??= this.facts().target;
    this.step();
    this.timer ??= setInterval(() => this.step(), PERIOD);
    return true;
  }

  release(source) {
    this.inputs.delete(source);
    if (this.inputs.size > 0) return;
    clearInterval(this.timer);
    this.timer = this.target = null;
  }

  may() {
    const may = this.session.holds && this.facts() !== null;
    this.refuse(may ? "" : "Take control first: who has control moves the camera.");
    return may;
  }

  step() {
    const step = (SPEED * PERIOD) / 1000;
    let [pan, tilt] = this.target;
    for (const input of this.inputs.values()) {
      const [left, up] = input();
      pan += step * left;
      tilt += step * up;
    }
    this.aim(pan, tilt);
  }

  /** Look there, as far as the limits let it. */
  aim(pan, tilt) {
    const [right, left, down, up] = this.facts().limits;
    this.target = [Math.min(Math.max(pan, right), left), Math.min(Math.max(tilt, down), up)];
    this.send({ do: "aim", session: this.session.key, epoch: String(this.session.epoch), pan: this.target[0], tilt: this.target[1] });
  }

  /** Look ahead. */
  ahead() {
    if (!this.may()) return;
    this.aim(0, 0);
    this.target = null;
  }

  /** Let who drags an element with the picture in it drag what is seen, while that's of use. */
  drag(stage, isUsed) {
    let last = null;
    stage.addEventListener("pointerdown", (event) => {
      if (event.button !== 0 || !isUsed() || !this.may()) return;
      stage.setPointerCapture(event.pointerId);
      last = { at: [event.clientX, event.clientY], target: this.facts().target };
    });
    stage.addEventListener("pointermove", (event) => {
      if (!last || performance.now() < this.sent + PERIOD) return;
      this.sent = performance.now();
      const scale = this.facts().view / stage.clientWidth;
      this.aim(last.target[0] + (event.clientX - last.at[0]) * scale, last.target[1] + (event.clientY - last.at[1]) * scale);
    });
    stage.addEventListener("lostpointercapture", () => (last = this.target = null));
  }

  /** Let keys turn it while that's of use. */
  keys(keys, ahead, isUsed) {
    window.addEventListener("keydown", (event) => {
      if (event.ctrlKey || event.altKey || event.metaKey || event.repeat || isTyping(event) || !isUsed()) return;
      if (!this.session.holds) return;
      if (event.code === ahead) this.ahead();
      else if (keys[event.code]) this.hold(event.code, () => keys[event.code], () => {});
    });
    window.addEventListener("keyup", (event) => this.inputs.has(event.code) && this.release(event.code));
    window.addEventListener("blur", () => [...this.inputs.keys()].forEach((source) => this.release(source)));
  }
}
