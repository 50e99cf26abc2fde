// The page's behaviour: the 3D scene, the time slider, and the cursors on the plots.
"use strict";

(function () {
  const run = JSON.parse(document.getElementById("run-data").textContent);
  const el = (id) => document.getElementById(id);
  const dark = window.matchMedia("(prefers-color-scheme: dark)");
  const TRAIL = 3.0; // seconds of tool trace that are drawn strongly
  const CREASE = Math.cos((35 * Math.PI) / 180); // sharper edges stay sharp when shaded

  function bytes(text) {
    const raw = atob(text);
    const out = new Uint8Array(raw.length);
    for (let i = 0; i < raw.length; i++) out[i] = raw.charCodeAt(i);
    return out.buffer;
  }
  const floats = (text) => new Float32Array(bytes(text));

  const times = floats(run.t);
  const n = run.chain.length;
  const behind = floats(run.behind);
  const samples = { virtual: floats(run.q_virtual), real: floats(run.q_real) };
  const duration = run.t_end - run.t_start;

  // Joints at time t since the start, linear between samples, held at both ends.
  function joints(twin, t) {
    const last = times.length - 1;
    let low = 0;
    let high = last;
    while (high - low > 1) {
      const middle = (low + high) >> 1;
      if (times[middle] <= t) low = middle;
      else high = middle;
    }
    const share = Math.min(1, Math.max(0, (t - times[low]) / (times[high] - times[low])));
    const q = new Array(n);
    for (let j = 0; j < n; j++) {
      const a = samples[twin][low * n + j];
      q[j] = a + share * (samples[twin][high * n + j] - a);
    }
    return q;
  }

  // When the real robot is at a place of the timeline; its play time never runs back.
  function whenPlayed(tau) {
    let low = 0;
    let high = times.length - 1;
    while (high - low > 1) {
      const middle = (low + high) >> 1;
      if (times[middle] - behind[middle] <= tau) low = middle;
      else high = middle;
    }
    const from = times[low] - behind[low];
    const span = times[high] - behind[high] - from;
    const share = span > 0 ? Math.min(1, Math.max(0, (tau - from) / span)) : 0;
    return times[low] + share * (times[high] - times[low]);
  }

  // Column-major products of rigid transforms, X_i = X_(i-1) Rz(q_i) A_i.
  function times4(a, b) {
    const out = new Array(16);
    for (let c = 0; c < 4; c++)
      for (let r = 0; r < 4; r++)
        out[4 * c + r] =
          a[r] * b[4 * c] + a[4 + r] * b[4 * c + 1] + a[8 + r] * b[4 * c + 2] + a[12 + r] * b[4 * c + 3];
    return out;
  }
  function links(q) {
    const out = [run.base];
    for (let i = 0; i < n; i++) {
      const c = Math.cos(q[i]);
      const s = Math.sin(q[i]);
      const turn = [c, s, 0, 0, -s, c, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1];
      out.push(times4(times4(out[i], turn), run.chain[i]));
    }
    return out;
  }

  // Corner normals: the mean of the faces around a corner that meet without a crease.
  function geometry(mesh) {
    const THREE = MeshCat.THREE;
    const vertices = floats(mesh.vertices);
    const faces = new Uint32Array(bytes(mesh.faces));
    const colours = new Uint8Array(bytes(mesh.colours));
    const normal = new Float32Array(faces.length);
    const around = new Map();
    for (let f = 0; f < faces.length; f += 3) {
      const [a, b, c] = [0, 1, 2].map((k) => {
        const v = 3 * faces[f + k];
        return new THREE.Vector3(vertices[v], vertices[v + 1], vertices[v + 2]);
      });
      const area = b.sub(a).cross(c.sub(a));
      normal.set([area.x, area.y, area.z], f);
      for (let k = 0; k < 3; k++) {
        if (!around.has(faces[f + k])) around.set(faces[f + k], []);
        around.get(faces[f + k]).push(f);
      }
    }
    const position = new Float32Array(3 * faces.length);
    const shading = new Float32Array(3 * faces.length);
    const tint = new Float32Array(3 * faces.length);
    for (let corner = 0; corner < faces.length; corner++) {
      const f = corner - (corner % 3);
      const own = new THREE.Vector3().fromArray(normal, f);
      const sum = new THREE.Vector3();
      for (const g of around.get(faces[corner])) {
        const other = new THREE.Vector3().fromArray(normal, g);
        if (own.dot(other) >= CREASE * own.length() * other.length()) sum.add(other);
      }
      sum.normalize().toArray(shading, 3 * corner);
      for (let k = 0; k < 3; k++) {
        position[3 * corner + k] = vertices[3 * faces[corner] + k];
        tint[3 * corner + k] = mesh.palette[colours[f / 3]][k];
      }
    }
    const out = new THREE.BufferGeometry();
    out.setAttribute("position", new THREE.BufferAttribute(position, 3));
    out.setAttribute("normal", new THREE.BufferAttribute(shading, 3));
    out.setAttribute("color", new THREE.BufferAttribute(tint, 3));
    return out;
  }

  const COLOURS = { virtual: 0x2f7de1, real: 0xe0662f };

  function body(twin, meshes) {
    const THREE = MeshCat.THREE;
    const group = new THREE.Group();
    group.name = twin;
    for (const shape of meshes) {
      const link = new THREE.Group();
      link.matrixAutoUpdate = false;
      if (twin === "real") {
        const solid = new THREE.MeshPhongMaterial({ vertexColors: true, shininess: 25, specular: 0x222222 });
        link.add(new THREE.Mesh(shape, solid));
      } else {
        // Depth first, so that only the ghost's nearest surface shows; pushed back so that it yields to the
        // solid where both coincide.
        const back = { transparent: true, polygonOffset: true, polygonOffsetFactor: 1.5, polygonOffsetUnits: 6 };
        const depth = new THREE.Mesh(shape, new THREE.MeshBasicMaterial({ ...back, colorWrite: false }));
        depth.renderOrder = 1;
        const skin = new THREE.Mesh(
          shape,
          new THREE.MeshPhongMaterial({ ...back, color: COLOURS.virtual, opacity: 0.42, depthWrite: false })
        );
        skin.renderOrder = 2;
        link.add(depth, skin);
      }
      group.add(link);
    }
    return group;
  }

  function trace(twin) {
    const THREE = MeshCat.THREE;
    const points = new Float32Array(3 * times.length);
    for (let k = 0; k < times.length; k++) {
      const q = Array.from(samples[twin].subarray(k * n, (k + 1) * n));
      points.set(links(q)[n].slice(12, 15), 3 * k);
    }
    const attribute = new THREE.BufferAttribute(points, 3);
    const make = () => new THREE.BufferGeometry().setAttribute("position", attribute);
    const color = COLOURS[twin];
    const whole = new THREE.Line(make(), new THREE.LineBasicMaterial({ color, transparent: true, opacity: 0.28 }));
    const recent = new THREE.Points(
      make(),
      new THREE.PointsMaterial({ color, size: 3.2 * Math.min(2, window.devicePixelRatio), sizeAttenuation: false })
    );
    whole.renderOrder = 3;
    whole.frustumCulled = false;
    recent.frustumCulled = false;
    const group = new THREE.Group();
    group.add(whole, recent);
    return { group, recent };
  }

  function makeScene(pane) {
    const THREE = MeshCat.THREE;
    const viewer = new MeshCat.Viewer(pane);
    viewer.gui.domElement.style.display = "none";
    // The bundle sizes itself by the window; the pane is what it has to fill.
    const resize = viewer.set_3d_pane_size.bind(viewer);
    viewer.set_3d_pane_size = () => resize(pane.clientWidth, pane.clientHeight);
    new ResizeObserver(() => viewer.set_3d_pane_size()).observe(pane);
    viewer.set_3d_pane_size();
    viewer.set_property(["Background"], "visible", false);
    viewer.set_property(["Axes"], "visible", false);

    function floor() {
      const [main, sub] = dark.matches ? [0x566070, 0x343c48] : [0x9aa5b4, 0xd3d9e1];
      const grid = new THREE.GridHelper(4, 20, main, sub);
      grid.rotateX(Math.PI / 2);
      grid.position.z = run.floor - 0.001;
      viewer.set_object(["Grid"], grid);
      viewer.set_dirty();
    }
    floor();
    dark.addEventListener("change", floor);

    const meshes = run.links.map(geometry);
    const twins = { virtual: body("virtual", meshes), real: body("real", meshes) };
    const traces = { virtual: trace("virtual"), real: trace("real") };
    for (const twin of ["real", "virtual"]) {
      viewer.set_object(["twins", twin], twins[twin]);
      viewer.set_object(["traces", twin], traces[twin].group);
    }

    // The camera lives in a y-up frame: scene (x, y, z) is (x, z, -y) there.
    function home() {
      const [low, high] = run.box;
      const middle = low.map((x, k) => (x + high[k]) / 2);
      const camera = viewer.camera;
      camera.fov = 32;
      const half = (camera.fov * Math.PI) / 360;
      const narrow = Math.min(1, pane.clientWidth / pane.clientHeight);
      const radius = 0.5 * Math.hypot(...low.map((x, k) => high[k] - x));
      const distance = (0.70 * radius) / Math.sin(Math.atan(Math.tan(half) * narrow));
      const azimuth = -0.30 * Math.PI;
      const elevation = 0.30;
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
    home();

    return {
      viewer,
      home,
      show(t, tReal) {
        for (const [twin, at] of [["virtual", t], ["real", tReal]]) {
          const poses = links(joints(twin, at));
          // Where nothing was measured, there's no robot.
          twins[twin].visible = poses[n].every(Number.isFinite);
          twins[twin].children.forEach((link, i) => {
            link.matrix.fromArray(poses[i]);
            link.matrixWorldNeedsUpdate = true;
          });
          const step = times[1] - times[0];
          const end = Math.min(times.length, Math.max(1, Math.floor(at / step) + 1));
          const start = Math.max(0, end - Math.round(TRAIL / step));
          traces[twin].recent.geometry.setDrawRange(start, end - start);
        }
        viewer.set_dirty();
      },
    };
  }

  let scene = null;
  if (run.links.length || n) {
    try {
      scene = makeScene(el("pane"));
    } catch (problem) {
      el("pane").replaceChildren();
      el("no-3d").hidden = false;
      el("no-3d").textContent = "No 3D view: this browser offers no WebGL. Plots and tables are below.";
    }
  }

  // Time: t runs from 0 to the duration; the read-out shows the run's own time.
  const slider = el("time");
  let t = 0;
  let playing = false;
  let before = null;

  slider.max = String(duration);
  slider.step = "any";

  function show() {
    const aligned = el("align").checked;
    slider.value = String(t);
    el("clock").textContent = (t + run.t_start).toFixed(2) + " s";
    slider.setAttribute("aria-valuetext", el("clock").textContent);
    if (scene) scene.show(t, aligned ? whenPlayed(t) : t);
    for (const cursor of document.querySelectorAll(".cursor")) {
      const { low, high, left, right } = cursor.dataset;
      const share = (t + run.t_start - low) / (high - low);
      cursor.style.left = 100 * (Number(left) + share * (right - left)) + "%";
      cursor.hidden = share < 0 || share > 1;
    }
    let now = null;
    for (const marker of run.markers) if (marker.t <= t + run.t_start + 1e-6) now = marker;
    el("now").textContent = now ? now.t.toFixed(2) + " s · " + now.text : "";
  }
  function play(on) {
    playing = on;
    before = null;
    el("play").textContent = on ? "Pause" : "Play";
    el("play").setAttribute("aria-pressed", String(on));
    if (on && t >= duration) t = 0;
    if (on) requestAnimationFrame(step);
  }
  function step(now) {
    if (!playing) return;
    if (before !== null) t = Math.min(duration, t + (Number(el("rate").value) * (now - before)) / 1000);
    before = now;
    show();
    if (t >= duration) play(false);
    else requestAnimationFrame(step);
  }
  function seek(to) {
    t = Math.min(duration, Math.max(0, to));
    show();
  }

  for (const marker of run.markers) {
    const mark = document.createElement("button");
    mark.type = "button";
    mark.className = "mark mark-" + (/^[a-z]+$/.test(marker.kind) ? marker.kind : "other");
    mark.title = marker.t.toFixed(2) + " s · " + marker.text;
    mark.setAttribute("aria-label", mark.title);
    mark.tabIndex = -1;
    const share = Math.min(1, Math.max(0, (marker.t - run.t_start) / duration));
    mark.style.left = "calc(9px + (100% - 18px) * " + share + ")";
    mark.addEventListener("click", () => seek(marker.t - run.t_start));
    el("marks").append(mark);
  }
  el("play").addEventListener("click", () => play(!playing));
  el("align").addEventListener("change", show);
  el("home").addEventListener("click", () => scene && scene.home());
  slider.addEventListener("input", () => {
    play(false);
    seek(Number(slider.value));
  });
  for (const cursor of document.querySelectorAll(".cursor"))
    cursor.parentElement.addEventListener("click", (event) => {
      const box = cursor.parentElement.getBoundingClientRect();
      const { low, high, left, right } = cursor.dataset;
      const share = ((event.clientX - box.left) / box.width - left) / (right - left);
      seek(Number(low) + share * (high - low) - run.t_start);
    });

  seek(0);
  window.report = { links, joints, whenPlayed, seek, play, scene, time: () => t + run.t_start };
})();
