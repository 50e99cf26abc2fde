// STOP: by button and by the space bar, at any time. What can't be sent yet is sent as soon as it can be.
import { h, icon, isTyping, write } from "./dom.js";

/** A stop waits here for its connection, also while the page loads anew. */
const KEY = "vrs-stop";
/** So long it's worth sending [s]: by then every lease has run out, and every robot has stopped by itself. */
const WAITS = 30;
const SHOWN = 4000;

export function mount(station, box) {
  const session = station.session;
  const note = h("span.stop-note", { id: "stop-note" });
  const button = h(
    "button.stop",
    { type: "button", id: "stop", "aria-describedby": "stop-note", title: "Stop the robot (space bar)" },
    icon("front_hand"),
    h("span", {}, "STOP"),
  );
  box.append(note, button);
  let fading = null;
  let mine = null;

  function say(text, lasting = false) {
    write(note, text);
    station.announce(text, { urgent: true });
    clearTimeout(fading);
    if (!lasting) fading = setTimeout(() => write(note, ""), SHOWN);
  }

  /** Who has control and can't be stopped from here; null where nobody is, or it can. */
  function another() {
    const { lease, link, welcome } = session;
    const may = link !== "live" || lease.yours || lease.state !== "held" || welcome?.role === "admin";
    return may ? null : lease.holder;
  }

  /** STOP is there where it works: nobody should rely on one that doesn't. */
  function show() {
    button.hidden = another() !== null;
  }

  function waits() {
    const since = Number(sessionStorage.getItem(KEY) ?? NaN);
    return Date.now() - since < 1000 * WAITS;
  }

  function wait(text) {
    sessionStorage.setItem(KEY, String(Date.now()));
    button.dataset.waits = "";
    say(text, true);
  }

  function stop() {
    station.dispatchEvent(new Event("stopping"));
    if (session.holds) {
      mine = session.order({ type: "stop" });
      if (session.link === "live") say("STOP sent");
      else wait("STOP: no answer from the server. It's sent again as soon as it can be; without word the robot stops");
    } else if (session.link !== "live" && session.link !== "locked") {
      wait("STOP: no connection. It's sent as soon as it can be; without word the robot stops by itself");
    } else if (session.welcome?.role === "admin" && session.lease.state === "held") {
      session.wish("take-over");
      say(`STOP: taking over from ${session.lease.holder}, which stops the robot`);
    } else if (another() !== null) say(`You can't stop the robot: ${another()} has control`);
    else say("Nobody has control: the robot is at rest, or coming to rest");
  }

  /** Whoever is connected again sends what waited, once it's known who has control. */
  function catchUp() {
    if (!waits() || !session.greeted) return;
    sessionStorage.removeItem(KEY);
    delete button.dataset.waits;
    if (session.holds) {
      mine = session.order({ type: "stop" });
      say("Connected again: STOP sent");
    } else say("Connected again: your control has run out, and the robot was stopped");
  }

  button.addEventListener("pointerdown", (event) => {
    event.preventDefault();
    stop();
  });
  // Those who click without a pointer: the Enter key, screen readers.
  button.addEventListener("click", (event) => event.detail === 0 && stop());
  window.addEventListener(
    "keydown",
    (event) => {
      if (event.code !== "Space" || isTyping(event)) return;
      event.preventDefault();
      event.stopImmediatePropagation();
      if (!event.repeat) stop();
    },
    { capture: true },
  );
  window.addEventListener(
    "keyup",
    (event) => {
      if (event.code !== "Space" || isTyping(event)) return;
      event.preventDefault();
      event.stopImmediatePropagation();
    },
    { capture: true },
  );
  station.on("lease", catchUp);
  for (const type of ["lease", "link", "welcome"]) station.on(type, show);
  station.on("outcome", (entry) => {
    if (entry !== mine) return;
    mine = null;
    sessionStorage.removeItem(KEY);
    delete button.dataset.waits;
    say(entry.outcome.refusal ? `STOP refused: ${entry.outcome.refusal}` : "Stopping");
  });
  show();
  if (waits()) catchUp();
  station.shared.stop = stop;
}
