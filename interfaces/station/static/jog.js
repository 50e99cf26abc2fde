// Jogging: joints and tool by buttons that are held, by keys, by the stick on the page and by a gamepad; named poses.
import { degrees, h, isTyping, mark, write } from "./dom.js";
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

  const speed = h("input", { id: "speed", type: "range", min: 5, max: 100, step: 5 });
  speed.value = localStorage.getItem(SPEED) ?? "30";
  const speedText = h("output", { for: "speed" });
  const showSpeed = () => {
    localStorage.setItem(SPEED, speed.value);
    write(speedText, speed.value + " %");
  };
  speed.addEventListener("input", showSpeed);
  showSpeed();
  const share = () => Number(speed.value) / 100;

  const shared = (station.shared.jog = {
    get share() { return share(); },
    get frame() { return frame; },
    /** A twist of a share of the full speed along, or about, an axis of the tool's frame. */
    twist(parts) {
      const scale = (part, k) => part * share() * (k < 3 ? robot.tool_speed : robot.tool_turn_speed);
      return { twist: parts.map(scale), frame };
    },
    rates(index, sign) {
      const most = session.welcome.limits.qd_max;
      return { rates: most.map((rate, k) => (k === index ? sign * share() * rate : 0)) };
    },
  });

  const needs = h("p.needs", { id: "jog-needs" });
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
    needs,
    h("div.row.speed", {}, h("label", { for: "speed" }, "Speed"), speed, speedText),
    section("Joints", "keys Q to Y up, A to H down", bars),
    section("Tool", "arrows, Page Up, Page Down", axes, frames),
    section("Go to", "", target),
  );
  mountPad(station, pad, steer, shared);

  function section(title, hint, content, extra = null) {
    const head = h("div.head", {}, h("h2", {}, title), hint ? h("span.hint", {}, hint) : null, extra);
    return h("section", {}, head, content);
  }

  /** A button that steers for as long as it's held, by pointer or by Enter. */
  function held(label, text, input) {
    const button = h("button.held", { type: "button", "aria-label": label, "aria-pressed": "false" }, text);
    const start = () => mark(button, "aria-pressed", String(steer.hold("jog", input, () => up(button))));
    const end = () => {
      up(button);
      steer.release("jog");
    };
    button.addEventListener("pointerdown", (event) => {
      if (event.button !== 0) return;
      button.setPointerCapture(event.pointerId);
      start();
    });
    for (const type of ["pointerup", "pointercancel", "lostpointercapture"]) {
      button.addEventListener(type, () => button.getAttribute("aria-pressed") === "true" && end());
    }
    button.addEventListener("keydown", (event) => event.key === "Enter" && !event.repeat && start());
    button.addEventListener("keyup", (event) => event.key === "Enter" && end());
    button.addEventListener("blur", () => button.getAttribute("aria-pressed") === "true" && end());
    button.addEventListener("contextmenu", (event) => event.preventDefault());
    return button;
  }

  function up(button) {
    mark(button, "aria-pressed", "false");
  }

  AXES.forEach((name, k) => {
    const along = (sign) => () => shared.twist([0, 1, 2, 3, 4, 5].map((other) => (other === k ? sign : 0)));
    const label = k < 3 ? `Tool along ${name}` : `Tool: ${name}`;
    const keys = Object.entries(TOOL).filter(([, [axis]]) => axis === k).map(([code]) => code.replace("Key", ""));
    axes.append(h("div.axis", { title: `Keys ${keys.join(" and ")}` }, held(label + ", minus", "−", along(-1)), h("span", {}, name),
      held(label + ", plus", "+", along(1))));
  });

  function build() {
    const { limits, poses: named, dof } = session.welcome;
    if (joints.length === dof) return;
    joints = Array.from({ length: dof }, (_, k) => {
      const value = h("span.value");
      const bar = h("i");
      const name = `Joint ${k + 1}`;
      bars.append(h("div.joint", {}, h("span.name", {}, "J" + (k + 1)),
        held(name + " down", "−", () => shared.rates(k, -1)),
        h("span.track", { "aria-hidden": "true" }, bar), value, held(name + " up", "+", () => shared.rates(k, 1))));
      return { value, bar, low: limits.q_min[k], high: limits.q_max[k] };
    });
    for (const [name, q] of Object.entries(named)) {
      poses.append(h("button", { type: "button", "data-pose": name, onclick: () => go(name, q) }, name));
    }
  }

  function go(name, q) {
    const command = { type: "move", target: { type: "joints", q }, speed: share() };
    if (when.value === "now") command.insertion = "replace";
    else if (when.value === "append") command.insertion = "append";
    else command.execute_at = session.now + Math.max(0.5, Number(later.value) || 0.5);
    session.order(command, name);
  }

  window.addEventListener("keydown", (event) => {
    if (event.repeat || event.ctrlKey || event.altKey || event.metaKey || isTyping(event)) return;
    if (event.target.closest?.("#strip-box, select, [role=tablist], [role=separator], input, dialog")) return;
    const input = keyed(event.code);
    if (!input || !session.holds) return;
    event.preventDefault();
    steer.hold("keys:" + event.code, input);
  });
  window.addEventListener("keyup", (event) => steer.release("keys:" + event.code));

  function keyed(code) {
    if (UP.includes(code) && UP.indexOf(code) < joints.length) return () => shared.rates(UP.indexOf(code), 1);
    if (DOWN.includes(code) && DOWN.indexOf(code) < joints.length) return () => shared.rates(DOWN.indexOf(code), -1);
    const axis = TOOL[code];
    return axis ? () => shared.twist([0, 1, 2, 3, 4, 5].map((k) => (k === axis[0] ? axis[1] : 0))) : null;
  }

  function show() {
    const ready = session.holds && session.link === "live";
    box.toggleAttribute("data-idle", !ready);
    const { lease } = session;
    const why = session.link !== "live" ? "No connection." : session.mayCommand ? "" : "You are here to watch.";
    const wait = lease.state === "held" ? `${lease.holder} has control.` : "Take control first, in the bar above.";
    write(needs, ready ? "" : why || wait);
    needs.hidden = ready;
  }

  /** The joints of the picture, ten times a second. */
  setInterval(() => {
    const q = station.shared.pane?.shown ?? (session.now === null ? null : session.timeline?.joints(session.now));
    if (!q) return;
    joints.forEach(({ value, bar, low, high }, k) => {
      write(value, degrees(q[k]));
      bar.style.left = `${Math.max(0, Math.min(100, (100 * (q[k] - low)) / (high - low)))}%`;
    });
  }, 100);

  for (const type of ["lease", "link"]) station.on(type, show);
  station.on("welcome", () => {
    build();
    show();
  });
  if (session.welcome) build();
  show();
}
