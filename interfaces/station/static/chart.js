// One plot: its head with the present value, what its lines mean, and the curves, drawn by uPlot.
import { clockText, h } from "./dom.js";
import { thinned } from "./thinning.js";

const HEIGHT = 112;
const STEPS = [1, 2, 5, 10, 15, 30, 60, 120, 300];
/** How lines across are drawn: colour, dashes. */
export const ACROSS = { begin: ["--muted", [2, 4]], corrected: ["--committed", []], halted: ["--bad", [6, 3]] };

/** A line as it's drawn, for a legend. */
export function swatch(colour, dash, width = 2) {
  const svg = document.createElementNS("http://www.w3.org/2000/svg", "svg");
  const path = document.createElementNS("http://www.w3.org/2000/svg", "path");
  svg.setAttribute("viewBox", "0 0 26 8");
  svg.setAttribute("aria-hidden", "true");
  svg.classList.add("swatch");
  path.setAttribute("d", "M0 4H26");
  path.setAttribute("stroke-dasharray", dash.join(" "));
  path.setAttribute("stroke-width", width);
  path.style.stroke = `var(${colour})`;
  svg.append(path);
  return svg;
}

/** The axis of values: room around what there is, and never less than what can be told apart. */
function range({ least, zero = false }, low, high) {
  if (low === null || high === null) return zero ? [0, least] : [-least / 2, least / 2];
  if (zero && low >= 0) return [0, Math.max(1.12 * high, least)];
  const [middle, half] = [(low + high) / 2, Math.max(0.56 * (high - low), least / 2)];
  return [middle - half, middle + half];
}

/** Whether a part of a page that's seen is to be drawn anew, as that's wanted or its last picture is so old [ms]. */
export function isDue(part, at, every) {
  return part.visible && (part.wanted || at - part.drawn >= every);
}

/** Of what is due to be drawn, what was drawn longest ago: so nothing waits for ever where all is due always. */
export function stalest(due) {
  return due.reduce((oldest, one) => (one.drawn < oldest.drawn ? one : oldest), due[0]);
}

export class Chart {
  /** @param {object} graph what it shows, see graphs.js */
  constructor(graph) {
    this.graph = graph;
    this.plot = null;
    this.visible = false;
    this.drawn = -Infinity;
    this.wanted = true;
    this.dots = [[], []];
    this.crosses = [];
    this.events = [];
    this.cursor = null;
    this.window = [0, 1];
    this.value = h("span.plot-value", { id: `value-${graph.name}` });
    this.area = h("div.plot-area", { role: "img", id: `plot-${graph.name}`, "aria-label": graph.title });
    const keys = graph.lines.map(({ label, colour, dash, width }) =>
      h("li", {}, swatch(colour, dash, width), label),
    );
    for (const [kind, label] of graph.marks ?? [])
      keys.push(h("li", {}, h(`span.plot-${kind}`, { "aria-hidden": "true" }), label));
    this.element = h(
      "details.plot",
      { open: graph.open, id: `graph-${graph.name}` },
      h(
        "summary",
        { title: graph.note },
        h("span.plot-title", {}, graph.title, " ", h("span.muted", {}, graph.unit)),
        this.value,
      ),
      keys.length > 1 ? h("ul.plot-key", { "aria-label": `Lines of ${graph.title}` }, ...keys) : null,
      this.area,
    );
    // A busy page tells several changes at once; the last one holds.
    new IntersectionObserver((changes) => {
      this.visible = changes.at(-1).isIntersecting;
      this.wanted = true;
    }).observe(this.area);
    new ResizeObserver(() => {
      const width = this.area.clientWidth;
      if (this.plot && width > 0) this.plot.setSize({ width, height: HEIGHT });
    }).observe(this.area);
  }

  /** Begin to draw. @param {Function} UPlot the library's class */
  begin(UPlot, colour) {
    const { graph } = this;
    this.colour = colour;
    const axis = {
      stroke: () => colour("--muted"),
      grid: { stroke: () => colour("--line"), width: 1 },
      ticks: { show: false },
      font: "11px system-ui, sans-serif",
      gap: 3,
    };
    const options = {
      width: Math.max(this.area.clientWidth, 100),
      height: HEIGHT,
      padding: [6, 8, 0, 0],
      legend: { show: false },
      cursor: { show: false },
      scales: {
        x: { time: false, range: () => this.window },
        y: { range: (_, low, high) => range(graph, ...this.extent(low, high)) },
      },
      axes: [
        {
          ...axis,
          size: 21,
          gap: 5,
          space: 60,
          incrs: STEPS,
          values: (_, splits) => splits.map((t) => clockText(t).replace(/\.0$/, "")),
        },
        {
          ...axis,
          size: 42,
          space: 24,
          values: (_, splits) => splits.map((y) => String(Number(y.toFixed(6))).replace("-", "−")),
        },
      ],
      series: [
        {},
        ...graph.lines.map((line) => ({
          label: line.label,
          stroke: () => colour(line.colour),
          dash: line.dash,
          width: line.width,
          points: { show: false },
        })),
      ],
      hooks: { drawClear: [(plot) => this.across(plot)], draw: [(plot) => this.marks(plot)] },
    };
    this.plot = new UPlot(options, [[0, 1], ...graph.lines.map(() => [null, null])], this.area);
  }

  /** What the axis must hold; a few long delays don't make all others small. */
  extent(low, high) {
    const delays = this.dots[1].filter((x) => x !== null).sort((a, b) => a - b);
    if (!delays.length) return [low, high];
    const usual = 1.12 * delays[Math.floor(0.9 * (delays.length - 1))];
    return [low === null ? 0 : Math.min(low, 0), high === null ? usual : Math.max(high, usual)];
  }

  /** Draw a window. @param {object} view see `Plots` */
  draw(view) {
    const { from, until, events, cursor, samples } = view;
    let data = this.graph.data(view);
    if (!data[0].length) data = [[from, until], ...this.graph.lines.map(() => [null, null])];
    if (this.graph.dots) {
      const { arrived, lost } = samples;
      this.dots = thinned(
        arrived.column("arrived"),
        [arrived.column("delay")],
        arrived.before(from),
        arrived.before(until),
        until - from,
      );
      this.crosses = lost.column("sent").subarray(lost.before(from), lost.before(until));
    }
    [this.window, this.events, this.cursor] = [[from, until], events, cursor];
    this.plot.batch(() => {
      this.plot.setData(data, false);
      this.plot.setScale("x", { min: from, max: until });
    });
  }

  /** Lines across, below the curves. */
  across(plot) {
    const { ctx, bbox } = plot;
    const line = (t, colour, dash, width) => {
      const x = Math.round(plot.valToPos(t, "x", true)) + 0.5;
      ctx.strokeStyle = this.colour(colour);
      ctx.lineWidth = width * devicePixelRatio;
      ctx.setLineDash(dash.map((part) => part * devicePixelRatio));
      ctx.beginPath();
      ctx.moveTo(x, bbox.top);
      ctx.lineTo(x, bbox.top + bbox.height);
      ctx.stroke();
    };
    ctx.save();
    ctx.globalAlpha = 0.55;
    for (const { t, kind } of this.events) line(t, ...ACROSS[kind], 1);
    ctx.globalAlpha = 1;
    if (this.cursor !== null) line(this.cursor, "--ink", [], 2);
    ctx.restore();
  }

  /** Single messages, over the curves. */
  marks(plot) {
    if (!this.graph.dots) return;
    const { ctx, bbox } = plot;
    const size = 2.4 * devicePixelRatio;
    ctx.save();
    ctx.fillStyle = this.colour("--virtual");
    this.dots[0].forEach((t, k) => {
      if (this.dots[1][k] === null) return;
      const [x, y] = [plot.valToPos(t, "x", true), Math.max(plot.valToPos(this.dots[1][k], "y", true), bbox.top)];
      ctx.fillRect(x - size / 2, y - size / 2, size, size);
    });
    ctx.strokeStyle = this.colour("--bad");
    ctx.lineWidth = 1.4 * devicePixelRatio;
    ctx.beginPath();
    for (const t of this.crosses.slice(-300)) {
      const [x, y] = [plot.valToPos(t, "x", true), bbox.top + bbox.height - 2 * size];
      for (const way of [-1, 1]) {
        ctx.moveTo(x - size, y - way * size);
        ctx.lineTo(x + size, y + way * size);
      }
    }
    ctx.stroke();
    ctx.restore();
  }
}
