// What each plot shows, in the words and units of the report and of `vrs compare`.
import { DEGREES, figure } from "./dom.js";
import { thinned } from "./thinning.js";

const JOINT_DASHES = [[], [9, 4], [3, 3], [9, 3, 2, 3], [14, 4], [2, 5]];

function line(label, colour, dash = [], width = 1.6) {
  return { label, colour, dash, width };
}

/** Data of columns of the samples' table, and a text of one row. */
function ofTable(columns, factor, words) {
  return {
    data({ samples, from, until, span, basis }) {
      const { table } = samples;
      const curves = columns(basis).map((name) => table.column(name));
      const x = table.column("t");
      return thinned(x, curves, table.before(from), table.before(until), span, factor);
    },
    words({ samples, index, basis }) {
      const row = columns(basis).map((name) => samples.table.get(name, index) * factor);
      return words(row, (name) => samples.table.get(name, index));
    },
  };
}

/** The plot of errors of some joints, counted from 1. */
function jointErrors(joints, more) {
  const words = (row) => {
    const worst = row.reduce((best, x, k) => (Math.abs(x) > Math.abs(row[best]) ? k : best), 0);
    return `worst: joint ${joints[worst]}, ${figure(row[worst], 3)} ${more.unit}`;
  };
  return {
    ...more,
    based: true,
    open: true,
    note: "Real minus virtual, joint by joint.",
    lines: joints.map((j) => line(`${j}`, `--j${((j - 1) % 6) + 1}`, JOINT_DASHES[(j - 1) % 6])),
    ...ofTable((basis) => joints.map((j) => `error_${basis}_${j}`), more.factor, words),
  };
}

function attributed([offset, link, servo], get) {
  const total = `${figure(1e3 * get("tool_user"), 2)} mm`;
  if (Number.isNaN(link)) return `${total}, of it offset ${figure(offset, 2)}; the rest isn't told`;
  return `${total} = offset ${figure(offset, 2)}, link ${figure(link, 2)}, servo ${figure(servo, 2)}`;
}

/**
 * The plots. `data` makes what is drawn of a window, `words` tells one moment; `least` is the shortest axis, in the
 * plot's unit, `zero` says that it begins at 0. `based` plots depend on where is compared.
 * @param {import("./chain.js").Chain} chain
 */
export function graphs(chain) {
  const joints = Array.from(chain.screws, (_, k) => k + 1);
  const [sliding, turning] = [true, false].map((slides) => joints.filter((j) => chain.slides(j - 1) === slides));
  return [
    ...(turning.length
      ? [jointErrors(turning, { name: "joint-error", title: "Joint error", unit: "deg", factor: DEGREES, least: 0.02 })]
      : []),
    ...(sliding.length
      ? [jointErrors(sliding, { name: "slide-error", title: "Error of prismatic joints", unit: "mm", factor: 1e3, least: 0.1 })]
      : []),
    {
      name: "tool-error",
      title: "Tool error",
      unit: "mm",
      least: 0.1,
      zero: true,
      based: true,
      open: true,
      note: "Distance of the real from the virtual last link's frame.",
      lines: [line("distance", "--real")],
      ...ofTable(
        (basis) => [`tool_${basis}`],
        1e3,
        ([x]) => `${figure(x, 2)} mm`,
      ),
    },
    {
      name: "tool-angle",
      title: "Tool angle error",
      unit: "deg",
      least: 0.02,
      zero: true,
      based: true,
      open: false,
      note: "Angle between the real and the virtual last link's frame.",
      lines: [line("angle", "--real")],
      ...ofTable(
        (basis) => [`angle_${basis}`],
        DEGREES,
        ([x]) => `${figure(x, 3)} deg`,
      ),
    },
    {
      name: "attribution",
      title: "Attribution of the tool error",
      unit: "mm",
      least: 0.1,
      open: true,
      note:
        "At the same moment, along the error's direction: offset, what the real robot plays later; link, where its " +
        "plan isn't the virtual robot's; servo, where it isn't on its plan. Parts add up to the whole, and may cancel.",
      lines: [
        line("whole", "--real", [], 4),
        line("offset", "--j1", [9, 4]),
        line("link", "--j4", [2, 3]),
        line("servo", "--j2", [9, 3, 2, 3]),
      ],
      data({ samples, from, until, span }) {
        const { table } = samples;
        const curves = ["tool_user", "offset", "link", "servo"].map((name) => table.column(name));
        return thinned(table.column("t"), curves, table.before(from), table.before(until), span, 1e3);
      },
      words: ofTable(() => ["offset", "link", "servo"], 1e3, attributed).words,
    },
    {
      name: "behind",
      title: "Offset D: how far behind",
      unit: "s",
      least: 0.02,
      zero: true,
      open: true,
      note: "−D, the user's time less the real robot's play time. Nothing while it has stopped by itself.",
      lines: [line("behind", "--real")],
      ...ofTable(
        () => ["D"],
        -1,
        ([behind], get) =>
          Number.isNaN(behind) ? "stopped by itself" : `${figure(behind, 3)} s behind (D ${figure(get("D"), 3)} s)`,
      ),
    },
    {
      name: "delay",
      title: "Delay",
      unit: "s",
      least: 0.02,
      zero: true,
      open: true,
      dots: true,
      note:
        "Round trip: a message to the robot and its answer. Age: of the newest measurement, when it came here. " +
        "Message: one way to the robot, by the emulated link alone; on a real network that can't be known live.",
      lines: [line("round trip", "--j1", [9, 4]), line("age", "--real")],
      marks: [
        ["dot", "message"],
        ["cross", "lost"],
      ],
      ...ofTable(
        () => ["round_trip", "age"],
        1,
        ([trip, age], get) =>
          `message ${figure(get("delay"), 3)}, round trip ${figure(trip, 3)}, age ${figure(age, 3)} s`,
      ),
    },
    {
      name: "time-difference",
      title: "Time difference",
      unit: "s",
      least: 0.02,
      open: true,
      ofPaths: true,
      note: "How much later than the virtual tool the real one came to a place of the path, where the virtual one moved.",
      lines: [line("time difference", "--virtual")],
      data({ paths, from, until, span }) {
        const { arrival = [], late = [] } = paths ?? {};
        const x = Float64Array.from(arrival);
        const first = arrival.findIndex((t) => t >= from);
        if (first < 0) return [[], []];
        const last = arrival.findLastIndex((t) => t < until);
        return thinned(x, [Float64Array.from(late)], first, last + 1, span);
      },
      words: ({ paths }) =>
        paths?.mean == null
          ? "no motion of the virtual tool to compare"
          : `mean ${figure(paths.mean, 3)}, sd ${figure(paths.sd, 3)}, max ${figure(paths.max, 3)} s`,
    },
  ];
}
