// How the connection is, and how the real robot is: two pills, each with a word and a symbol.
import { draw, h, icon, mark, write } from "./dom.js";
import { busy } from "./tasks.js";

const WORDS = {
  connecting: ["sync", "Connecting"],
  live: ["wifi", "Live"],
  stale: ["hourglass_empty", "Stale"],
  lost: ["wifi_off", "Lost"],
  locked: ["lock", "Locked"],
};

/** How a state shows: "good", "warn" or "bad". */
const TONES = { live: "good", connecting: "warn", stale: "warn", lost: "bad", locked: "warn" };

function pill(id, title) {
  const symbol = icon("sync");
  const words = h("span");
  const element = h("span.pill", { id, title, role: "status" }, symbol, words);
  return {
    element,
    show(tone, name, text) {
      mark(element, "data-tone", tone);
      draw(symbol, name);
      write(words, text);
    },
  };
}

export function mount(station, box) {
  const session = station.session;
  const body = station.drives ? "smart_toy" : "precision_manufacturing";
  const link = pill("link-pill", "Connection of this page to the server");
  const robot = pill("robot-pill", "The real robot, as the server last heard of it");
  const resume = h("button.small", { type: "button", id: "resume", hidden: true }, "Resume");
  resume.addEventListener("click", () => session.wish("resume"));
  box.append(link.element, robot.element, resume);
  askForTokens(station);

  let told = "";
  function show() {
    const [name, word] = WORDS[session.link];
    link.show(TONES[session.link], name, word);
    mark(link.element, "data-state", session.link);
    const state = session.state;
    const live = session.link === "live";
    const halted = live && state?.halted;
    if (!live || !state) robot.show("none", body, "Real robot unknown");
    else if (!state.connected) robot.show("bad", "cloud_off", "Real robot not heard");
    else if (halted) robot.show("warn", "pause_circle", "Real robot waits");
    else if (busy(session)) robot.show("good", "route", "Drives by itself");
    else robot.show("good", body, "Real robot follows");
    robot.element.title = halted ? state.halted : "The real robot, as the server last heard of it";
    const hidden = !(halted && session.holds);
    if (resume.hidden && !hidden) requestAnimationFrame(() => resume.scrollIntoView({ block: "nearest", inline: "nearest" }));
    resume.hidden = hidden;
    if (halted && session.holds && halted !== told) station.announce(`Real robot waits: ${halted}`);
    told = halted;
  }

  for (const type of ["link", "state", "lease", "welcome", "tasks"]) station.on(type, show);
  station.on("link", (state) => {
    if (state === "lost") station.announce("Connection lost. Trying again.", { urgent: true });
    if (state === "live") station.announce("Connected.");
  });
  show();
}

/** Ask for a token where the server lets nobody in without one. */
function askForTokens(station) {
  const session = station.session;
  const input = h("input", { id: "token", type: "password", autocomplete: "off", spellcheck: "false", required: true });
  const refused = h("p.refused", { id: "refused", role: "alert" });
  const form = h(
    "form",
    { method: "dialog" },
    h("h2", {}, "This server asks for a token"),
    h("label", { for: "token" }, "Token of a viewer, an operator or an admin"),
    input,
    refused,
    h("button.main", { id: "enter" }, "Enter"),
  );
  const dialog = h("dialog.door", { id: "door", "aria-label": "Token" }, form);
  document.getElementById("station").append(dialog);
  dialog.addEventListener("cancel", (event) => event.preventDefault());
  form.addEventListener("submit", (event) => {
    event.preventDefault();
    sessionStorage.setItem("token", input.value);
    input.value = "";
    dialog.close();
    session.unlock(sessionStorage.getItem("token"));
    station.dispatchEvent(new Event("unlocked"));
  });
  const look = () => {
    if (session.link !== "locked" || dialog.open) return;
    write(refused, session.token ? "That token isn't valid here." : "");
    sessionStorage.removeItem("token");
    dialog.showModal();
  };
  station.on("link", look);
  look();
}
