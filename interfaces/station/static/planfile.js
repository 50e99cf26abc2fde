// Plan files (docs/plan-files.md): what is planned, saved to one; and one's moves, given again one after the other.
import { movesBetween } from "./moves.js";
import { clockText, DEGREES, Dialog, html, save, useRef, useState } from "./ui.js";

/** A plan that is loaded begins so long after it was asked for [s], or after what is planned. */
const LEAD = 1;
/** In the file the first move begins then [s]. */
const FIRST = 0.5;

/** The moves that are still to come. */
export function planned({ timeline, now, reader }) {
  if (!timeline || now === null) return [];
  return movesBetween(timeline, now, Infinity, (id, t) => reader.nameOf(id, t)).filter(({ start }) => start > now);
}

/** Save what is planned. */
export function saveMoves({ session, chain }) {
  const moves = planned(session);
  const inDegrees = (x, k) => (chain.slides(k) ? x : x * DEGREES);
  const rows = moves.map(({ start, end, name }) => {
    const { speed, motion, profile, label } = name ?? {};
    const execute = start - moves[0].start + FIRST;
    const move = session.timeline.joints(end).map(inDegrees);
    return { issue: 0, execute, move, speed, motion, profile, insertion: "append", comment: label || undefined };
  });
  const title = `Planned at ${clockText(session.now)}`;
  const start = session.timeline.joints(moves[0].start).map(inDegrees);
  const lines = [{ schema: "vrs-plan/1", title, start }, ...rows].map((line) => JSON.stringify(line) + "\n");
  save(lines, `plan-${Math.round(session.now)}s.jsonl`);
}

/** A plan file's commands, by the server, which knows what fits the robot; or what is wrong. */
async function read(file, { token }) {
  const address = `${window.VrsLink.FOLDER}/plan?name=${encodeURIComponent(file.name)}`;
  try {
    const answer = await fetch(address, { method: "POST", headers: token ? { Authorization: "Bearer " + token } : {}, body: file });
    return await answer.json();
  } catch {
    return { problem: "the server doesn't answer: nothing was loaded" };
  }
}

/** Give commands one after the other, the first at a time [s]; why one isn't taken, "" where all are. */
async function give({ commands, session, replace }) {
  const times = commands.map(({ execute_at: at, issued_at: issued }) => at ?? issued);
  const shift = (replace ? session.now : Math.max(session.now, session.timeline.end)) + LEAD - Math.min(...times);
  for (const [k, { issued_at, ...command }] of commands.entries()) {
    const first = replace && k === 0 ? { insertion: "replace" } : {};
    const entry = session.order({ ...command, execute_at: times[k] + shift, ...first }, `plan ${k + 1}`);
    while (entry && entry.outcome === null && !entry.forgotten) await new Promise((resolve) => setTimeout(resolve, 20));
    const { refusal, receipt } = entry?.outcome ?? { refusal: "it wasn't sent" };
    const why = refusal || (receipt?.status === "rejected" ? receipt.reason : "");
    if (why) return `move ${k + 1} of ${commands.length} isn't taken: ${why}` + (k ? "; those before it are in the plan" : "");
  }
  return "";
}

/** The button that loads a plan file; asked first is whether it takes the place of what is planned. */
export function Loader({ strip: { station, session, idle }, tool }) {
  const input = useRef(null);
  const [found, setFound] = useState(null);

  async function choose({ target }) {
    const [file] = target.files;
    target.value = "";
    const { problem, title, commands } = await read(file, session);
    if (problem) station.refuse(problem);
    else setFound({ title, commands });
  }

  async function load(replace) {
    setFound(null);
    const why = await give({ commands: found.commands, session, replace });
    if (why) station.refuse(why);
    else station.announce(`${found.commands.length} moves are planned`);
  }

  return html`${tool("load", "upload", "Load a plan file", () => input.current.click(), "Load", { why: idle })}
    <input type="file" id="plan-file" accept=".jsonl" hidden aria-label="Plan file" ref=${input} onChange=${choose} />
    ${found && html`<${Dialog} class="ask" aria-label="Load a plan" close=${() => setFound(null)}>
      <p>${found.title}: ${found.commands.length} ${found.commands.length === 1 ? "move" : "moves"}.</p>
      <div class="row">
        <button class="main" type="button" id="load-append" onClick=${() => load(false)}>After what is planned</button>
        <button type="button" id="load-replace" onClick=${() => load(true)}>In its place</button>
        <button type="button" onClick=${() => setFound(null)}>Leave it</button>
      </div><//>`}`;
}
