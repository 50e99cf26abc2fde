// The figures of a window, by the names and units of `vrs compare`: what plots show, for those who read.
import { DEGREES, figure, h, write } from "./dom.js";
import { BASES } from "./samples.js";


function spread(column) {
  const known = column.filter((x) => !Number.isNaN(x));
  if (!known.length) return { count: 0, mean: NaN, rms: NaN, max: NaN, p95: NaN };
  let [sum, squares, max] = [0, 0, 0];
  for (const x of known) {
    sum += x;
    squares += x * x;
    max = Math.max(max, Math.abs(x));
  }
  const sorted = known.slice().sort();
  const p95 = sorted[Math.min(Math.round(0.95 * (sorted.length - 1)), sorted.length - 1)];
  return { count: known.length, mean: sum / known.length, rms: Math.sqrt(squares / known.length), max, p95 };
}

const row = (name, value, unit, factor = 1, digits = 3) => [name, figure(factor * (value ?? NaN), digits), unit];

/** Rows of name, value, unit. */
export function figuresOf({ samples, from, until, paths }) {
  const { table, arrived, lost } = samples;
  const [first, last] = [table.before(from), table.before(until)];
  const of = (name) => spread(table.column(name).slice(first, last));
  const rows = [];
  for (const basis of BASES) {
    const errors = [
      ["tool", of(`tool_${basis}`), "mm", 1e3],
      ["angle", of(`angle_${basis}`), "deg", DEGREES],
    ];
    for (let j = 1; j <= samples.joints; j++)
      errors.push([`joint ${j}`, of(`error_${basis}_${j}`), ...(samples.chain.slides(j - 1) ? ["mm", 1e3] : ["deg", DEGREES])]);
    for (const [name, { rms, max }, ...unit] of errors)
      rows.push(row(`${name} rms, ${basis}`, rms, ...unit), row(`${name} max, ${basis}`, max, ...unit));
  }
  const behind = spread(
    table
      .column("D")
      .slice(first, last)
      .map((D) => -D),
  );
  const delay = spread(arrived.column("delay").slice(arrived.before(from), arrived.before(until)));
  const [mean, p95, max] = paths?.pathError ?? [];
  return [
    ...rows,
    row("tool rms, servo", of("tool_servo").rms, "mm", 1e3),
    ...[
      ["behind", behind],
      ["message delay", delay],
    ].flatMap(([name, of]) => [
      row(`${name}, mean`, of.mean, "s"),
      row(`${name}, 95 %`, of.p95, "s"),
      row(`${name}, at most`, of.max, "s"),
    ]),
    row("messages lost", lost.before(until) - lost.before(from), "", 1, 0),
    row("round trip, mean", of("round_trip").mean, "s"),
    ...["mean", "sd", "max", "bound"].map((name) => row(`time difference, ${name}`, paths?.[name], "s")),
    row("progress", paths?.progress, "%", 100, 1),
    row("path error, mean", mean, "mm", 1e3),
    row("path error, 95 %", p95, "mm", 1e3),
    row("path error, max", max, "mm", 1e3),
  ];
}

/** A table that is filled while it's open. */
export class Figures {
  constructor() {
    this.drawn = -Infinity;
    this.wanted = true;
    this.body = h("tbody");
    this.caption = h("caption");
    const head = ["Figure", "Value", "Unit"].map((text) => h("th", { scope: "col" }, text));
    this.table = h("table.plot-figures", {}, this.caption, h("thead", {}, h("tr", {}, ...head)), this.body);
    this.element = h(
      "details.plot",
      { id: "plot-figures" },
      h("summary", {}, h("span.plot-title", {}, "Figures of this window")),
      this.table,
    );
    this.element.addEventListener("toggle", () => {
      this.wanted = true;
    });
  }

  get visible() {
    return this.element.open;
  }

  draw(view, title) {
    const rows = figuresOf(view);
    write(this.caption, title);
    while (this.body.children.length < rows.length)
      this.body.append(h("tr", {}, h("th", { scope: "row" }), h("td"), h("td")));
    rows.forEach((row, k) => row.forEach((text, c) => write(this.body.children[k].children[c], text)));
  }
}
