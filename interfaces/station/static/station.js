// The station: one session for the page, and the panels, each a component in its own place.
import { Chain } from "./chain.js";
import { DriveSession } from "./drivesession.js";
import { Happenings } from "./happenings.js";
import { Jogging } from "./jogging.js";
import { App, Layout } from "./layout.js";
import { Notice, Notices } from "./notice.js";
import { Session } from "./session.js";
import { Steer } from "./steer.js";
import { Stop } from "./stop.js";
import { html, observed, render } from "./ui.js";

const NAME = "vrs-name";

/** What panels are given: the session, what the robot is, a voice for screen readers, and what they share. */
class Station extends EventTarget {
  constructor(config) {
    super();
    this.config = config;
    /** Whether the robot drives on arcs, and no joints of it move on polynomials. */
    this.drives = config.robot.segments === "arcs";
    /** Links and tool at joints; a robot that drives has none. */
    this.chain = this.drives ? null : new Chain(config.robot);
    this.session = new (this.drives ? DriveSession : Session)({
      name: myName(),
      token: sessionStorage.getItem("token"),
      relays: config.relays,
    });
    this.layout = new Layout(config.panels);
    observed(this, {
      // What is said to those who listen to the page.
      polite: "",
      urgent: "",
      /** The time of the timeline that is looked at [s]; null: now. Setting it shows another one. */
      cursor: null,
      /** The 3D view, see twins.js; null before it's there, and where the browser draws none. */
      scene: null,
      /** The camera of a mobile robot, see camera.js, once its panel is there. */
      camera: null,
      /** VAL-II's terminal, once its panel is there. */
      terminal: null,
    });
    /** What couldn't be done, said at the control that was used. */
    this.notices = new Notices(this.session);
    /** What is held by hand: `steer.hold(who, input)`. */
    this.steer = new Steer(this);
    /** How an arm is jogged. */
    this.jog = this.drives ? null : new Jogging(this);
    /** STOP: `stop.press()`. */
    this.stop = new Stop(this);
    /** What happened, for the strip and the plots. */
    this.happenings = new Happenings(this);
  }

  /** Joints of the virtual robot as the picture shows them; null where nothing is known. */
  get shown() {
    const t = this.cursor ?? this.session.now;
    return t === null || !this.session.timeline ? null : this.session.timeline.joints(t);
  }

  /** Why no orders can be given from here now; "" where they can. */
  get idle() {
    const { link, holds, lease, mayCommand } = this.session;
    if (link !== "live") return "No connection.";
    if (holds) return "";
    if (this.session.relays) return "This relay is for watching: control is to be had at the robot's own page.";
    if (!mayCommand) return "You are here to watch.";
    return lease.state === "held" ? `${lease.holder} has control.` : "Take control first, in the bar above.";
  }

  /** Say something to those who listen to the page. */
  announce(text, { urgent = false } = {}) {
    this[urgent ? "urgent" : "polite"] = text;
  }

  /** Say at the control that was used why something isn't done; nothing of "". */
  refuse(why) {
    this.notices.say(why);
  }

  /** Let people be known by a name from now on. */
  rename(name) {
    localStorage.setItem(NAME, name);
    this.session.name = name;
  }

  on(type, listener) {
    this.session.addEventListener(type, (event) => listener(event.detail));
  }
}

function Page({ station }) {
  return html`<${App} station=${station} />
    <${Notice} notices=${station.notices} />
    <div class="spoken" aria-live="polite">${station.polite}</div>
    <div class="spoken" role="alert" aria-live="assertive" id="alert">${station.urgent}</div>`;
}

function myName() {
  const known = localStorage.getItem(NAME);
  if (known) return known;
  const made = "Operator " + (100 + Math.floor(Math.random() * 900));
  localStorage.setItem(NAME, made);
  return made;
}

const root = document.getElementById("station");
const config = JSON.parse(root.dataset.config);
const station = new Station(config);
window.station = station;
render(html`<${Page} station=${station} />`, root);
const { layout } = station;
const modules = await Promise.all(config.panels.map(({ name }) => import(`./${name}.js`)));
for (const [k, { name }] of config.panels.entries()) {
  // A task each: in one, all of them would hold the page up.
  layout.modules = { ...layout.modules, [name]: modules[k] };
  await new Promise((resolve) => setTimeout(resolve));
}
root.dataset.ready = "";
station.dispatchEvent(new Event("ready"));
