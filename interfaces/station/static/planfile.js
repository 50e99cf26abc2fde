// Plan files (docs/plan-files.md): what is planned, saved to one; and one's moves, given again one after the other.
import { Dialog, html, save, useRef, useState } from "./ui.js";

/** A plan that is loaded begins so long after it was asked for [s], or after what is planned. */
const LEAD = 1;

/** Whether moves are still to come. */
export function isPlanned({ timeline, now }) {
  if (!timeline || now === null) return false;
  const under = timeline.segments[Math.max(0, timeline.indexAt(now))]?.commandId;
  return timeline.segments.some(({ start, commandId }) => start > now && commandId !== null && commandId !== under);
}

/** Save what is planned. */
export async function savePlan(station) {
  const { session } = station;
  const { plan, problem } = await session.ask("/plan");
  if (problem) station.refuse(problem);
  else save([plan], `plan-${Math.round(session.now)}s.jsonl`);
}

/** Give commands one after the other, the first at a time [s]; why one isn't taken, "" where all are. */
async function give({ commands, session, replace }) {
  const times = commands.map(({ execute_at: at, issued_at: issued }) => at ?? issued);
  const shift = (replace ? session.now : Math.max(session.now, session.timeline.end)) + LEAD - Math.min(...times);
  const opening = replace ? commands.findIndex(({ type }) => type === "move") : -1;
  for (const [k, { issued_at, ...command }] of commands.entries()) {
    const first = k === opening ? { insertion: "replace" } : {};
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
    const { problem, title, commands } = await session.ask(`/plan?name=${encodeURIComponent(file.name)}`, { method: "POST", body: file });
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
