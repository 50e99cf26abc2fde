// What asks for a token, over a page whose server wants one.
import { html, useEffect, useRef } from "./ui.js";

/** @param {object} page has `unlock(token)`, and `refused` where one was shown that isn't valid */
export function Door({ page }) {
  const input = useRef(null);
  useEffect(() => input.current.focus(), []);

  function enter(event) {
    event.preventDefault();
    page.unlock(input.current.value);
  }

  return html`<form id="enter" onSubmit=${enter}>
    <label for="token">This server asks for a token.</label>
    <div><input id="token" ref=${input} type="password" autocomplete="off" spellcheck="false" required /><button>Enter</button></div>
    <p id="refused" hidden=${!page.refused}>That token isn't valid here.</p></form>`;
}
