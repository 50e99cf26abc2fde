// What every page with a 3D view of the robots needs: the connection to the server, and MeshCat's viewer.
"use strict";

// A WebSocket that comes again by itself, sooner at first.
window.VrsLink = class {
  // handlers: take(data), state("connecting" | "live" | "lost" | "token")
  constructor(path, protocols, handlers) {
    this.path = path;
    this.protocols = protocols;
    this.handlers = handlers;
    this.state = "connecting";
    this.socket = null;
    this.tries = 0;
    this.heard = 0;
    this.again = null;
    setInterval(() => this.beat(), VrsLink.BEAT);
  }

  connect() {
    this.again = null;
    const url = (location.protocol === "https:" ? "wss://" : "ws://") + location.host + VrsLink.FOLDER + this.path;
    const mine = (this.socket = new WebSocket(url, this.protocols));
    mine.binaryType = "arraybuffer";
    this.heard = performance.now();
    mine.onopen = () => mine.send(JSON.stringify({ token: sessionStorage.getItem("token") }));
    mine.onmessage = (message) => {
      this.heard = performance.now();
      if (mine !== this.socket) return;
      if (this.state !== "live") {
        this.tries = 0;
        this.become("live");
      }
      if (message.data !== "beat") this.handlers.take(message.data);
    };
    mine.onclose = (event) => {
      if (mine !== this.socket) return;
      this.socket = null;
      if (event.code === VrsLink.UNAUTHORISED) this.become("token");
      else this.retry();
    };
  }

  become(state) {
    this.state = state;
    this.handlers.state(state);
  }

  retry() {
    this.socket = null;
    this.become("lost");
    if (this.again === null) this.again = setTimeout(() => this.connect(), Math.min(5000, 250 * 2 ** this.tries++));
  }

  send(text) {
    const open = this.socket !== null && this.socket.readyState === WebSocket.OPEN;
    if (open) this.socket.send(text);
    return open;
  }

  beat() {
    if (this.socket === null) return;
    if (performance.now() - this.heard > VrsLink.PATIENCE) {
      const old = this.socket;
      this.retry();
      old.close();
    } else this.send("beat");
  }
};
VrsLink.BEAT = 2000; // [ms] between two questions whether the server is there
VrsLink.PATIENCE = 6000; // [ms] without an answer after which the connection counts as lost
VrsLink.UNAUTHORISED = 4401;
VrsLink.FOLDER = location.pathname.replace(/\/[^/]*$/, ""); // of the page: one below /robots/NAME/ is that robot's

// Lights that a scene drawn by software does without: each costs time at every pixel.
const SIDE_LIGHTS = ["PointLightNegativeX", "PointLightPositiveX"];

// Whether no graphics card draws, here and in the rest of the page.
const SOFTWARE = (() => {
  const gl = document.createElement("canvas").getContext("webgl");
  const info = gl?.getExtension("WEBGL_debug_renderer_info");
  const name = info ? gl.getParameter(info.UNMASKED_RENDERER_WEBGL) : "";
  gl?.getExtension("WEBGL_lose_context")?.loseContext();
  return /swiftshader|llvmpipe|softpipe|software|basic render/i.test(name);
})();

// Make a viewer whose edges aren't smoothed, which takes four samples of each pixel; its own options don't say.
function withoutSmoothing(make) {
  const own = HTMLCanvasElement.prototype.getContext;
  HTMLCanvasElement.prototype.getContext = function (kind, options) {
    return own.call(this, kind, options && { ...options, antialias: false });
  };
  try {
    return make();
  } finally {
    HTMLCanvasElement.prototype.getContext = own;
  }
}

// Both robots, their paths and their room in a pane; throws where the browser offers no WebGL.
window.VrsScene = class {
  static software = SOFTWARE;

  constructor(pane, labels, drawn) {
    this.pane = pane;
    this.labels = labels;
    this.drawn = drawn || (() => {});
    this.dark = window.matchMedia("(prefers-color-scheme: dark)");
    this.pool = [];
    this.hidden = new Set();
    this.framed = null;
    this.ahead = null; // [s] until the real robot is at rest
    // The bundle asks for the pane's size when it's made, and sizes itself by the window; the pane is what it fills.
    const viewer = (this.viewer = SOFTWARE ? withoutSmoothing(() => new MeshCat.Viewer(pane)) : new MeshCat.Viewer(pane));
    if (SOFTWARE) for (const light of SIDE_LIGHTS) viewer.set_property(["Lights", light], "visible", false);
    viewer.gui.domElement.style.display = "none";
    const resize = viewer.set_3d_pane_size.bind(viewer);
    viewer.set_3d_pane_size = () => {
      // Kept: to ask for it in each frame would lay out the page in each.
      [this.width, this.height] = [pane.clientWidth, pane.clientHeight];
      if (this.width && this.height) resize(this.width, this.height);
    };
    new ResizeObserver(() => viewer.set_3d_pane_size()).observe(pane);
    viewer.set_3d_pane_size();
    viewer.set_property(["Background"], "visible", false);
    viewer.set_property(["Axes"], "visible", false);
    const draw = viewer.render.bind(viewer);
    viewer.render = () => {
      draw();
      this.writeLabels();
      this.drawn();
    };
    this.drawGrid();
    this.dark.addEventListener("change", () => this.drawGrid());
  }

  node(...path) {
    return this.viewer.scene_tree.find(path).object;
  }

  // Whether the server shows the real robot.
  get real() {
    return Boolean(this.viewer.scene_tree.children[VrsScene.ROOT]) && this.node(VrsScene.ROOT, "real").visible;
  }

  drawGrid() {
    const THREE = MeshCat.THREE;
    const [main, sub] = this.dark.matches ? [0x778396, 0x4a5665] : [0x9aa5b4, 0xd0d7e0];
    const grid = new THREE.GridHelper(4, 20, main, sub);
    grid.rotateX(Math.PI / 2);
    this.viewer.set_object(["Grid"], grid);
    this.viewer.set_dirty();
  }

  // Take a message of several commands, each after its length.
  take(data) {
    const view = new DataView(data);
    for (let at = 0; at + 4 <= data.byteLength; ) {
      const length = view.getUint32(at, true);
      this.viewer.handle_command_bytearray(new Uint8Array(data, at + 4, length));
      at += 4 + length;
    }
    this.applyToggles();
    this.frameOnce();
  }

  // The camera lives in a y-up frame: scene (x, y, z) is (x, z, -y) there.
  home() {
    const box = this.node(VrsScene.ROOT).box;
    if (!box) return;
    const [low, high] = box;
    const middle = low.map((x, k) => x + (k === 2 ? 0.44 : 0.5) * (high[k] - x));
    const camera = this.viewer.camera;
    camera.fov = 32;
    const half = (camera.fov * Math.PI) / 360;
    const narrow = Math.min(1, this.width / this.height);
    const radius = 0.5 * Math.hypot(...low.map((x, k) => high[k] - x));
    // Of an arm, nearer than would show the whole reach: it's rarely stretched out.
    const root = this.node(VrsScene.ROOT);
    const distance = ((root.away ?? 0.66) * radius) / Math.sin(Math.atan(Math.tan(half) * Math.max(narrow, 0.45)));
    const azimuth = root.azimuth ?? -0.3 * Math.PI;
    const elevation = root.elevation ?? 0.34;
    const eye = [
      middle[0] + distance * Math.cos(elevation) * Math.cos(azimuth),
      middle[1] + distance * Math.cos(elevation) * Math.sin(azimuth),
      middle[2] + distance * Math.sin(elevation),
    ];
    camera.position.set(eye[0], eye[2], -eye[1]);
    this.viewer.controls.target.set(middle[0], middle[2], -middle[1]);
    this.viewer.controls.update();
    this.viewer.set_dirty();
  }

  // Where the user hasn't moved the camera, it's placed anew for another robot.
  frameOnce() {
    const box = JSON.stringify(this.node(VrsScene.ROOT).box);
    if (box && box !== this.framed) {
      this.framed = box;
      this.home();
    }
  }

  // What is shown: below the nodes that the server hides and shows itself.
  toggle(name) {
    const shown = this.hidden.delete(name);
    if (!shown) this.hidden.add(name);
    this.applyToggles();
    this.viewer.set_dirty();
    return shown;
  }

  applyToggles() {
    for (const [name, path] of Object.entries({
      virtual: ["virtual"],
      real: ["real", "body"],
      committed: ["committed"],
      driven: ["driven"],
      learned: ["learned"],
    }))
      this.node(VrsScene.ROOT, ...path).visible = !this.hidden.has(name);
  }

  // How long until the real robot is there, beside the marks of the committed path.
  writeLabels() {
    const path = this.node(VrsScene.ROOT, "committed");
    const play = path.play;
    const { width, height } = this;
    const taken = [];
    let used = 0;
    this.ahead = null;
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
      if (end) this.ahead = left;
      if (!path.visible || used >= VrsScene.LABELS) continue;
      const parts = mark.children;
      const at = parts[parts.length - 1].getWorldPosition(new MeshCat.THREE.Vector3()).project(this.viewer.camera);
      if (at.z > 1 || Math.abs(at.x) > 1.05 || Math.abs(at.y) > 1.05) continue;
      const x = ((at.x + 1) / 2) * width;
      const y = ((1 - at.y) / 2) * height;
      const wide = end ? 104 : 50;
      if (taken.some(([u, v, w]) => x - u < w && u - x < wide && Math.abs(v - y) < 24)) continue;
      taken.push([x, y, wide]);
      if (this.pool.length === used) this.pool.push(this.labels.appendChild(document.createElement("span")));
      const label = this.pool[used++];
      VrsScene.write(label, end ? "rest in " + left.toFixed(1) + " s" : left.toFixed(1) + " s");
      label.className = end ? "end" : "";
      label.hidden = false;
      const [way, back] = x + 12 + wide < width ? [x + 12, ""] : [x - 12, " translateX(-100%)"];
      label.style.transform = "translate(" + Math.round(way) + "px, " + Math.round(y - 22) + "px)" + back;
    }
    for (let k = used; k < this.pool.length; k++) this.pool[k].hidden = true;
  }

  static write(element, text) {
    if (element.textContent !== text) element.textContent = text;
  }
};
VrsScene.ROOT = "vrs";
VrsScene.LABELS = 24;
