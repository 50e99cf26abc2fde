// One picture of a graph by uPlot, with what happened drawn across it, and the time that is looked at.
import { ACROSS } from "./happenings.js";
import { theme } from "./theme.js";
import { clockText, observed } from "./ui.js";

const HEIGHT = 112;
const STEPS = [1, 2, 5, 10, 15, 30, 60, 120, 300, 600, 1800];

const colours = new Map();

/** A colour of the theme, by its name. */
function colour(name) {
  const key = theme() + name;
  if (!colours.has(key)) colours.set(key, getComputedStyle(document.documentElement).getPropertyValue(name).trim());
  return colours.get(key);
}

/** How a legend's marker is drawn. */
const styleOf = (line) => (line?.points ? "dotted" : line?.dash.length ? "dashed" : "solid");

/** The axis of values: room around what there is, and never less than what can be told apart. */
function range({ least, zero = false }, low, high) {
  if (low === null || high === null) return zero ? [0, least] : [-least / 2, least / 2];
  if (zero && low >= 0) return [0, Math.max(1.12 * high, least)];
  const [middle, half] = [(low + high) / 2, Math.max(0.56 * (high - low), least / 2)];
  return [middle - half, middle + half];
}

/** Of parts that are seen, the one that is to be drawn now: of those that are wanted or have their time, the oldest. */
export function due(parts, at, period) {
  const ready = parts.filter((part) => part.visible && (part.wanted || at - part.drawn >= period(part)));
  return ready.reduce((oldest, one) => (one.drawn < oldest.drawn ? one : oldest), ready[0]);
}

export class Chart {
  /**
   * @param {object} graph what it shows, see graphs.js
   * @param {number} of whose samples
   */
  constructor(graph, of = 0) {
    Object.assign(this, { graph, of, plot: null, visible: false, drawn: -Infinity, wanted: true, cursor: null, events: [] });
    this.window = [0, 1];
    /** What it says of a moment, and what screen readers are told of it. */
    observed(this, { text: "", spoken: graph.title });
  }

  /** Be in an element; what ends that. */
  attach(area) {
    this.area = area;
    // A busy page tells several changes at once; the last one holds.
    const seen = new IntersectionObserver((changes) => {
      this.visible = changes.at(-1).isIntersecting;
      this.wanted = true;
    });
    const sized = new ResizeObserver(() => {
      if (this.plot && area.clientWidth) this.plot.setSize({ width: area.clientWidth, height: HEIGHT });
    });
    for (const observer of [seen, sized]) observer.observe(area);
    return () => {
      for (const observer of [seen, sized]) observer.disconnect();
      this.plot?.destroy();
      this.plot = null;
    };
  }

  /** Draw a window. @param {object} view see `Plots` */
  draw(UPlot, view) {
    this.plot ??= this.make(UPlot, view.seek);
    const { from, until, events } = view;
    const found = this.graph.data(view, UPlot.join);
    const data = found[0].length ? found : [[from, until], ...this.graph.lines.map(() => [null, null])];
    [this.window, this.events] = [[from, until], events];
    this.plot.batch(() => {
      this.plot.setData(data, false);
      this.plot.setScale("x", { min: from, max: until });
    });
    this.point(view.cursor);
  }

  /** Mark the time that is looked at; null for none. */
  point(t) {
    this.cursor = t;
    if (!this.plot) return;
    this.hand.hidden = t === null || t < this.window[0] || t > this.window[1];
    if (t !== null) this.hand.style.transform = `translateX(${this.plot.valToPos(t, "x")}px)`;
  }

  make(UPlot, seek) {
    const { graph } = this;
    const axis = {
      stroke: () => colour("--muted"),
      grid: { stroke: () => colour("--line"), width: 1 },
      ticks: { show: false },
      font: "11px system-ui, sans-serif",
    };
    const plot = new UPlot(
      {
        width: Math.max(this.area.clientWidth, 100),
        height: HEIGHT,
        padding: [6, 8, 0, 0],
        legend: { show: graph.lines.length > 1, live: false, markers: { dash: (_, k) => styleOf(graph.lines[k - 1]) } },
        cursor: { y: false, drag: { x: false } },
        scales: {
          x: { time: false, range: () => this.window },
          y: { range: (_, low, high) => range(graph, low, high) },
        },
        axes: [
          { ...axis, size: 21, gap: 5, space: 60, incrs: STEPS, values: (_, at) => at.map((t) => clockText(t).replace(/\.0$/, "")) },
          { ...axis, size: 42, gap: 3, space: 24, values: (_, at) => at.map((y) => String(Number(y.toFixed(6))).replace("-", "−")) },
        ],
        series: [
          {},
          ...graph.lines.map(({ label, colour: name, dash, width, points }) => ({
            label,
            stroke: () => colour(name),
            ...(points
              ? { paths: () => null, points: { show: true, size: 4, fill: () => colour(name) } }
              : { dash, width, points: { show: false } }),
          })),
        ],
        hooks: { drawClear: [(drawn) => this.across(drawn)] },
      },
      [[0, 1], ...graph.lines.map(() => [null, null])],
      this.area,
    );
    this.hand = plot.over.appendChild(document.createElement("i"));
    this.hand.className = "plot-hand";
    if (seek) plot.over.addEventListener("click", () => seek(plot.posToVal(plot.cursor.left, "x")));
    return plot;
  }

  /** Lines across, below the curves. */
  across({ ctx, bbox, valToPos }) {
    ctx.save();
    ctx.globalAlpha = 0.55;
    ctx.lineWidth = devicePixelRatio;
    for (const { t, kind } of this.events) {
      const x = Math.round(valToPos(t, "x", true)) + 0.5;
      const [, name, dash] = ACROSS[kind];
      ctx.strokeStyle = colour(name);
      ctx.setLineDash(dash.map((part) => part * devicePixelRatio));
      ctx.beginPath();
      ctx.moveTo(x, bbox.top);
      ctx.lineTo(x, bbox.top + bbox.height);
      ctx.stroke();
    }
    ctx.restore();
  }
}
