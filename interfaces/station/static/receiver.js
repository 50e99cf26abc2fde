// Picture and sound from the server by RTP: one peer connection, made again when it breaks.

/** How long addresses are looked for, and a connection may take [ms]. */
const GATHER = 1500;
const PATIENCE = 12000;
/** Failures in a row after which it's given up. */
const TRIES = 2;
/** Over so long pictures are counted [ms]. */
const COUNTED = 2000;

export class Receiver {
  /**
   * @param {HTMLVideoElement} video where it's shown
   * @param {Function} send takes a message to the server
   * @param {Function} giveUp is told why, when it can't be had
   */
  constructor(video, send, giveUp) {
    this.video = video;
    this.send = send;
    this.giveUp = giveUp;
    this.peer = null;
    this.wanted = false;
    /** Whether an offer waits for its answer. */
    this.waits = false;
    this.failures = 0;
    /** Pictures that were decoded and shown. */
    this.frames = 0;
    this.times = [];
    if (video.requestVideoFrameCallback) {
      const count = (now) => {
        this.count(now);
        video.requestVideoFrameCallback(count);
      };
      video.requestVideoFrameCallback(count);
    }
  }

  count(now) {
    this.frames += 1;
    this.times.push(now);
    while (this.times[0] < now - COUNTED) this.times.shift();
  }

  /** Pictures a second, of late. */
  get rate() {
    const since = performance.now() - COUNTED;
    return this.times.filter((time) => time > since).length / (COUNTED / 1000);
  }

  /** Have it, or not. */
  want(wanted) {
    if (wanted === this.wanted) return;
    this.wanted = wanted;
    if (wanted) this.start();
    else {
      this.stop();
      this.send({ do: "leave" });
    }
  }

  async start() {
    const peer = (this.peer = new RTCPeerConnection({ iceServers: [] }));
    const stream = new MediaStream();
    this.video.srcObject = stream;
    for (const kind of ["video", "audio"]) peer.addTransceiver(kind, { direction: "recvonly" });
    peer.ontrack = (event) => stream.addTrack(event.track);
    peer.onconnectionstatechange = () => {
      if (peer !== this.peer) return;
      if (peer.connectionState === "connected") this.failures = 0;
      if (peer.connectionState === "failed") this.fail("The connection for picture and sound failed.");
    };
    await peer.setLocalDescription();
    await gathered(peer);
    if (peer !== this.peer) return;
    this.waits = this.send({ do: "watch", offer: peer.localDescription.sdp });
    setTimeout(() => {
      if (peer === this.peer && peer.connectionState !== "connected") this.fail("Picture and sound don't get through.");
    }, PATIENCE);
  }

  async answer(sdp) {
    this.waits = false;
    const peer = this.peer;
    if (!peer || peer.signalingState !== "have-local-offer") return;
    await peer.setRemoteDescription({ type: "answer", sdp });
    // Muted it may play without being asked to.
    this.video.play().catch(() => {});
  }

  /** It didn't work: it may be wanted once more, then it's given up. */
  fail(why) {
    this.stop();
    this.failures += 1;
    if (this.failures >= TRIES) this.giveUp(why);
  }

  stop() {
    this.waits = false;
    this.wanted = false;
    this.times = [];
    if (!this.peer) return;
    const peer = this.peer;
    this.peer = null;
    peer.close();
    this.video.srcObject = null;
  }
}

/** Wait until a peer knows its addresses, but not for long. */
function gathered(peer) {
  return new Promise((resolve) => {
    const look = () => peer.iceGatheringState === "complete" && resolve();
    peer.addEventListener("icegatheringstatechange", look);
    setTimeout(resolve, GATHER);
    look();
  });
}
