// How the connection is, and how the real robot is: two pills, each with a word and a symbol; and the door for tokens.
import { html, Pill, useEffect, useOn, useRef } from "./ui.js";
import { busy } from "./tasks.js";

/** Tone, symbol and word of a connection. */
const LINKS = {
  connecting: ["warn", "sync", "Connecting"],
  live: ["good", "wifi", "Live"],
  stale: ["warn", "hourglass_empty", "Stale"],
  lost: ["bad", "wifi_off", "Lost"],
  locked: ["warn", "lock", "Locked"],
};

export function Panel({ station }) {
  const { session } = station;
  const { link } = session;
  useOn(session, "link", (now) => {
    if (now === "lost") station.announce("Connection lost. Trying again.", { urgent: true });
    if (now === "live") station.announce("Connected.");
  });
  const [tone, symbol, word] = LINKS[link];
  return html`
    <${Pill} id="link-pill" title="Connection of this page to the server" tone=${tone} icon=${symbol} data-state=${link}>${word}<//>
    <${RealRobot} station=${station} />
    <${Door} station=${station} />`;
}

/** How the real robot is, and what lets it go on. */
function RealRobot({ station }) {
  const { session } = station;
  const { link, state, holds } = session;
  const body = station.drives ? "smart_toy" : "precision_manufacturing";
  const known = link === "live" && state;
  const why = (known && state.halted) || "";
  const resume = useRef(null);
  useEffect(() => {
    if (!why || !holds) return;
    station.announce(`Real robot waits: ${why}`);
    resume.current.scrollIntoView({ block: "nearest", inline: "nearest" });
  }, [why, holds]);
  const [tone, symbol, words] = !known ? ["none", body, "Real robot unknown"]
    : !state.connected ? ["bad", "cloud_off", "Real robot not heard"]
    : why ? ["warn", "pause_circle", "Real robot waits"]
    : busy(session) ? ["good", "route", "Drives by itself"]
    : ["good", body, "Real robot follows"];
  return html`
    <${Pill} id="robot-pill" title=${why || "The real robot, as the server last heard of it"} tone=${tone} icon=${symbol}>${words}<//>
    <button class="small" type="button" id="resume" ref=${resume} hidden=${!(why && holds)} onClick=${() => session.wish("resume")}>
      Resume</button>`;
}

/** Asks for a token, or a class's code and a name, where the server lets nobody in without one. */
function Door({ station }) {
  const { session } = station;
  const locked = session.link === "locked";
  const [dialog, input, name] = [useRef(null), useRef(null), useRef(null)];
  const teaches = station.config.panels.some((panel) => panel.name === "class");
  const code = new URLSearchParams(location.search).get("code");
  useEffect(() => {
    if (!locked) return;
    sessionStorage.removeItem("token");
    if (code && !session.token) input.current.value = code;
    dialog.current.showModal();
  }, [locked]);

  function enter() {
    const token = input.current.value.trim();
    if (name.current) station.rename(name.current.value.trim());
    if (code) history.replaceState(null, "", location.pathname);
    input.current.value = "";
    session.unlock(token);
  }

  const wrong = teaches ? "That code isn't valid: codes change every ten minutes." : "That token isn't valid here.";
  return html`<dialog class="door" id="door" ref=${dialog} aria-label=${teaches ? "Join the class" : "Token"}
    onCancel=${(event) => event.preventDefault()}>
    <form method="dialog" onSubmit=${enter}>
      <h2>${teaches ? "Join the class" : "This server asks for a token"}</h2>
      ${teaches && html`<label for="own-name">Your name, as others see it</label>
        <input id="own-name" ref=${name} maxlength="24" autocomplete="off" required defaultValue=${session.name} />`}
      <label for="token">${teaches ? "Code of six characters, or a token" : "Token of a viewer, an operator or an admin"}</label>
      <input id="token" ref=${input} type=${teaches ? "text" : "password"} autocomplete="off" spellcheck="false" required />
      <p class="refused" id="refused" role="alert">${locked && session.token ? wrong : ""}</p>
      <button class="main" id="enter">Enter</button>
    </form></dialog>`;
}
