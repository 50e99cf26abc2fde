// What components are made of: Preact with htm, signals as fields, symbols, and numbers as people read them.
import { html, signal, useEffect, useRef } from "./preact.min.js";
import { OUTLINES } from "./icons.js";

export { batch, computed, effect, html, render, signal, untracked } from "./preact.min.js";
export { useComputed, useEffect, useLayoutEffect, useMemo, useRef, useSignal, useSignalEffect, useState } from "./preact.min.js";

/**
 * Give an object fields that are signals: a component that reads one while it's drawn is drawn anew when that changes.
 * @param {object} object
 * @param {object} fields their first values, by name
 */
export function observed(object, fields) {
  for (const [name, value] of Object.entries(fields)) {
    const field = signal(value);
    const change = (to) => (field.value = to);
    Object.defineProperty(object, name, { get: () => field.value, set: change, enumerable: true });
  }
}

/** Listen to what happens (an order, an outcome, a problem) for as long as the component is there. */
export function useOn(target, type, listener, options) {
  const newest = useRef(listener);
  newest.current = listener;
  useEffect(() => {
    const hear = (event) => newest.current(event instanceof CustomEvent ? event.detail : event);
    target.addEventListener(type, hear, options);
    return () => target.removeEventListener(type, hear, options);
  }, [target, type]);
}

/** Do something every so often [ms] for as long as the component is there. */
export function useEvery(period, action) {
  const newest = useRef(action);
  newest.current = action;
  useEffect(() => {
    const timer = setInterval(() => newest.current(), period);
    return () => clearInterval(timer);
  }, [period]);
}

/** A symbol by its name in `OUTLINES`; people hear and read the words beside it. */
export function Icon({ name }) {
  return html`<svg class="icon" viewBox="0 0 24 24" aria-hidden="true"><path d=${OUTLINES[name]} /></svg>`;
}

/** A state in a word and a symbol. */
export function Pill({ id, title, tone, icon, children, ...others }) {
  return html`<span class="pill" role="status" id=${id} title=${title} data-tone=${tone} ...${others}>
    <${Icon} name=${icon} /><span>${children}</span></span>`;
}

/** A dialog over the page, open for as long as it's there; `close` is called when it's left. */
export function Dialog({ children, close, ...others }) {
  const dialog = useRef(null);
  useEffect(() => dialog.current.showModal(), []);
  return html`<dialog ref=${dialog} onClose=${close} ...${others}>${children}</dialog>`;
}

/** One of several: pairs of a value and what people read. */
export function Choice({ label, options, choose, ...others }) {
  return html`<select aria-label=${label} onChange=${({ target }) => choose(target.value)} ...${others}>
    ${options.map(([value, text]) => html`<option value=${value}>${text}</option>`)}</select>`;
}

/** Of a control: that it can't work now and why, "" where it can, and what else it's titled. */
export const barred = (why, title) => ({ "aria-disabled": why ? "true" : undefined, title: why || title });

/** Let the browser keep a file. @param {string[]} parts its text */
export function save(parts, name, type = "text/csv") {
  const link = Object.assign(document.createElement("a"), { href: URL.createObjectURL(new Blob(parts, { type })), download: name });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);
}

/** Whether a key that is pressed belongs to what is written in. */
export function isTyping(event) {
  const target = event.target;
  if (!(target instanceof HTMLElement)) return false;
  if (target.isContentEditable || target.tagName === "TEXTAREA") return true;
  return target.tagName === "INPUT" && !["range", "checkbox", "radio", "button"].includes(target.type);
}

/** Degrees of a radian. */
export const DEGREES = 180 / Math.PI;

/** A number for people, with a real minus. */
export function figure(x, digits) {
  if (x === null || x === undefined || !Number.isFinite(x)) return "–";
  const text = x.toFixed(digits);
  return (Number(text) === 0 ? text.replace("-", "") : text).replace("-", "−");
}

/** Radians as degrees. */
export const degrees = (angle) => `${figure(angle * DEGREES, 1)}°`;

/** Seconds of the session as m:ss.s. */
export function clockText(t, decimals = 1) {
  const scale = 10 ** decimals;
  const parts = Math.round(Math.abs(t) * scale);
  const seconds = ((parts % (60 * scale)) / scale).toFixed(decimals).padStart(3 + decimals, "0");
  return (t < 0 ? "−" : "") + Math.floor(parts / (60 * scale)) + ":" + seconds;
}
