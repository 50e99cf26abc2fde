// The page's behaviour: one scene, one connection, and what is written beside them.
"use strict";

(function () {
  const el = (id) => document.getElementById(id);
  let scene = null;

  const link = new VrsLink("/meshcat", ["vrs.meshcat.1"], {
    take: (data) => scene.take(data),
    state(state) {
      if (state === "live") el("enter").hidden = true;
      if (state === "token") askToken();
      say();
    },
  });

  function say() {
    const texts = { connecting: "Connecting…", lost: "No connection; trying again…", token: "Locked", live: "Live" };
    const live = link.state === "live";
    el("status").dataset.state = link.state;
    const text = live && !scene.real ? "Live · the real robot isn't connected" : texts[link.state];
    VrsScene.write(el("status-text"), text);
    // Apart from the state, which a screen reader reads out when it changes.
    const ahead = live && scene.ahead !== null ? "· at rest in " + scene.ahead.toFixed(1) + " s" : "";
    VrsScene.write(el("status-ahead"), ahead);
  }

  function askToken() {
    el("refused").hidden = sessionStorage.getItem("token") === null;
    sessionStorage.removeItem("token");
    el("enter").hidden = false;
    el("token").focus();
  }

  for (const button of document.querySelectorAll("#legend button"))
    button.addEventListener("click", () => {
      button.setAttribute("aria-pressed", String(scene.toggle(button.dataset.path)));
    });

  el("home").addEventListener("click", () => scene.home());
  el("enter").addEventListener("submit", (event) => {
    event.preventDefault();
    sessionStorage.setItem("token", el("token").value);
    el("token").value = "";
    link.connect();
  });

  try {
    scene = new VrsScene(el("pane"), el("labels"), say);
  } catch (problem) {
    el("pane").replaceChildren();
    el("no-3d").hidden = false;
    el("no-3d").textContent = "No 3D view: this browser offers no WebGL.";
    el("legend").hidden = el("home").hidden = el("status").hidden = true;
    return;
  }
  link.connect();
  window.view = {
    viewer: scene.viewer,
    node: (...path) => scene.node(...path),
    home: () => scene.home(),
    get socket() { return link.socket; },
  };
})();
