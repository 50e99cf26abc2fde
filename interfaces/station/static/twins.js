// The scene with this page's colours, and with robots that the page may place by itself, to show another time.

import { keep, placeAfter } from "./history.js";
import { Pacing } from "./pacing.js";

const ROOT = window.VrsScene.ROOT;

export class StationScene extends window.VrsScene {
  /** @param {() => ?number} now session time [s]; null before it's known */
  constructor(pane, labels, now) {
    super(pane, labels);
    /** What the server says of the robots while another time is shown, to go on with; null while now is. */
    this.kept = null;
    /** What it has said of the virtual hand and of what that has taken along: {t, command} by time, for each part. */
    this.virtualHand = new Map();
    const handle = this.viewer.handle_command.bind(this.viewer);
    this.viewer.handle_command = (command) => {
      if (isVirtualHand(command)) this.note(command, now() ?? -Infinity);
      const concerns = this.kept !== null && placed(command);
      if (concerns) this.kept.set(keyOf(command), command);
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
    for (const path of this.handled()) {
      const { object } = this.viewer.scene_tree.find(path);
      object.updateMatrix();
      const name = "/" + path.join("/");
      this.kept.set(name + " ", { type: "set_transform", path: name, matrix: object.matrix.toArray() });
    }
    for (const [key, rows] of this.virtualHand) this.kept.set(key, rows.at(-1).command);
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

  /** Take what the server says at a time [s] of the virtual hand. */
  note(command, t) {
    const key = keyOf(command);
    if (!this.virtualHand.has(key)) this.virtualHand.set(key, []);
    keep(this.virtualHand.get(key), { t, command });
  }

  /** Paths of the real hand's parts, and of the things. */
  handled() {
    const below = (...path) => {
      let node = this.viewer.scene_tree;
      for (const name of path) node = node?.children[name];
      return Object.keys(node?.children ?? {}).filter((name) => /^\d+$/.test(name)).map((name) => [...path, name]);
    };
    const links = below(ROOT, "real", "body");
    return [...links.flatMap((path) => below(...path, "hand")), ...below(ROOT, "things")];
  }

  /**
   * Show both hands and the things as they were.
   * @param {number} t [s]
   * @param {{opening: number, things: Map<number, number[]>} | null} was of the real hand; null leaves it, and things
   * @param {{link: number, aside: number} | null} hand where the fingers are
   */
  grasp(t, was, hand) {
    // Before the first of all it's as it was known first.
    for (const rows of this.virtualHand.values()) this.handle(rows[Math.max(placeAfter(t, rows) - 1, 0)].command);
    this.viewer.set_dirty();
    if (!was || !hand) return;
    for (const [finger, side] of [["1", 1], ["2", -1]]) {
      const node = this.viewer.scene_tree.find([ROOT, "real", "body", String(hand.link), "hand", finger]);
      node.object.updateMatrix();
      const matrix = node.object.matrix.toArray();
      matrix[12] = side * (was.opening / 2 + hand.aside);
      node.set_transform(matrix);
    }
    for (const [k, pose] of was.things) this.viewer.scene_tree.find([ROOT, "things", String(k)]).set_transform(matrixOf(pose));
  }

  /** Show a robot with its links at poses; null hides it. */
  pose(twin, poses) {
    this.node(ROOT, twin).visible = poses !== null;
    const body = this.viewer.scene_tree.find([ROOT, twin, "body"]);
    poses?.forEach((X, k) => body.find([String(k)]).set_transform(X));
    this.viewer.set_dirty();
  }
}

/** A pose of x, y, z and a quaternion x, y, z, w as a matrix, by columns. */
function matrixOf([x, y, z, i, j, k, w]) {
  return [
    1 - 2 * (j * j + k * k), 2 * (i * j + w * k), 2 * (i * k - w * j), 0,
    2 * (i * j - w * k), 1 - 2 * (i * i + k * k), 2 * (j * k + w * i), 0,
    2 * (i * k + w * j), 2 * (j * k - w * i), 1 - 2 * (i * i + j * j), 0, x, y, z, 1,
  ];
}

const keyOf = ({ path, property }) => path + " " + (property ?? "");

/** Whether a command moves a part of the virtual hand, or moves, shows or hides what that has taken along. */
function isVirtualHand({ type, path }) {
  const parts = path.split("/").filter(Boolean);
  const part = (parts[1] === "virtual" && parts[4] === "hand" && parts.length === 6) || parts[1] === "predicted";
  return parts[0] === ROOT && part && (type === "set_transform" || type === "set_property");
}

/** Whether a command places a robot, its hand or a thing, or shows or hides one or its path. */
function placed({ type, path, property }) {
  const parts = path.split("/").filter(Boolean);
  if (parts[0] !== ROOT) return false;
  if (type === "set_transform") {
    const link = parts.length === 4 && parts[2] === "body";
    return link || parts[4] === "hand" || parts[1] === "things" || parts[1] === "predicted";
  }
  return type === "set_property" && property === "visible" && (parts.length === 2 || parts[1] === "predicted");
}
