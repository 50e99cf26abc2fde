// What is kept, as a file of comma-separated values in SI units.

const AT_ONCE = 400;
const UNITS = [
  [/^(t|play|D|age|round_trip|delay|time_difference|behind)$/, "_s"],
  [/^(tool_.*|offset|link|servo|x|y|z|path_error)$/, "_m"],
  [/^(angle|real|reference|error)_/, "_rad"],
];

function headed(name, slides) {
  const joint = /^(?:real|reference|error_[a-z]+)_(\d+)$/.exec(name);
  if (joint && slides(joint[1] - 1)) return name + "_m";
  return name + (UNITS.find(([pattern]) => pattern.test(name))?.[1] ?? "");
}

/**
 * A table's rows as text, a piece at a time so that nothing waits for it; what isn't known is left empty.
 * @param {(joint: number) => boolean} slides whether a joint is prismatic, from 0
 */
export async function textOf(table, slides = () => false) {
  const columns = table.names.map((name) => table.column(name).slice());
  const parts = [table.names.map((name) => headed(name, slides)).join(",") + "\n"];
  const count = columns[0].length;
  for (let from = 0; from < count; from += AT_ONCE) {
    let text = "";
    for (let k = from; k < Math.min(from + AT_ONCE, count); k++)
      text += columns.map((column) => (Number.isNaN(column[k]) ? "" : column[k])).join(",") + "\n";
    parts.push(text);
    await new Promise((resolve) => setTimeout(resolve));
  }
  return parts;
}

/** Let the browser keep a file. */
export function save(parts, name) {
  const url = URL.createObjectURL(new Blob(parts, { type: "text/csv" }));
  const link = document.createElement("a");
  [link.href, link.download] = [url, name];
  link.click();
  setTimeout(() => URL.revokeObjectURL(url), 1000);
}
