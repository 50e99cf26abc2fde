// Plots of how far the robots are apart, why, and what the network does: of what is live here, and of recordings.
import { Chart, due } from "./chart.js";
import { armFigures, armGraphs, BASES, driveGraphs, DRIVE_FIGURES, rowsOf } from "./graphs.js";
import { ACROSS } from "./happenings.js";
import { DriveSamples, Samples } from "./samples.js";
import { Table } from "./table.js";
import { theme } from "./theme.js";
import { clockText, effect, html, observed, save, useEffect, useMemo, useRef } from "./ui.js";

/** Windows that one may choose: seconds, name, time between two pictures of a plot [ms], and two comparisons [ms]. */
const SPANS = [[30, "30 s", 180, 1000], [120, "2 min", 300, 2500], [600, "10 min", 800, 8000]];
const TURN = 50;
/** Time between two countings of the figures [ms]. */
const COUNTED = 1000;
/** Drawing takes this share of the time at most. */
const SHARE = 0.2;
/** Values older than this aren't the present ones [s]. */
const OLD = 1.5;
/** The paths are compared from so long before the window [s]. */
const LEAD = 10;
/** Values in words are written, and told to screen readers, so often [ms]. */
const SAID = 250;
const SPOKEN = 2000;
const COMPARED = { timeline: "at the same place in the plan", user: "at the same moment" };
const NOT_LIVE = [
  "The virtual robot is as shown, corrections included; the report and vrs compare take what the commands alone make.",
  "The report's own attribution switches causes off in runs of its own: that can't be had live. Payload and friction are in the servo's part.",
  "Times of the real robot are by the clocks as they were compared, sure to half the shortest round trip.",
  "Time difference and path error are of this window; what is still to come of a path isn't reached.",
];

/** Plots that are drawn one after the other, as far as they're seen. */
export class Plots {
  /**
   * @param {object[]} graphs what is plotted, see graphs.js
   * @param {Array[]} figures what is told in numbers, see there
   * @param {object[]} sources samples of the session, or of each recording: tables `table`, `arrived`, `lost`, `paths`
   * @param {Array[]} spans windows, as `SPANS`; the first is shown
   */
  constructor(graphs, figures, sources, spans) {
    Object.assign(this, { graphs, figureNames: figures, spans, cost: 0, said: -Infinity, spoken: -Infinity, saidAt: null });
    /** What is said of a time of which nothing is known. */
    this.nothing = "not kept here";
    /** Of what the figures are. */
    this.counted = "this window";
    this.charts = graphs.flatMap((graph) => sources.map((_, k) => new Chart(graph, k)));
    this.figures = { visible: false, wanted: true, drawn: -Infinity };
    this.parts = [...this.charts, this.figures];
    observed(this, { span: spans[0], basis: BASES[0], shows: "", title: "", rows: [] });
    // All is drawn anew where one of these is another.
    effect(() => this.again(theme(), this.span, this.basis));
  }

  again() {
    for (const part of this.parts) part.wanted = true;
  }

  /** Draw one plot, or the figures, if they're due: never two at once. @param {object[]} views one for each source */
  turn(views, at = performance.now()) {
    this.say(views, at);
    if (!this.UPlot) {
      this.loading ??= import("./uplot.min.js").then(({ default: UPlot }) => (this.UPlot = UPlot));
      return;
    }
    const seen = this.charts.filter((chart) => chart.visible).length;
    const period = Math.max(this.span[2], (this.cost * seen) / SHARE);
    const part = due(this.parts, at, (one) => (one === this.figures ? COUNTED : period));
    if (!part) return;
    if (part === this.figures) this.count(views);
    else {
      part.draw(this.UPlot, views[part.of]);
      this.cost += 0.2 * (performance.now() - at - this.cost);
    }
    [part.drawn, part.wanted] = [at, false];
  }

  count([view, ...others]) {
    this.title = this.titleOf(view);
    this.rows = rowsOf(this.figureNames, [view, ...others].map(({ samples, from, until }) => samples.summary(from, until)));
  }

  titleOf({ from, until, cursor }) {
    return cursor === null ? `Newest ${this.span[1]}` : `${clockText(from)} to ${clockText(until)}`;
  }

  /** Say how everything stands, also of plots that are folded or out of sight. */
  say(views, at) {
    const [{ cursor }] = views;
    if (at - this.said < SAID && cursor === this.saidAt) return;
    [this.said, this.saidAt] = [at, cursor];
    const speaks = at - this.spoken > SPOKEN;
    if (speaks) this.spoken = at;
    const shown = this.titleOf(views[0]);
    for (const chart of this.charts) {
      chart.text = this.words(chart, views[chart.of]);
      if (speaks) chart.spoken = `${chart.graph.title}, ${chart.graph.unit}, ${shown}: ${chart.text}`;
    }
    this.shows = `${shown}${cursor === null ? "" : `, values at ${clockText(cursor)}`}`;
  }

  /** The value at the cursor, or the newest one. */
  words({ graph }, view) {
    const { samples: { table, compared }, cursor, now } = view;
    if (graph.ofPaths) return graph.words({ path: compared });
    const t = cursor ?? now;
    const index = table.before(t + 1e-9) - 1;
    if (index >= 0 && t - table.get(table.names[0], index) <= OLD) return graph.words({ ...view, index });
    if (cursor !== null) return this.nothing;
    return table.length ? "nothing heard now" : "nothing heard yet";
  }
}

/** Those of the session. */
class LivePlots extends Plots {
  constructor(station) {
    const { chain, drives } = station;
    const samples = drives ? new DriveSamples(station) : new Samples(station);
    const arm = chain && { joints: chain.screws.length, slides: (joint) => chain.slides(joint) };
    super(drives ? driveGraphs(true) : armGraphs(arm, true), drives ? DRIVE_FIGURES : armFigures(arm), [samples], SPANS);
    Object.assign(this, { station, samples });
    this.events = { key: "", found: [] };
    this.compared = -Infinity;
    this.comparing = this.number = 0;
    effect(() => this.again(station.cursor));
    setInterval(() => this.work(), TURN);
  }

  /** What is shown now; null where nothing is known yet. */
  view() {
    const { now } = this.station.session;
    if (now === null) return null;
    const [span] = this.span;
    const { cursor } = this.station;
    const until = cursor === null ? now : Math.min(now, cursor + span / 2);
    // Lines across are the same for all plots of a turn or two.
    const key = `${Math.floor(until * 4)} ${span}`;
    if (this.events.key !== key) this.events = { key, found: this.station.happenings.between(until - span, until) };
    return { samples: this.samples, from: until - span, until, cursor, now, basis: this.basis, events: this.events.found };
  }

  work() {
    this.samples.advance();
    if (document.hidden || this.station.layout.shown !== "plots") return;
    const view = this.view();
    if (!view) return;
    if (!this.station.drives) this.compare(view, performance.now());
    this.turn([view]);
  }

  /** Let the paths be compared now and then, where somebody looks at that. */
  compare({ from, until }, at) {
    const looked = this.figures.visible || this.charts.some(({ graph, visible }) => graph.ofPaths && visible);
    if (!looked || this.comparing || at - this.compared < this.span[3]) return;
    const { path, table } = this.samples;
    const last = Math.min(until, table.newest);
    const leader = path.between(from - LEAD, last + 1e-9);
    const follower = [Math.max(table.before(from - LEAD) - 1, 0), table.length];
    if (leader[1] - leader[0] < 3 || follower[1] - follower[0] < 2) return;
    this.compared = at;
    if (!this.worker) {
      this.worker = new Worker("/station/pathworker.js", { type: "module" });
      this.worker.onmessage = ({ data }) => this.found(data);
    }
    const points = (of, [low, high]) => {
      const columns = ["x", "y", "z"].map((name) => of.column(name));
      return Float64Array.from({ length: 3 * (high - low) }, (_, k) => columns[k % 3][low + Math.floor(k / 3)]);
    };
    this.comparing = ++this.number;
    this.worker.postMessage({
      number: this.number,
      t: path.column("t").slice(...leader),
      leader: points(path, leader),
      times: table.column("t").slice(...follower),
      follower: points(table, follower),
    });
  }

  /** What became of it, by the names of a summary. */
  found({ number, arrival, late, mean, sd, max, bound, progress, pathError }) {
    if (number !== this.comparing) return;
    this.comparing = 0;
    this.samples.paths = Table.of({ arrival, late });
    this.samples.compared = {
      time_difference_mean: mean, time_difference_sd: sd, time_difference_max: max, time_difference_bound: bound, progress,
      path_error_mean: pathError[0], path_error_p95: pathError[1], path_error_max: pathError[2],
    };
    this.charts.find(({ graph }) => graph.ofPaths).wanted = true;
  }

  /** Let the browser keep what is kept here as a file. */
  async keep() {
    const { samples, station } = this;
    const parts = await samples.table.csv((name) => samples.headed(name));
    save(parts, `vrs-${station.drives ? "drive" : "plots"}-${Math.round(station.session.now ?? 0)}s.csv`);
    station.announce(`${samples.table.length} samples saved.`);
  }
}

/** Style sheets of plots, loaded once. */
export function loadStyles() {
  for (const name of ["uplot", "plots"]) {
    const sheet = Object.assign(document.createElement("link"), { rel: "stylesheet", href: `/station/${name}.css` });
    document.head.append(sheet);
  }
}

export function Panel({ station }) {
  const plots = useMemo(() => {
    loadStyles();
    return (station.plots = new LivePlots(station));
  }, []);
  return html`<${Board} plots=${plots} save=${() => plots.keep()} notes=${station.drives ? [] : NOT_LIVE} />`;
}

/**
 * Plots with what stands around them: the window that is shown, what is compared, and the figures.
 * @param {string[]} letters what to call each of several recordings
 * @param {string[]} notes what isn't known
 */
export function Board({ plots, letters = [""], save, notes = [] }) {
  const { graphs, spans } = plots;
  return html`
    <div class="row plots-head">
      <div class="row spans" role="group" aria-label="Time that is shown">${spans.map((span) => html`<button type="button"
        aria-pressed=${String(plots.span === span)} data-span=${span[0]} onClick=${() => (plots.span = span)}>${span[1]}</button>`)}</div>
      <span class="grow"></span>
      ${save && html`<button type="button" id="plots-save" title="Save what is kept, ten minutes at most" onClick=${save}>CSV</button>`}
    </div>
    ${graphs.some(({ based }) => based) && html`<label class="row plots-head"><span>Errors</span>
      <select id="plots-basis" aria-label="Where the errors are compared" value=${plots.basis}
        onChange=${({ target }) => (plots.basis = target.value)}>
        ${BASES.map((basis) => html`<option value=${basis}>${COMPARED[basis]}</option>`)}</select></label>`}
    <${Shows} plots=${plots} />
    ${graphs.map((graph) => html`<${Graph} key=${graph.name} graph=${graph} letters=${letters}
      charts=${plots.charts.filter((chart) => chart.graph === graph)} />`)}
    <ul class="plot-key" aria-label="Lines across the plots">${Object.entries(ACROSS).map(([kind, [text]]) =>
      html`<li><i class=${`across across-${kind}`}></i>${text}</li>`)}</ul>
    <${Figures} plots=${plots} letters=${letters} />
    <details class="plot"><summary><span class="plot-title">What these show</span></summary><dl class="plot-notes">
      ${graphs.map(({ title, note }) => html`<dt>${title}</dt><dd>${note}</dd>`)}
      ${notes.length > 0 && html`<dt>What isn't known live</dt>${notes.map((text) => html`<dd>${text}</dd>`)}`}</dl></details>`;
}

const Shows = ({ plots }) => html`<p class="muted plots-shows" id="plots-shows">${plots.shows}</p>`;

function Graph({ graph: { name, title, unit, note, open }, charts, letters }) {
  return html`<details class="plot" id=${`graph-${name}`} open=${open}>
    <summary title=${note}><span class="plot-title">${title} <span class="muted">${unit}</span></span>
      <${Value} name=${name} charts=${charts} letters=${letters} /></summary>
    ${charts.map((chart, k) => html`<${Area} chart=${chart} letter=${letters[k]} id=${`plot-${name}${k ? "-b" : ""}`} />`)}</details>`;
}

const Value = ({ name, charts, letters }) => html`<span class="plot-value" id=${`value-${name}`}>
  ${charts.map((chart, k) => html`<span>${letters[k] && html`<b>${letters[k]}</b> `}${chart.text}</span>`)}</span>`;

function Area({ chart, letter, id }) {
  const area = useRef(null);
  useEffect(() => chart.attach(area.current), [chart]);
  return html`${letter && html`<b class="plot-letter" aria-hidden="true">${letter}</b>`}
    <div class=${`plot-area ${chart.graph.lines.length > 1 ? "keyed" : ""}`} role="img" id=${id} aria-label=${letter + (letter && ": ") + chart.spoken} ref=${area}></div>`;
}

/** A table of what the plots show, for those who read; filled while it's open. */
function Figures({ plots, letters }) {
  const toggle = ({ target }) => Object.assign(plots.figures, { visible: target.open, wanted: true });
  return html`<details class="plot" id="plot-figures" onToggle=${toggle}>
    <summary><span class="plot-title">Figures of ${plots.counted}</span></summary>
    <table class="plot-figures"><caption>${plots.title}</caption>
      <thead><tr>${["Figure", ...letters.map((letter) => letter || "Value"), "Unit"].map((text) => html`<th scope="col">${text}</th>`)}</tr></thead>
      <tbody>${plots.rows.map(([name, ...cells]) => html`<tr key=${name}><th scope="row">${name}</th>
        ${cells.map((text) => html`<td>${text}</td>`)}</tr>`)}</tbody></table></details>`;
}
