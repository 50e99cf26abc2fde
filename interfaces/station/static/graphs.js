// What plots and figures show of each kind of robot, as data, in the words and units of the report and of `vrs compare`.
import { DEGREES, figure } from "./ui.js";

const JOINT_DASHES = [[], [9, 4], [3, 3], [9, 3, 2, 3], [14, 4], [2, 5]];
/** The two ways of comparing: with the virtual robot at the real one's play time, or at the same moment. */
export const BASES = ["timeline", "user"];

/**
 * A line of a graph.
 * @param {string} of a column of the samples' `table`, or of `more.table`; % in it is where is compared
 */
function line(label, of, colour, dash = [], more = {}) {
  return { label, of, colour, dash, width: 1.6, table: "table", ...more };
}

/** What is drawn of a window: times, then a curve a line; lines of several tables are joined by `join`. */
function data({ lines }, { samples, from, until, basis }, factor, join) {
  const tables = [...new Set(lines.map(({ table }) => table))];
  const parts = tables.map((table) => {
    const names = lines.filter((one) => one.table === table).map(({ of }) => of.replace("%", basis));
    return samples[table]?.curves(names, from, until, factor) ?? [[], ...names.map(() => [])];
  });
  if (parts.length === 1) return parts[0];
  const joined = join(parts);
  // A few long delays don't make all others small: they are at the upper edge.
  const points = lines.findIndex(({ points }) => points) + 1;
  const known = joined.slice(1).map((curve) => curve.filter((x) => x !== null && x !== undefined));
  const usual = known[points - 1].toSorted((a, b) => a - b);
  const most = known.slice(0, points - 1).flat().reduce((top, x) => Math.max(top, x), 1.12 * usual[Math.floor(0.9 * (usual.length - 1))]);
  joined[points] = joined[points].map((x) => (x > most ? most : x));
  return joined;
}

/**
 * A graph, with `data` that makes what is drawn of a window, and `words` that tells one moment. `least` is the shortest axis,
 * in the graph's unit, `zero` says that it begins at 0; `based` graphs depend on where is compared.
 * @param {(row: number[], get: (name: string) => number) => string} say what a row says, in the graph's unit
 */
function graph(name, title, unit, factor, digits, lines, note, { say, ...more }) {
  const plain = (row) => `${row.map((x) => figure(x, digits)).join(" / ")} ${unit}`;
  const own = lines.filter(({ table }) => table === "table");
  return {
    name, title, unit, digits, lines, note, open: true, ...more,
    data(view, join) { return data(this, view, factor, join); },
    words: ({ samples: { table }, index, basis }) =>
      (say ?? plain)(own.map(({ of }) => factor * table.get(of.replace("%", basis), index)), (column) => table.get(column, index)),
  };
}

/** The graph of errors of some joints, counted from 1. */
function jointErrors(joints, name, title, unit, factor, least) {
  const lines = joints.map((j) => line(`${j}`, `error_%_${j}`, `--j${((j - 1) % 6) + 1}`, JOINT_DASHES[(j - 1) % 6]));
  const say = (row) => {
    const worst = row.reduce((best, x, k) => (Math.abs(x) > Math.abs(row[best]) ? k : best), 0);
    return `worst: joint ${joints[worst]}, ${figure(row[worst], 3)} ${unit}`;
  };
  return graph(name, title, unit, factor, 3, lines, "Real minus virtual, joint by joint.", { least, based: true, say });
}

function attributed([whole, offset, link, servo]) {
  if (Number.isNaN(link)) return `${figure(whole, 2)} mm, of it offset ${figure(offset, 2)}; the rest isn't told`;
  return `${figure(whole, 2)} mm = offset ${figure(offset, 2)}, link ${figure(link, 2)}, servo ${figure(servo, 2)}`;
}

const delays = (heard) => graph("delay", "Delay", "s", 1, 3,
  [
    ...(heard ? [line("round trip", "round_trip", "--j1", [9, 4]), line("age", "age", "--real")] : []),
    line("message", "delay", "--virtual", [], { table: "arrived", points: true }),
    line("lost", "none", "--bad", [], { table: "lost", points: true }),
  ],
  "Round trip: a message to the robot and its answer. Age: of the newest measurement, when it came here. " +
  "Message: one way to the robot, by the emulated link alone; on a real network that can't be known live. Lost ones are at 0.",
  {
    least: 0.02, zero: true,
    say: ([trip, age], get) => heard
      ? `message ${figure(get("delay"), 3)}, round trip ${figure(trip, 3)}, age ${figure(age, 3)} s` : "",
  });

/**
 * Graphs of an arm.
 * @param {{joints: number, slides: (joint: number) => boolean}} arm how many it has, and which are prismatic, from 0
 * @param {boolean} heard whether it's live: what only the page hears is there
 */
export function armGraphs({ joints, slides }, heard) {
  const numbers = Array.from({ length: joints }, (_, k) => k + 1);
  const [sliding, turning] = [true, false].map((which) => numbers.filter((j) => slides(j - 1) === which));
  return [
    ...(turning.length ? [jointErrors(turning, "joint-error", "Joint error", "deg", DEGREES, 0.02)] : []),
    ...(sliding.length ? [jointErrors(sliding, "slide-error", "Error of prismatic joints", "mm", 1e3, 0.1)] : []),
    graph("tool-error", "Tool error", "mm", 1e3, 2, [line("distance", "tool_%", "--real")],
      "Distance of the real from the virtual last link's frame.", { least: 0.1, zero: true, based: true }),
    graph("tool-angle", "Tool angle error", "deg", DEGREES, 3, [line("angle", "angle_%", "--real")],
      "Angle between the real and the virtual last link's frame.", { least: 0.02, zero: true, based: true, open: false }),
    graph("attribution", "Attribution of the tool error", "mm", 1e3, 2,
      [
        line("whole", "tool_user", "--real", [], { width: 4 }), line("offset", "offset", "--j1", [9, 4]),
        line("link", "link", "--j4", [2, 3]), line("servo", "servo", "--j2", [9, 3, 2, 3]),
      ],
      "At the same moment, along the error's direction: offset, what the real robot plays later; link, where its " +
      "plan isn't the virtual robot's; servo, where it isn't on its plan. Parts add up to the whole, and may cancel.",
      { least: 0.1, say: attributed }),
    graph("behind", "Offset D: how far behind", "s", -1, 3, [line("behind", "D", "--real")],
      "−D, the user's time less the real robot's play time. Nothing while it has stopped by itself.",
      {
        least: 0.02, zero: true,
        say: ([behind]) => Number.isNaN(behind) ? "stopped by itself" : `${figure(behind, 3)} s behind (D ${figure(-behind, 3)} s)`,
      }),
    delays(heard),
    {
      ...graph("time-difference", "Time difference", "s", 1, 3, [line("time difference", "late", "--virtual", [], { table: "paths" })],
        "How much later than the virtual tool the real one came to a place of the path, where the virtual one moved.", { least: 0.02 }),
      ofPaths: true,
      words: ({ path }) => path?.time_difference_mean == null ? "no motion of the virtual tool to compare"
        : ["mean", "sd", "max"].map((one) => `${one} ${figure(path[`time_difference_${one}`], 3)}`).join(", ") + " s",
    },
  ];
}

/** Graphs of a mobile robot. */
export function driveGraphs(heard) {
  return [
    graph("path-error", "Path error", "cm", 100, 1, [line("path error", "path_error", "--virtual")],
      "Distance of the real robot from the nearest place of the virtual one's path; live, of where it takes itself to be.",
      { least: 1, zero: true }),
    graph("time-difference", "Time difference and D", "s", 1, 2,
      [line("time difference", "time_difference", "--virtual"), line("−D", "behind", "--committed", [6, 3])],
      "How much later the real robot is where the virtual one was. −D is what its architecture keeps of delay in store; braking distance comes on top.",
      { least: 0.2, zero: true }),
    delays(heard),
  ];
}

/** Names, units, and where in a summary (docs/summary.md) they are: figures of errors by one way of comparing. */
const errors = (basis, { joints, slides }) => [
  ["tool", "tool_%_m", "mm", 1e3], ["angle", "angle_%_deg", "deg", 1],
  ...Array.from({ length: joints }, (_, j) => slides(j)
    ? [`joint ${j + 1}`, `joint_%_m.${j}`, "mm", 1e3] : [`joint ${j + 1}`, `joint_%_deg.${j}`, "deg", 1]),
].flatMap(([name, place, ...unit]) => ["rms", "max"].map((kind) =>
  [`${name} ${kind}, ${basis}`, `errors.${basis}_time.${place.replace("%", kind)}`, ...unit]));

const TIME_DIFFERENCE = ["mean", "sd", "max", "bound"].map((one) => [`time difference, ${one}`, `time_difference_${one}`, "s"]);
const PATH_ERROR = [["mean", "mean"], ["95 %", "p95"], ["max", "max"]].map(([name, one]) => [`path error, ${name}`, `path_error_${one}`]);

/** An arm's figures: name, place in the summary, unit, factor, digits. */
export const armFigures = (arm) => [
  ...BASES.flatMap((basis) => errors(basis, arm)),
  ["tool rms, servo", "errors.servo.tool_rms_m", "mm", 1e3],
  ...[["behind", "behind."], ["message delay", "messages.delay_"]].flatMap(([name, place]) =>
    [["mean", "mean_s"], ["95 %", "p95_s"], ["at most", "max_s"]].map(([kind, end]) => [`${name}, ${kind}`, place + end, "s"])),
  ["messages lost", "messages.lost", "", 1, 0],
  ["round trip, mean", "round_trip_s", "s"],
  ...[...TIME_DIFFERENCE, ["progress", "progress", "%", 100, 1], ...PATH_ERROR.map(([name, place]) => [name, place, "mm", 1e3])]
    .map(([name, place, ...unit]) => [name, `path.${place}`, ...unit]),
];

/** A mobile robot's. */
export const DRIVE_FIGURES = [
  ...PATH_ERROR.map(([name, place]) => [name, place, "cm", 100, 2]),
  ...TIME_DIFFERENCE,
  ["progress", "progress", "%", 100, 1],
  ["speed error", "speed_error", "m/s"],
  ["collisions", "collisions", "", 1, 0],
  ["longest delay", "longest_delay", "s"],
  ["round trip, mean", "round_trip_s", "s"],
];

/** Rows of name, a value a summary, and unit; what no summary knows of is left out. */
export function rowsOf(figures, summaries) {
  const found = (summary, place) => place.split(".").reduce((value, name) => value?.[name], summary);
  return figures.flatMap(([name, place, unit, factor = 1, digits = 3]) => {
    const values = summaries.map((summary) => found(summary, place));
    if (values.every((value) => value === undefined)) return [];
    return [[name, ...values.map((value) => figure(value == null ? NaN : factor * value, digits)), unit]];
  });
}
