// Single pictures of the robot's camera, one a second, where RTP isn't to be had.

const PERIOD = 1000;

export class Stills {
  /**
   * @param {HTMLImageElement} image where they're shown
   * @param {object} session knows the token
   * @param {function(): string} view says what's to be seen
   */
  constructor(image, session, view) {
    this.image = image;
    this.session = session;
    this.view = view;
    this.wanted = false;
    /** Pictures that were shown. */
    this.frames = 0;
    this.rate = 0;
  }

  /** Show them, or don't. */
  want(wanted) {
    const begins = wanted && !this.wanted;
    this.wanted = wanted;
    if (!wanted) this.rate = 0;
    if (begins && !this.busy) this.run();
  }

  async run() {
    this.busy = true;
    while (this.wanted) {
      const due = performance.now() + PERIOD;
      await this.fetch().catch(() => {});
      await new Promise((resolve) => setTimeout(resolve, Math.max(0, due - performance.now())));
    }
    this.busy = false;
  }

  async fetch() {
    const answer = await this.session.fetch(`/media/still?view=${this.view()}`);
    this.rate = answer.ok ? 1000 / PERIOD : 0;
    if (!answer.ok) return;
    const before = this.image.src;
    this.image.src = URL.createObjectURL(await answer.blob());
    await this.image.decode();
    if (before) URL.revokeObjectURL(before);
    this.frames += 1;
  }
}
