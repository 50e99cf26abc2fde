// A floor plan as a drawing in metres, y upwards; a click, or a drag for a heading, gives a goal.
const SVG = "http://www.w3.org/2000/svg";
/** A drag that's shorter is a click [m]. */
const DRAG = 0.15;
/** An ellipse is drawn so many standard deviations wide, and never smaller than this [m]. */
const SIGMAS = 2;
const LEAST = 0.02;
const MARGIN = 0.15;
/** For the axes' numbers [m], and what lies between two of them: the first of which there are few enough [m]. */
const AXIS = 0.5;
const TICKS = [1, 2, 5, 10, 20, 50, 100];
const MOST_TICKS = 12;
/** Length of a heading's arrow [m]. */
const ARROW = 0.55;

function s(tag, props = {}) {
  const element = document.createElementNS(SVG, tag);
  for (const [key, value] of Object.entries(props)) element.setAttribute(key, value);
  return element;
}

const path = (points) => points.map(([x, y], k) => `${k ? "L" : "M"}${x.toFixed(3)} ${y.toFixed(3)}`).join("");

export class FloorPlan {
  /**
   * @param {Function} chosen is given a goal
   * @param {Function} pointed is given where the pointer is [m], null where it's away
   */
  constructor(chosen, pointed) {
    this.element = s("svg", { class: "plan", id: "map", role: "img", "aria-label": "Map of the known walls, the robots and the route" });
    this.world = s("g");
    const layer = (tag, name, props = {}) => {
      const element = s(tag, { class: name, ...props });
      this.world.append(element);
      return element;
    };
    this.floor = layer("rect", "plan-floor", { x: 0, y: 0 });
    this.grid = layer("path", "plan-grid");
    this.things = layer("path", "plan-things");
    this.vias = layer("g", "plan-vias");
    this.line = layer("path", "plan-route");
    this.points = layer("path", "plan-seen");
    this.named = layer("g", "plan-places");
    this.doubt = layer("ellipse", "plan-doubt");
    this.virtual = layer("path", "plan-virtual");
    this.real = layer("path", "plan-real");
    this.goal = layer("path", "plan-goal");
    this.axes = s("g", { class: "plan-axes" });
    this.element.append(this.world, this.axes);
    this.known = null;
    this.lastSeen = null;
    this.begun = null;
    this.#listen(chosen);
    this.element.addEventListener("pointermove", (event) => this.known && pointed(this.#at(event)));
    this.element.addEventListener("pointerleave", () => pointed(null));
  }

  /** Show the known map. */
  plan(plan) {
    if (plan === this.known) return;
    this.known = plan;
    const [length, width] = plan.size;
    this.element.setAttribute("viewBox", `${-AXIS} ${-MARGIN} ${length + AXIS + MARGIN} ${width + AXIS + MARGIN}`);
    this.#rule(length, width);
    this.world.setAttribute("transform", `matrix(1 0 0 -1 0 ${width})`);
    this.floor.setAttribute("width", length);
    this.floor.setAttribute("height", width);
    this.things.setAttribute("d", plan.things.map((ring) => path(ring) + "Z").join(""));
    this.vias.replaceChildren(...plan.via.map(([x, y]) => s("circle", { cx: x, cy: y, r: 0.05 })));
  }

  /** A grid, with its metres at the edges. */
  #rule(length, width) {
    const step = TICKS.find((one) => Math.max(length, width) / one <= MOST_TICKS) ?? TICKS.at(-1);
    const marks = (most) => Array.from({ length: Math.floor(most / step + 1e-9) + 1 }, (_, k) => k * step);
    const text = (words, props) => {
      const element = s("text", props);
      element.textContent = words;
      return element;
    };
    this.grid.setAttribute("d", marks(length).map((x) => `M${x} 0V${width}`).join("") + marks(width).map((y) => `M0 ${y}H${length}`).join(""));
    this.axes.replaceChildren(
      ...marks(length).map((x) => text(x ? String(x) : "0 m", { x, y: width + 0.36, "text-anchor": "middle" })),
      ...marks(width).slice(1).map((y) => text(String(y), { x: -0.1, y: width - y + 0.09, "text-anchor": "end" })),
      text("x", { x: length - 0.5 * step, y: width + 0.36, "text-anchor": "middle", class: "axis" }),
      text("y", { x: -0.1, y: 0.09 + width - (Math.floor(width / step) - 0.5) * step, "text-anchor": "end", class: "axis" }));
  }

  /** Show where both robots are; the real one only where that's known. */
  robots(virtual, real) {
    this.virtual.setAttribute("d", this.#outline(virtual));
    this.real.setAttribute("d", real ? this.#outline(real) : "");
  }

  #outline([x, y, turn]) {
    const [front, rear, width] = this.known?.robot ?? [0, 0, 0];
    const half = width / 2;
    const c = Math.cos(turn);
    const w = Math.sin(turn);
    const at = (a, b) => [x + c * a - w * b, y + w * a + c * b];
    const nose = [at(front - 0.14, half * 0.55), at(front - 0.02, 0), at(front - 0.14, -half * 0.55)];
    return path([at(front, half), at(-rear, half), at(-rear, -half), at(front, -half)]) + "Z" + path(nose);
  }

  /** Show what the laser saw, and how sure the robot is of its place. */
  seen(seen, real) {
    if (seen !== this.lastSeen) {
      this.lastSeen = seen;
      this.points.setAttribute("d", seen.points.map(([x, y]) => `M${x} ${y}h0`).join(""));
    }
    this.doubt.style.display = seen.doubt && real ? "" : "none";
    if (!seen.doubt || !real) return;
    const [xx, xy, yy] = seen.doubt;
    const mean = (xx + yy) / 2;
    const off = Math.hypot((xx - yy) / 2, xy);
    const turn = (0.5 * Math.atan2(2 * xy, xx - yy) * 180) / Math.PI;
    const radius = (variance) => Math.max(LEAST, SIGMAS * Math.sqrt(Math.max(0, variance)));
    this.doubt.setAttribute("rx", radius(mean + off));
    this.doubt.setAttribute("ry", radius(mean - off));
    this.doubt.setAttribute("transform", `translate(${real[0]} ${real[1]}) rotate(${turn})`);
  }

  /** Show the way that's being driven, and where to. */
  route(points, goal) {
    this.line.setAttribute("d", path(points));
    this.sent = goal;
    if (!this.begun) this.#aim(goal);
  }

  /** Show places with their names. */
  places(all) {
    this.named.replaceChildren(...Object.entries(all).flatMap(([name, { x, y }]) => {
      const text = s("text", { transform: `matrix(1 0 0 -1 ${x + 0.1} ${y + 0.08})` });
      text.textContent = name;
      return [s("rect", { x: x - 0.06, y: y - 0.06, width: 0.12, height: 0.12 }), text];
    }));
  }

  #aim(goal) {
    if (!goal) {
      this.goal.setAttribute("d", "");
      return;
    }
    const { x, y, heading } = goal;
    let d = `M${x - 0.12} ${y - 0.12}L${x + 0.12} ${y + 0.12}M${x - 0.12} ${y + 0.12}L${x + 0.12} ${y - 0.12}`;
    if (heading != null) {
      const tip = (turn, far) => [x + far * Math.cos(heading + turn), y + far * Math.sin(heading + turn)];
      d += path([[x, y], tip(0, ARROW)]) + path([tip(0.3, ARROW - 0.14), tip(0, ARROW), tip(-0.3, ARROW - 0.14)]);
    }
    this.goal.setAttribute("d", d);
  }

  /** Where a pointer is [m]. */
  #at(event) {
    const at = new DOMPoint(event.clientX, event.clientY).matrixTransform(this.world.getScreenCTM().inverse());
    return [at.x, at.y];
  }

  #listen(chosen) {
    const goal = (event) => {
      const [x, y] = this.begun;
      const [u, v] = this.#at(event);
      const round = (value) => Math.round(value * 1000) / 1000;
      const place = { x: round(x), y: round(y) };
      return Math.hypot(u - x, v - y) < DRAG ? place : { ...place, heading: round(Math.atan2(v - y, u - x)) };
    };
    const leave = () => {
      this.begun = null;
      this.#aim(this.sent ?? null);
    };
    this.element.addEventListener("pointerdown", (event) => {
      if (event.button !== 0 || !this.known) return;
      this.element.setPointerCapture(event.pointerId);
      this.begun = this.#at(event);
      this.#aim(goal(event));
    });
    this.element.addEventListener("pointermove", (event) => this.begun && this.#aim(goal(event)));
    this.element.addEventListener("pointerup", (event) => {
      if (!this.begun) return;
      const found = goal(event);
      leave();
      chosen(found);
    });
    this.element.addEventListener("pointercancel", leave);
    window.addEventListener("keydown", (event) => event.key === "Escape" && this.begun && leave());
  }
}
