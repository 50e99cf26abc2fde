// The page's behaviour: MeshCat's viewer, the connection to the server, and what is written into the scene.
"use strict";

(function () {
  const BATCHES = "vrs.meshcat.1"; // subprotocol: commands after their lengths
  const BEAT = 2000; // [ms] between two questions whether the server is there
  const PATIENCE = 6000; // [ms] without an answer after which the connection counts as lost
  const UNAUTHORISED = 4401;
  const ROOT = "vrs";
  const LABELS = 24;

  const el = (id) => document.getElementById(id);
  const dark = window.matchMedia("(prefers-color-scheme: dark)");
  const pane = el("pane");
  let viewer = null;

  function makeViewer() {
    // The bundle asks for the pane's size when it's made, and sizes itself by the window; the pane is what it fills.
    viewer = new MeshCat.Viewer(pane);
    viewer.gui.domElement.style.display = "none";
    const resize = viewer.set_3d_pane_size.bind(viewer);
    viewer.set_3d_pane_size = () => {
      if (pane.clientWidth && pane.clientHeight) resize(pane.clientWidth, pane.clientHeight);
    };
    new ResizeObserver(() => viewer.set_3d_pane_size()).observe(pane);
    viewer.set_3d_pane_size();
    viewer.set_property(["Background"], "visible", false);
    viewer.set_property(["Axes"], "visible", false);
    const draw = viewer.render.bind(viewer);
    viewer.render = () => {
      draw();
      writeLabels();
    };
    drawGrid();
    dark.addEventListener("change", drawGrid);
  }

  const node = (...path) => viewer.scene_tree.find(path).object;

  function drawGrid() {
    const THREE = MeshCat.THREE;
    const [main, sub] = dark.matches ? [0x778396, 0x4a5665] : [0x9aa5b4, 0xd0d7e0];
    const grid = new THREE.GridHelper(4, 20, main, sub);
    grid.rotateX(Math.PI / 2);
    viewer.set_object(["Grid"], grid);
    viewer.set_dirty();
  }

  // The camera lives in a y-up frame: scene (x, y, z) is (x, z, -y) there.
  let framed = null;
  function home() {
    const box = node(ROOT).box;
    if (!box) return;
    const [low, high] = box;
    const middle = low.map((x, k) => x + (k === 2 ? 0.44 : 0.5) * (high[k] - x));
    const camera = viewer.camera;
    camera.fov = 32;
    const half = (camera.fov * Math.PI) / 360;
    const narrow = Math.min(1, pane.clientWidth / pane.clientHeight);
    const radius = 0.5 * Math.hypot(...low.map((x, k) => high[k] - x));
    // Nearer than would show the whole reach: arms are rarely stretched out.
    const distance = (0.54 * radius) / Math.sin(Math.atan(Math.tan(half) * Math.max(narrow, 0.45)));
    const azimuth = -0.3 * Math.PI;
    const elevation = 0.34;
    const eye = [
      middle[0] + distance * Math.cos(elevation) * Math.cos(azimuth),
      middle[1] + distance * Math.cos(elevation) * Math.sin(azimuth),
      middle[2] + distance * Math.sin(elevation),
    ];
    camera.position.set(eye[0], eye[2], -eye[1]);
    viewer.controls.target.set(middle[0], middle[2], -middle[1]);
    viewer.controls.update();
    viewer.set_dirty();
  }

  // Where the user hasn't moved the camera, it's placed anew for another robot.
  function frameOnce() {
    const box = JSON.stringify(node(ROOT).box);
    if (box && box !== framed) {
      framed = box;
      home();
    }
  }

  // How long until the real robot is there, beside the marks of the committed path.
  const pool = [];
  let ahead = null;
  function writeLabels() {
    const path = node(ROOT, "committed");
    const play = path.play;
    const width = pane.clientWidth;
    const height = pane.clientHeight;
    const taken = [];
    let used = 0;
    ahead = null;
    const marks = [];
    for (const piece of path.children) {
      const shown = piece.children.find((child) => child.userData.t !== undefined);
      if (!piece.visible || !shown || play === undefined) continue;
      marks.push(shown);
    }
    marks.sort((a, b) => b.userData.end - a.userData.end || a.userData.t - b.userData.t);
    for (const mark of marks) {
      const { t, end } = mark.userData;
      const left = Math.max(0, t - play);
      if (end) ahead = left;
      if (!path.visible || used >= LABELS) continue;
      const parts = mark.children;
      const at = parts[parts.length - 1].getWorldPosition(new MeshCat.THREE.Vector3()).project(viewer.camera);
      if (at.z > 1 || Math.abs(at.x) > 1.05 || Math.abs(at.y) > 1.05) continue;
      const x = ((at.x + 1) / 2) * width;
      const y = ((1 - at.y) / 2) * height;
      if (taken.some(([u, v]) => Math.abs(u - x) < 44 && Math.abs(v - y) < 20)) continue;
      taken.push([x, y]);
      if (pool.length === used) pool.push(el("labels").appendChild(document.createElement("span")));
      const label = pool[used++];
      const text = end ? "rest in " + left.toFixed(1) + " s" : left.toFixed(1) + " s";
      write(label, text);
      label.className = end ? "end" : "";
      label.hidden = false;
      const beside = x + 12 + label.offsetWidth < width ? x + 12 : x - 12 - label.offsetWidth;
      label.style.transform = "translate(" + Math.round(beside) + "px, " + Math.round(y - 22) + "px)";
    }
    for (let k = used; k < pool.length; k++) pool[k].hidden = true;
    say();
  }

  function write(element, text) {
    if (element.textContent !== text) element.textContent = text;
  }

  // The connection: it comes again by itself, sooner at first.
  let state = "connecting";
  let tries = 0;
  let socket = null;
  let heard = 0;
  let again = null;

  function say(next) {
    if (next) state = next;
    let text = { connecting: "Connecting…", lost: "No connection; trying again…", token: "Locked", live: "Live" }[state];
    if (state === "live" && viewer) {
      const real = viewer.scene_tree.children[ROOT] && node(ROOT, "real").visible;
      if (!real) text = "Live · the real robot isn't connected";
    }
    el("status").dataset.state = state;
    write(el("status-text"), text);
    // Apart from the state, which a screen reader reads out when it changes.
    write(el("status-ahead"), state === "live" && ahead !== null ? "· at rest in " + ahead.toFixed(1) + " s" : "");
  }

  function take(data) {
    const view = new DataView(data);
    for (let at = 0; at + 4 <= data.byteLength; ) {
      const length = view.getUint32(at, true);
      viewer.handle_command_bytearray(new Uint8Array(data, at + 4, length));
      at += 4 + length;
    }
    applyToggles();
    frameOnce();
  }

  function connect() {
    again = null;
    const url = (location.protocol === "https:" ? "wss://" : "ws://") + location.host + "/meshcat";
    const mine = (socket = new WebSocket(url, [BATCHES]));
    mine.binaryType = "arraybuffer";
    heard = performance.now();
    mine.onopen = () => mine.send(JSON.stringify({ token: sessionStorage.getItem("token") }));
    mine.onmessage = (message) => {
      heard = performance.now();
      if (mine !== socket) return;
      if (state !== "live") {
        tries = 0;
        el("enter").hidden = true;
        say("live");
      }
      if (typeof message.data !== "string") take(message.data);
    };
    mine.onclose = (event) => {
      if (mine !== socket) return;
      if (event.code === UNAUTHORISED) askToken();
      else retry();
    };
  }

  function retry() {
    socket = null;
    say("lost");
    if (again === null) again = setTimeout(connect, Math.min(5000, 250 * 2 ** tries++));
  }

  function askToken() {
    socket = null;
    el("refused").hidden = sessionStorage.getItem("token") === null;
    sessionStorage.removeItem("token");
    el("enter").hidden = false;
    el("token").focus();
    say("token");
  }

  setInterval(() => {
    if (socket === null) return;
    if (performance.now() - heard > PATIENCE) {
      const old = socket;
      retry();
      old.close();
    } else if (socket.readyState === WebSocket.OPEN) socket.send("beat");
  }, BEAT);

  // What is shown: below the nodes that the server hides and shows itself.
  const hidden = new Set();
  function applyToggles() {
    for (const [name, path] of Object.entries({
      virtual: ["virtual"],
      real: ["real", "body"],
      committed: ["committed"],
    }))
      node(ROOT, ...path).visible = !hidden.has(name);
  }
  for (const button of document.querySelectorAll("#legend button"))
    button.addEventListener("click", () => {
      const name = button.dataset.path;
      if (!hidden.delete(name)) hidden.add(name);
      button.setAttribute("aria-pressed", String(!hidden.has(name)));
      applyToggles();
      viewer.set_dirty();
    });

  el("home").addEventListener("click", home);
  el("enter").addEventListener("submit", (event) => {
    event.preventDefault();
    sessionStorage.setItem("token", el("token").value);
    el("token").value = "";
    connect();
  });

  try {
    makeViewer();
  } catch (problem) {
    pane.replaceChildren();
    el("no-3d").hidden = false;
    el("no-3d").textContent = "No 3D view: this browser offers no WebGL.";
    el("legend").hidden = el("home").hidden = el("status").hidden = true;
    return;
  }
  connect();
  window.view = { viewer, node, home, get socket() { return socket; } };
})();
