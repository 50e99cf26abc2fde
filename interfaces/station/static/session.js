// The page's connection to the server: greeted, followed, kept alive, and made again by itself.
import { ClockSync, Reader } from "./vrs.js";
import { decode, LEASED } from "./protocol.js";
import { Orders } from "./orders.js";
import { observed } from "./ui.js";
import { Wire } from "./wire.js";

/** Silence after which what is shown is stale, and after which the connection counts as lost [s]. */
const STALE = 0.6;
const LOST = 1.4;
/** Time between two looks at all that [ms]; where one comes later than this, the page itself was held up [s]. */
const LOOK = 100;
const HELD_UP = 0.4;
const LONGEST_WAIT = 1500;
const PINGS = 10;
/** A relay that can't be reached so often is left for another one. */
const MOST_TRIES = 1;
const KEY = "vrs-session";
/** Tokens are longer than a class's codes. */
const SHORTEST_TOKEN = 20;
/** A token opens its own role and those below it. */
const ROLES = ["admin", "operator", "viewer"];

const seconds = () => performance.now() / 1000;

/**
 * What is known of the server, as fields that components follow by reading them; and events: "link" (how the connection is), "welcome", "lease", "state" (the real robot), "edit" (of the timeline),
 * "network" (the way to the robot), "rerouted" (that it has changed), "order" and "outcome" (of commands), "wish" (a request), "problem" (what couldn't be done), "locked" (a token is asked for).
 */
export class Session extends EventTarget {
  /** @param {{name: string, token: ?string, relays: string}} who and where the robot is served, for a relay's page */
  constructor({ name, token, relays }) {
    super();
    this.token = token;
    this.relays = relays;
    /** Pages of the other relays. */
    this.others = [];
    /** Type of the message that lets this page in. */
    this.welcomes = "welcome";
    observed(this, {
      name,
      /** "connecting", "live", "stale", "lost" or "locked". */
      link: "connecting",
      welcome: null,
      lease: { state: "free" },
      /** The real robot; null before it was told. */
      state: null,
      /** How the way to the robot is; null before that was asked. */
      network: null,
      epoch: null,
      /** Of a class: who is here; null before that was asked. */
      present: null,
    });
    this.sync = new ClockSync();
    this.reader = null;
    this.orders = new Orders((message) => this.send(message));
    /** Whether a token was just given at the door, and nobody has been let in by it yet. */
    this.entered = false;
    this.roles = this.wanted(token);
    this.requests = 0;
    this.pings = 0;
    this.tries = 0;
    this.heard = seconds();
    this.looked = this.heard;
    this.wire = new Wire({
      open: () => this.greet(),
      message: (text) => this.hear(text),
      close: () => this.lose(),
    });
    this.key = sessionStorage.getItem(KEY);
    // A tab that is duplicated must not go on with the session of the first.
    sessionStorage.removeItem(KEY);
    window.addEventListener("pagehide", () => this.key && sessionStorage.setItem(KEY, this.key));
    setInterval(() => this.look(), LOOK);
    this.connect();
  }

  /** Session time [s]; null before the clocks are compared. */
  get now() {
    return this.sync.time(seconds());
  }

  /** The copy of the timeline; null until it's whole. */
  get timeline() {
    return this.reader?.timeline ?? null;
  }

  /** Up to this time [s] what is shown has happened. */
  get past() {
    return this.reader ? this.reader.past : -Infinity;
  }

  get holds() {
    return Boolean(this.lease.yours && this.epoch);
  }

  get mayCommand() {
    return this.welcome !== null && this.welcome.role !== "viewer";
  }

  /** Let a token count from now on; null for none. */
  unlock(token) {
    this.token = token;
    this.entered = true;
    this.roles = this.wanted(token);
    this.become("connecting");
    this.connect();
  }

  /** Roles to ask for, one after the other: at a relay one watches. */
  wanted(token) {
    return this.relays ? ["viewer"] : token ? [...ROLES] : ["operator", "viewer"];
  }

  connect() {
    clearTimeout(this.again);
    const scheme = location.protocol === "https:" ? "wss://" : "ws://";
    this.heard = seconds();
    this.greeted = false;
    this.connected = true;
    this.wire.connect(scheme + location.host + window.VrsLink.FOLDER + "/ws");
  }

  greet() {
    this.heard = seconds();
    const hello = { type: "hello", protocol: 1, role: this.roles[0], name: this.name };
    if (this.token) hello.token = this.token;
    if (this.key) hello.session = this.key;
    this.wire.send(hello);
  }

  /** The connection is gone: try again, later each time. */
  lose() {
    this.connected = this.greeted = false;
    this.wire.close();
    if (this.link === "locked") return;
    if (this.refused) {
      this.refused = false;
      this.roles.shift();
      if (this.roles.length === 0) {
        this.become("locked");
        return;
      }
      this.connect();
      return;
    }
    this.become("lost");
    // A relay that's gone: the page of another one has the same. Who is merely told that the robot's server is gone stays.
    if (this.tries >= MOST_TRIES && this.others.length && !this.unheard) {
      location.replace(this.others[Math.floor(Math.random() * this.others.length)]);
      return;
    }
    this.again = setTimeout(() => this.connect(), Math.min(LONGEST_WAIT, 200 * 2 ** this.tries++));
  }

  become(link) {
    if (link === this.link) return;
    this.link = link;
    this.emit("link", link);
  }

  emit(type, detail) {
    this.dispatchEvent(new CustomEvent(type, { detail }));
  }

  /** Send a message; whether there's a connection. */
  send(message) {
    const open = this.greeted && this.wire.isOpen;
    if (open) this.wire.send(message);
    return open;
  }

  /** Take a frame; what can't be taken is passed over. */
  hear(text) {
    this.heard = seconds();
    const message = decode(text);
    if (message) this.take(message);
  }

  take(message) {
    const now = seconds();
    if (message.type === "problem") this.object(message);
    else if (message.type === this.welcomes) this.begin(message, now);
    else if (message.type === "lease") this.setLease(message);
    else if (message.type === "pong") this.sync.receive(message.t, message.received, message.answered, now);
    else if (message.type === "state") {
      this.state = message;
      this.emit("state", message);
    } else if (message.type === "network") {
      const before = this.network;
      this.network = message;
      this.emit("network", message);
      if (before && message.changed_at !== before.changed_at) this.emit("rerouted", message);
    } else if (message.type === "present") {
      this.present = message;
    } else if (message.type === "relays") {
      this.others = message.pages;
    } else if (message.type === "outcome") {
      const entry = this.orders.answer(message);
      if (entry) this.emit("outcome", entry);
    } else if (this.reader) this.read(message, now);
  }

  read(message, now) {
    const before = this.timeline;
    this.reader.receive(message, now);
    if (this.timeline !== before) {
      const change = message.type === "change" ? message : null;
      this.emit("edit", { before, after: this.timeline, change });
    }
    if (message.type === "pulse" && this.timeline) this.become("live");
  }

  begin(welcome, now) {
    const again = this.welcome !== null;
    if (again && this.welcome.instance !== welcome.instance) {
      // Another server may have another robot, and other files.
      this.wire.close();
      location.reload();
      return;
    }
    this.greeted = true;
    this.tries = 0;
    this.unheard = false;
    this.welcome = welcome;
    this.key = welcome.session;
    this.roles = [welcome.role];
    // A code counts once, and for this door alone: from now on the session's secret is the token.
    if (this.token && this.token.length < SHORTEST_TOKEN) this.token = welcome.session;
    if (this.token) sessionStorage.setItem("token", this.token);
    if (this.entered) this.emit("unlocked");
    this.entered = false;
    this.orders.renew(welcome.resumed, now);
    if (!again) this.reader = this.makeReader();
    else if (this.reader) this.reader.number += 1;
    for (let k = 0; k < PINGS; k++) this.ping();
    this.emit("welcome", welcome);
    this.setLease(welcome.lease);
    if (welcome.lease.member) this.wish("who");
    this.reader?.follow(now);
  }

  /** What keeps a copy of the timeline; null for a robot of which nothing is followed. */
  makeReader() {
    return new Reader((message) => this.send(message));
  }

  setLease(lease) {
    this.lease = lease;
    this.epoch = lease.yours ? lease.epoch : null;
    this.beat();
    this.emit("lease", lease);
  }

  /** A message that the server couldn't take. */
  object(problem) {
    if (!this.greeted && problem.code === "refused") {
      this.refused = true;
      return;
    }
    if (problem.fatal) this.key = null;
    this.unheard = problem.code === "unheard";
    this.emit("problem", problem);
  }

  ping() {
    this.send({ type: "ping", number: ++this.pings, t: seconds() });
  }

  /** What keeps the lease. */
  beat() {
    this.wire.beat(this.holds && this.greeted ? { type: "beat", epoch: this.epoch } : null);
  }

  look() {
    const now = seconds();
    const late = now - this.looked;
    this.looked = now;
    this.beat();
    // What has come meanwhile waits behind this look: nothing is known of the server yet.
    if (late > HELD_UP) return;
    const silent = now - this.heard;
    if (this.connected && silent > LOST) this.lose();
    else if (this.link === "live" && silent > STALE) this.become("stale");
    if (!this.greeted) return;
    this.reader?.advance(now);
    this.orders.advance(now);
    if (Math.floor(now) !== Math.floor(now - late)) this.ping();
  }

  /** Give a command, null to take back the newest; a label says for people where it goes. Null where it isn't sent. */
  order(command, label = "") {
    const why = !this.holds ? "You don't have control" : this.link === "live" ? "" : "There's no connection";
    if (why && !(this.holds && command?.type === "stop")) {
      this.emit("problem", { code: "lease", text: why + ": nothing was sent." });
      return null;
    }
    const entry = this.orders.give(command, this.epoch, seconds(), label);
    this.emit("order", entry);
    return entry;
  }

  /** Ask the server by HTTP, by its address below the page's. */
  fetch(path, given) {
    return fetch(window.VrsLink.FOLDER + path, { headers: this.token ? { Authorization: "Bearer " + this.token } : {}, ...given });
  }

  /** The same of what answers in JSON: where it doesn't do it, the answer's `problem` says why. */
  async ask(path, given) {
    try {
      return await (await this.fetch(path, given)).json();
    } catch {
      return { problem: "the server doesn't answer: nothing was done" };
    }
  }

  /** Ask something of the lease, or of the way to the robot; the request's number, 0 where it couldn't be sent. */
  wish(type, fields = {}) {
    const message = { type, number: ++this.requests, ...fields };
    if (LEASED.has(type)) message.epoch = this.epoch ?? "1";
    const sent = this.send(message);
    if (sent) this.emit("wish", message);
    else if (type !== "survey") this.emit("problem", { code: "lease", text: "There's no connection: nothing was asked." });
    return sent ? message.number : 0;
  }
}
