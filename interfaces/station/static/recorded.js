// Plots of recordings: what the server makes of them, by the definitions of `vrs compare`.
import { armFigures, armGraphs, driveGraphs, DRIVE_FIGURES } from "./graphs.js";
import { Board, Plots } from "./plots.js";
import { Table } from "./table.js";
import { html, useEffect, useSignal } from "./ui.js";

/** Windows, see `Plots`: the whole is drawn when it's another, the others follow the play head. */
const SPANS = [[Infinity, "Whole", Infinity], [120, "2 min", 300], [30, "30 s", 200], [5, "5 s", 100]];
const TURN = 50;
/** Lines across, by the kinds of marks; more begins of moves than these say nothing any more. */
const LINES = { command: "begin", corrected: "corrected", stopped: "halted" };
const MOST = 40;
/** What is being written is asked for again after so long [ms], or so many times as long as it took. */
const AGAIN = 10000;
const TIMES = 10;

export class RecordedPlots extends Plots {
  /** @param {object[]} found what the server has of each recording */
  constructor(replay, found) {
    const [{ joints, prismatic }] = found;
    const arm = { joints, slides: (joint) => prismatic.includes(joint) };
    const sources = found.map(() => ({}));
    super(joints ? armGraphs(arm, false) : driveGraphs(false), joints ? armFigures(arm) : DRIVE_FIGURES, sources, SPANS);
    Object.assign(this, { replay, sources, nothing: "nothing measured here", counted: "the whole recording" });
    this.take(found);
  }

  take(found) {
    found.forEach(({ summary, ...tables }, k) => {
      for (const name of ["table", "arrived", "lost", "paths"]) this.sources[k][name] = tables[name] && Table.of(tables[name]);
      Object.assign(this.sources[k], { compared: summary.path, summary: () => summary });
    });
    this.missing = found.flatMap(({ summary }, k) => (summary.missing ?? []).map((text) => this.replay.letter(k) + text));
    this.again();
  }

  count(views) {
    super.count(views);
    this.title = "As vrs compare has them";
  }

  work() {
    const { span: [start, end], shown, marks, wish } = this.replay;
    const [length] = this.span;
    const from = length < Infinity ? Math.max(start, Math.min(shown - length / 2, end - length)) : start;
    const until = Math.min(end, from + length);
    const views = this.sources.map((samples, k) => {
      const lines = marks[k].flatMap(({ kind, t }) => (kind in LINES && t >= from && t <= until ? [{ kind: LINES[kind], t }] : []));
      const begins = lines.filter(({ kind }) => kind === "begin").length;
      const events = begins > MOST ? lines.filter(({ kind }) => kind !== "begin") : lines;
      return { samples, from, until, cursor: shown, now: shown, basis: this.basis, events, seek: (t) => wish("seek", { t }) };
    });
    if (this.drawnTo !== until && length === Infinity) this.again();
    this.drawnTo = until;
    this.turn(views);
    for (const chart of this.charts) if (chart.visible && chart.plot) chart.point(shown);
  }
}

/** Reads the recordings' curves, and shows them. */
export function Side({ replay }) {
  const plots = useSignal(null);
  const problem = useSignal("");
  useEffect(() => {
    let timer = 0;
    let left = false;

    async function ask(k) {
      const answer = await fetch(`${window.VrsLink.FOLDER}/replay/curves/${k}${location.search}`, {
        headers: { Authorization: `Bearer ${sessionStorage.getItem("token") ?? ""}` },
      });
      const found = await answer.json();
      if (!answer.ok) throw new Error(found.problem);
      return found;
    }

    async function read() {
      const begun = performance.now();
      try {
        const found = await Promise.all(replay.items.map((_, k) => ask(k)));
        if (left) return;
        if (plots.value) plots.value.take(found);
        else plots.value = new RecordedPlots(replay, found);
        problem.value = "";
      } catch (error) {
        problem.value = `Nothing can be plotted: ${error.message}`;
      }
      if (replay.growing && !left) timer = setTimeout(read, Math.max(AGAIN, TIMES * (performance.now() - begun)));
    }

    read();
    const turning = setInterval(() => document.hidden || plots.value?.work(), TURN);
    return () => {
      left = true;
      clearInterval(turning);
      clearTimeout(timer);
    };
  }, [replay.items.length, replay.growing]);
  const shown = plots.value;
  return html`<div class="panel-plots">
    <p class="muted" id="plots-problem" role="status" hidden=${shown && !problem.value}>${problem.value || "Reading the recording…"}</p>
    ${shown && html`<${Board} plots=${shown} letters=${replay.items.length > 1 ? ["A", "B"] : [""]} />
      ${shown.missing.length > 0 && html`<p class="muted plots-shows" id="plots-missing">Not in it: ${shown.missing.join("; ")}</p>`}`}</div>`;
}
