// Live plots: how far the robots are apart, why, and what the network does.
import { ACROSS, Chart, isDue, stalest, swatch } from "./chart.js";
import { save, textOf } from "./csv.js";
import { clockText, h, mark, write } from "./dom.js";
import { Figures } from "./figures.js";
import { graphs } from "./graphs.js";
import { KINDS } from "./happenings.js";
import { PlotHead, loadStyles, notes, palette } from "./plothead.js";
import { Samples } from "./samples.js";

/** Windows that one may choose: seconds, name, time between two pictures of a plot [ms], and two comparisons [ms]. */
const SPANS = [
  [30, "30 s", 180, 1000],
  [120, "2 min", 300, 2500],
  [600, "10 min", 800, 8000],
];
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
const COMPARED = [
  ["timeline", "at the same place in the plan"],
  ["user", "at the same moment"],
];
const NOTES = [
  "The virtual robot is as shown, corrections included; the report and vrs compare take what the commands alone make.",
  "The report's own attribution switches causes off in runs of its own: that can't be had live. Payload and friction are in the servo's part.",
  "Times of the real robot are by the clocks as they were compared, sure to half the shortest round trip.",
  "Time difference and path error are of this window; what is still to come of a path isn't reached.",
];

export function mount(station, box) {
  loadStyles();
  station.shared.plots = new Plots(station, box);
}

class Plots {
  constructor(station, box) {
    this.station = station;
    this.session = station.session;
    this.samples = new Samples(station);
    this.happenings = station.happenings;
    this.charts = graphs(this.samples.chain).map((graph) => new Chart(graph));
    this.figures = new Figures();
    this.parts = [...this.charts, this.figures];
    this.head = new PlotHead(SPANS, { chosen: () => this.choose(), save: () => this.save() });
    this.colour = palette(() => this.again());
    this.basis = "timeline";
    this.paths = null;
    this.compared = this.said = this.spoken = -Infinity;
    this.saidAt = null;
    this.comparing = 0;
    this.number = 0;
    this.cost = 0;
    this.cached = { key: "", events: [] };
    this.build(box);
    station.addEventListener("cursor", () => this.again());
    setInterval(() => this.turn(), TURN);
  }

  build(box) {
    this.basisBox = h(
      "select",
      { id: "plots-basis", "aria-label": "Where the errors are compared" },
      ...COMPARED.map(([value, text]) => h("option", { value }, text)),
    );
    this.basisBox.addEventListener("change", () => {
      this.basis = this.basisBox.value;
      this.again();
    });
    this.shows = h("p.muted.plots-shows", { id: "plots-shows" });
    const keys = KINDS.map(([kind, text]) => h("li", {}, swatch(...ACROSS[kind]), text));
    box.append(
      this.head.element,
      h("label.row.plots-head", {}, h("span", {}, "Errors"), this.basisBox),
      this.shows,
      ...this.charts.map((chart) => chart.element),
      h("ul.plot-key", { "aria-label": "Lines across the plots" }, ...keys),
      this.figures.element,
      notes(
        this.charts.map(({ graph }) => graph),
        h("dt", {}, "What isn't known live"),
        ...NOTES.map((text) => h("dd", {}, text)),
      ),
    );
  }

  choose() {
    this.paths = null;
    this.compared = -Infinity;
    this.again();
  }

  again() {
    for (const part of this.parts) part.wanted = true;
  }

  /** What is shown now; null where nothing is known yet. */
  view() {
    const { now } = this.session;
    if (now === null) return null;
    const [span] = this.head.span;
    const cursor = this.station.cursor;
    const until = cursor === null ? now : Math.min(now, cursor + span / 2);
    return {
      samples: this.samples,
      from: until - span,
      until,
      span,
      cursor,
      now,
      basis: this.basis,
      paths: this.paths,
    };
  }

  /** Draw one plot, or the figures, if they're due: never two at once. */
  turn() {
    this.samples.advance();
    if (document.hidden || !this.shown) return;
    const view = this.view();
    if (!view) return;
    this.library ??= import("./uplot.min.js").then(({ default: UPlot }) => {
      this.UPlot = UPlot;
    });
    const at = performance.now();
    this.say(view, at);
    if (!this.UPlot) return;
    this.compare(view, at);
    const seen = this.charts.filter((chart) => chart.visible).length;
    const period = Math.max(this.head.span[2], (this.cost * seen) / SHARE);
    const due = this.parts.filter((part) => isDue(part, at, part === this.figures ? COUNTED : period));
    const part = stalest(due);
    if (!part) return;
    if (part === this.figures) part.draw(view, this.title(view));
    else this.draw(part, view);
    [part.drawn, part.wanted] = [at, false];
  }

  get shown() {
    return this.station.layout.shown === "plots";
  }

  draw(chart, view) {
    const begun = performance.now();
    if (!chart.plot) chart.begin(this.UPlot, this.colour);
    chart.draw({ ...view, events: this.events(view) });
    this.cost += 0.2 * (performance.now() - begun - this.cost);
  }

  /** Say how everything stands, also of plots that are folded or out of sight. */
  say(view, at) {
    if (at - this.said < SAID && view.cursor === this.saidAt) return;
    [this.said, this.saidAt] = [at, view.cursor];
    const speaks = at - this.spoken > SPOKEN;
    if (speaks) this.spoken = at;
    const shown = this.title(view);
    for (const chart of this.charts) {
      const { title, unit } = chart.graph;
      const text = this.words(chart, view);
      write(chart.value, text);
      if (speaks) mark(chart.area, "aria-label", `${title}, ${unit}, ${shown}: ${text}`);
    }
    write(this.shows, `${shown}${view.cursor === null ? "" : `, values at ${clockText(view.cursor)}`}`);
  }

  title({ from, until, cursor }) {
    return cursor === null ? `Newest ${this.head.span[1]}` : `${clockText(from)} to ${clockText(until)}`;
  }

  /** The value at the cursor, or the newest one. */
  words({ graph }, view) {
    const { table } = this.samples;
    const t = view.cursor ?? view.now;
    const index = table.before(t + 1e-9) - 1;
    if (graph.ofPaths) return graph.words(view);
    if (index < 0 || t - table.get("t", index) > OLD) {
      if (view.cursor !== null) return "not kept here";
      return table.length ? "nothing heard now" : "nothing heard yet";
    }
    return graph.words({ ...view, index });
  }

  /** Lines across; for all plots of a turn or two the same. */
  events({ from, until }) {
    const key = `${Math.floor(until * 4)} ${this.head.span[0]}`;
    if (this.cached.key !== key) this.cached = { key, events: this.happenings.between(from, until) };
    return this.cached.events;
  }

  /** Let the paths be compared now and then, where somebody looks at that. */
  compare({ from, until, samples }, at) {
    const chart = this.charts.find(({ graph }) => graph.ofPaths);
    const looked = chart.visible || this.figures.element.open;
    if (!looked || this.comparing || at - this.compared < this.head.span[3]) return;
    const { path, table } = samples;
    const last = Math.min(until, table.newest);
    const leader = [path.before(from - LEAD), path.before(last + 1e-9)];
    const follower = [Math.max(table.before(from - LEAD) - 1, 0), table.length];
    if (leader[1] - leader[0] < 3 || follower[1] - follower[0] < 2) return;
    this.compared = at;
    if (!this.worker) {
      this.worker = new Worker("/station/pathworker.js", { type: "module" });
      this.worker.onmessage = ({ data }) => this.found(data);
    }
    const points = (from_, [low, high]) => {
      const columns = ["x", "y", "z"].map((name) => from_.column(name));
      const joined = new Float64Array(3 * (high - low));
      for (let k = low; k < high; k++) for (let i = 0; i < 3; i++) joined[3 * (k - low) + i] = columns[i][k];
      return joined;
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

  found(paths) {
    if (paths.number !== this.comparing) return;
    this.comparing = 0;
    this.paths = paths;
    this.charts.find(({ graph }) => graph.ofPaths).wanted = true;
  }

  async save() {
    const parts = await textOf(this.samples.table, (joint) => this.samples.chain.slides(joint));
    save(parts, `vrs-plots-${Math.round(this.session.now ?? 0)}s.csv`);
    this.station.announce(`${this.samples.table.length} samples saved.`);
  }
}
