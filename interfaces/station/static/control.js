// Who has control: shown always; asked for, given back and taken over by buttons.
import { Dialog, html, Icon, Pill, useEffect, useOn, useRef, useState } from "./ui.js";

const ENDED = { expired: "it ran out", released: "given back", "taken over": "it was taken over" };

/** Tone, symbol and words of who has control. */
function standing({ lease, link, holds, welcome }) {
  if (link !== "live") return ["none", "help", "Control unknown"];
  if (holds) return ["mine", "sports_esports", "You have control"];
  if (lease.offered_until) return ["mine", "sports_esports", "It's your turn"];
  if (lease.waiting) return ["other", "hourglass_top", `You are number ${lease.waiting} in the queue`];
  if (lease.state === "held") return ["other", "person", `${lease.holder} has control`];
  if (lease.state === "ending") return ["warn", "hourglass_top", "The robot comes to rest"];
  return ["none", "lock_open", welcome?.role === "viewer" ? "You watch" : "Nobody has control"];
}

export function Panel({ station }) {
  const { session } = station;
  const { lease, link, holds, welcome } = session;
  const live = link === "live";
  const wanted = useRef(false);
  const [asking, setAsking] = useState(false);

  function ask(type) {
    wanted.current = type === "acquire";
    session.wish(type);
  }

  useEffect(() => {
    document.getElementById("station").dataset.control = live && holds ? "yes" : "no";
  }, [live, holds]);
  useOn(session, "lease", ({ state, holder, ended }) => {
    if (session.holds) station.announce("You have control");
    else if (state === "held") station.announce(`${holder} has control`);
    else if (state === "ending" && ENDED[ended]) station.announce(`Control ended: ${ENDED[ended]}`);
    // The robot was still coming to rest when it was asked for.
    if (session.holds || state === "held") wanted.current = false;
    else if (wanted.current && state === "free") ask("acquire");
  });

  useEffect(() => {
    if (lease.offered_until) station.announce("It's your turn: take control", { urgent: true });
  }, [lease.offered_until]);

  // In a class, who can't have control at once asks for it.
  const { member, offered_until: offered, waiting } = lease;
  const queued = Boolean(member && !holds && session.mayCommand);
  const busy = lease.state !== "free" || waiting > 0 || Boolean(session.present?.offered);
  const [tone, symbol, words] = standing(session);
  const button = (id, text, shown, action) =>
    html`<button class="small" type="button" id=${id} hidden=${!(live && shown)} onClick=${action}>${text}</button>`;
  return html`
    <${Pill} id="control-pill" tone=${tone} icon=${symbol}>${words}<//>
    ${button("take", "Take control", session.mayCommand && (queued ? offered || !busy : lease.state === "free"), () => ask("acquire"))}
    ${button("ask", "Ask for control", queued && busy && !offered && !waiting, () => session.wish("request-control"))}
    ${button("withdraw", offered ? "Not now" : "Leave the queue", queued && (offered || waiting), () => session.wish("withdraw"))}
    ${button("give", "Give back", holds, () => ask("release"))}
    ${button("take-over", "Take over", welcome?.role === "admin" && lease.state === "held" && !holds, () => setAsking(true))}
    ${session.relays
      ? html`<a id="served" href=${session.relays} title="This relay is for watching: control is to be had there">The robot's own page</a>`
      : html`<${Name} station=${station} />`}
    ${asking && html`<${TakeOver} holder=${lease.holder} ask=${ask} close=${() => setAsking(false)} />`}`;
}

function TakeOver({ holder, ask, close }) {
  return html`<${Dialog} class="ask" aria-label="Take over control" close=${close}>
    <p>Take control from ${holder ?? "the one who has it"}? The robot is stopped first.</p>
    <div class="row">
      <button class="main" type="button" id="take-over-yes" onClick=${() => (ask("take-over"), close())}>Stop and take over</button>
      <button type="button" onClick=${close}>Leave it</button>
    </div><//>`;
}

/** One's name, as others see it. */
function Name({ station }) {
  const details = useRef(null);

  function rename({ target }) {
    const given = target.value.trim();
    if (given) station.rename(given);
    target.value = station.session.name;
    details.current.open = false;
    if (given) station.announce(`You are ${given} from your next connection on`);
  }

  return html`<details class="me" ref=${details}><summary aria-label="Your name" title="Your name"><${Icon} name="person" /></summary>
    <input id="name" maxlength="40" size="14" aria-label="Your name, as others see it" value=${station.session.name} onChange=${rename} />
  </details>`;
}
