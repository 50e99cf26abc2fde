// A line that is being typed in a terminal, below what has been said: history, and the keys that people know.

/** Lines that are kept, from one visit to the next. */
const KEPT = 200;
const KEY = "vrs-terminal";
/** Pieces of what a terminal sends for keys: sequences, control characters, and text between them. */
const KEYS = /\x1b(?:\[[0-9;]*[~A-Za-z]|O[A-Za-z]|.)?|[\x00-\x1f\x7f]|[^\x00-\x1f\x1b\x7f]+/gs;
const WORD = /\s*\S+\s*$/;

export class Editor {
  /**
   * @param term an xterm
   * @param {{line: function(string[]), interrupt: function(), complete: function(string)}} does
   */
  constructor(term, does) {
    this.term = term;
    this.does = does;
    this.prompt = "";
    this.text = "";
    this.at = 0;
    /** What a program typed without ending the line; it stands before the prompt. */
    this.partial = "";
    /** Rows between the first one of the line and the cursor. */
    this.row = 0;
    this.history = JSON.parse(localStorage.getItem(KEY) ?? "[]");
    this.back = 0;
    this.draft = "";
    this.keys = this.bound();
  }

  /** What keys do, by what a terminal sends for them: each key, and its letter with Ctrl. */
  bound() {
    const does = [
      ["\x7f \b", () => this.cut(this.at - 1, this.at)], ["\x1b[3~ \x04", () => this.cut(this.at, this.at + 1)],
      ["\x1b[D \x1bOD \x02", () => this.go(this.at - 1)], ["\x1b[C \x1bOC \x06", () => this.go(this.at + 1)],
      ["\x1b[H \x1bOH \x01", () => this.go(0)], ["\x1b[F \x1bOF \x05", () => this.go(Infinity)],
      ["\x1b[A \x1bOA \x10", () => this.recall(1)], ["\x1b[B \x1bOB \x0e", () => this.recall(-1)],
      ["\x15", () => this.cut(0, this.at)], ["\x0b", () => this.cut(this.at, Infinity)],
      ["\x17", () => this.cut(this.at - (this.text.slice(0, this.at).match(WORD)?.[0].length ?? 0), this.at)],
      ["\x03", () => this.interrupt()], ["\x0c", () => this.wipe()],
      ["\t", () => this.text && this.does.complete(this.text.slice(0, this.at))],
    ];
    return Object.fromEntries(does.flatMap(([keys, action]) => keys.split(" ").map((key) => [key, action])));
  }

  /** Take what the terminal sends for keys, or a text that's pasted. */
  take(data) {
    const pasted = data.replaceAll("\x1b[200~", "").replaceAll("\x1b[201~", "");
    const lines = [];
    for (const piece of pasted.replace(/\r\n?|\n/g, "\r").match(KEYS) ?? []) {
      if (piece === "\r") lines.push(this.end());
      else this.press(piece);
    }
    if (lines.length) this.does.line(lines);
    else this.draw();
  }

  press(piece) {
    const does = this.keys[piece];
    if (does) does();
    else if (piece >= " ") this.insert(piece);
  }

  insert(text) {
    this.text = this.text.slice(0, this.at) + text + this.text.slice(this.at);
    this.at += text.length;
  }

  cut(from, to) {
    from = Math.max(0, from);
    this.text = this.text.slice(0, from) + this.text.slice(to);
    this.at = from;
  }

  go(at) {
    this.at = Math.max(0, Math.min(this.text.length, at));
  }

  recall(by) {
    const back = Math.max(0, Math.min(this.history.length, this.back + by));
    if (back === this.back) return;
    if (this.back === 0) this.draft = this.text;
    this.back = back;
    this.text = back === 0 ? this.draft : this.history[this.history.length - back];
    this.at = this.text.length;
  }

  /** The line is complete: it's left standing, and remembered. */
  end() {
    const line = this.leave("");
    this.prompt = "";
    if (line.trim() && line !== this.history.at(-1)) {
      this.history = [...this.history, line].slice(-KEPT);
      localStorage.setItem(KEY, JSON.stringify(this.history));
    }
    return line;
  }

  /** Type a line for somebody; what they had typed is dropped. */
  enter(line) {
    this.text = line;
    this.does.line([this.end()]);
  }

  interrupt() {
    this.leave("^C");
    this.does.interrupt();
  }

  /** Leave what is typed standing, with a mark behind it, and begin a line below; what was typed. */
  leave(mark) {
    const line = this.text;
    this.at = line.length;
    this.draw();
    this.term.write(mark + "\r\n");
    this.text = this.partial = "";
    this.at = this.row = this.back = 0;
    return line;
  }

  wipe() {
    this.erase();
    this.term.write("\x1b[2J\x1b[H");
  }

  clear() {
    this.erase();
    this.text = this.partial = this.prompt = "";
    this.at = this.back = 0;
  }

  print(text) {
    this.term.write(text);
  }

  /** What follows a word, as far as it's certain; all that may, where it isn't. */
  complete({ text, fragment, words }) {
    if (this.text.slice(0, this.at) !== text || words.length === 0) return;
    let common = words[0];
    for (const word of words) {
      while (!word.toLowerCase().startsWith(common.toLowerCase())) common = common.slice(0, -1);
    }
    if (common.length > fragment.length || words.length === 1) {
      this.cut(this.at - fragment.length, this.at);
      this.insert(words.length === 1 ? common + " " : common);
      this.draw();
    } else {
      this.erase();
      this.term.write(`\x1b[36m${words.join("  ")}\x1b[0m\r\n`);
      this.draw();
    }
  }

  /**
   * Write what was said above the line.
   * @param {string} coloured as it's written
   * @param {string} bare as it was said
   * @param {string} prompt what is asked now
   * @param {function()} done called when it has been shown
   */
  hear(coloured, bare, prompt, done) {
    this.erase();
    const before = this.partial;
    const ends = bare.lastIndexOf("\n");
    this.partial = ends < 0 ? before + bare : bare.slice(ends + 1);
    const cut = coloured.lastIndexOf("\n");
    const whole = ends < 0 ? "" : before + coloured.slice(0, cut + 1) + "\x1b[0m";
    this.prompt = prompt;
    this.term.write(whole, done);
    this.draw();
  }

  /** What stands before that which is typed. */
  get head() {
    const partial = this.partial.replace(/[\x00-\x1f\x7f-\x9f]/g, "");
    return partial && this.prompt.length === 1 ? partial + "\r\n" + this.prompt : partial + this.prompt;
  }

  erase() {
    this.term.write((this.row ? `\x1b[${this.row}A` : "") + "\r\x1b[J");
    this.row = 0;
  }

  /** Write the line anew, and put the cursor where it belongs. */
  draw() {
    this.erase();
    const width = Math.max(2, this.term.cols);
    const [first, last] = this.head.includes("\r\n") ? this.head.split("\r\n") : ["", this.head];
    const above = this.head.includes("\r\n") ? Math.max(1, Math.ceil(first.length / width)) : 0;
    const all = last.length + this.text.length;
    const at = last.length + this.at;
    // A line that ends with the row leaves the cursor in it: the blank takes it on.
    const full = all > 0 && all % width === 0 ? " \b" : "";
    this.term.write(this.head + this.text + full);
    const up = Math.floor(all / width) - Math.floor(at / width);
    this.term.write((up ? `\x1b[${up}A` : "") + `\r${at % width ? `\x1b[${at % width}C` : ""}`);
    this.row = above + Math.floor(at / width);
  }
}
