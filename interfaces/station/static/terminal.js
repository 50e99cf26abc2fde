// VAL-II's monitor: a terminal of this page at the server's controller. Lines are edited here, and sent whole.
import { theme } from "./theme.js";
import { effect, html, Icon, observed, useEffect, useRef } from "./ui.js";
import { Editor } from "./lineedit.js";

/** Lines that can be scrolled back to. */
const SCROLLBACK = 2000;
/** Lines that go into one message, and characters of a line; the server takes no more. */
const [AT_ONCE, LONGEST] = [100, 2048];
/** Time between two messages when much is pasted, and between two that tell what has been shown [ms]. */
const PACE = 60;
const HINT = "Tab completes, Ctrl-C aborts, Escape leaves";
/** Sizes of the letters [px], and the width from which on the larger ones are taken. */
const [SMALL, USUAL, WIDE] = [11, 13, 460];
const STYLES = { answer: "", typed: "\x1b[1m", note: "\x1b[36m", error: "\x1b[31m" };
const OFF = "\x1b[0m";
const COLOURS = {
  light: { background: "#ffffff", foreground: "#18202c", cursor: "#1f6fd6", cursorAccent: "#ffffff", cyan: "#3d5a73",
    red: "#b3261e", selectionBackground: "#bcd6fa" },
  dark: { background: "#10151b", foreground: "#e7ecf3", cursor: "#6aa9ff", cursorAccent: "#10151b", cyan: "#93b4cf",
    red: "#ff8a80", selectionBackground: "#2c527d" },
};

/** What a program types may ring, and begin lines, but does nothing else to the terminal. */
const plain = (text) => text.replace(/[\x00-\x06\x08\x0b-\x1f\x7f-\x9f]/g, "").replaceAll("\n", "\r\n");

class Monitor {
  constructor(station, screen) {
    this.session = station.session;
    this.screen = screen;
    this.term = this.fit = this.editor = this.socket = null;
    this.started = false;
    /** Sizes of what has been shown, and of what the server was told of that. */
    this.shown = this.told = 0;
    /** Lines to be sent; timers of both kinds of messages. */
    this.outgoing = [];
    this.pacing = this.telling = null;
    /** By which session the server thinks that this page commands, and whether a lost connection is to be made again. */
    this.who = "";
    this.relive = false;
    // How the connection is, in words; programs that can be loaded; and whether it's closed, to be opened again by hand.
    observed(this, { state: "", files: [], closed: false });
    station.on("lease", () => this.tellWho());
    station.on("link", (link) => {
      if (link !== "live" || !this.relive) return;
      this.relive = false;
      this.open();
    });
  }

  /** What is on the screen and above it, for tests and for copying. */
  get text() {
    const buffer = this.term?.buffer.active;
    const lines = [];
    for (let y = 0; y < (buffer?.length ?? 0); y++) {
      const line = buffer.getLine(y);
      const part = line.translateToString(!buffer.getLine(y + 1)?.isWrapped);
      if (line.isWrapped) lines[lines.length - 1] += part;
      else lines.push(part);
    }
    return lines.join("\n").trimEnd();
  }

  get columns() {
    return this.term?.cols ?? 0;
  }

  get connected() {
    return this.socket?.readyState === WebSocket.OPEN;
  }

  /** Nothing is loaded, and nobody connects, before somebody looks at it. */
  look() {
    if (this.screen.clientWidth === 0) return;
    if (!this.started) this.start();
    else if (this.fit) this.fitted();
  }

  async start() {
    this.started = true;
    this.state = "Loading …";
    const sheet = Object.assign(document.createElement("link"), { rel: "stylesheet", href: "/station/xterm.css" });
    document.head.append(sheet);
    const [{ Terminal }, { FitAddon }] = await Promise.all([import("./xterm.min.js"), import("./xterm-fit.min.js")]);
    const term = (this.term = new Terminal({
      convertEol: false, cursorBlink: false, fontFamily: "ui-monospace, 'DejaVu Sans Mono', Menlo, Consolas, monospace",
      fontSize: USUAL, scrollback: SCROLLBACK, screenReaderMode: true, theme: COLOURS[theme()],
    }));
    this.fit = new FitAddon();
    term.loadAddon(this.fit);
    term.open(this.screen);
    term.textarea.setAttribute("aria-label", "VAL-II terminal. " + HINT);
    term.textarea.id = "terminal-input";
    this.editor = new Editor(term, {
      line: (lines) => this.type(lines),
      interrupt: () => this.send({ type: "interrupt" }),
      complete: (text) => this.send({ type: "complete", text: text.slice(0, LONGEST) }),
    });
    term.attachCustomKeyEventHandler((event) => this.takes(event));
    term.onData((data) => this.connected && this.editor.take(data));
    effect(() => (term.options.theme = COLOURS[theme()]));
    this.fitted();
    this.open();
  }

  fitted() {
    this.term.options.fontSize = this.screen.clientWidth < WIDE ? SMALL : USUAL;
    this.fit.fit();
    this.editor.draw();
    this.send({ type: "columns", columns: this.columns });
  }

  /** Whether a key is the terminal's. Escape leaves; keys that are the page's or the browser's stay so. */
  takes(event) {
    if (event.key === "Escape") {
      if (event.type === "keydown") document.getElementById("tab-terminal").focus();
      return false;
    }
    if (event.key === "Tab") {
      if (event.shiftKey || !this.editor.text) return false;
      event.preventDefault();
      return true;
    }
    const copies = event.ctrlKey && event.key.toLowerCase() === "c" && (event.shiftKey || this.term.hasSelection());
    const pastes = event.ctrlKey && event.key.toLowerCase() === "v";
    return !(copies || pastes);
  }

  /** Connect: one at a time; a terminal that was lost begins anew. */
  open() {
    if (this.socket !== null || !this.term || this.session.link === "locked") return;
    this.closed = false;
    this.state = "Connecting …";
    this.shown = this.told = 0;
    this.outgoing = [];
    const mine = (this.socket = new WebSocket(location.origin.replace(/^http/, "ws") + window.VrsLink.FOLDER + "/val"));
    mine.onopen = () => {
      this.who = "";
      this.send({ type: "hello", token: this.session.token ?? null, session: this.session.key ?? "" });
    };
    mine.onmessage = ({ data }) => this.socket === mine && this.take(JSON.parse(data));
    mine.onclose = ({ code, reason }) => {
      if (this.socket !== mine) return;
      this.socket = null;
      const why = reason || (code === 1000 ? "the monitor was left" : "the connection was lost");
      this.editor.clear();
      this.editor.print(`\x1b[33m[closed: ${plain(why)}]${OFF}\r\n`);
      this.state = `Closed: ${why}`;
      this.closed = true;
      if (!reason) this.relive = true;
    };
  }

  send(message) {
    if (this.connected) this.socket.send(JSON.stringify(message));
  }

  /** Tell the server by which session this page commands. */
  tellWho() {
    const session = this.session.key ?? "";
    if (session === this.who || !this.connected) return;
    this.who = session;
    this.send({ type: "who", session });
  }

  take(message) {
    if (message.type === "said") this.hear(message);
    else if (message.type === "completed") this.editor.complete(message);
    else if (message.type === "ready") {
      this.state = message.barred ? "You watch: what moves or changes something is refused" : HINT;
      this.files = message.barred ? [] : message.files;
      this.tellWho();
      requestAnimationFrame(() => this.fitted());
    }
  }

  hear({ pieces, prompt, size }) {
    const text = pieces.map(([part, style]) => (STYLES[style] ?? "") + plain(part) + OFF).join("");
    this.editor.hear(text, pieces.map(([part]) => part).join(""), plain(prompt), () => {
      this.shown = size;
      this.telling ??= setTimeout(() => this.tell(), PACE);
    });
  }

  /** The server sends no more than fits before it hears what has been shown. */
  tell() {
    this.telling = null;
    if (this.shown > this.told) this.send({ type: "shown", size: (this.told = this.shown) });
  }

  type(lines) {
    this.outgoing.push(...lines.map((line) => line.slice(0, LONGEST + 1)));
    this.pump();
  }

  pump() {
    if (this.pacing !== null || this.outgoing.length === 0) return;
    const part = [];
    let size = 0;
    while (this.outgoing.length && part.length < AT_ONCE && size < 2 * LONGEST) {
      part.push(this.outgoing.shift());
      size += part.at(-1).length;
    }
    this.send({ type: "lines", lines: part });
    this.pacing = setTimeout(() => {
      this.pacing = null;
      this.pump();
    }, PACE);
  }

  load(name) {
    if (!this.connected || !name) return;
    this.editor.enter(`LOAD ${name}`);
    this.term.focus();
  }
}

export function Panel({ station }) {
  const [screen, chosen] = [useRef(null), useRef(null)];
  useEffect(() => {
    station.terminal = new Monitor(station, screen.current);
    const watch = new ResizeObserver(() => station.terminal.look());
    watch.observe(screen.current);
    return () => watch.disconnect();
  }, []);
  const { terminal } = station;
  const files = terminal?.files ?? [];
  return html`
    <div class="row programs" hidden=${files.length === 0}><label for="terminal-file">Programs</label>
      <select id="terminal-file" ref=${chosen} aria-label="Program">
        ${files.map((name) => html`<option>${name}</option>`)}</select>
      <button type="button" id="terminal-load" onClick=${() => terminal.load(chosen.current.value)}>Load</button></div>
    <div class="screen" id="terminal-screen" ref=${screen}></div>
    <div class="row foot"><${Icon} name="keyboard" /><span id="terminal-state" role="status">${terminal?.state}</span>
      <button class="small" type="button" id="terminal-again" hidden=${!terminal?.closed} onClick=${() => terminal.open()}>
        Open again</button></div>`;
}
