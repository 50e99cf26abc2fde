// The hand: opened and closed, and how the real one is; of robots whose gripper has fingers.
import { barred, figure, html } from "./ui.js";

/** What is told of the real hand, for people. */
function words({ opening, holds }) {
  return `real: ${figure(1000 * opening, 0)} mm${(holds ?? null) === null ? "" : ", holds something"}`;
}

export function Hand({ station }) {
  const { session } = station;
  const why = station.idle;
  const real = session.state?.hand;

  /** Let the fingers go to an opening [m], or "inf" for as far as they go. */
  function grip(opening, label) {
    if (why) station.refuse(why);
    else session.order({ type: "grip", opening }, label);
  }

  const button = (id, opening, label, title) => html`<button class="small" type="button" id=${id} ...${barred(why, title)}
    onClick=${() => grip(opening, label)}>${title}</button>`;
  return html`<section>
    <div class="head"><h2>Hand</h2><span class="hint grow" id="hand-state">${real ? words(real) : ""}</span>
      ${button("hand-open", "inf", "Open the hand", "Open")}${button("hand-close", 0, "Close the hand", "Close")}</div></section>`;
}
