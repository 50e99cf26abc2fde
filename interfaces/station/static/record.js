// Recording on the fly, and the list of recordings: replayed alone or side by side, copied, deleted.
import { sideLink } from "./sidelink.js";
import { html, Icon, observed, useEffect, useMemo, useRef, useSignal, useState } from "./ui.js";

const ALIGNED = { start: "beginnings together", began: "as they happened, by the clock", timeline: "at equal session times" };
const MOST_CHOSEN = 2;
const OPEN = ["Choose one or two to replay", "Replay", "Replay side by side"];

const two = (number) => String(number).padStart(2, "0");
const plain = (name) => name.replace(/\.mcap$/, "");

/** Bytes as people read them. */
function sizeText(bytes) {
  if (bytes < 1e6) return Math.max(1, Math.round(bytes / 1e3)) + " kB";
  return (bytes / 1e6).toFixed(bytes < 1e7 ? 1 : 0) + " MB";
}

/** Seconds as h:mm:ss or m:ss. */
function lengthText(seconds) {
  const whole = Math.round(seconds);
  const [hours, minutes] = [Math.floor(whole / 3600), Math.floor(whole / 60) % 60];
  return (hours ? `${hours}:${two(minutes)}` : minutes) + ":" + two(whole % 60);
}

function whenText(seconds) {
  const at = new Date(seconds * 1000);
  return `${at.getFullYear()}-${two(at.getMonth() + 1)}-${two(at.getDate())} ${two(at.getHours())}:${two(at.getMinutes())}`;
}

/** When, how long, how large. */
const factsOf = ({ began, changed, length, size }) =>
  [whenText(began ?? changed), length === null ? null : lengthText(length), sizeText(size)].filter(Boolean).join(" · ");

/** What the server records and has, as fields, and what it's asked for. */
export class Recordings {
  constructor(station) {
    this.station = station;
    // What is being recorded, four times a second; of it what seldom changes: its name, and why it failed.
    observed(this, { now: null, growing: null, failed: "" });
    observed(this, { items: [], directory: "", more: 0, robot: "", problem: "", busy: false });
    sideLink(station, "/recordings/board", {
      take: (data) => {
        const { kind, ...told } = JSON.parse(typeof data === "string" ? data : new TextDecoder().decode(data));
        if (kind === "list") Object.assign(this, told);
        else if (kind === "recording") Object.assign(this, told, { growing: told.now?.name ?? null, failed: told.now?.problem ?? "" });
      },
    });
  }

  /** A name that isn't taken: the robot, and the time here. */
  get freshName() {
    const robot = this.robot.replace(/[^\w.+-]/g, "-").replace(/^[^A-Za-z0-9]+/, "") || "recording";
    const name = `${robot} ${whenText(Date.now() / 1000).replace(":", ".")}`;
    const taken = (one) => this.items.some((item) => item.name === `${one}.mcap`);
    let [fresh, number] = [name, 2];
    while (taken(fresh)) fresh = `${name} (${number++})`;
    return fresh;
  }

  /** Ask the server; what it answers, or null where it doesn't do it. */
  async ask(what, name) {
    this.busy = true;
    const body = JSON.stringify({ do: what, ...(name && { name }) });
    const found = await this.station.session.ask("/recordings", { method: "POST", body });
    this.busy = false;
    this.complain(found.problem ?? "");
    return found.problem ? null : found;
  }

  complain(text) {
    this.problem = text;
    this.station.refuse(text);
  }

  async end() {
    const name = this.growing;
    if (await this.ask("end")) this.station.announce("Recording ended: " + plain(name));
  }

  async copy(name) {
    const found = await this.ask("copy", name);
    if (!found) return;
    const link = Object.assign(document.createElement("a"), { href: window.VrsLink.FOLDER + found.path, download: name });
    link.click();
  }

  async delete(name) {
    if (await this.ask("delete", name)) this.station.announce(`${plain(name)} is deleted`);
  }
}

export function Panel({ station }) {
  const recordings = useMemo(() => (station.recordings = new Recordings(station)), []);
  const { growing, failed, items, directory, more, problem } = recordings;
  const [chosen, setChosen] = useState([]); // names, the first chosen first
  const [doomed, setDoomed] = useState(null);
  const may = station.session.mayCommand;
  const there = chosen.filter((one) => items.some(({ name, playable }) => name === one && playable));

  useEffect(() => {
    const { dataset } = document.getElementById("tab-record");
    if (growing) dataset.recording = failed ? "failed" : "yes";
    else delete dataset.recording;
    if (failed) station.announce(failed, { urgent: true });
  }, [growing, failed]);

  const choose = (name) => setChosen(there.includes(name) ? there.filter((one) => one !== name) : [...there, name].slice(-MOST_CHOSEN));
  const letter = (name) => (there.includes(name) ? (there.length > 1 ? "AB"[there.indexOf(name)] : "✓") : "");
  return html`
    ${growing ? html`<${Now} recordings=${recordings} may=${may} />` : may && html`<${Begin} recordings=${recordings} />`}
    <p class="muted" id="record-idle" hidden=${Boolean(growing) || may}>Nothing is being recorded. Operators can begin.</p>
    <p class="refused" id="record-problem" hidden=${!problem}>${problem}</p>
    <h2>Recordings</h2>
    <ul class="recordings" id="recordings" aria-label="Recordings, newest first">${items.map((item) => html`<${Row} key=${item.name} item=${item}
      growing=${growing === item.name} letter=${letter(item.name)} choose=${choose} copy=${() => recordings.copy(item.name)}
      drop=${may && (() => setDoomed(item))} />`)}</ul>
    ${doomed && html`<${Deletion} key=${doomed.name} item=${doomed} drop=${() => recordings.delete(doomed.name)} close=${() => setDoomed(null)} />`}
    <p class="muted where">${directory && (items.length ? `In ${directory}${more ? `, and ${more} older ones` : ""}` : `None yet in ${directory}`)}</p>
    <${Choice} chosen=${there} />`;
}

/** A name, shown before it begins, and the button that begins. */
function Begin({ recordings }) {
  const given = useSignal(null);

  async function begin(event) {
    event.preventDefault();
    const name = plain(event.target.elements["record-name"].value.trim());
    if (!name) return recordings.complain("The recording needs a name.");
    if (await recordings.ask("begin", name + ".mcap")) recordings.station.announce("Recording " + plain(name));
  }

  return html`<form class="row" id="record-form" onSubmit=${begin}>
    <input id="record-name" maxlength="95" spellcheck="false" autocomplete="off" aria-label="Name of the recording"
      value=${given.value ?? recordings.freshName} onInput=${({ target }) => (given.value = target.value)} />
    <span class="muted">.mcap</span>
    <button class="main" type="submit" id="record-begin" disabled=${recordings.busy}><${Icon} name="fiber_manual_record" /><span>Record</span></button></form>`;
}

/** What is being recorded. */
function Now({ recordings, may }) {
  const { name, length, size, dropped, problem } = recordings.now;
  const left = dropped ? ` · ${dropped} messages left out: the disk is slow` : "";
  return html`<div class="recording" id="recording" data-failed=${problem ? "" : null}>
    <${Icon} name=${problem ? "error" : "fiber_manual_record"} />
    <div class="grow"><span class="what">${problem ? "Not recording" : `Recording ${plain(name)}`}</span>
      <span class="muted">${problem || `since ${lengthText(length)} · ${sizeText(size)}${left}`}</span></div>
    <button type="button" id="record-end" hidden=${!may} disabled=${recordings.busy} onClick=${() => recordings.end()}>
      <${Icon} name="stop" /><span>${problem ? "Put it away" : "End"}</span></button></div>`;
}

function Row({ item, growing, letter, choose, copy, drop }) {
  const { name, playable, problem } = item;
  return html`<li data-name=${name}>
    <button class="pick" type="button" aria-pressed=${String(Boolean(letter))} disabled=${!playable} onClick=${() => choose(name)}>
      <span class="letter" aria-hidden="true">${letter}</span>
      <span class="about"><span class="name">${plain(name)}</span><span class="muted">${factsOf(item)}</span>
        <span class="wrong" data-growing=${growing ? "" : null}>${growing ? "being recorded" : problem}</span></span></button>
    <button class="quiet" type="button" disabled=${growing} onClick=${copy} aria-label=${`Download ${name}`} title="Download"><${Icon} name="download" /></button>
    ${drop && html`<button class="quiet" type="button" disabled=${growing} onClick=${drop} aria-label=${`Delete ${name}`} title="Delete"><${Icon} name="delete" /></button>`}
  </li>`;
}

/** What is replayed of those that are chosen. */
function Choice({ chosen }) {
  const [align, setAlign] = useState("start");
  const query = new URLSearchParams({ a: chosen[0], ...(chosen.length > 1 && { b: chosen[1], align }) });
  return html`<div class="choice">
    <select id="record-align" aria-label="Side by side, aligned" hidden=${chosen.length < 2} value=${align} onChange=${({ target }) => setAlign(target.value)}>
      ${Object.entries(ALIGNED).map(([value, text]) => html`<option value=${value}>${text}</option>`)}</select>
    <a class="open" id="record-replay" target="_blank" rel="opener" aria-disabled=${chosen.length ? null : "true"}
      href=${chosen.length ? `${window.VrsLink.FOLDER}/replay?${query}` : null}><${Icon} name="play_circle" /><span>${OPEN[chosen.length]}</span></a></div>`;
}

/** Asks before a recording is lost; beside the list, so that STOP stays within reach. */
function Deletion({ item, drop, close }) {
  const keep = useRef(null);
  useEffect(() => {
    keep.current.focus();
    keep.current.closest(".deletion").scrollIntoView({ block: "nearest" });
  }, []);
  return html`<div class="deletion" role="alertdialog" aria-label="Delete a recording" onKeyDown=${({ key }) => key === "Escape" && close()}>
    <p>Delete <b>${plain(item.name)}</b>? The file (${factsOf(item)}) is lost for everybody, and can't be brought back.</p>
    <div class="row">
      <button type="button" id="record-delete-yes" onClick=${() => (drop(), close())}>Delete it</button>
      <button type="button" ref=${keep} onClick=${close}>Keep it</button>
    </div></div>`;
}
