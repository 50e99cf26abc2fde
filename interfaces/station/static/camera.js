// What the robot sees, says and shows: its camera's picture and sound by RTP, or single pictures, and both its axes.
import { Gaze } from "./gaze.js";
import { Held, Needs } from "./handling.js";
import { Receiver } from "./receiver.js";
import { sideLink } from "./sidelink.js";
import { Stills } from "./stills.js";
import { barred, DEGREES, figure, html, Icon, observed, useEffect, useEvery, useMemo, useRef, useState } from "./ui.js";

const PERIOD = 250;
const LONGEST = 300;
/** Keys and buttons, and which way they turn the camera: left, up. */
const KEYS = { KeyJ: [1, 0], KeyL: [-1, 0], KeyI: [0, 1], KeyK: [0, -1] };
const BUTTONS = [
  null, ["Look up", "keyboard_arrow_up", [0, 1]], null,
  ["Look left", "keyboard_arrow_left", [1, 0]], ["Look ahead", "filter_center_focus", null],
  ["Look right", "keyboard_arrow_right", [-1, 0]],
  null, ["Look down", "keyboard_arrow_down", [0, -1]], null,
];
/** What pictures are of, and what's said of them. */
const VIEWS = {
  robot: ["Robot", "What the robot's camera sees"],
  overhead: ["Overhead", "The room from above"],
  both: ["Both", "What the robot's camera sees, and the room from above"],
};

/** What is known of the camera, and what brings its picture. */
class Camera {
  constructor(station) {
    this.station = station;
    observed(this, {
      /** What the server says of camera, voice and screen; null before. */
      facts: null,
      /** Whether RTP is of no use here, and why not. */
      single: false,
      why: "",
      refused: "",
      muted: true,
      view: "robot",
      /** Whether the robot's microphone is heard, too. */
      hears: false,
      /** Whether the picture comes by RTP. */
      byRtp: false,
    });
    this.gaze = new Gaze(station.session, () => this.facts, (message) => this.send(message), (why) => this.refuse(why));
  }

  /** Begin once there's where to show it. */
  begin(video, image) {
    this.video = video;
    video.muted = true;
    this.link = sideLink(this.station, "/media", { take: (data) => this.take(JSON.parse(data)), state: (state) => this.connected(state) });
    this.receiver = new Receiver(video, (message) => this.send(message), (why) => this.fallBack(why));
    this.stills = new Stills(image, this.station.session, () => this.view);
  }

  send(message) {
    return this.link.send(JSON.stringify(message));
  }

  refuse(why) {
    this.refused = why;
    this.station.refuse(why);
  }

  /** RTP doesn't come: single pictures do. */
  fallBack(why) {
    this.single = true;
    this.why = why ?? "";
    this.look();
  }

  take(news) {
    if (news.kind === "answer") this.receiver.answer(news.sdp);
    else if (news.kind === "media") this.facts = news;
    else if (news.kind === "problem") {
      if (this.receiver.waits) this.receiver.fail(news.text);
      else this.refuse(news.text);
    }
    this.look();
  }

  connected(state) {
    if (state === "live") {
      this.single = false;
      this.receiver?.stop();
      this.choose();
    }
    if (this.receiver) this.look();
  }

  /** Watch by RTP, by single pictures, or not at all, as it's of use now. */
  look() {
    const shown = this.video.parentElement.offsetParent !== null && document.visibilityState === "visible";
    const able = this.link.state === "live" && this.facts !== null;
    this.byRtp = Boolean(able && this.facts.video && !this.single && window.RTCPeerConnection !== undefined);
    this.receiver.want(this.byRtp && (shown || !this.video.muted));
    this.stills.want(able && !this.byRtp && shown);
  }

  listen() {
    this.muted = this.video.muted = !this.video.muted;
    this.look();
  }

  /** See and hear something else from now on. */
  choose({ view = this.view, hears = this.hears } = {}) {
    Object.assign(this, { view, hears });
    this.send({ do: "choose", view, hears });
  }

  /** Listen to the robot's microphone, or no more. */
  hear() {
    this.choose({ hears: this.muted || !this.hears });
    if (this.hears && this.muted) this.listen();
  }

  /** Say words aloud, show them, or clear what is shown. */
  utter(what, text) {
    const { session, idle } = this.station;
    const wrong = idle || (what !== "clear" && !text ? "There are no words to say or to show." : "");
    this.refuse(wrong);
    if (wrong) return;
    const wish = { do: what, session: session.key, epoch: String(session.epoch), ...(what === "clear" ? {} : { text }) };
    if (!this.send(wish)) this.refuse("There's no connection: nothing was sent.");
  }

  /** What stands in the way of picture and sound. */
  get problem() {
    const { facts } = this;
    if (!facts || facts.problem || (facts.video && facts.voice)) return facts?.problem || (this.single ? this.why : "");
    return facts.missing ? `Single pictures only: ${facts.missing} isn't installed where the server runs (the extra media).`
      : this.single ? this.why : "";
  }
}

export function Panel({ station }) {
  const camera = useMemo(() => (station.camera = new Camera(station)), []);
  const { facts } = camera;
  const why = station.idle;
  const words = useRef(null);
  const utter = (what) => camera.utter(what, words.current.value.trim());
  const message = facts?.message;
  const { display } = station.config.robot;
  const asked = display ? "Words to say or to show" : "Words to say";
  const speak = (id, what, text, off) => html`<button class="small" type="button" id=${id} ...${barred(off)}
    onClick=${() => utter(what)}>${text}</button>`;
  return html`<link rel="stylesheet" href="/station/camera.css" />
    <${Stage} station=${station} camera=${camera} />
    <p class="advice" id="camera-problem" role="status" hidden=${!camera.problem}>${camera.problem}</p>
    <${Needs} station=${station} id="camera-needs" />
    <div class="drive-by"><div class="cross" role="group" aria-label="Turn the camera">
      ${BUTTONS.map((entry) => (entry ? html`<${Turn} camera=${camera} entry=${entry} why=${why} />` : html`<span></span>`))}</div>
      <p class="hint">Drag the picture, hold a button, or the keys J L I K; C looks ahead.</p></div>
    <div class="row"><input id="camera-text" ref=${words} maxlength=${LONGEST} autocomplete="off" aria-label=${asked} placeholder=${asked}
        onKeyDown=${(event) => event.key === "Enter" && utter("speak")} />
      ${speak("camera-say", "speak", "Say", why)}${display && html`${speak("camera-show", "show", "Show", why)}
      ${speak("camera-clear", "clear", "Clear", why || (message ? "" : "Nothing is shown."))}`}</div>
    <p class="refused" id="camera-refused">${camera.refused}</p>
    ${display && html`<h2>On its screen</h2><p class="message" id="camera-message">${message || "Nothing"}</p>`}`;
}

function Turn({ camera, entry: [label, symbol, way], why }) {
  const icon = html`<${Icon} name=${symbol} />`;
  if (!way) return html`<button class="held" type="button" aria-label=${label} ...${barred(why, label)} onClick=${() => camera.gaze.ahead()}>${icon}</button>`;
  return html`<${Held} steer=${camera.gaze} source="button" aria-label=${label} title=${label} why=${why} input=${() => way}>${icon}<//>`;
}

/** The picture, how it comes, and where the camera looks. */
function Stage({ station, camera }) {
  const [stage, video, image] = [useRef(null), useRef(null), useRef(null)];
  const [rate, setRate] = useState([0, 0]);
  const { facts, byRtp, muted, view, hears } = camera;
  const [, label] = VIEWS[view];
  const toggle = (id, on, icon, text, shown, does) => html`<button class="small" type="button" id=${id} aria-pressed=${String(on)}
    hidden=${!shown} onClick=${does}><${Icon} name=${icon} /><span>${text}</span></button>`;
  useEffect(() => {
    camera.begin(video.current, image.current);
    camera.gaze.drag(stage.current, () => camera.view !== "overhead");
    camera.gaze.keys(KEYS, "KeyC", () => stage.current.offsetParent !== null);
    const look = () => camera.look();
    const seen = new IntersectionObserver(look);
    seen.observe(stage.current);
    document.addEventListener("visibilitychange", look);
    return () => (seen.disconnect(), document.removeEventListener("visibilitychange", look));
  }, []);
  useEvery(PERIOD, () => {
    camera.look();
    const source = camera.receiver.wanted ? camera.receiver : camera.stills;
    if (stage.current.offsetParent !== null) setRate([source.rate, source.frames]);
  });
  const [per, frames] = rate;
  const side = (x, more, less) => `${figure(Math.abs(x * DEGREES), 0)}° ${x >= 0 ? more : less}`;
  return html`<div class="stage" id="camera-stage" ref=${stage}>
      <video id="camera-video" ref=${video} playsinline autoplay hidden=${!byRtp} aria-label=${label} />
      <img id="camera-still" ref=${image} alt=${label} hidden=${byRtp} draggable=${false} />
      <p class="waiting" id="camera-wait" hidden=${per > 0 || frames > 0}>Waiting for the camera</p>
      <p class="caption" id="camera-saying" role="status" hidden=${!facts?.saying}>${facts?.saying ? `“${facts.saying}”` : ""}</p></div>
    <div class="row of-picture"><span class="rate" id="camera-rate" title="Pictures a second that arrive">
        ${per ? `${figure(per, 1)} pictures/s` : "no picture"}</span>
      <span class="muted" id="camera-angles">${facts && `${side(facts.pan, "left", "right")}, ${side(facts.tilt, "up", "down")}`}</span>
      <span class="grow"></span>
      ${toggle("camera-sound", !muted, muted ? "volume_off" : "volume_up", muted ? "Sound on" : "Sound off", byRtp, () => camera.listen())}</div>
    <div class="row"><select id="camera-view" aria-label="Which camera" value=${view}
        onChange=${({ target }) => camera.choose({ view: target.value })}>
        ${Object.entries(VIEWS).map(([name, [title]]) => html`<option value=${name}>${title}</option>`)}</select><span class="grow"></span>
      <span class="muted" id="camera-level" hidden=${!facts?.microphone} title="At its microphone">${facts?.level == null ? "silent" : `${facts.level} dB`}</span>
      ${toggle("camera-hear", hears && !muted, "mic", "Microphone", byRtp && facts.microphone, () => camera.hear())}</div>`;
}

/** What the robot's screen shows, over the 3D view. */
export function Screen({ station }) {
  const shown = station.camera?.facts?.message;
  return html`<div class="robot-screen" id="robot-screen" role="status" hidden=${!shown}>${shown ?? ""}</div>`;
}
