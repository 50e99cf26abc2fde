// Recording on the fly, and the list of recordings: replayed alone or side by side, and copied.
import { draw, h, icon, mark, write } from "./dom.js";
import { sideLink } from "./sidelink.js";

const ALIGNED = [
  ["start", "beginnings together"],
  ["began", "as they happened, by the clock"],
  ["timeline", "at equal session times"],
];
const MOST_CHOSEN = 2;

/** Bytes as people read them. */
function sizeText(bytes) {
  if (bytes < 1e6) return Math.max(1, Math.round(bytes / 1e3)) + " kB";
  return (bytes / 1e6).toFixed(bytes < 1e7 ? 1 : 0) + " MB";
}

/** Seconds as h:mm:ss or m:ss. */
function lengthText(seconds) {
  const whole = Math.round(seconds);
  const two = (number) => String(number).padStart(2, "0");
  const [hours, minutes] = [Math.floor(whole / 3600), Math.floor(whole / 60) % 60];
  return (hours ? hours + ":" + two(minutes) : minutes) + ":" + two(whole % 60);
}

function whenText(seconds) {
  const at = new Date(seconds * 1000);
  const two = (number) => String(number).padStart(2, "0");
  const day = `${at.getFullYear()}-${two(at.getMonth() + 1)}-${two(at.getDate())}`;
  return `${day} ${two(at.getHours())}:${two(at.getMinutes())}`;
}

/** A name that isn't taken yet, unless two people are very quick. */
function freshName() {
  return whenText(Date.now() / 1000).replace(" ", "_").replace(":", ".") + "." + String(new Date().getSeconds()).padStart(2, "0");
}

export function mount(station, box) {
  const session = station.session;
  let now = null; // what is being recorded
  let items = [];
  let chosen = []; // names, the first chosen first
  let busy = false;

  const name = h("input", { id: "record-name", maxlength: 95, spellcheck: "false", autocomplete: "off", "aria-label": "Name of the recording" });
  const begin = h("button.main", { type: "submit", id: "record-begin" }, icon("fiber_manual_record"), h("span", {}, "Record"));
  const form = h("form.row", { id: "record-form" }, name, h("span.muted", {}, ".mcap"), begin);
  const end = h("button", { type: "button", id: "record-end", onclick: finish }, icon("stop"), h("span", {}, "End recording"));
  const symbol = icon("fiber_manual_record");
  const what = h("span.what");
  const facts = h("span.muted");
  const card = h("div.recording", { id: "recording", hidden: true }, symbol, h("div.grow", {}, what, facts), end);
  const problem = h("p.refused", { id: "record-problem", hidden: true });
  const idle = h("p.muted", { id: "record-idle" });
  const list = h("ul.recordings", { id: "recordings", "aria-label": "Recordings, newest first" });
  const where = h("p.muted.where");
  const align = h("select", { id: "record-align", "aria-label": "Side by side, aligned", onchange: showChoice },
    ...ALIGNED.map(([value, text]) => h("option", { value }, text)));
  const open = h("a.open", { id: "record-replay", target: "_blank", rel: "opener" }, icon("play_circle"), h("span"));
  const choice = h("div.choice", {}, align, open);
  box.append(form, card, idle, problem, h("h2", {}, "Recordings"), list, where, choice);
  name.value = freshName();
  form.addEventListener("submit", (event) => {
    event.preventDefault();
    start();
  });

  function complain(text) {
    problem.hidden = !text;
    write(problem, text);
    station.refuse(text);
  }

  /** Ask the server; what it answers, or null where it doesn't do it. */
  async function ask(request) {
    const headers = { "Content-Type": "application/json" };
    if (session.token) headers.Authorization = "Bearer " + session.token;
    busy = true;
    showState();
    try {
      const answer = await fetch(window.VrsLink.FOLDER + "/recordings", { method: "POST", headers, body: JSON.stringify(request) });
      const found = await answer.json();
      complain(found.problem ?? "");
      return answer.ok ? found : null;
    } catch {
      complain("The server doesn't answer: nothing was done.");
      return null;
    } finally {
      busy = false;
      showState();
    }
  }

  async function start() {
    const given = name.value.trim().replace(/\.mcap$/, "");
    if (!given) return complain("The recording needs a name.");
    if (await ask({ do: "begin", name: given + ".mcap" })) station.announce("Recording " + given);
  }

  async function finish() {
    const ended = now?.name;
    if (await ask({ do: "end" })) {
      name.value = freshName();
      station.announce("Recording ended: " + ended);
    }
  }

  async function copy(item) {
    const found = await ask({ do: "copy", name: item.name });
    if (found) h("a", { href: window.VrsLink.FOLDER + found.path, download: item.name }).click();
  }

  let told = "";
  function showState() {
    const may = session.mayCommand;
    const tab = document.getElementById("tab-record");
    mark(tab, "data-recording", now ? (now.problem ? "failed" : "yes") : null);
    form.hidden = Boolean(now) || !may;
    card.hidden = !now;
    idle.hidden = Boolean(now) || may;
    write(idle, "Nothing is being recorded. Operators can begin.");
    begin.disabled = end.disabled = busy;
    end.hidden = !may;
    const failed = now?.problem ?? "";
    if (failed !== told) {
      told = failed;
      if (failed) station.announce(failed, { urgent: true });
    }
    if (!now || box.offsetParent === null) return;
    mark(card, "data-failed", Boolean(failed));
    draw(symbol, failed ? "error" : "fiber_manual_record");
    write(what, failed ? "Not recording" : "Recording " + now.name);
    const dropped = now.dropped ? ` · ${now.dropped} messages left out: the disk is slow` : "";
    write(facts, failed || `since ${lengthText(now.length)} · ${sizeText(now.size)}${dropped}`);
    write(end.lastChild, failed ? "Put it away" : "End");
  }

  function row(item) {
    const [title, facts, wrong] = [h("span.name"), h("span.muted"), h("span.wrong")];
    const pick = h("button.pick", { type: "button", "aria-pressed": "false", onclick: () => choose(item.name) },
      h("span.letter", { "aria-hidden": "true" }), h("span.about", {}, title, facts, wrong));
    const get = h("button.quiet", { type: "button", onclick: () => copy(item), "aria-label": "Download " + item.name, title: "Download" },
      icon("download"));
    const growing = now?.name === item.name;
    write(title, item.name.replace(/\.mcap$/, ""));
    const length = item.length === null ? null : lengthText(item.length);
    write(facts, [whenText(item.began ?? item.changed), length, sizeText(item.size)].filter(Boolean).join(" · "));
    write(wrong, growing ? "being recorded" : item.problem);
    mark(wrong, "data-growing", growing);
    pick.disabled = !item.playable;
    get.disabled = growing;
    return h("li", { "data-name": item.name }, pick, get);
  }

  function choose(which) {
    chosen = chosen.includes(which) ? chosen.filter((one) => one !== which) : [...chosen, which].slice(-MOST_CHOSEN);
    showChoice();
  }

  function showChoice() {
    for (const element of list.children) {
      const place = chosen.indexOf(element.dataset.name);
      mark(element.firstChild, "aria-pressed", place >= 0);
      write(element.querySelector(".letter"), place < 0 ? "" : chosen.length > 1 ? "AB"[place] : "✓");
    }
    align.hidden = chosen.length < 2;
    mark(open, "aria-disabled", chosen.length === 0 ? "true" : null);
    write(open.lastChild, ["Choose one or two to replay", "Replay", "Replay side by side"][chosen.length]);
    if (chosen.length === 0) return open.removeAttribute("href");
    const query = new URLSearchParams({ a: chosen[0] });
    if (chosen.length > 1) {
      query.set("b", chosen[1]);
      query.set("align", align.value);
    }
    mark(open, "href", window.VrsLink.FOLDER + "/replay?" + query);
  }

  let drawn = "";
  function showList() {
    if (box.offsetParent === null) return;
    const key = JSON.stringify([items, now?.name]);
    if (key === drawn) return;
    drawn = key;
    const focused = document.activeElement?.closest?.(".recordings li")?.dataset.name;
    chosen = chosen.filter((one) => items.some((item) => item.name === one && item.playable));
    list.replaceChildren(...items.map(row));
    showChoice();
    const again = [...list.children].find((element) => element.dataset.name === focused);
    if (again) again.firstChild.focus();
  }

  sideLink(station, "/recordings/board", {
    take(data) {
      const message = JSON.parse(typeof data === "string" ? data : new TextDecoder().decode(data));
      if (message.kind === "recording") now = message.now;
      else if (message.kind === "list") {
        items = message.items;
        const more = message.more ? `, and ${message.more} older ones` : "";
        write(where, items.length ? `In ${message.directory}${more}` : `None yet in ${message.directory}`);
      }
      showState();
      showList();
    },
  });
  // Draws what has come while the panel was hidden.
  new IntersectionObserver(() => {
    showState();
    showList();
  }).observe(box);
  station.on("welcome", showState);
  station.shared.record = { get now() { return now; }, get items() { return items; } };
  showState();
  showChoice();
}
