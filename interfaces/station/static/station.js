// The station: one session for the page, and the panels, each mounted into its own element.
import { Chain } from "./chain.js";
import { h } from "./dom.js";
import { DriveSession } from "./drivesession.js";
import { Layout } from "./layout.js";
import { Notices } from "./notice.js";
import { Session } from "./session.js";

const NAME = "vrs-name";

/** What panels are given: the session, what the robot is, a voice for screen readers, and what they share. */
class Station extends EventTarget {
  constructor(root, config) {
    super();
    this.config = config;
    /** Whether the robot drives on arcs, and no joints of it move on polynomials. */
    this.drives = config.robot.segments === "arcs";
    /** Links and tool at joints; a robot that drives has none. */
    this.chain = this.drives ? null : new Chain(config.robot);
    this.session = new (this.drives ? DriveSession : Session)({ name: myName(), token: sessionStorage.getItem("token") });
    this.layout = new Layout(root, config.panels);
    /** What panels offer each other, by the panel's name. */
    this.shared = {};
    this.polite = root.appendChild(h("div.spoken", { "aria-live": "polite" }));
    this.notices = new Notices(this.session, root);
    this.urgent = root.appendChild(h("div.spoken", { role: "alert", "aria-live": "assertive", id: "alert" }));
  }

  /** Say something to those who listen to the page. */
  announce(text, { urgent = false } = {}) {
    (urgent ? this.urgent : this.polite).textContent = text;
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

function myName() {
  const known = localStorage.getItem(NAME);
  if (known) return known;
  const made = "Operator " + (100 + Math.floor(Math.random() * 900));
  localStorage.setItem(NAME, made);
  return made;
}

const root = document.getElementById("station");
const config = JSON.parse(root.dataset.config);
const station = new Station(root, config);
window.station = station;
const { panels } = config;
const modules = await Promise.all(panels.map((panel) => import(`./${panel.name}.js`)));
for (const [k, panel] of panels.entries()) {
  // A task each: in one, all of them would hold the page up.
  await new Promise((resolve) => setTimeout(resolve));
  modules[k].mount(station, document.getElementById(`panel-${panel.name}`));
}
root.dataset.ready = "";
station.dispatchEvent(new Event("ready"));
