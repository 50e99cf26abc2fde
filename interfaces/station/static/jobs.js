// The list of jobs: edited, reordered, kept by the server, tried on the virtual robot, and done.
import { DEGREES, h, icon, isTyping, mark, planted, write } from "./dom.js";
import { Needs } from "./handling.js";
import { ask, goalText } from "./tasks.js";
import { html } from "./ui.js";

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

export function mount(station, box) {
  const { session } = station;
  const list = h("ol.jobs", { id: "jobs" });
  const empty = h("p.muted", { id: "jobs-empty" }, "No jobs yet. Add the first one below.");
  const fault = h("p.refused", { id: "jobs-fault" });
  const stage = h("p.journey", { id: "jobs-stage", role: "status" });
  const screen = h("p.screen", { id: "jobs-shows", hidden: true });
  const policy = h("p.muted", { id: "jobs-policy" });
  const buttons = {};
  const bar = h("div.job-bar", { role: "group", "aria-label": "The list" }, ...COMMANDS.map(([word, symbol, title]) => {
    buttons[word] = h("button", { type: "button", id: `jobs-${word}`, onclick: () => command(word) }, icon(symbol), title);
    return buttons[word];
  }));
  const kind = h("select", { id: "job-kind", "aria-label": "Kind of job" },
    ...Object.entries(KINDS).map(([value, { name }]) => h("option", { value }, name)));
  const text = h("input", { id: "job-text", "aria-label": "Of the new job", autocomplete: "off", maxlength: 400 });
  const program = h("textarea", { id: "job-source", rows: 5, hidden: true, spellcheck: "false", maxlength: 16000,
    "aria-label": "VAL-II file of the program", placeholder: ".PROGRAM pick\n…\n.END" });
  const adding = h("form.job-add", { id: "job-add" }, kind, text, h("button.main", { id: "job-add-it" }, "Add"), program);
  const placeName = h("input", { id: "place-name", "aria-label": "Name of a place", placeholder: "name", maxlength: 40, autocomplete: "off" });
  const keeping = h("form.job-add", { id: "place-add" }, h("span.muted", {}, "Here is"), placeName, h("button", {}, "Keep place"));
  box.append(planted(html`<${Needs} station=${station} id="jobs-needs" />`), bar, stage, screen, fault, list, empty, adding, keeping, policy);

  /** The list as it was edited here, until the server has answered the last edit; edits come faster than answers. */
  let draft = null;
  let edits = 0;
  const listed = () => draft ?? session.tasks?.jobs ?? { jobs: [], places: {} };
  const jobs = () => listed().jobs;
  const places = () => listed().places;
  const say = (words) => {
    write(fault, words);
    station.refuse(words);
  };
  const command = (word) => ask(station, { do: word }, say);
  function send(entries, named = places()) {
    draft = { jobs: entries, places: named };
    edits += 1;
    const mine = edits;
    ask(station, { jobs: draft }, (words) => {
      // One that was refused takes those that were made on top of it along.
      if (words || mine === edits) settle();
      say(words);
    });
    show();
  }
  function settle() {
    draft = null;
    show();
  }
  const number = () => 1 + Math.max(0, ...jobs().map((job) => job.number));

  function hint() {
    text.placeholder = KINDS[kind.value].hint;
    program.hidden = kind.value !== "arm";
  }
  kind.addEventListener("change", hint);
  hint();

  adding.addEventListener("submit", (event) => {
    event.preventDefault();
    const job = read(kind.value, text.value, number(), places(), program.value);
    if (typeof job === "string") return say(job);
    text.value = program.value = "";
    return send([...jobs(), job]);
  });
  keeping.addEventListener("submit", (event) => {
    event.preventDefault();
    const real = session.state?.real;
    const name = placeName.value.trim();
    if (!real || !name) return say(real ? "Give the place a name first." : "Nobody knows where the robot is.");
    placeName.value = "";
    const round = (value) => Math.round(value * 1000) / 1000;
    return send(jobs(), { ...places(), [name]: { x: round(real[0]), y: round(real[1]), heading: round(real[2]) } });
  });

  function change(job, field) {
    const found = read(job.do, field.value, number(), places(), job.source);
    if (typeof found === "string") {
      field.value = written(job);
      say(found);
    } else if (field.value !== written(job)) send(jobs().map((other) => (other.number === job.number ? found : other)));
  }

  function move(job, by) {
    const entries = jobs().filter((other) => other.number !== job.number);
    entries.splice(jobs().findIndex((other) => other.number === job.number) + by, 0, job);
    send(entries);
  }

  function row(job, at, all, progress, forecast, running) {
    const [symbol, word] = STAGES[progress?.stage ?? "planned"];
    const field = h("input.what", { value: written(job), "aria-label": `${KINDS[job.do].name} ${at + 1}`, disabled: running,
      title: job.do === "move" && places()[job.to] ? goalText(places()[job.to]) : null, maxlength: 400, autocomplete: "off" });
    field.addEventListener("change", () => change(job, field));
    const tool = (label, name, does, off) => h("button.quiet", { type: "button", "aria-label": `${label} job ${at + 1}`,
      title: label, disabled: running || off, onclick: does }, icon(name));
    const mine = forecast?.find((one) => one.number === job.number);
    const lasts = mine?.problem ? mine.problem : mine ? duration(mine.lasts) : "";
    const note = [progress?.reason, lasts].filter(Boolean).join(" · ");
    return h("li.job", { "data-stage": progress?.stage ?? "planned", "data-number": job.number },
      h("span.stage", { title: word }, icon(symbol), h("span.spoken", {}, word)),
      h("span.kind", {}, KINDS[job.do].name), field,
      h("span.tools-job", {}, tool("Earlier", "arrow_upward", () => move(job, -1), at === 0),
        tool("Later", "arrow_downward", () => move(job, 1), at === all.length - 1),
        tool("Remove", "delete", () => send(jobs().filter((other) => other.number !== job.number)), false)),
      note ? h("span.note", { "data-bad": mine?.problem ? true : null }, note) : null);
  }

  let shown = "";
  function show() {
    const tasks = session.tasks;
    if (!tasks) return;
    const { progress, forecast } = tasks;
    const stageNow = progress.stage;
    const running = stageNow === "running";
    const ready = session.holds && session.link === "live";
    const text = JSON.stringify([listed(), progress, forecast, ready]);
    if (text !== shown) {
      shown = text;
      const by = new Map(progress.jobs.map((one) => [one.number, one]));
      const focus = document.activeElement?.closest?.("#jobs") && document.activeElement.getAttribute("aria-label");
      list.replaceChildren(...jobs().map((job, at, all) => row(job, at, all, by.get(job.number), forecast, running)));
      if (focus) list.querySelector(`[aria-label="${CSS.escape(focus)}"]`)?.focus();
    }
    empty.hidden = jobs().length > 0;
    list.hidden = jobs().length === 0;
    const waits = running && jobs().some((job) => job.do === "wait" && job.seconds == null
      && progress.jobs.some((one) => one.number === job.number && one.stage === "running"));
    const many = jobs().length > 0;
    const can = { "dry-run": many, run: many && !running, pause: running, abort: running || stageNow === "paused",
      resume: many && ["paused", "failed", "aborted"].includes(stageNow), key: waits };
    for (const [word, button] of Object.entries(buttons)) button.disabled = !(ready && can[word]);
    mark(buttons.key, "data-waits", waits);
    const predicted = forecast ? ` Dry run: ${outlook(forecast)}.` : "";
    const says = tasks.says ? ` Says: “${tasks.says}”` : "";
    write(stage, `${STAGES[stageNow][1]}${progress.reason ? ": " + progress.reason : ""}.${predicted}${says}`);
    stage.dataset.state = stageNow;
    write(screen, tasks.shows);
    screen.hidden = !tasks.shows;
    write(policy, [LOSSES[tasks.loss] ?? "", tasks.problem].filter(Boolean).join(" "));
    mark(policy, "data-bad", tasks.problem ? true : null);
  }

  // The key of a WAIT is Enter, as in the paper, where it means nothing else.
  window.addEventListener("keydown", (event) => {
    if (event.key !== "Enter" || event.repeat || isTyping(event) || buttons.key.disabled) return;
    if (event.target.closest?.("button, select, a, summary, dialog, [role=tab], [role=separator]")) return;
    event.preventDefault();
    command("key");
  });
  for (const type of ["tasks", "lease", "link", "welcome"]) station.on(type, show);
  station.on("link", (link) => link === "lost" && settle());
  show();
}
