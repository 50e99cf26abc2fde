// The play-back page: what the server says of the one play head, a scene for each recording, and their plots.
import { Controls, Help, rounded } from "./controls.js";
import { Door } from "./door.js";
import { Side } from "./recorded.js";
import { KINDS, Kinds, MarkShape, SeekBar } from "./seekbar.js";
import "./theme.js";
import { clockText, html, observed, render, useEffect, useRef } from "./ui.js";

const NAMES = ["A", "B"];
/** What an error is called and how it's written, by its unit. */
const ERRORS = {
  rad: ["Largest joint error", (error) => ((error * 180) / Math.PI).toFixed(3) + "°"],
  m: ["Path error", (error) => (100 * error).toFixed(2) + " cm"],
};
const LEGEND = [
  ["virtual", "Virtual robot", " (ghost, as commanded)"],
  ["real", "Real robot", " (solid, as measured)"],
  ["committed", "Committed path", " (as known then)"],
  ["driven", "Paths driven", ""],
  ["learned", "Learned obstacles", ""],
];
/** What a mobile robot's recording may show, beside what every one does. */
const OWN = ["driven", "learned"];
/** So long stands what is said [ms]. */
const SAID = 4000;
const decoder = new TextDecoder();
const same = (a, b) => JSON.stringify(a) === JSON.stringify(b);

/** What is known of the play-back, as fields that components follow by reading them. */
class Replay {
  constructor() {
    observed(this, {
      /** How the connection is; what stands in the way of the recordings, from a server that opens them when they're asked for. */
      link: "connecting", standing: null, refused: false,
      items: [], marks: [[], []], hidden: new Set(),
      /** Of what the server said last, what seldom changes, and what changes thirty times a second. */
      known: false, span: [0, 1], loop: null, mode: "paused", rate: 1, growing: false, t: 0, panes: [], latest: null,
      /** Time under the pointer while the bar is dragged [s]; a line that stands for a while; whether plots are shown. */
      dragged: null, said: "", plotted: false,
    });
    this.views = [];
    this.letter = (k) => (this.items.length > 1 ? `${NAMES[k]} · ` : "");
    this.wish = (what, more) => this.board.send(JSON.stringify({ do: what, ...more }));
    this.board = new window.VrsLink("/replay/board" + location.search, [], {
      take: (data) => this.take(JSON.parse(typeof data === "string" ? data : decoder.decode(data))),
      state: (link) => {
        if (link === "token") {
          this.refused = sessionStorage.getItem("token") !== null;
          sessionStorage.removeItem("token");
        }
        this.link = link;
      },
    });
    this.board.connect();
  }

  /** The time that is shown [s], and as it's told to screen readers. */
  get shown() {
    return this.dragged ?? this.t;
  }

  get spoken() {
    return Math.round(20 * this.shown) / 20;
  }

  take(message) {
    if (message.kind === "recordings") this.items = message.items;
    else if (message.kind === "marks") {
      const marks = message.marks.filter(({ kind }) => kind in KINDS);
      this.marks = this.marks.map((lane, k) => (k === message.index ? marks : lane));
    } else if (message.kind === "state") this.follow(message);
    else if (message.kind === "refused") this.say(message.text);
    else if (["opening", "open", "failed"].includes(message.kind)) this.standing = message;
  }

  follow(state) {
    this.state = state;
    // What is equal stays the same object, and draws nothing.
    for (const name of ["span", "loop"]) if (!same(this[name], state[name])) this[name] = state[name];
    for (const name of ["mode", "rate", "growing", "t", "panes"]) this[name] = state[name];
    this.known = true;
    // The newest mark that the play head has passed.
    const passed = state.panes.flatMap(({ mark }, k) => (mark ? [{ ...mark, k, at: mark.t + this.items[k].shift }] : []));
    const latest = passed.sort((a, b) => b.at - a.at)[0] ?? null;
    if (!same(this.latest, latest)) this.latest = latest;
  }

  /** Say something for a while. */
  say(text) {
    this.said = text;
    clearTimeout(this.saying);
    this.saying = setTimeout(() => (this.said = ""), SAID);
  }

  /** Let a token count from now on. */
  unlock(token) {
    sessionStorage.setItem("token", token);
    this.link = "connecting";
    this.board.connect();
    for (const { link } of this.views) if (link.state === "token") link.connect();
  }

  /** One camera for all panes: what is compared is seen from the same side. */
  turn(view) {
    if (this.turning) return;
    this.turning = true;
    const { camera, controls } = view.scene.viewer;
    for (const { scene } of this.views) {
      if (!scene || scene === view.scene) continue;
      scene.viewer.camera.position.copy(camera.position);
      scene.viewer.controls.target.copy(controls.target);
      scene.viewer.controls.update();
      scene.viewer.set_dirty();
    }
    this.turning = false;
  }

  node(k, ...path) {
    return this.views[k].scene.node(...path);
  }
}

function Page({ replay }) {
  const { items, plotted, standing, link } = replay;
  const help = useRef(null);
  useEffect(() => {
    if (items.length) document.title = items.map(({ name }) => name).join(" · ") + " · play-back";
  }, [items]);
  return html`
    <div id="upper">
      <main id="stage" data-panes=${items.length || 1} aria-label="Recorded robots">${items.map((item, k) => html`<${View} replay=${replay} k=${k} item=${item} />`)}</main>
      <aside id="side" aria-label="Plots" hidden=${!plotted}>${plotted && html`<${Side} replay=${replay} />`}</aside>
    </div>
    <section id="dock" aria-label="Play-back">
      <${Latest} replay=${replay} />
      <${SeekBar} replay=${replay} />
      <${Controls} replay=${replay} help=${help} />
      <${Kinds} replay=${replay} />
      <${Status} replay=${replay} />
    </section>
    <p id="standing" role="status" hidden=${!standing || standing.kind === "open"} data-kind=${standing?.kind}>${standing?.text}</p>
    <${Help} dialog=${help} />
    ${link === "token" && html`<${Door} page=${replay} />`}`;
}

/** A recording's robots, and what is known of them. */
function View({ replay, k, item }) {
  const root = useRef(null);
  const pane = useRef(null);
  const labels = useRef(null);
  const view = useRef(null);
  const without = useRef(null);
  if (!view.current) view.current = { scene: null, part: (selector) => root.current.querySelector(selector) };
  useEffect(() => {
    const mine = (replay.views[k] = view.current);
    try {
      mine.scene = new window.VrsScene(pane.current, labels.current);
      mine.scene.viewer.controls.addEventListener("change", () => replay.turn(mine));
    } catch {
      without.current.hidden = false;
    }
    mine.link = new window.VrsLink(`/replay/scene/${k}${location.search}`, ["vrs.meshcat.1"], {
      take: (data) => mine.scene?.take(data),
      state() {},
    });
    if (mine.scene) mine.link.connect();
  }, []);

  function toggle({ currentTarget }, path) {
    const { scene } = view.current;
    if (scene) currentTarget.setAttribute("aria-pressed", String(scene.toggle(path)));
  }

  return html`<section class="view" ref=${root}>
    <div class="pane" role="img" aria-label=${`Robots of recording ${NAMES[k]} in 3D`} ref=${pane}></div>
    <div class="labels" aria-hidden="true" ref=${labels}></div>
    <p class="no-3d" ref=${without} hidden>No 3D view: this browser offers no WebGL. Play-back works all the same.</p>
    <div class="card left">
      <h1 class="name" title=${[item.title, `delay ${item.delay}`, item.driver].filter(Boolean).join(" · ")}>${replay.letter(k)}${item.name}</h1>
      <ul class="legend">${LEGEND.map(([path, text, more]) => html`<li hidden=${OWN.includes(path) && !item.shows.includes(path)}>
        <button type="button" aria-pressed="true" data-path=${path} onClick=${(event) => toggle(event, path)}>
          <i class=${`key key-${path}`}></i>${text}<span>${more}</span></button></li>`)}</ul>
    </div>
    <${Facts} replay=${replay} k=${k} unit=${item.unit} />
    <p class="card damage" hidden=${!item.damage}>${item.damage}</p>
  </section>`;
}

function Facts({ replay, k, unit }) {
  const pane = replay.panes[k];
  const [name, written] = ERRORS[unit];
  const value = (x, say) => (x === null || x === undefined ? "–" : say(x));
  return html`<dl class="card right facts">
      <div><dt>Own time</dt><dd class="own">${value(pane?.t, (t) => clockText(t, 3))}</dd></div>
      <div><dt>Real robot behind</dt><dd class="behind">${value(pane?.behind, (t) => `${t.toFixed(3)} s`)}</dd></div>
      <div><dt class="error-name">${name}</dt><dd class="error">${value(pane?.error, written)}</dd></div>
    </dl>
    <p class="absent card" hidden=${!pane || (pane.real && pane.virtual)}>
      ${!pane || pane.virtual ? "The real robot wasn't recorded here" : "This part of the file is lost"}</p>`;
}

/** What was said, or the newest mark that the play head has passed. */
function Latest({ replay }) {
  const { latest, said } = replay;
  if (said) return html`<p id="now" role="status"><span>${said}</span></p>`;
  if (!latest) return html`<p id="now" role="status"></p>`;
  const kind = latest.kind in KINDS ? latest.kind : "other";
  return html`<p id="now" role="status"><${MarkShape} kind=${kind} /><b>${replay.letter(latest.k)}${clockText(latest.t, 2)}</b>
    <span>${KINDS[kind][0]} · ${latest.text}</span></p>`;
}

function Status({ replay: { link, known, mode, rate } }) {
  const doing = () => {
    if (!known) return "Connected";
    const standing = { paused: "Paused", live: "Live", "catching-up": "Going live…" }[mode];
    return standing ?? `${rate < 0 ? "Rewinding" : "Playing"} at ${rounded(Math.abs(rate))}`;
  };
  const text = { connecting: "Connecting…", lost: "No connection; trying again…", token: "Locked" }[link] ?? doing();
  return html`<p id="status" data-state=${link}><i></i><span id="status-text" role="status">${text}</span></p>`;
}

const replay = new Replay();
render(html`<${Page} replay=${replay} />`, document.body);
window.replay = replay;
