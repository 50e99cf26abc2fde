// Jogging: joints and tool by buttons, keys, sliders and typed numbers, by the stick and by a gamepad; poses.
import { Hand } from "./hand.js";
import { Held, letGo, Needs, SpeedRow } from "./handling.js";
import { POSE } from "./jogging.js";
import { Pad } from "./pad.js";
import { barred, Choice, figure, html, Icon, isTyping, useComputed, useEvery, useOn, useRef, useState } from "./ui.js";

/** Keys of the joints, up and down, the seventh to the twelfth in rows of their own; and of the tool. */
const UP = ["KeyQ", "KeyW", "KeyE", "KeyR", "KeyT", "KeyY", "Digit1", "Digit2", "Digit3", "Digit4", "Digit5", "Digit6"];
const DOWN = ["KeyA", "KeyS", "KeyD", "KeyF", "KeyG", "KeyH", "KeyZ", "KeyX", "KeyC", "KeyV", "KeyB", "KeyN"];
const TOOL = {
  ArrowUp: [0, 1], ArrowDown: [0, -1], ArrowLeft: [1, 1], ArrowRight: [1, -1], PageUp: [2, 1], PageDown: [2, -1],
  KeyU: [3, 1], KeyJ: [3, -1], KeyI: [4, 1], KeyK: [4, -1], KeyO: [5, 1], KeyL: [5, -1],
};
const AXES = ["x", "y", "z", "turn x", "turn y", "turn z"];
/** What the keys move, by their codes: "joint" or "tool", which joint or axis, and the sign. */
export const KEYS = new Map([
  ...UP.map((code, k) => [code, ["joint", k, 1]]), ...DOWN.map((code, k) => [code, ["joint", k, -1]]),
  ...Object.entries(TOOL).map(([code, [axis, sign]]) => [code, ["tool", axis, sign]]),
]);
const STEPS = [[0, "hold"], ...[0.1, 1, 5, 10].map((step) => [step, `${step}° / mm`])];
const FRAMES = [["base", "base frame"], ["tool", "tool frame"]];
const MOTIONS = [["line", "in a line"], ["joint", "by joints"]];
const BEGINS = [["now", "now"], ["append", "after the plan"], ["later", "in …"]];
/** A bar is drawn anew for so small a part of its length: each time takes a moment of a page without a graphics card. */
const GRAINS = 200;
/** Time between two looks at the joints, and at the poses that others save [ms]. */
const [LOOK, POSES] = [100, 2000];
const TURN = "as VAL-II's WHERE has it, in the base frame: R = Rz(O − 90°) Ry(A + 90°) Rz(T)";
const FRAME = "Of the tool's point in the base frame; VAL-II's WHERE tells it in its own world";

/** A key as it's written on it. */
const keyName = (code) => code.replace(/Key|Digit/, "").replace(/(Page|Arrow)(.)/, "$1 $2");
const keyOf = (what) => keyName([...KEYS].find(([, one]) => String(one) === String(what))[0]);

export function Panel({ station }) {
  const { session, steer, jog } = station;
  const { welcome } = session;
  /** The move to what was typed, and in which fields. */
  const asked = useRef({});

  useEvery(LOOK, () => {
    jog.q = station.shown ?? jog.q;
  });
  useOn(window, "keydown", (event) => {
    if (event.repeat || event.ctrlKey || event.altKey || event.metaKey || isTyping(event)) return;
    if (event.target.closest?.("#strip-box, select, [role=tablist], [role=separator], input, dialog")) return;
    const what = KEYS.get(event.code);
    if (!what || !session.holds || (what[0] === "joint" && what[1] >= welcome.dof)) return;
    event.preventDefault();
    station.notices.use(document.querySelector(`[data-jog="${what.join(" ")}"]`));
    if (!jog.once(what)) steer.hold("keys:" + event.code, () => jog.held(what));
  });
  useOn(window, "keyup", (event) => steer.release("keys:" + event.code));
  useOn(session, "outcome", (entry) => {
    if (entry !== asked.current.entry || !entry.outcome.receipt || entry.outcome.receipt.status === "rejected") return;
    jog.settle(asked.current.kind);
    asked.current = {};
  });

  function goTyped(kind, motion) {
    asked.current = { kind, entry: jog.goTyped(kind, motion) };
  }

  if (!welcome) return html`<${Needs} station=${station} id="jog-needs" />`;
  const dof = Math.min(UP.length, welcome.dof);
  return html`
    <${Needs} station=${station} id="jog-needs" />
    <${SpeedRow} speed=${jog.speed}>
      <${Choice} id="jog-step" label="A press is" title="What a press of a button or key does" options=${STEPS} value=${jog.step}
        choose=${(step) => (jog.step = Number(step))} /><//>
    <${Joints} station=${station} dof=${dof} go=${goTyped} />
    <${Tool} station=${station} go=${goTyped} />
    ${station.config.robot.hand ? html`<${Hand} station=${station} />` : ""}
    <${Poses} station=${station} />`;
}

/** A button that jogs. */
function Jog({ station, what, label, children }) {
  const { steer, jog } = station;
  return html`<${Held} steer=${steer} source="jog" aria-label=${label} data-jog=${what.join(" ")} title=${`Key ${keyOf(what)}`}
    why=${steer.idle} input=${() => jog.held(what)} once=${() => jog.once(what)}>${children}<//>`;
}

/** Goes to what is typed. */
function Go({ station, kind, go, children }) {
  return html`<button class="small go" type="button" id=${`go-${kind}`} ...${barred(station.idle, "Go to what is typed")}
    onClick=${go}>${children}</button>`;
}

/** A number as it is, which may be typed: Enter goes there, Escape takes it back. */
function Field({ jog, kind, k, field: { name, sign }, label, title, go }) {
  const shown = useComputed(() => figure(jog.shown[kind].value?.[k], 1));
  const typed = jog.typed[name];

  function key(event) {
    if (event.key === "Enter") go();
    else if (event.key === "Escape") jog.type(name, undefined);
  }

  return html`<label class="field" data-typed=${typed === undefined ? undefined : ""} title=${title}>
    <input id=${`jog-${name}`} inputmode="decimal" autocomplete="off" value=${typed ?? shown.value}
      aria-label=${`${label} in ${sign === "°" ? "degrees" : sign}`} aria-invalid=${jog.wrong === name ? "true" : undefined}
      onFocus=${({ target }) => target.select()} onInput=${({ target }) => jog.type(name, target.value)} onKeyDown=${key} />
    <span aria-hidden="true">${sign}</span></label>`;
}

function Joints({ station, dof, go }) {
  const { jog } = station;
  const fields = jog.fields("joints").slice(0, dof);
  const further = dof === 7 ? ", 1 and Z" : `, 1 to ${dof - 6}, Z to ${keyName(DOWN[dof - 1])}`;
  const more = dof > 6 ? further : "";
  const last = Math.min(6, dof) - 1;
  return html`<section>
    <div class="head"><h2>Joints</h2>
      <span class="hint">keys Q to ${keyName(UP[last])} up, A to ${keyName(DOWN[last])} down${more}</span>
      <${Go} station=${station} kind="joints" go=${() => go("joints")}>Go<//></div>
    <div class="joints" role="group" aria-label="Joints">
      ${fields.map((field, k) => html`<div class="joint"><span class="name" title=${field.called}>${field.name}</span>
        <${Jog} station=${station} what=${["joint", k, -1]} label=${`Joint ${k + 1} down`}>−<//>
        <${Slider} station=${station} k=${k} field=${field} go=${() => go("joints")} />
        <${Field} jog=${jog} kind="joints" k=${k} field=${field} label=${`Joint ${k + 1}`} go=${() => go("joints")}
          title=${`${figure(field.low, 1)} to ${figure(field.high, 1)} ${field.sign}`} />
        <${Jog} station=${station} what=${["joint", k, 1]} label=${`Joint ${k + 1} up`}>+<//></div>`)}
    </div></section>`;
}

/** A joint between its limits: drawn to another value, it moves there when it's let go. */
function Slider({ station, k, field: { name, low, high }, go }) {
  const { jog } = station;
  const typed = Number(jog.typed[name] ?? NaN);
  const grain = (high - low) / GRAINS;
  const shown = useComputed(() => (jog.q ? Math.round(jog.shown.joints.value[k] / grain) * grain : low));
  const why = station.idle;

  function drop() {
    go();
    if (why) jog.type(name, undefined);
  }

  return html`<input class="slide" type="range" min=${low} max=${high} step="any" aria-label=${`Joint ${k + 1}, drawn`}
    ...${barred(why, "Draw it to another value: the joint moves when you let go")}
    value=${Number.isFinite(typed) ? typed : shown.value} onChange=${drop} onPointerUp=${letGo}
    onInput=${({ target }) => jog.type(name, Number(target.value).toFixed(1))} />`;
}

function Tool({ station, go }) {
  const { jog } = station;
  const [motion, setMotion] = useState("line");
  const fields = jog.fields("pose");
  const goes = () => go("pose", motion);
  const button = (k, sign, text) => {
    const label = `${k < 3 ? `Tool along ${AXES[k]}` : `Tool: ${AXES[k]}`}, ${sign < 0 ? "minus" : "plus"}`;
    return html`<${Jog} station=${station} what=${["tool", k, sign]} label=${label}>${text}<//>`;
  };
  const field = (k) => html`<${Field} jog=${jog} kind="pose" k=${k} field=${fields[k]} go=${goes}
    label=${k < 3 ? `Tool's ${POSE[k]}` : `Tool's angle ${POSE[k]}`}
    title=${k < 3 ? FRAME : `Turn of the tool, ${TURN}`} />`;
  return html`<section>
    <div class="head"><h2>Tool</h2>
      <${Choice} id="jog-frame" label="Frame of the tool's axes" options=${FRAMES} value=${jog.frame}
        choose=${(to) => (jog.frame = to)} />
      <span class="grow"></span>
      <${Choice} id="pose-motion" label="How the tool goes to what is typed" options=${MOTIONS} value=${motion}
        choose=${setMotion} />
      <${Go} station=${station} kind="pose" go=${goes}>Go<//></div>
    <div class="axes" role="group" aria-label="Tool">
      ${[0, 1, 2].map((k) => html`<div class="axis">
        <span>${POSE[k]}</span>${button(k, -1, "−")}${field(k)}${button(k, 1, "+")}
        <span>${AXES[k + 3]}</span>${button(k + 3, -1, "−")}${button(k + 3, 1, "+")}
        <span>${POSE[k + 3]}</span>${field(k + 3)}</div>`)}
    </div></section>`;
}

function Poses({ station }) {
  const { jog, session } = station;
  const name = useRef(null);
  const why = station.idle;
  const pose = ([title, q]) => html`<button type="button" data-pose=${title} ...${barred(why)}
    onClick=${() => jog.go({ target: { type: "joints", q } }, title)}>${title}</button>`;
  const views = session.mayCommand ? "" : "viewers save and delete no poses";

  useEvery(POSES, () => session.link === "live" && jog.poses());

  async function save(event) {
    event.preventDefault();
    const wrong = views || (await jog.save(name.current.value.trim()));
    station.refuse(wrong);
    if (!wrong) name.current.value = "";
  }

  async function remove(title) {
    station.refuse(views || (await jog.poses({ name: title })));
  }

  return html`<section>
    <div class="head"><h2>Go to</h2><span class="grow"></span><label for="when">Begin</label>
      <${Choice} id="when" label="When to begin" options=${BEGINS} value=${jog.begin} choose=${(to) => (jog.begin = to)} />
      <input id="later" type="number" min="0.5" max="600" step="0.5" value=${jog.later} hidden=${jog.begin !== "later"}
        aria-label="Seconds from now" onInput=${({ target }) => (jog.later = target.value)} /></div>
    <div class="goes"><div>
      <div class="poses" role="group" aria-label="Named poses">${Object.entries(session.welcome.poses).map(pose)}</div>
      <form class="row" onSubmit=${save}><input id="pose-name" ref=${name} maxlength="40" size="10" autocomplete="off"
          aria-label="Name of a pose to save" placeholder="Name" title="The server keeps poses: everyone has them" />
        <button id="pose-save" ...${barred(views, "Save the joints that are shown, for everyone")}>Save</button></form></div>
      <div class="pad-row"><${Pad} station=${station} twist=${(parts) => jog.twist(parts)} why=${station.steer.idle} /></div>
    </div>
    <div class="poses" role="group" aria-label="Saved poses" hidden=${Object.keys(jog.saved).length === 0}>
      ${Object.entries(jog.saved).map(([title, q]) => html`<span class="saved">${pose([title, q])}
        <button class="quiet" type="button" aria-label=${`Delete pose ${title}`} ...${barred(views, "Delete it, for everyone")}
          onClick=${() => remove(title)}><${Icon} name="delete" /></button></span>`)}</div></section>`;
}
