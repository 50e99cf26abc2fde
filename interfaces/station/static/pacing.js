// How finely and how often the 3D view is drawn: a machine that draws slowly still has time for everything else.

/** Pixels of the drawing for one of the page, the finest first. */
const RATIOS = [1, 0.75, 0.5, 0.35];
/** Of them, where there's no graphics card: there a change holds the page up longer than any frame. */
const SOFTWARE_LEVEL = 1;
/** A frame that takes longer than this is slow, and so many of them in a row are too slow [ms]. */
const SLOW = 70;
const TOO_MANY = 3;
/** So many quick frames in a row, and it may be finer again [ms]. */
const QUICK = 12;
const MANY = 60;
/** Of the time, drawing takes at most this share where it's slow. */
const SHARE = 0.5;

export class Pacing {
  /**
   * @param {object} viewer MeshCat's; its `render` is replaced
   * @param {boolean} software whether it's drawn without a graphics card
   */
  constructor(viewer, software) {
    this.viewer = viewer;
    this.adapts = !software;
    this.level = 0;
    this.slow = 0;
    this.quick = 0;
    this.cost = 0;
    this.drawnAt = -Infinity;
    const draw = viewer.render.bind(viewer);
    viewer.render = () => this.pass(draw);
    this.set(software ? SOFTWARE_LEVEL : 0);
  }

  set(level) {
    this.level = level;
    this.viewer.renderer.setPixelRatio(RATIOS[level] * Math.min(window.devicePixelRatio || 1, 2));
  }

  pass(draw) {
    const begun = performance.now();
    // What isn't drawn now stays to be drawn.
    if (this.cost > SLOW && begun - this.drawnAt < this.cost / SHARE) return;
    this.drawnAt = begun;
    draw();
    requestAnimationFrame(() => this.measure(performance.now() - begun));
  }

  measure(cost) {
    this.cost = cost;
    if (!this.adapts) return;
    this.slow = cost > SLOW ? this.slow + 1 : 0;
    this.quick = cost < QUICK ? this.quick + 1 : 0;
    if (this.slow >= TOO_MANY && this.level < RATIOS.length - 1) this.change(1);
    else if (this.quick >= MANY && this.level > 0) this.change(-1);
  }

  change(way) {
    this.slow = this.quick = 0;
    this.set(this.level + way);
    this.viewer.set_dirty();
  }
}
