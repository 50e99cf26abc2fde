// What became of the commands that were given here, the newest first; a command's receipt changes with later ones.
import { clockText, draw, h, icon, write } from "./dom.js";

const MOST = 60;
const TONES = { accepted: "good", postponed: "warn", rejected: "bad", undone: "none", refused: "bad", pending: "none" };
const SYMBOLS = {
  accepted: "check_circle",
  postponed: "schedule",
  rejected: "block",
  undone: "undo",
  refused: "block",
  pending: "more_horiz",
  forgotten: "help",
};

/** What a command is, for people. */
export function describe({ command, label }) {
  if (command === null) return "Undo";
  switch (command.type) {
    case "move":
      return `Move to ${label || "a place"} at ${Math.round(100 * (command.speed ?? 1))} %`;
    case "retime":
      return `Begin at ${clockText(command.execute_at)}`;
    case "cancel":
      return "Delete";
    case "via":
      return "By another place";
    case "scale":
      return `Pace × ${command.factor}`;
    case "stop":
      return "STOP";
    default:
      return command.type[0].toUpperCase() + command.type.slice(1);
  }
}

/** How it stands, in a word and a sentence. */
export function standing(entry) {
  const { outcome } = entry;
  if (outcome === null) return [entry.forgotten ? "forgotten" : "pending", entry.forgotten ? "its fate isn't known" : ""];
  if (outcome.refusal) return ["refused", outcome.refusal];
  const receipt = outcome.receipt;
  if (!receipt) return ["accepted", entry.command === null ? "there was nothing to take back" : ""];
  if (receipt.undone) return ["undone", "taken back"];
  const said = receipt.reason ? [receipt.reason] : [];
  if (receipt.superseded_by) said.push(`cut short by #${receipt.superseded_by}`);
  if (receipt.superseded?.length) said.push(`in the place of ${receipt.superseded.map((id) => "#" + id).join(", ")}`);
  if (receipt.shift) said.push(`later moves shifted by ${receipt.shift.toFixed(2)} s`);
  return [receipt.status, said.join("; ")];
}

export function mount(station, box) {
  const list = h("ol.receipts", { id: "receipts", "aria-label": "Commands given here, newest first" });
  const empty = h("p.muted", {}, "What becomes of your commands is told here.");
  box.append(empty, list);
  const rows = new Map();
  let steers = null;

  function row() {
    const symbol = icon("more_horiz");
    const [what, when, why] = [h("span.what"), h("span.when"), h("span.why")];
    const element = h("li.receipt", {}, symbol, h("div", {}, h("div.line", {}, what, when), why));
    list.prepend(element);
    empty.hidden = true;
    while (list.children.length > MOST) list.lastChild.remove();
    return { element, symbol, what, when, why };
  }

  function fill(parts, entry) {
    const [status, why] = standing(entry);
    const receipt = entry.outcome?.receipt;
    parts.element.dataset.status = status;
    parts.element.dataset.tone = TONES[status] ?? "none";
    draw(parts.symbol, SYMBOLS[status] ?? "help");
    const id = receipt?.command_id ?? entry.command?.command_id;
    const number = id ? `#${id} ` : "";
    write(parts.what, number + describe(entry));
    const span = receipt?.execute_at != null ? `${clockText(receipt.execute_at)} – ${clockText(receipt.end)}` : "";
    write(parts.when, span);
    write(parts.why, status + (why ? ": " + why : ""));
  }

  /** Steering is one row for as long as it goes on: fifty inputs a second tell nothing one by one. */
  function steered(entry) {
    if (!steers || entry.at - steers.at > 1) {
      const parts = row();
      steers = { parts, at: entry.at, first: entry.at, count: 0, missed: 0 };
      parts.element.dataset.tone = "good";
      draw(parts.symbol, "open_with");
      write(parts.what, "Steering");
    }
    steers.at = entry.at;
    steers.count += 1;
    write(steers.parts.when, `${(steers.at - steers.first).toFixed(1)} s`);
    if (!steers.missed) write(steers.parts.why, `${steers.count} inputs`);
    return steers;
  }

  station.on("order", (entry) => {
    if (entry.command?.type === "steer") {
      rows.set(entry, { steer: steered(entry) });
    } else {
      const parts = row();
      rows.set(entry, parts);
      fill(parts, entry);
    }
    if (rows.size > 400) rows.delete(rows.keys().next().value);
  });
  station.on("outcome", (entry) => {
    const parts = rows.get(entry);
    if (!parts) return;
    if (parts.steer) {
      settle(parts.steer, entry);
      return;
    }
    fill(parts, entry);
  });

  /** An input that wasn't taken is told of. */
  function settle(row, entry) {
    const [status, why] = standing(entry);
    if (status !== "refused" && status !== "rejected") return;
    row.missed += 1;
    row.parts.element.dataset.tone = "warn";
    draw(row.parts.symbol, "warning");
    write(row.parts.why, `${row.missed} of ${row.count} inputs not taken: ${why}`);
  }
}
