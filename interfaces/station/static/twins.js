// The scene with this page's colours, and with robots that the page may place by itself, to show another time.

import { Pacing } from "./pacing.js";

const ROOT = window.VrsScene.ROOT;

export class StationScene extends window.VrsScene {
  constructor(...given) {
    super(...given);
    /** What the server says of the robots while another time is shown, to go on with; null while now is. */
    this.kept = null;
    const handle = this.viewer.handle_command.bind(this.viewer);
    this.viewer.handle_command = (command) => {
      const concerns = this.kept !== null && placed(command);
      if (concerns) this.kept.set(command.path + " " + (command.property ?? ""), command);
      else handle(command);
    };
    this.handle = handle;
    this.pacing = new Pacing(this.viewer, window.VrsScene.software);
  }

  /** How much further away than on the page of the view alone the camera stands: the arm stretched up fits too. */
  get further() {
    return 1.2;
  }

  /** As the page of the view alone, from a little further away. */
  home() {
    super.home();
    const { camera, controls } = this.viewer;
    camera.position.sub(controls.target).multiplyScalar(this.further).add(controls.target);
    controls.update();
  }

  /** Light or dark. */
  paint(dark) {
    this.dark = { matches: dark };
    this.drawGrid();
  }

  /** Show another time from now on: `pose` places the robots. */
  leave() {
    if (this.kept !== null) return;
    this.kept = new Map();
    for (const twin of ["virtual", "real"]) {
      const body = this.viewer.scene_tree.find([ROOT, twin, "body"]);
      for (const [name, { object }] of Object.entries(body.children)) {
        object.updateMatrix();
        const path = `/${ROOT}/${twin}/body/${name}`;
        this.kept.set(path + " ", { type: "set_transform", path, matrix: object.matrix.toArray() });
      }
    }
    for (const part of ["real", "committed"]) {
      const path = `/${ROOT}/${part}`;
      const value = this.node(ROOT, part).visible;
      this.kept.set(path + " visible", { type: "set_property", path, property: "visible", value });
    }
    this.node(ROOT, "committed").visible = false;
  }

  /** Show what is now. */
  resume() {
    if (this.kept === null) return;
    const kept = this.kept;
    this.kept = null;
    for (const command of kept.values()) this.handle(command);
    this.applyToggles();
    this.viewer.set_dirty();
  }

  /** Show a robot with its links at poses; null hides it. */
  pose(twin, poses) {
    this.node(ROOT, twin).visible = poses !== null;
    const body = this.viewer.scene_tree.find([ROOT, twin, "body"]);
    poses?.forEach((X, k) => body.find([String(k)]).set_transform(X));
    this.viewer.set_dirty();
  }
}

/** Whether a command places a robot, or shows or hides one or its path. */
function placed({ type, path, property }) {
  const parts = path.split("/").filter(Boolean);
  if (parts[0] !== ROOT) return false;
  if (type === "set_transform") return parts.length === 4 && parts[2] === "body";
  return type === "set_property" && property === "visible" && parts.length === 2;
}
