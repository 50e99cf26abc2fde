// The page's frame: the bar, the 3D view with the panels' tabs beside it, and the strip; each panel in its own place.
import { html, Icon, observed, useEffect, useRef, useState } from "./ui.js";

const WIDTH = "vrs-side-width";
const [NARROWEST, WIDEST, USUAL] = [320, 640, 364];
const STEP = 24;

/** Which tab is shown. */
export class Layout {
  constructor(panels) {
    this.panels = panels;
    const side = panels.filter(({ place }) => place === "side").map(({ name }) => name);
    observed(this, {
      shown: side[0],
      /** The panels that are there so far, by name: what their modules export. */
      modules: {},
    });
  }

  show(name) {
    this.shown = name;
  }
}

export function App({ station }) {
  const { panels, robots } = station.config;
  const at = (place) => panels.filter((panel) => panel.place === place)
    .map((panel) => html`<${Card} key=${panel.name} station=${station} panel=${panel} />`);
  return html`
    <header id="bar"><h1 class="name">VRS teleop</h1>
      ${robots.length > 0 && html`<nav id="robots" aria-label="Robots">
        ${robots.map(([name, page, here]) => html`<a href=${page} aria-current=${here && "page"}>${name}</a>`)}</nav>`}
      <div id="bar-panels">${at("header")}</div></header>
    <main id="work">
      <div id="pane-box">${at("pane")}</div>
      <${Splitter} />
      <div id="side"><${Tabs} station=${station} /><div id="tab-panels" tabindex="0">${at("side")}</div></div>
    </main>
    <section id="strip-box" aria-label="What was and what is planned">${at("strip")}</section>
    ${at("nowhere")}`;
}

/** A panel's place. The camera's picture stands beside the stick: one drives by it. */
function Card({ station, panel: { name, place } }) {
  const { layout } = station;
  const module = layout.modules[name];
  const shown = layout.shown === name || (name === "camera" && layout.shown === "drive");
  const tabbed = place === "side" ? { role: "tabpanel", "aria-labelledby": `tab-${name}`, hidden: !shown } : {};
  return html`<div id=${`card-${name}`} class="card" ...${tabbed}>
    <div id=${`panel-${name}`} class=${`panel panel-${name}`}>${module?.Panel && html`<${module.Panel} station=${station} />`}</div></div>`;
}

function Tabs({ station: { layout, drives } }) {
  const side = layout.panels.filter(({ place }) => place === "side");

  function walk(event) {
    const at = side.findIndex(({ name }) => name === layout.shown);
    const to = { ArrowRight: at + 1, ArrowLeft: at - 1, Home: 0, End: side.length - 1 }[event.key];
    if (to === undefined) return;
    event.preventDefault();
    event.stopPropagation();
    const { name } = side[(to + side.length) % side.length];
    layout.show(name);
    document.getElementById(`tab-${name}`).focus();
  }

  function choose({ detail, currentTarget }, name) {
    layout.show(name);
    // Arrow keys drive; who came here by them walks on by them.
    if (drives && detail) currentTarget.blur();
  }

  return html`<div id="tabs" role="tablist" aria-label="Panels" onKeyDown=${walk}>
    ${side.map(({ name, title, icon }) => {
      const chosen = name === layout.shown;
      return html`<button class="tab" type="button" role="tab" id=${`tab-${name}`} aria-controls=${`card-${name}`}
        aria-selected=${String(chosen)} tabindex=${chosen ? 0 : -1} onClick=${(event) => choose(event, name)}>
        ${icon && html`<${Icon} name=${icon} />`}${title}</button>`;
    })}</div>`;
}

/** Between the 3D view and the panels: drawn, or moved by arrow keys. */
function Splitter() {
  const [width, setWidth] = useState(Number(localStorage.getItem(WIDTH)) || USUAL);
  const most = Math.min(WIDEST, window.innerWidth - 560);
  const now = Math.round(Math.max(NARROWEST, Math.min(most, width)));
  const held = useRef(null);
  useEffect(() => {
    document.getElementById("station").style.setProperty("--side", `${now}px`);
    localStorage.setItem(WIDTH, now);
  }, [now]);

  function key(event) {
    const way = { ArrowLeft: STEP, ArrowRight: -STEP }[event.key];
    if (way === undefined) return;
    event.preventDefault();
    event.stopPropagation();
    setWidth(now + way);
  }

  function grab(event) {
    event.currentTarget.setPointerCapture(event.pointerId);
    held.current = now + event.clientX;
  }

  const move = (event) => held.current !== null && setWidth(held.current - event.clientX);
  return html`<div id="splitter" role="separator" aria-orientation="vertical" aria-label="Width of the panels" tabindex="0"
    aria-valuemin=${NARROWEST} aria-valuemax=${WIDEST} aria-valuenow=${now} onKeyDown=${key} onPointerDown=${grab}
    onPointerMove=${move} onLostPointerCapture=${() => (held.current = null)}></div>`;
}
