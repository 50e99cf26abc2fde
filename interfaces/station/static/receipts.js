// What became of the commands that were given here, the newest first; a command's receipt changes with later ones.
import { clockText, html, Icon, useOn, useRef, useState } from "./ui.js";

const MOST = 60;
/** Steering inputs further apart than this are two rows [s]. */
const APART = 1;
/** What has come is drawn after so long [ms]. */
const SOON = 100;
/** Tone and symbol of how it stands. */
const LOOKS = {
  accepted: ["good", "check_circle"],
  postponed: ["warn", "schedule"],
  rejected: ["bad", "block"],
  refused: ["bad", "block"],
  undone: ["none", "undo"],
  pending: ["none", "more_horiz"],
  forgotten: ["none", "help"],
};
const WORDS = { cancel: "Delete", via: "By another place", stop: "STOP" };

/** What a command is, for people. */
function describe({ command, label }) {
  if (command === null) return "Undo";
  const { type } = command;
  if (type === "move") return `Move: ${label || "a place"}, ${Math.round(100 * (command.speed ?? 1))}\u00a0%`;
  if (type === "retime") return `Begin at ${clockText(command.execute_at)}`;
  if (type === "scale") return `Pace × ${command.factor}`;
  return WORDS[type] || label || type[0].toUpperCase() + type.slice(1);
}

/** How it stands, in a word and a sentence. */
function standing({ command, outcome, forgotten }) {
  if (outcome === null) return forgotten ? ["forgotten", "its fate isn't known"] : ["pending", ""];
  if (outcome.refusal) return ["refused", outcome.refusal];
  const { receipt } = outcome;
  if (!receipt) return ["accepted", command === null ? "there was nothing to take back" : ""];
  if (receipt.undone) return ["undone", "taken back"];
  const said = receipt.reason ? [receipt.reason] : [];
  if (receipt.superseded_by) said.push(`cut short by #${receipt.superseded_by}`);
  if (receipt.superseded?.length) said.push(`in the place of ${receipt.superseded.map((id) => "#" + id).join(", ")}`);
  if (receipt.shift) said.push(`later moves shifted by ${receipt.shift.toFixed(2)} s`);
  return [receipt.status, said.join("; ")];
}

export function Panel({ station: { session } }) {
  /** A row a command; steering is one for as long as it goes on: fifty inputs a second tell nothing one by one. */
  const rows = useRef([]).current;
  const timer = useRef(null);
  const [, draw] = useState(0);

  function changed() {
    timer.current ??= setTimeout(() => {
      timer.current = null;
      draw((count) => count + 1);
    }, SOON);
  }

  useOn(session, "order", (entry) => {
    const steered = rows.find((row) => row.inputs);
    if (entry.command?.type !== "steer") rows.unshift({ entry });
    else if (steered && entry.at - steered.last <= APART) Object.assign(steered, { last: entry.at, inputs: steered.inputs + 1 });
    else rows.unshift({ entry, last: entry.at, inputs: 1, missed: 0, why: "" });
    rows.splice(MOST);
    changed();
  });
  useOn(session, "outcome", (entry) => {
    const [status, why] = standing(entry);
    const steered = entry.command?.type === "steer" && rows.find((row) => row.inputs);
    // An input that wasn't taken is told of.
    if (steered && ["refused", "rejected"].includes(status)) Object.assign(steered, { missed: steered.missed + 1, why });
    changed();
  });
  return html`<p class="muted" hidden=${rows.length > 0}>What becomes of your commands is told here.</p>
    <ol class="receipts" id="receipts" aria-label="Commands given here, newest first">${rows.map((row) =>
      html`<${row.inputs ? Steered : Command} key=${`${row.entry.epoch} ${row.entry.number}`} row=${row} />`)}</ol>`;
}

function Command({ row: { entry } }) {
  const [status, why] = standing(entry);
  const receipt = entry.outcome?.receipt;
  const id = receipt?.command_id ?? entry.command?.command_id;
  const span = receipt?.execute_at != null ? `${clockText(receipt.execute_at)} – ${clockText(receipt.end)}` : "";
  return html`<${Receipt} status=${status} look=${LOOKS[status] ?? LOOKS.forgotten} what=${(id ? `#${id} ` : "") + describe(entry)}
    when=${span} why=${status + (why ? ": " + why : "")} />`;
}

function Steered({ row: { entry, last, inputs, missed, why } }) {
  const text = missed ? `${missed} of ${inputs} inputs not taken: ${why}` : `${inputs} inputs`;
  return html`<${Receipt} look=${missed ? ["warn", "warning"] : ["good", "open_with"]} what="Steering"
    when=${`${(last - entry.at).toFixed(1)} s`} why=${text} />`;
}

function Receipt({ status, look: [tone, symbol], what, when, why }) {
  return html`<li class="receipt" data-status=${status} data-tone=${tone}><${Icon} name=${symbol} /><div>
    <div class="line"><span class="what">${what}</span><span class="when">${when}</span></div><span class="why">${why}</span></div></li>`;
}
