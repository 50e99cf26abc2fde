// Live plots of a mobile robot: how far the real one is from the path, how much later, and what the network does.
import { Chart, isDue, stalest } from "./chart.js";
import { save, textOf } from "./csv.js";
import { figure, mark, write } from "./dom.js";
import { Messages } from "./messages.js";
import { PlotHead, loadStyles, notes, palette } from "./plothead.js";
import { Table } from "./table.js";
import { thinned } from "./thinning.js";

/** Windows that one may choose: seconds, name, time between two pictures [ms]. */
const SPANS = [[30, "30 s", 200], [120, "2 min", 400], [600, "10 min", 900]];
/** Ten minutes of what comes ten to twenty times a second. */
const KEPT = 13000;
const TURN = 60;
const SAID = 250;
/** Values older than this aren't the present ones [s]. */
const OLD = 1.5;
const COLUMNS = ["t", "path_error", "time_difference", "behind", "delay", "round_trip", "age"];

function graph(name, title, unit, factor, digits, columns, lines, note, more = {}) {
  return {
    name, title, unit, note, zero: true, open: true,
    lines: lines.map(([label, colour, dash = []]) => ({ label, colour, dash, width: 1.6 })),
    data({ samples: { table }, from, until, span }) {
      const curves = columns.map((column) => table.column(column));
      return thinned(table.column("t"), curves, table.before(from), table.before(until), span, factor);
    },
    words: ({ samples: { table }, index }) =>
      `${columns.map((column) => figure(table.get(column, index) * factor, digits)).join(" / ")} ${unit}`,
    ...more,
  };
}

const GRAPHS = [
  graph("path-error", "Path error", "cm", 100, 1, ["path_error"], [["path error", "--virtual"]],
    "Distance of the real robot, as it takes itself to be, from the nearest place of the virtual one's path.", { least: 1 }),
  graph("time-difference", "Time difference and D", "s", 1, 2, ["time_difference", "behind"],
    [["time difference", "--virtual"], ["−D, how far behind it plays", "--committed", [6, 3]]],
    "How much later the real robot is where the virtual one was. −D is what its architecture keeps of delay in store; braking distance comes on top.",
    { least: 0.2 }),
  graph("delay", "Delay", "s", 1, 2, ["delay", "round_trip"], [["to the robot", "--virtual"], ["round trip", "--real", [3, 3]]],
    "Each message to the robot by the emulated link alone; the round trip has the real network in it.",
    { least: 0.05, dots: true, marks: [["dot", "a message"], ["cross", "a lost one"]] }),
  graph("age", "Age of what is known", "s", 1, 2, ["age"], [["age", "--virtual"]],
    "How old the newest measurement of the real robot was when it came to this page.", { least: 0.2, open: false }),
];

class Samples {
  constructor(station) {
    this.session = station.session;
    this.table = new Table(COLUMNS, KEPT);
    this.messages = new Messages();
    this.instance = null;
    station.on("welcome", ({ instance }) => {
      if (this.instance !== instance) this.clear();
      this.instance = instance;
    });
    station.on("state", (state) => this.hear(state));
  }

  get arrived() { return this.messages.arrived; }
  get lost() { return this.messages.lost; }

  clear() {
    this.table.clear();
    this.messages.clear();
  }

  hear(state) {
    this.messages.hear(state.messages);
    const { now } = this.session;
    if (state.t == null || now === null || state.now <= this.table.newest) return;
    const gone = state.halted ? { ...state, D: null } : state;
    this.table.push([state.now, state.path_error ?? NaN, state.time_difference ?? NaN, gone.D == null ? NaN : -gone.D,
      this.messages.delay, state.round_trip ?? NaN, Math.max(0, now - state.t)]);
  }
}

export function mount(station, box) {
  loadStyles();
  const { session, layout } = station;
  const samples = new Samples(station);
  const charts = GRAPHS.map((one) => new Chart(one));
  const colour = palette(again);
  const head = new PlotHead(SPANS, {
    chosen: again,
    save: () => textOf(samples.table).then((parts) => save(parts, `vrs-drive-${Math.round(session.now ?? 0)}s.csv`)),
  });
  let UPlot = null;
  let said = -Infinity;

  box.append(head.element, ...charts.map((chart) => chart.element), notes(GRAPHS));

  function again() {
    for (const chart of charts) chart.wanted = true;
  }

  setInterval(() => {
    const { now } = session;
    if (document.hidden || layout.shown !== "deviation" || now === null) return;
    const at = performance.now();
    const [span, , period] = head.span;
    const view = { samples, from: now - span, until: now, span, cursor: null, events: [] };
    if (at - said > SAID) say(view, (said = at));
    if (!UPlot) {
      UPlot = import("./uplot.min.js").then((found) => (UPlot = found.default));
      return;
    }
    if (UPlot instanceof Promise) return;
    const chart = stalest(charts.filter((one) => isDue(one, at, period)));
    if (!chart) return;
    if (!chart.plot) chart.begin(UPlot, colour);
    chart.draw(view);
    [chart.drawn, chart.wanted] = [at, false];
  }, TURN);

  function say(view) {
    const { table } = samples;
    const index = table.length - 1;
    const known = index >= 0 && session.now - table.get("t", index) < OLD;
    for (const chart of charts) {
      const text = known ? chart.graph.words({ ...view, index }) : "nothing heard yet";
      write(chart.value, text);
      mark(chart.area, "aria-label", `${chart.graph.title}: ${text}`);
    }
  }
}
