// Dragging the tool: a handle at the virtual tool; where it's dropped, the tool goes.
import { html, useEffect, useRef } from "./ui.js";

/** The handle is taken within so many pixels. */
const REACH = 26;
/** The nearer the tool is, the slower it goes: speed by distance [1/s]. */
const GAIN = 3;
/** So near it has arrived [m], and so long it may take after it was dropped [s]. */
const THERE = 8e-4;
const PATIENCE = 12;

export function Panel({ station }) {
  const [handle, goal] = [useRef(null), useRef(null)];
  useEffect(() => follow(station, handle.current, goal.current), [station.scene]);
  return html`<div class="handle" id="handle" ref=${handle} aria-hidden="true" title="Drag the tool" hidden></div>
    <div class="goal" id="goal" ref=${goal} aria-hidden="true" hidden></div>`;
}

/** Let the handle be taken, and the tool follow it. */
function follow(station, handle, goal) {
  const { session, steer, chain, scene } = station;
  if (!scene) return;
  const { pane } = scene;
  const THREE = window.MeshCat.THREE;
  /** Where the tool is to go, in the base frame [m]; null while nothing is dragged. */
  let target = null;
  let droppedAt = null;
  let plane = null;
  let offset = null;

  /** The tool in the base frame [m], as the picture shows it. */
  const tool = () => (station.shown ? chain.toolAt(station.shown) : null);
  // The scene's z is up; the camera lives in a frame with y up: (x, y, z) is (x, z, −y) there.
  const seen = ([x, y, z]) => new THREE.Vector3(x, z, -y);
  const back = ({ x, y, z }) => [x, -z, y];

  function project(point) {
    const at = seen(point).project(scene.viewer.camera);
    return { x: ((at.x + 1) / 2) * scene.width, y: ((1 - at.y) / 2) * scene.height, behind: at.z > 1 };
  }

  /** Where the pointer's ray meets the plane through the tool that faces the camera. */
  function pointed(event) {
    const box = pane.getBoundingClientRect();
    const at = new THREE.Vector3(
      (2 * (event.clientX - box.left)) / box.width - 1,
      1 - (2 * (event.clientY - box.top)) / box.height,
      0.5,
    );
    const camera = scene.viewer.camera;
    const eye = camera.getWorldPosition(new THREE.Vector3());
    const ray = new THREE.Ray(eye, at.unproject(camera).sub(eye).normalize());
    return ray.intersectPlane(plane, new THREE.Vector3());
  }

  /** Towards the target, slower as it comes near. */
  function input() {
    const here = tool();
    if (target === null || here === null) return null;
    const way = target.map((x, k) => x - here[k]);
    const distance = Math.hypot(...way);
    const late = droppedAt !== null && performance.now() / 1000 - droppedAt > PATIENCE;
    if (late || (droppedAt !== null && distance < THERE)) return null;
    const fastest = station.jog.share * station.config.robot.tool_speed;
    const speed = Math.min(fastest, GAIN * distance);
    const scale = distance > 1e-9 ? speed / distance : 0;
    return { twist: [...way.map((x) => x * scale), 0, 0, 0], frame: "base" };
  }

  function end() {
    target = droppedAt = null;
    scene.viewer.controls.enabled = true;
    handle.classList.remove("held");
  }

  function take(event) {
    const here = tool();
    if (event.button !== 0 || !here || station.cursor !== null || !session.holds) return;
    const at = project(here);
    const box = pane.getBoundingClientRect();
    if (Math.hypot(event.clientX - box.left - at.x, event.clientY - box.top - at.y) > REACH) return;
    event.preventDefault();
    event.stopPropagation();
    scene.viewer.controls.enabled = false;
    const camera = scene.viewer.camera;
    plane = new THREE.Plane().setFromNormalAndCoplanarPoint(
      camera.getWorldDirection(new THREE.Vector3()),
      seen(here),
    );
    const met = pointed(event);
    offset = seen(here).sub(met);
    target = here;
    droppedAt = null;
    station.notices.use(handle);
    if (!steer.hold("drag", input, end)) return;
    handle.classList.add("held");
    pane.setPointerCapture(event.pointerId);
  }

  function move(event) {
    if (target === null || droppedAt !== null) return;
    const met = pointed(event);
    if (met) target = back(met.add(offset));
  }

  function drop() {
    if (target === null || droppedAt !== null) return;
    droppedAt = performance.now() / 1000;
    scene.viewer.controls.enabled = true;
    handle.classList.remove("held");
  }

  pane.addEventListener("pointerdown", take, { capture: true });
  pane.addEventListener("pointermove", move, { capture: true });
  for (const type of ["pointerup", "pointercancel", "lostpointercapture"]) pane.addEventListener(type, drop);

  /** The handle stands at the tool, and the mark where it's to go, in every frame of the picture. */
  function place() {
    const here = tool();
    const shown = here !== null && session.holds && session.link === "live" && station.cursor === null;
    put(handle, shown ? project(here) : null);
    put(goal, shown && target !== null ? project(target) : null);
    requestAnimationFrame(place);
  }

  function put(element, at) {
    const hidden = at === null || at.behind;
    if (element.hidden !== hidden) element.hidden = hidden;
    if (!hidden) element.style.transform = `translate(${at.x.toFixed(1)}px, ${at.y.toFixed(1)}px)`;
  }

  /** For tests: where the tool is to go, where it is, and where that is in the picture. */
  station.drag = { get target() { return target; }, tool, project };
  place();
}
