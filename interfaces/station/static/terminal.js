// VAL-II's monitor: a terminal of this page at the server's controller. Lines are edited here, and sent whole.
import { h, icon, write } from "./dom.js";
import { theme } from "./theme.js";
import { effect } from "./ui.js";
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

export function mount(station, box) {
  const session = station.session;
  const files = h("select", { id: "terminal-file", "aria-label": "Program" });
  const load = h("button", { type: "button", id: "terminal-load", onclick: loadChosen }, "Load");
  const bar = h("div.row.programs", { hidden: true }, h("label", { for: "terminal-file" }, "Programs"), files, load);
  const screen = h("div.screen", { id: "terminal-screen" });
  const state = h("span", { id: "terminal-state", role: "status" });
  const again = h("button.small", { type: "button", id: "terminal-again", hidden: true, onclick: open }, "Open again");
  box.append(bar, screen, h("div.row.foot", {}, icon("keyboard"), state, again));
  let term = null;
  let fit = null;
  let editor = null;
  let socket = null;
  let started = false;
  let shown = 0;
  let told = 0;
  let telling = null;
  let outgoing = [];
  let pacing = null;

  // Nothing is loaded, and nobody connects, before somebody looks at it.
  const watch = new ResizeObserver(() => {
    if (screen.clientWidth === 0) return;
    if (!started) start();
    else if (fit) fitted();
  });
  watch.observe(screen);

  async function start() {
    started = true;
    say("Loading …");
    document.head.append(h("link", { rel: "stylesheet", href: "/station/xterm.css" }));
    const [{ Terminal }, { FitAddon }] = await Promise.all([import("./xterm.min.js"), import("./xterm-fit.min.js")]);
    term = new Terminal({
      convertEol: false, cursorBlink: false, fontFamily: "ui-monospace, 'DejaVu Sans Mono', Menlo, Consolas, monospace",
      fontSize: USUAL, scrollback: SCROLLBACK, screenReaderMode: true, theme: COLOURS[theme()],
    });
    fit = new FitAddon();
    term.loadAddon(fit);
    term.open(screen);
    term.textarea.setAttribute("aria-label", "VAL-II terminal. " + HINT);
    term.textarea.id = "terminal-input";
    editor = new Editor(term, { line: typed, interrupt: () => send({ type: "interrupt" }), complete });
    term.attachCustomKeyEventHandler(key);
    term.onData((data) => connected() && editor.take(data));
    effect(() => (term.options.theme = COLOURS[theme()]));
    fitted();
    open();
  }

  function fitted() {
    term.options.fontSize = screen.clientWidth < WIDE ? SMALL : USUAL;
    fit.fit();
    editor?.draw();
  }

  /** Escape leaves; keys that are the page's or the browser's stay so. */
  function key(event) {
    if (event.key === "Escape") {
      if (event.type === "keydown") document.getElementById("tab-terminal").focus();
      return false;
    }
    if (event.key === "Tab") {
      if (event.shiftKey || !editor.text) return false;
      event.preventDefault();
      return true;
    }
    const copies = event.ctrlKey && event.key.toLowerCase() === "c" && (event.shiftKey || term.hasSelection());
    const pastes = event.ctrlKey && event.key.toLowerCase() === "v";
    return !(copies || pastes);
  }

  // The connection: one at a time; a terminal that was lost begins anew.

  const connected = () => socket !== null && socket.readyState === WebSocket.OPEN;

  function say(text) {
    write(state, text);
  }

  function open() {
    if (socket !== null || !term || session.link === "locked") return;
    again.hidden = true;
    say("Connecting …");
    shown = told = 0;
    outgoing = [];
    const mine = new WebSocket(location.origin.replace(/^http/, "ws") + window.VrsLink.FOLDER + "/val");
    socket = mine;
    mine.onopen = () => {
      who = "";
      mine.send(JSON.stringify({ type: "hello", token: session.token ?? null, ...me() }));
    };
    mine.onmessage = ({ data }) => socket === mine && take(JSON.parse(data));
    mine.onclose = ({ code, reason }) => {
      if (socket !== mine) return;
      socket = null;
      editor.clear();
      const why = reason || (code === 1000 ? "the monitor was left" : "the connection was lost");
      editor.print(`\x1b[33m[closed: ${plain(why)}]${OFF}\r\n`);
      editor.prompt = "";
      say(`Closed: ${why}`);
      again.hidden = false;
      if (!reason) relive = true;
    };
  }

  function send(message) {
    if (connected()) socket.send(JSON.stringify(message));
  }

  const me = () => ({ session: session.key ?? "" });
  let who = "";
  let relive = false;

  /** The server is told by which session this page commands. */
  function tellWho() {
    const now = JSON.stringify(me());
    if (now !== who && connected()) {
      who = now;
      send({ type: "who", ...me() });
    }
  }

  station.on("lease", tellWho);
  station.on("link", (link) => {
    if (link === "live" && relive) {
      relive = false;
      open();
    }
  });

  function take(message) {
    if (message.type === "said") hear(message);
    else if (message.type === "ready") ready(message);
    else if (message.type === "completed") editor.complete(message);
  }

  function ready({ files: names, barred }) {
    say(barred ? "You watch: what moves or changes something is refused" : HINT);
    files.replaceChildren(...names.map((name) => h("option", { value: name }, name)));
    bar.hidden = names.length === 0 || barred;
    tellWho();
    fitted();
  }

  function hear({ pieces, prompt, size }) {
    const text = pieces.map(([part, style]) => (STYLES[style] ?? "") + plain(part) + OFF).join("");
    editor.hear(text, pieces.map(([part]) => part).join(""), plain(prompt), () => {
      shown = size;
      telling ??= setTimeout(tell, PACE);
    });
  }

  /** The server sends no more than fits before it hears what has been shown. */
  function tell() {
    telling = null;
    if (shown > told) send({ type: "shown", size: (told = shown) });
  }

  function typed(lines) {
    outgoing.push(...lines.map((line) => line.slice(0, LONGEST + 1)));
    pump();
  }

  function pump() {
    if (pacing !== null || outgoing.length === 0) return;
    const part = [];
    let size = 0;
    while (outgoing.length && part.length < AT_ONCE && size < 2 * LONGEST) {
      const line = outgoing.shift();
      size += line.length;
      part.push(line);
    }
    send({ type: "lines", lines: part });
    pacing = setTimeout(() => {
      pacing = null;
      pump();
    }, PACE);
  }

  function complete(text) {
    send({ type: "complete", text: text.slice(0, LONGEST) });
  }

  function loadChosen() {
    if (!connected() || !files.value) return;
    editor.enter(`LOAD ${files.value}`);
    term.focus();
  }

  station.shared.terminal = {
    /** What is on the screen and above it, for tests and for copying. */
    get text() {
      if (!term) return "";
      const buffer = term.buffer.active;
      const lines = [];
      for (let y = 0; y < buffer.length; y++) {
        const line = buffer.getLine(y);
        const part = line.translateToString(!buffer.getLine(y + 1)?.isWrapped);
        if (line.isWrapped) lines[lines.length - 1] += part;
        else lines.push(part);
      }
      return lines.join("\n").trimEnd();
    },
    get columns() {
      return term?.cols ?? 0;
    },
  };
}
