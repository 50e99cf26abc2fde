// Jogging: joints and tool by buttons that are held, by keys, by the stick on the page and by a gamepad; named poses.
import { degrees, figure, h, isTyping, write } from "./dom.js";
import { held, needs, Speed } from "./handling.js";
import { mountPad } from "./pad.js";
import { steering } from "./steer.js";

/** Keys of the joints, up and down, and of the tool. */
const UP = ["KeyQ", "KeyW", "KeyE", "KeyR", "KeyT", "KeyY"];
const DOWN = ["KeyA", "KeyS", "KeyD", "KeyF", "KeyG", "KeyH"];
const TOOL = {
  ArrowUp: [0, 1], ArrowDown: [0, -1], ArrowLeft: [1, 1], ArrowRight: [1, -1], PageUp: [2, 1], PageDown: [2, -1],
  KeyU: [3, 1], KeyJ: [3, -1], KeyI: [4, 1], KeyK: [4, -1], KeyO: [5, 1], KeyL: [5, -1],
};
const AXES = ["x", "y", "z", "turn x", "turn y", "turn z"];
const SPEED = "vrs-speed";

export function mount(station, box) {
  const session = station.session;
  const steer = steering(station);
  const robot = station.config.robot;
  let joints = [];
  let frame = "base";

  const speed = new Speed(SPEED, "30");

  const shared = (station.shared.jog = {
    get share() { return speed.share; },
    get frame() { return frame; },
    /** A twist of a share of the full speed along, or about, an axis of the tool's frame. */
    twist(parts) {
      const scale = (part, k) => part * speed.share * (k < 3 ? robot.tool_speed : robot.tool_turn_speed);
      return { twist: parts.map(scale), frame };
    },
    rates(index, sign) {
      const most = session.welcome.limits.qd_max;
      return { rates: most.map((rate, k) => (k === index ? sign * speed.share * rate : 0)) };
    },
  });

  const bars = h("div.joints", { role: "group", "aria-label": "Joints" });
  const frames = h("select", { id: "jog-frame", "aria-label": "Frame of the tool's axes" },
    h("option", { value: "base" }, "base frame"), h("option", { value: "tool" }, "tool frame"));
  frames.addEventListener("change", () => (frame = frames.value));
  const axes = h("div.axes", { role: "group", "aria-label": "Tool" });
  const poses = h("div.poses", { role: "group", "aria-label": "Named poses" });
  const when = h("select", { id: "when", "aria-label": "When to begin" },
    h("option", { value: "now" }, "now"), h("option", { value: "append" }, "after the plan"),
    h("option", { value: "later" }, "in …"));
  const later = h("input", { id: "later", type: "number", min: 0.5, max: 600, step: 0.5, value: 5, hidden: true,
    "aria-label": "Seconds from now" });
  when.addEventListener("change", () => (later.hidden = when.value !== "later"));
  const pad = h("div.pad-row");
  const target = h("div.go", {}, h("div", {}, poses, h("div.row.when", {}, h("label", { for: "when" }, "Begin"), when, later)), pad);
  box.append(
    needs(station, box, "jog-needs"),
    speed.row,
    section("Joints", "keys Q to Y up, A to H down", bars),
    section("Tool", "arrows, Page Up, Page Down", axes, frames),
    section("Go to", "", target),
  );
  mountPad(station, pad, steer, shared);

  function section(title, hint, content, extra = null) {
    const head = h("div.head", {}, h("h2", {}, title), hint ? h("span.hint", {}, hint) : null, extra);
    return h("section", {}, head, content);
  }

  /** The buttons, by the joint or the axis of the tool and the sign. */
  const buttons = new Map();
  function button(what, label, text, input) {
    buttons.set(what, held(steer, "jog", { "aria-label": label }, text, input));
    return buttons.get(what);
  }

  AXES.forEach((name, k) => {
    const along = (sign) => () => shared.twist([0, 1, 2, 3, 4, 5].map((other) => (other === k ? sign : 0)));
    const label = k < 3 ? `Tool along ${name}` : `Tool: ${name}`;
    const keys = Object.entries(TOOL).filter(([, [axis]]) => axis === k).map(([code]) => code.replace("Key", ""));
    axes.append(h("div.axis", { title: `Keys ${keys.join(" and ")}` }, button(`tool ${k} -1`, label + ", minus", "−", along(-1)),
      h("span", {}, name), button(`tool ${k} 1`, label + ", plus", "+", along(1))));
  });

  function build() {
    const { limits, poses: named, dof } = session.welcome;
    if (joints.length === dof) return;
    joints = Array.from({ length: dof }, (_, k) => {
      const value = h("span.value");
      const bar = h("i");
      const name = `Joint ${k + 1}`;
      bars.append(h("div.joint", {}, h("span.name", {}, "J" + (k + 1)),
        button(`joint ${k} -1`, name + " down", "−", () => shared.rates(k, -1)),
        h("span.track", { "aria-hidden": "true" }, bar), value, button(`joint ${k} 1`, name + " up", "+", () => shared.rates(k, 1))));
      return { value, bar, low: limits.q_min[k], high: limits.q_max[k] };
    });
    for (const [name, q] of Object.entries(named)) {
      poses.append(h("button", { type: "button", "data-pose": name, onclick: () => go(name, q) }, name));
    }
  }

  function go(name, q) {
    const command = { type: "move", target: { type: "joints", q }, speed: speed.share };
    if (when.value === "now") command.insertion = "replace";
    else if (when.value === "append") command.insertion = "append";
    else command.execute_at = session.now + Math.max(0.5, Number(later.value) || 0.5);
    session.order(command, name);
  }

  window.addEventListener("keydown", (event) => {
    if (event.repeat || event.ctrlKey || event.altKey || event.metaKey || isTyping(event)) return;
    if (event.target.closest?.("#strip-box, select, [role=tablist], [role=separator], input, dialog")) return;
    const [what, input] = keyed(event.code);
    if (!input || !session.holds) return;
    event.preventDefault();
    station.notices.use(buttons.get(what));
    steer.hold("keys:" + event.code, input);
  });
  window.addEventListener("keyup", (event) => steer.release("keys:" + event.code));

  function keyed(code) {
    for (const [codes, sign] of [[UP, 1], [DOWN, -1]]) {
      const joint = codes.indexOf(code);
      if (joint >= 0 && joint < joints.length) return [`joint ${joint} ${sign}`, () => shared.rates(joint, sign)];
    }
    const [axis, sign] = TOOL[code] ?? [];
    if (axis === undefined) return ["", null];
    return [`tool ${axis} ${sign}`, () => shared.twist([0, 1, 2, 3, 4, 5].map((k) => (k === axis ? sign : 0)))];
  }

  /** The joints of the picture, ten times a second. */
  setInterval(() => {
    const q = station.shown;
    if (!q) return;
    joints.forEach(({ value, bar, low, high }, k) => {
      write(value, station.chain.slides(k) ? `${figure(q[k], 3)} m` : degrees(q[k]));
      bar.style.left = `${Math.max(0, Math.min(100, (100 * (q[k] - low)) / (high - low)))}%`;
    });
  }, 100);

  station.addEventListener("cursor", () => box.toggleAttribute("data-blind", steer.blind));
  station.on("welcome", build);
  if (session.welcome) build();
}
