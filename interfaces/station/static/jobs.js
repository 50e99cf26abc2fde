// The list of jobs: edited, reordered, kept by the server, tried on the virtual robot, and done.
import { Needs } from "./handling.js";
import { ask, goalText } from "./tasks.js";
import { barred, Choice, DEGREES, html, Icon, isTyping, useOn, useRef, useState } from "./ui.js";

/** Kinds of jobs: name, what is written, and how a job is read from its fields. */
const KINDS = {
  move: { name: "MOVE", hint: "a place, or x y heading°" },
  voice: { name: "VOICE", hint: "what to say" },
  message: { name: "MESSAGE", hint: "what to show" },
  wait: { name: "WAIT", hint: "seconds, or key" },
  arm: { name: "ARM", hint: "name of a VAL-II program" },
};
const STAGES = {
  planned: ["radio_button_unchecked", "Planned"],
  running: ["play_circle", "Running"],
  paused: ["pause_circle", "Paused"],
  done: ["check_circle", "Done"],
  failed: ["error", "Failed"],
  aborted: ["cancel", "Aborted"],
};
/** What a list is asked, its symbol and its name. */
const COMMANDS = [
  ["dry-run", "science", "Dry run"], ["run", "play_arrow", "Run"], ["pause", "pause", "Pause"],
  ["resume", "redo", "Resume"], ["abort", "stop_circle", "Abort"], ["key", "keyboard_return", "Key"],
];
const LOSSES = {
  stop: "When the operator is lost, the robot stops and the list is paused.",
  "carry-on": "When the operator is lost, the robot carries on with the list.",
};

/** What a job's field shows. */
function written(job) {
  if (job.do === "move") {
    if (typeof job.to === "string") return job.to;
    const { x, y, heading } = job.to;
    return [x, y, ...(heading == null ? [] : [(heading * DEGREES).toFixed(1)])].join(" ");
  }
  if (job.do === "wait") return job.seconds == null ? "key" : String(job.seconds);
  return job.do === "arm" ? job.program : job.text;
}

/** A job from what was written; a text where it's none. */
function read(kind, text, number, places, source) {
  const words = text.trim();
  if (!words) return "Write something first.";
  if (kind === "move") {
    if (words in places) return { do: kind, number, to: words };
    const [x, y, turn, ...more] = words.split(/[\s,;]+/).map(Number);
    if ([x, y, turn ?? 0].some((value) => !Number.isFinite(value)) || y === undefined || more.length) {
      return `“${words}” is no place of this list (${Object.keys(places).join(", ") || "there's none"}) and no x y heading.`;
    }
    return { do: kind, number, to: turn === undefined ? { x, y } : { x, y, heading: turn / DEGREES } };
  }
  if (kind === "wait") {
    if (words === "key") return { do: kind, number };
    const seconds = Number(words.replace(/\s*s$/, ""));
    if (Number.isFinite(seconds) && seconds >= 0 && seconds <= 86400) return { do: kind, number, seconds };
    return `“${words}” is neither seconds, 0 to 86400, nor “key”.`;
  }
  return kind === "arm" ? { do: kind, number, program: words, source: source ?? "" } : { do: kind, number, text: words };
}

/** How long a job takes [s], for people; null where nobody knows. */
function duration(lasts) {
  if (lasts == null) return "nobody knows how long";
  return lasts < 0.05 ? "at once" : `about ${lasts < 10 ? lasts.toFixed(1) : lasts.toFixed(0)} s`;
}

/** What the dry run said of the whole list. */
function outlook(forecast) {
  const last = forecast[forecast.length - 1];
  if (last?.problem) return `job ${forecast.length} would fail`;
  const total = forecast.reduce((sum, one) => sum + (one.lasts ?? 0), 0);
  return duration(total) + (forecast.some((one) => one.lasts == null) ? " and what nobody knows" : "");
}

const NONE = { jobs: [], places: {} };

/** Why a list can't be asked something now; "" where it can. */
function hindrance(word, { jobs }, progress) {
  const { stage } = progress;
  const running = stage === "running";
  if (word === "key") {
    const waits = jobs.some((job) => job.do === "wait" && job.seconds == null
      && progress.jobs.some((one) => one.number === job.number && one.stage === "running"));
    return running && waits ? "" : "No job waits for the key.";
  }
  if (word === "pause") return running ? "" : "The list isn't running.";
  if (word === "abort") return running || stage === "paused" ? "" : "The list isn't running.";
  if (jobs.length === 0) return "There are no jobs yet.";
  if (word === "resume") return ["paused", "failed", "aborted"].includes(stage) ? "" : "The list isn't paused.";
  return word === "run" && running ? "The list is running." : "";
}

export function Panel({ station }) {
  const { session } = station;
  const { tasks, link } = session;
  /** The list as it was edited here, until the server has answered the last edit; edits come faster than answers. */
  const [draft, setDraft] = useState(null);
  const edits = useRef(0);
  const newest = useRef(null);
  const [fault, setFault] = useState("");
  useOn(session, "link", (to) => to === "lost" && setList(null));
  useOn(window, "keydown", (event) => {
    // The key of a WAIT is Enter, as in the paper, where it means nothing else.
    if (event.key !== "Enter" || event.repeat || isTyping(event) || !session.tasks || whyNot("key")) return;
    if (event.target.closest?.("button, select, a, summary, dialog, [role=tab], [role=separator]")) return;
    event.preventDefault();
    command("key");
  });

  function setList(list) {
    newest.current = list;
    setDraft(list);
  }

  function say(words) {
    setFault(words);
    station.refuse(words);
  }

  const list = () => newest.current ?? session.tasks?.jobs ?? NONE;
  const whyNot = (word) => station.idle || hindrance(word, list(), session.tasks.progress);
  const command = (word) => (whyNot(word) ? say(whyNot(word)) : ask(station, { do: word }, setFault));

  function send(change) {
    setList({ ...list(), ...change });
    const mine = ++edits.current;
    ask(station, { jobs: newest.current }, (words) => {
      // One that was refused takes those that were made on top of it along.
      if (words || mine === edits.current) setList(null);
      setFault(words);
    });
  }

  if (!tasks) return html`<${Needs} station=${station} id="jobs-needs" />`;
  const { progress, forecast } = tasks;
  const { jobs, places } = draft ?? tasks.jobs;
  const stage = progress.stage;
  const number = 1 + Math.max(0, ...jobs.map((job) => job.number));
  const why = station.idle || (stage === "running" ? "The list is running: pause or abort it first." : "");
  const predicted = forecast ? ` Dry run: ${outlook(forecast)}.` : "";
  const says = tasks.says ? ` Says: “${tasks.says}”` : "";
  return html`<link rel="stylesheet" href="/station/tasks.css" />
    <${Needs} station=${station} id="jobs-needs" />
    <div class="job-bar" role="group" aria-label="The list">${COMMANDS.map(([word, symbol, title]) =>
      html`<button type="button" id=${`jobs-${word}`} ...${barred(whyNot(word), title)} onClick=${() => command(word)}
        data-waits=${word === "key" && !whyNot("key") ? "" : undefined}><${Icon} name=${symbol} />${title}</button>`)}</div>
    <p class="journey" id="jobs-stage" role="status" data-state=${stage}>
      ${`${STAGES[stage][1]}${progress.reason ? ": " + progress.reason : ""}.${predicted}${says}`}</p>
    <p class="screen" id="jobs-shows" hidden=${!tasks.shows}>${tasks.shows}</p>
    <p class="refused" id="jobs-fault">${fault}</p>
    <ol class="jobs" id="jobs" hidden=${jobs.length === 0}>${jobs.map((job, at) => html`<${Row} key=${job.number} job=${job} at=${at}
      jobs=${jobs} places=${places} why=${why} send=${send} say=${say} progress=${progress.jobs.find((one) => one.number === job.number)}
      forecast=${forecast?.find((one) => one.number === job.number)} />`)}</ol>
    <p class="muted" id="jobs-empty" hidden=${jobs.length > 0}>No jobs yet. Add the first one below.</p>
    <${NewJob} why=${why} places=${places} number=${number} say=${say} add=${(job) => send({ jobs: [...list().jobs, job] })} />
    <${NewPlace} session=${session} why=${why} say=${say} add=${(place) => send({ places: { ...list().places, ...place } })} />
    <p class="muted" id="jobs-policy" data-bad=${tasks.problem ? "" : undefined}>
      ${[LOSSES[tasks.loss] ?? "", tasks.problem].filter(Boolean).join(" ")}</p>`;
}

function Row({ job, at, jobs, places, why, send, say, progress, forecast }) {
  const stage = progress?.stage ?? "planned";
  const [symbol, word] = STAGES[stage];
  const kind = KINDS[job.do].name;
  const others = jobs.filter((other) => other !== job);
  const lasts = forecast ? forecast.problem || duration(forecast.lasts) : "";
  const note = [progress?.reason, lasts].filter(Boolean).join(" · ");

  function change({ target }) {
    const found = why || read(job.do, target.value, job.number, places, job.source);
    if (typeof found !== "string") send({ jobs: jobs.map((other) => (other === job ? found : other)) });
    else {
      target.value = written(job);
      say(found);
    }
  }

  const tool = (label, name, end, entries) => html`<button class="quiet" type="button" aria-label=${`${label} job ${at + 1}`}
    ...${barred(why || end, label)} onClick=${() => (why || end ? say(why || end) : send({ jobs: entries }))}><${Icon} name=${name} /></button>`;
  const moved = (by) => others.toSpliced(at + by, 0, job);
  return html`<li class="job" data-stage=${stage} data-number=${job.number}>
    <span class="stage" title=${word}><${Icon} name=${symbol} /><span class="spoken">${word}</span></span>
    <span class="kind">${kind}</span>
    <input class="what" value=${written(job)} aria-label=${`${kind} ${at + 1}`} readonly=${why !== ""} maxlength="400" autocomplete="off"
      title=${why || (job.do === "move" && places[job.to] ? goalText(places[job.to]) : undefined)} onChange=${change} />
    <span class="tools-job">${tool("Earlier", "arrow_upward", at === 0 && "It's the first.", moved(-1))}
      ${tool("Later", "arrow_downward", at === jobs.length - 1 && "It's the last.", moved(1))}
      ${tool("Remove", "delete", "", others)}</span>
    ${note && html`<span class="note" data-bad=${forecast?.problem ? "" : undefined}>${note}</span>`}</li>`;
}

function NewJob({ why, places, number, say, add }) {
  const [kind, setKind] = useState("move");
  const [text, program] = [useRef(null), useRef(null)];

  function submit(event) {
    event.preventDefault();
    const job = why || read(kind, text.current.value, number, places, program.current.value);
    say(typeof job === "string" ? job : "");
    if (typeof job === "string") return;
    text.current.value = program.current.value = "";
    add(job);
  }

  return html`<form class="job-add" id="job-add" onSubmit=${submit}>
    <${Choice} id="job-kind" label="Kind of job" options=${Object.entries(KINDS).map(([value, { name }]) => [value, name])} value=${kind} choose=${setKind} />
    <input id="job-text" ref=${text} aria-label="Of the new job" autocomplete="off" maxlength="400" placeholder=${KINDS[kind].hint} />
    <button class="main" id="job-add-it" ...${barred(why, "Add it at the end")}>Add</button>
    <textarea id="job-source" ref=${program} rows="5" hidden=${kind !== "arm"} spellcheck="false" maxlength="16000"
      aria-label="VAL-II file of the program" placeholder=${".PROGRAM pick\n…\n.END"}></textarea></form>`;
}

function NewPlace({ session, why, say, add }) {
  const input = useRef(null);

  function submit(event) {
    event.preventDefault();
    const real = session.state?.real;
    const name = input.current.value.trim();
    const wrong = why || (!real && "Nobody knows where the robot is.") || (!name && "Give the place a name first.") || "";
    say(wrong);
    if (wrong) return;
    input.current.value = "";
    const [x, y, heading] = real.map((value) => Math.round(value * 1000) / 1000);
    add({ [name]: { x, y, heading } });
  }

  return html`<form class="job-add" id="place-add" onSubmit=${submit}><span class="muted">Here is</span>
    <input id="place-name" ref=${input} aria-label="Name of a place" placeholder="name" maxlength="40" autocomplete="off" />
    <button ...${barred(why, "Keep where the robot is under this name")}>Keep place</button></form>`;
}
