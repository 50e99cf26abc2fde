// What the robot sees, says and shows: its camera's picture and sound by RTP, or single pictures, and both its axes.
import { Gaze } from "./gaze.js";
import { DEGREES, draw, h, icon, mark, planted, write } from "./dom.js";
import { Held, Needs } from "./handling.js";
import { Receiver } from "./receiver.js";
import { sideLink } from "./sidelink.js";
import { Stills } from "./stills.js";
import { html, Icon } from "./ui.js";

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

export function mount(station, box) {
  document.head.append(h("link", { rel: "stylesheet", href: "/station/camera.css" }));
  const { session } = station;
  /** What the server says of camera, voice and screen; null before. */
  let facts = null;
  /** Whether RTP is of no use here, and single pictures are shown. */
  let single = false;

  const video = h("video", { id: "camera-video", playsinline: true, autoplay: true, "aria-label": "What the robot's camera sees" });
  video.muted = true;
  const still = h("img", { id: "camera-still", alt: "What the robot's camera sees", hidden: true, draggable: "false" });
  const caption = h("p.caption", { id: "camera-saying", role: "status", hidden: true });
  const wait = h("p.waiting", { id: "camera-wait" }, "Waiting for the camera");
  const stage = h("div.stage", { id: "camera-stage" }, video, still, wait, caption);
  const rate = h("span.rate", { id: "camera-rate", title: "Pictures a second that arrive" });
  const angles = h("span.muted", { id: "camera-angles" });
  const sound = h("button.small", { type: "button", id: "camera-sound", "aria-pressed": "false", onclick: listen },
    icon("volume_off"), h("span", {}, "Sound on"));
  const problem = h("p.advice", { id: "camera-problem", role: "status", hidden: true });
  const said = h("p.refused", { id: "camera-refused", hidden: true });

  const link = sideLink(station, "/media", { take: (data) => take(JSON.parse(data)), state: connected });
  const receiver = new Receiver(video, (message) => link.send(JSON.stringify(message)), fallBack);
  const stills = new Stills(still, session);
  const gaze = new Gaze(session, () => facts, (message) => link.send(JSON.stringify(message)), refuse);

  const cross = h("div.cross", { role: "group", "aria-label": "Turn the camera" }, ...BUTTONS.map((entry) => entry ? button(...entry) : h("span")));
  const text = h("input", { id: "camera-text", maxlength: LONGEST, autocomplete: "off", "aria-label": "Words to say or to show", placeholder: "Words to say or to show" });
  const say = h("button.small", { type: "button", id: "camera-say", onclick: () => utter("speak") }, "Say");
  const show = h("button.small", { type: "button", id: "camera-show", onclick: () => utter("show") }, "Show");
  const clear = h("button.small", { type: "button", id: "camera-clear", onclick: () => utter("clear") }, "Clear");
  const message = h("p.message", { id: "camera-message" });
  const words = h("div.row", {}, text, say, show, clear);
  box.append(stage, h("div.row", {}, rate, angles, h("span.grow"), sound), problem,
    planted(html`<${Needs} station=${station} id="camera-needs" />`),
    h("div.drive-by", {}, cross, h("p.hint", {}, "Drag the picture, hold a button, or the keys J L I K; C looks ahead.")),
    words, said, h("h2", {}, "On its screen"), message);
  const toast = h("div.robot-screen", { id: "robot-screen", role: "status", hidden: true });
  document.getElementById("pane-box").append(toast);

  function button(label, symbol, way) {
    const props = { "aria-label": label, title: label };
    if (way) return planted(html`<${Held} steer=${gaze} source="button" ...${props} input=${() => way}><${Icon} name=${symbol} /><//>`);
    return h("button.held", { type: "button", ...props, onclick: () => gaze.ahead() }, icon(symbol));
  }

  function refuse(why) {
    said.hidden = !why;
    write(said, why);
    station.refuse(why);
  }

  function utter(what) {
    const given = text.value.trim();
    if (what !== "clear" && !given) return refuse("There are no words to say or to show.");
    if (!session.holds) return refuse("Take control first: who has control speaks.");
    refuse("");
    const wish = { do: what, session: session.key, epoch: String(session.epoch) };
    if (what !== "clear") wish.text = given;
    if (!link.send(JSON.stringify(wish))) refuse("There's no connection: nothing was sent.");
  }

  text.addEventListener("keydown", (event) => event.key === "Enter" && utter("speak"));

  function listen() {
    video.muted = !video.muted;
    mark(sound, "aria-pressed", String(!video.muted));
    draw(sound.firstChild, video.muted ? "volume_off" : "volume_up");
    write(sound.lastChild, video.muted ? "Sound on" : "Sound off");
    look();
  }

  /** RTP doesn't come: single pictures do. */
  function fallBack(why) {
    single = true;
    if (why) write(problem, why);
    look();
  }

  function take(news) {
    if (news.kind === "answer") receiver.answer(news.sdp);
    else if (news.kind === "problem") {
      if (receiver.waits) receiver.fail(news.text);
      else refuse(news.text);
    } else if (news.kind === "media") {
      facts = news;
      look();
      tell();
    }
  }

  function connected(state) {
    if (state === "live") {
      single = false;
      receiver.stop();
    }
    look();
  }

  const isShown = () => box.offsetParent !== null && document.visibilityState === "visible";

  /** Watch by RTP, by single pictures, or not at all, as it's of use now. */
  function look() {
    const able = link.state === "live" && facts !== null;
    const byRtp = able && facts.video && !single && window.RTCPeerConnection !== undefined;
    receiver.want(byRtp && (isShown() || !video.muted));
    stills.want(able && !byRtp && isShown());
    video.hidden = !byRtp;
    still.hidden = byRtp;
    sound.hidden = !byRtp;
  }

  function tell() {
    if (!facts) return;
    const { message: shown, saying } = facts;
    toast.hidden = !shown;
    write(toast, shown);
    write(message, shown || "Nothing");
    caption.hidden = !saying;
    write(caption, saying ? `“${saying}”` : "");
    const missing = facts.missing ? `Single pictures only: ${facts.missing} isn't installed where the server runs (the extra media).` : "";
    const why = facts.problem || (facts.video && facts.voice) || missing || (single && problem.textContent) || "";
    write(problem, why);
    problem.hidden = !why;
    clear.disabled = !shown || !session.holds;
    say.disabled = show.disabled = !session.holds;
    if (box.offsetParent === null) return;
    const per = receiver.wanted ? receiver.rate : stills.rate;
    write(rate, per ? `${per.toFixed(1)} pictures/s` : "no picture");
    wait.hidden = per > 0 || (receiver.wanted ? receiver.frames : stills.frames) > 0;
    const side = facts.pan >= 0 ? "left" : "right";
    write(angles, `${Math.abs(facts.pan * DEGREES).toFixed(0)}° ${side}, ${Math.abs(facts.tilt * DEGREES).toFixed(0)}° ${facts.tilt >= 0 ? "up" : "down"}`);
  }

  gaze.drag(stage);
  gaze.keys(KEYS, "KeyC", () => box.offsetParent !== null);
  new IntersectionObserver(look).observe(box);
  document.addEventListener("visibilitychange", look);
  setInterval(() => {
    look();
    tell();
  }, PERIOD);
  station.on("lease", tell);
  station.shared.camera = { video, receiver, stills, get facts() { return facts; } };
}
