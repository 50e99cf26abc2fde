// The page's behaviour: what the server says, and a scene for each recording.
"use strict";

(function () {
  const el = (id) => document.getElementById(id);
  const write = VrsScene.write;
  const { KINDS, makeMark, seconds } = VrsSeekBar;
  const NAMES = ["A", "B"];
  // What an error is called and how it's written, by its unit.
  const ERRORS = {
    rad: { name: "Largest joint error", text: (error) => ((error * 180) / Math.PI).toFixed(3) + "°" },
    m: { name: "Path error", text: (error) => (100 * error).toFixed(2) + " cm" },
  };

  let state = null; // what the server said last
  let items = []; // the recordings
  const views = [];

  // What the server says, and what it's asked for.
  const board = new VrsLink("/replay/board" + location.search, [], {
    take(data) {
      const text = typeof data === "string" ? data : new TextDecoder().decode(data);
      const message = JSON.parse(text);
      if (message.kind === "recordings") setUp(message.items);
      else if (message.kind === "marks") bar.takeMarks(message);
      else if (message.kind === "state") show(message);
      else if (message.kind === "refused") say(message.text);
      else if (["opening", "open", "failed"].includes(message.kind)) showStanding(message);
    },
    state(next) {
      if (next === "live") el("enter").hidden = true;
      if (next === "token") askToken();
      el("status").dataset.state = next;
      sayStatus();
    },
  });
  const wish = (what, more) => board.send(JSON.stringify({ do: what, ...more }));
  const letter = (k) => (items.length > 1 ? NAMES[k] + " · " : "");
  const bar = new VrsSeekBar(wish, letter);
  const controls = new VrsControls(wish, say, () => views.forEach((view) => view.scene && view.scene.home()));

  // A server that has other things to do opens the recordings when they're asked for.
  function showStanding({ kind, text }) {
    el("standing").hidden = kind === "open";
    el("standing").dataset.kind = kind;
    write(el("standing"), text);
  }

  function sayStatus() {
    const doing = () => {
      if (!state) return "Connected";
      if (state.mode === "paused") return "Paused";
      if (state.mode === "live") return "Live";
      if (state.mode === "catching-up") return "Going live…";
      return (state.rate < 0 ? "Rewinding at " : "Playing at ") + VrsControls.rounded(Math.abs(state.rate));
    };
    const texts = { connecting: () => "Connecting…", lost: () => "No connection; trying again…", token: () => "Locked", live: doing };
    write(el("status-text"), texts[board.state]());
  }

  function askToken() {
    el("refused").hidden = sessionStorage.getItem("token") === null;
    sessionStorage.removeItem("token");
    el("enter").hidden = false;
    el("token").focus();
  }

  el("enter").addEventListener("submit", (event) => {
    event.preventDefault();
    sessionStorage.setItem("token", el("token").value);
    el("token").value = "";
    el("enter").hidden = true;
    board.connect();
    for (const view of views) if (view.link.state === "token") view.link.connect();
  });

  // A view for each recording.
  function setUp(next) {
    items = next;
    document.title = items.map((item) => item.name).join(" · ") + " · play-back";
    el("stage").dataset.panes = String(items.length);
    bar.setLanes(items.length);
    for (let k = views.length; k < items.length; k++) views.push(makeView(k));
    views.forEach((view, k) => {
      const item = items[k];
      write(view.part(".name"), letter(k) + item.name);
      view.part(".name").title = [item.title, "delay " + item.delay, item.driver].filter(Boolean).join(" · ");
      write(view.part(".error-name"), ERRORS[item.unit].name);
      for (const path of ["driven", "learned"])
        view.part(`[data-path=${path}]`).parentElement.hidden = !item.shows.includes(path);
      view.part(".damage").hidden = !item.damage;
      write(view.part(".damage"), item.damage);
    });
  }

  function makeView(k) {
    el("stage").append(el("view").content.cloneNode(true));
    const root = el("stage").lastElementChild;
    const view = { root, part: (selector) => root.querySelector(selector), scene: null, link: null };
    root.querySelector(".pane").setAttribute("aria-label", "Robots of recording " + NAMES[k] + " in 3D");
    try {
      view.scene = new VrsScene(root.querySelector(".pane"), root.querySelector(".labels"));
      view.scene.viewer.controls.addEventListener("change", () => follow(view));
    } catch (problem) {
      el("no-3d").hidden = false;
      el("no-3d").textContent = "No 3D view: this browser offers no WebGL. Play-back works all the same.";
    }
    for (const button of root.querySelectorAll(".legend button"))
      button.addEventListener("click", () => {
        if (view.scene) button.setAttribute("aria-pressed", String(view.scene.toggle(button.dataset.path)));
      });
    view.link = new VrsLink("/replay/scene/" + k + location.search, ["vrs.meshcat.1"], {
      take: (data) => view.scene && view.scene.take(data),
      state() {},
    });
    if (view.scene) view.link.connect();
    return view;
  }

  // One camera for all panes: what is compared is seen from the same side.
  let following = false;
  function follow(view) {
    if (following) return;
    following = true;
    for (const other of views) {
      if (other === view || !other.scene) continue;
      other.scene.viewer.camera.position.copy(view.scene.viewer.camera.position);
      other.scene.viewer.controls.target.copy(view.scene.viewer.controls.target);
      other.scene.viewer.controls.update();
      other.scene.viewer.set_dirty();
    }
    following = false;
  }

  function show(next) {
    state = next;
    document.body.dataset.mode = next.mode;
    bar.show(next);
    controls.show(next);
    next.panes.forEach((pane, k) => {
      const view = views[k];
      if (!view) return;
      write(view.part(".own"), seconds(pane.t, 3));
      write(view.part(".behind"), pane.behind === null ? "–" : seconds(pane.behind, 3));
      write(view.part(".error"), pane.error === null ? "–" : ERRORS[items[k].unit].text(pane.error));
      view.part(".absent").hidden = pane.real && pane.virtual;
      write(view.part(".absent"), pane.virtual ? "The real robot wasn't recorded here" : "This part of the file is lost");
    });
    showLatest(next);
    sayStatus();
  }

  // The newest mark that the play head has passed.
  let told = "";
  let saying = 0;
  function showLatest(next) {
    if (performance.now() < saying) return;
    const latest = next.panes
      .map((pane, k) => pane.mark && { ...pane.mark, k })
      .filter(Boolean)
      .sort((a, b) => b.t + items[b.k].shift - (a.t + items[a.k].shift))[0];
    const key = latest ? latest.k + " " + latest.t + latest.text : "";
    if (key === told) return;
    told = key;
    if (!latest) return el("now").replaceChildren();
    const time = document.createElement("b");
    time.textContent = letter(latest.k) + seconds(latest.t);
    const text = document.createElement("span");
    text.textContent = (KINDS[latest.kind] || "Mark") + " · " + latest.text;
    el("now").replaceChildren(makeMark(latest.kind in KINDS ? latest.kind : "other"), time, text);
  }

  function say(text) {
    saying = performance.now() + 4000;
    told = "said";
    const line = document.createElement("span");
    line.textContent = text;
    el("now").replaceChildren(line);
  }

  el("aside").hidden = !location.search;
  board.connect();
  window.replay = {
    views,
    wish,
    marks: bar.marks,
    get state() { return state; },
    get board() { return board; },
    node: (k, ...path) => views[k].scene.node(...path),
  };
})();
