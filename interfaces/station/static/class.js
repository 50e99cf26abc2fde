// Who is here and who waits for control; for the teacher of a class how to join; for admins, who gets control next.
import { html, useEffect, useState } from "./ui.js";

/** Codes are asked for again so long after they ran out [ms]. */
const AFTER = 500;
const DOES = { viewer: "watch", operator: "operate" };

export function Panel({ station }) {
  const { session } = station;
  const teaches = session.welcome?.role === "admin";
  return html`${teaches && station.config.codes && html`<${Invitations} session=${session} />`}<${Present} station=${station} teaches=${teaches} />`;
}

/** The codes in force, and their links as pictures. */
function Invitations({ session }) {
  const [shown, setShown] = useState([]);
  const [tries, setTries] = useState(0);
  useEffect(() => {
    let timer = null;
    const again = (wait) => (timer = setTimeout(() => setTries(tries + 1), wait));
    const load = async () => {
      const { invitations } = await session.ask("/class");
      const pictures = await Promise.all(invitations.map(async ({ role }) => (await session.fetch(`/class/${role}.svg`)).blob()));
      setShown(invitations.map((one, k) => ({ ...one, picture: URL.createObjectURL(pictures[k]) })));
      again(1000 * Math.min(...invitations.map((one) => one.expires_in)) + AFTER);
    };
    load().catch(() => again(2000));
    return () => clearTimeout(timer);
  }, [tries, session.token]);
  useEffect(() => () => shown.forEach(({ picture }) => URL.revokeObjectURL(picture)), [shown]);
  return html`<section><div class="head"><h2>Join</h2><span class="hint">codes change every ten minutes</span></div>
    <div class="invitations">${shown.map(({ role, code, link, picture }) => html`<figure key=${role} id=${`join-${role}`}>
      <img src=${picture} alt=${`QR code of ${link}`} width="132" height="132" />
      <figcaption>To ${DOES[role]}<strong class="code">${code}</strong><a href=${link}>${link}</a></figcaption></figure>`)}</div></section>`;
}

function Present({ station: { session, config }, teaches }) {
  const { present, lease } = session;
  if (!present) return null;
  const { members = [], others = 0, holder, offered } = present;
  const standing = ({ number, waiting, role }) => (number === holder ? "has control" : number === offered ? "may take control"
    : waiting ? `waits, number ${waiting}` : role === "viewer" ? "watches" : role === "admin" ? (config.codes ? "teaches" : "may take over") : "");
  const act = (type, member, id, text, label) => html`<button class="small" type="button" data-do=${id} aria-label=${label}
    onClick=${() => session.wish(type, { member })}>${text}</button>`;
  return html`<section><div class="head"><h2>Here</h2><span class="hint">${members.length + others}</span></div>
    <ul class="members" id="members">${members.map((one) => html`<li key=${one.number} data-member=${one.number}>
      <span class="who"><span class="name">${one.name}${one.number === lease.member && html` <span class="muted">(you)</span>`}</span>
        <span class="muted">${standing(one)}</span></span>
      ${teaches && one.role !== "viewer" && one.number !== holder && one.number !== lease.member
        && act("give-control", one.number, "give", "Give control", `Give control to ${one.name}`)}
      ${teaches && one.waiting > 0 && act("withdraw", one.number, "remove", "Remove", `Take ${one.name} out of the queue`)}
    </li>`)}</ul>
    ${others > 0 && html`<p class="muted">and ${others} more</p>`}</section>`;
}
