// Elements of the panels that aren't components.
import { render } from "./preact.min.js";
import { OUTLINES } from "./icons.js";

export { DEGREES, clockText, degrees, figure, isTyping } from "./ui.js";

/**
 * An element.
 * @param {string} tag with classes after dots: "div.row.wide"
 * @param {object} props attributes; `on…` are listeners, null and false leave one out
 * @param {...(Node|string|null)} children
 */
export function h(tag, props = {}, ...children) {
  const [name, ...classes] = tag.split(".");
  const element = document.createElement(name);
  if (classes.length) element.className = classes.join(" ");
  for (const [key, value] of Object.entries(props)) {
    if (value === null || value === undefined || value === false) continue;
    if (key.startsWith("on")) element.addEventListener(key.slice(2), value);
    else element.setAttribute(key, value === true ? "" : value);
  }
  element.append(...children.filter((child) => child !== null && child !== undefined));
  return element;
}

/** A component in an element of its own. */
export function planted(component) {
  const place = h("span.planted");
  render(component, place);
  return place;
}

const SVG = "http://www.w3.org/2000/svg";

/** A symbol by its name in `OUTLINES`; people hear and read the words beside it. */
export function icon(name) {
  const symbol = document.createElementNS(SVG, "svg");
  symbol.setAttribute("class", "icon");
  symbol.setAttribute("viewBox", "0 0 24 24");
  symbol.setAttribute("aria-hidden", "true");
  symbol.append(document.createElementNS(SVG, "path"));
  draw(symbol, name);
  return symbol;
}

/** Let a symbol be another one, but touch nothing if it's that already. */
export function draw(symbol, name) {
  mark(symbol.firstChild, "d", OUTLINES[name]);
}

/** Write a text, but touch nothing if it's there already. */
export function write(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

/** Set an attribute, but touch nothing if it's so already; null takes it away. */
export function mark(element, name, value) {
  if (value === null || value === false) element.removeAttribute(name);
  else if (element.getAttribute(name) !== String(value)) element.setAttribute(name, String(value));
}
