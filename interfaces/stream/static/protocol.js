// Generated from the definitions of messages by `make generate`: don't edit.
// What may come into a page (docs/protocol.md), and what checks it there: a function a message, a line a field.

/** The ends of whole numbers and of real ones: JSON has no infinity. */
const WHOLE = 2 ** 63;
const REAL = Number.MAX_VALUE;

/** A message that can't be taken. */
class Misfit extends Error {}

function fail(where, wanted) {
  throw new Misfit(`${where} isn't ${wanted}`);
}

// Each looks at what stands in a place, and gives it back.

function whole(x, low, high, where) {
  if (!Number.isInteger(x) || x < low || x > high) fail(where, `a whole number from ${low} to ${high}`);
  return x;
}

function real(x, low, high, where) {
  if (typeof x !== "number" || !(x >= low && x <= high)) fail(where, `a number from ${low} to ${high}`);
  return x;
}

function text(x, least, most, where) {
  if (typeof x !== "string" || x.length < least || (x.length > most && [...x].length > most))
    fail(where, `a text of ${least} to ${most} characters`);
  return x;
}

function like(x, pattern, where) {
  return typeof x === "string" && pattern.test(x) ? x : fail(where, `a text like ${pattern}`);
}

function flag(x, where) {
  return typeof x === "boolean" ? x : fail(where, "true or false");
}

/** One of some words; `newer`, where it's given, stands for any other. */
function word(x, known, where, newer) {
  if (known.has(x)) return x;
  return newer !== undefined && typeof x === "string" ? newer : fail(where, `one of ${[...known].join(", ")}`);
}

function list(x, least, most, where, check) {
  if (!Array.isArray(x) || x.length < least || x.length > most) fail(where, `an array of ${least} to ${most}`);
  if (check !== undefined) for (const one of x) check(one);
  return x;
}

function numbers(x, least, most, low, high, where) {
  list(x, least, most, where);
  for (const one of x) real(one, low, high, where);
  return x;
}

function tuple(x, where, ...checks) {
  list(x, checks.length, checks.length, where);
  for (let i = 0; i < checks.length; i++) checks[i](x[i]);
  return x;
}

function map(x, where, check) {
  if (typeof x !== "object" || x === null || Array.isArray(x)) fail(where, "a map");
  if (check !== undefined) for (const one of Object.values(x)) check(one);
  return x;
}

const STATUS = new Set(["accepted", "postponed", "rejected"]);
const REFUSAL_CODE = new Set(["other", "overruled", "not-following"]);
const FRAME_STATUS = new Set(["predicted", "confirmed", "falsified"]);
const PROBLEM_CODE = new Set(["malformed", "unknown-type", "not-allowed", "out-of-range", "too-large", "too-fast", "hello-expected", "hello-late", "version", "refused", "full", "lease", "stale-epoch", "stopping", "unheard", "failed"]);
const LEASE_STATE = new Set(["free", "held", "ending"]);
const LEASE_END = new Set(["released", "expired", "taken over"]);
const ROLE = new Set(["viewer", "operator", "admin", "site"]);
const JOB_STAGE = new Set(["planned", "running", "paused", "done", "failed", "aborted"]);
const DOING = new Set(["nothing", "goal", "jobs"]);
const JOURNEY_STATE = new Set(["idle", "driving", "waiting", "arrived", "failed", "ended"]);
const OPERATOR_LOSS = new Set(["stop", "carry-on"]);

/** What became of a command; it belongs to one version of the timeline. */
function checkReceipt(m) {
  map(m, "Receipt");
  whole(m.command_id, 0, WHOLE, "Receipt.command_id"); // Names the command from now on, from 1; rejected commands have an id, too.
  word(m.status, STATUS, "Receipt.status");
  m.issued_at = m.issued_at === undefined || m.issued_at === null ? null : real(m.issued_at, -1e9, 1e9, "Receipt.issued_at"); // Issue time [s]; None where none was given to an offline engine.
  m.asked_at = m.asked_at === undefined || m.asked_at === null ? null : real(m.asked_at, -1e9, 1e9, "Receipt.asked_at"); // Execution time that was asked for [s]; None where none was.
  m.execute_at = m.execute_at === undefined || m.execute_at === null ? null : real(m.execute_at, -1e9, 1e9, "Receipt.execute_at"); // Start of the motion [s]; None when rejected.
  m.end = m.end === undefined || m.end === null ? null : real(m.end, -1e9, 1e9, "Receipt.end"); // Arrival [s]; None when rejected.
  m.q = m.q === undefined || m.q === null ? null : numbers(m.q, 1, 64, -1e9, 1e9, "Receipt.q"); // Joints of the target [rad], (n,), poses resolved; None when rejected, or where there's no target.
  m.reason = m.reason === undefined ? "" : text(m.reason, 0, 2000, "Receipt.reason"); // Why it was postponed or rejected, or what else the user must know.
  m.version = m.version === undefined ? 0 : whole(m.version, 0, WHOLE, "Receipt.version"); // Version of the timeline that the command made, or left when rejected.
  m.shift = m.shift === undefined ? 0.0 : real(m.shift, -1e9, 1e9, "Receipt.shift"); // Δ by which the commands in `shifted` were shifted [s].
  m.superseded_by = m.superseded_by === undefined || m.superseded_by === null ? null : whole(m.superseded_by, 0, WHOLE, "Receipt.superseded_by"); // Id of the later command that cut this one short or dropped it, 0 for a correction; None while it stands.
  m.undone = m.undone === undefined ? false : flag(m.undone, "Receipt.undone"); // Whether it was taken back or cancelled.
  m.shifted = m.shifted === undefined ? [] : list(m.shifted, 0, Infinity, "Receipt.shifted", (x) => whole(x, 1, WHOLE, "Receipt.shifted")); // Ids of commands whose moves now come at another time.
  m.superseded = m.superseded === undefined ? [] : list(m.superseded, 0, Infinity, "Receipt.superseded", (x) => whole(x, 1, WHOLE, "Receipt.superseded")); // Ids of commands that won't arrive any more, wholly or in part.
  m.hindrance = m.hindrance === undefined ? "" : text(m.hindrance, 0, 2000, "Receipt.hindrance"); // Of a steering input that's accepted: what keeps the arm from going as asked, and what leads away from it. That's a singularity or a joint's limit. Of an offset: that the limits don't let it be reached in time.
  return m;
}

/** Server: What became of an order; again when a later command changed that. */
function checkOutcome(m) {
  map(m, "outcome");
  if (m.type !== undefined && m.type !== "outcome") fail("outcome", "outcome");
  whole(m.number, 1, WHOLE, "outcome.number"); // Of the order.
  real(m.made_at, -1e9, 1e9, "outcome.made_at"); // The engine's time [s].
  m.receipt = m.receipt === undefined || m.receipt === null ? null : checkReceipt(m.receipt); // None where it was refused, there was nothing to take back, or the command gives no receipt.
  m.refusal = m.refusal === undefined ? "" : text(m.refusal, 0, 2000, "outcome.refusal"); // Why it wasn't taken at all, `no lease: …` where the epoch isn't in force, or why nothing is taken back.
  m.revision = m.revision === undefined ? 0 : whole(m.revision, 0, WHOLE, "outcome.revision"); // Counts up with each change of the receipt, from 0.
  m.code = m.code === undefined ? "other" : word(m.code, REFUSAL_CODE, "outcome.code", "other"); // Why it was refused or rejected, where clients decide by it.
  return m;
}

/** Server: The frame that was asked for, with its status as it is now. */
function checkAnswer(m) {
  map(m, "answer");
  if (m.type !== undefined && m.type !== "answer") fail("answer", "answer");
  whole(m.number, 0, WHOLE, "answer.number"); // Of the `Ask`.
  real(m.t, -1e9, 1e9, "answer.t"); // Time that the frame shows [s].
  real(m.made_at, -1e9, 1e9, "answer.made_at"); // The engine's time when it was made [s].
  numbers(m.q, 1, 64, -1e9, 1e9, "answer.q"); // Joints [rad].
  word(m.status, FRAME_STATUS, "answer.status");
  real(m.now, -1e9, 1e9, "answer.now"); // The engine's time when this was sent [s].
  m.falsified_by = m.falsified_by === undefined || m.falsified_by === null ? null : whole(m.falsified_by, -WHOLE, WHOLE, "answer.falsified_by"); // Id of the first command that changed what happens at `t`; None where none did, or nobody knows which.
  return m;
}

/** Server: The newest frame of a broadcaster, and what became of earlier ones. */
function checkBroadcast(m) {
  map(m, "broadcast");
  if (m.type !== undefined && m.type !== "broadcast") fail("broadcast", "broadcast");
  whole(m.number, 0, WHOLE, "broadcast.number"); // Counts the broadcaster's frames.
  real(m.t, -1e9, 1e9, "broadcast.t"); // Time that the frame shows [s].
  real(m.made_at, -1e9, 1e9, "broadcast.made_at"); // The engine's time when it was made [s].
  numbers(m.q, 1, 64, -1e9, 1e9, "broadcast.q"); // Joints [rad].
  whole(m.since, 0, WHOLE, "broadcast.since"); // Number of the first frame of which anything is known; what became of older ones isn't.
  whole(m.through, 0, WHOLE, "broadcast.through"); // Frames from `since` to this one are confirmed, but for those in `falsified`; later ones are predicted.
  m.status = m.status === undefined ? "predicted" : word(m.status, FRAME_STATUS, "broadcast.status"); // How far it could be trusted when it was made.
  m.falsified_by = m.falsified_by === undefined || m.falsified_by === null ? null : whole(m.falsified_by, -WHOLE, WHOLE, "broadcast.falsified_by"); // Id of the first command that changed what happens at `t`; None where none did, or nobody knows which.
  m.falsified = m.falsified === undefined ? [] : list(m.falsified, 0, 256, "broadcast.falsified", (x) => tuple(x, "broadcast.falsified", (x) => whole(x, 0, WHOLE, "broadcast.falsified"), (x) => whole(x, 0, WHOLE, "broadcast.falsified"), (x) => x === null ? x : whole(x, -WHOLE, WHOLE, "broadcast.falsified"))); // [first, last, command]: numbers of frames that were falsified, and the command that did it, or null.
  return m;
}

/** Server: The newest frames of a broadcaster in compact form, and what became of earlier ones. */
function checkCompact(m) {
  map(m, "compact");
  if (m.type !== undefined && m.type !== "compact") fail("compact", "compact");
  like(m.q, /^(?=.{4})(?:[A-Za-z0-9+/]{4})*(?:[A-Za-z0-9+/]{2}==|[A-Za-z0-9+/]{3}=)?$/, "compact.q"); // 1 to 16 frames that follow each other: *bin* in msgpack, in JSON base64 with padding (RFC 4648).
  m.since = m.since === undefined || m.since === null ? null : whole(m.since, 0, WHOLE, "compact.since"); // As in `Broadcast`; absent: what was told last, with a key frame 1.
  m.falsified = m.falsified === undefined ? [] : list(m.falsified, 0, 256, "compact.falsified", (x) => tuple(x, "compact.falsified", (x) => whole(x, 0, WHOLE, "compact.falsified"), (x) => whole(x, 0, WHOLE, "compact.falsified"), (x) => x === null ? x : whole(x, -WHOLE, WHOLE, "compact.falsified"))); // As in `Broadcast`: what is new since the message before; with a key frame all that are known.
  return m;
}

/** What a command is, and what people call it; of several of one command each counts from its time on. */
function checkCommandName(m) {
  map(m, "CommandName");
  whole(m.command_id, -WHOLE, WHOLE, "CommandName.command_id");
  real(m.t, -1e9, 1e9, "CommandName.t"); // From this session time on [s]: steering goes one way, then another.
  text(m.kind, 0, 200, "CommandName.kind"); // Type of the command.
  m.label = m.label === undefined ? "" : text(m.label, 0, 60, "CommandName.label"); // As the order said.
  m.speed = m.speed === undefined ? 1.0 : real(m.speed, 0, 1, "CommandName.speed"); // Of a move, as it was commanded.
  return m;
}

/** Server: What there is to see, for one who has just come. */
function checkScene(m) {
  map(m, "scene");
  if (m.type !== undefined && m.type !== "scene") fail("scene", "scene");
  whole(m.number, 1, WHOLE, "scene.number"); // Of the `Follow`.
  text(m.robot, 0, 200, "scene.robot"); // Name of the robot's model.
  numbers(m.initial, 1, 64, -1e9, 1e9, "scene.initial"); // Joints before the start [rad].
  real(m.start, -1e9, 1e9, "scene.start"); // Origin of the timeline [s].
  real(m.end, -1e9, 1e9, "scene.end"); // End of what is planned [s].
  whole(m.segments, 0, WHOLE, "scene.segments"); // How many it has; `Want` fetches them.
  whole(m.edit, 0, WHOLE, "scene.edit"); // Number of its newest edit.
  real(m.now, -1e9, 1e9, "scene.now"); // Session time [s].
  m.rate = m.rate === undefined || m.rate === null ? null : real(m.rate, 5e-324, 10000, "scene.rate"); // Of the frames that follow [1/s]; absent for segments.
  m.names = m.names === undefined ? [] : list(m.names, 0, 256, "scene.names", checkCommandName); // Of the newest commands, oldest first; absent for frames.
  return m;
}

/** A segment as it crosses: an array of three or four. */
function checkSegmentRow(m) {
  list(m, 3, Infinity, "SegmentRow");
  real(m[0], 5e-324, 1e9, "SegmentRow.duration"); // [s].
  if (m[1] !== null) whole(m[1], -WHOLE, WHOLE, "SegmentRow.command_id"); // Of the command that made it; None for a hold.
  list(m[2], 1, 32, "SegmentRow.coefficients", (x) => numbers(x, 1, 64, -REAL, REAL, "SegmentRow.coefficients")); // By ascending power, of each joint.
  if (!(m[3] === undefined || m[3] === null)) real(m[3], -1e9, 1e9, "SegmentRow.start"); // [s]; None where it's the end of the one before, or the message's.
  return m;
}

/** Server: A part of the timeline that a `Scene` named. */
function checkHistory(m) {
  map(m, "history");
  if (m.type !== undefined && m.type !== "history") fail("history", "history");
  whole(m.edit, 0, WHOLE, "history.edit"); // Of that scene.
  whole(m.index, 0, WHOLE, "history.index"); // Index of the first segment.
  m.dof = m.dof === undefined ? 0 : whole(m.dof, 0, 64, "history.dof"); // Joints of the segments.
  m.start = m.start === undefined ? 0.0 : real(m.start, -1e9, 1e9, "history.start"); // Start of the first segment [s].
  m.segments = m.segments === undefined ? [] : list(m.segments, 0, 256, "history.segments", checkSegmentRow); // In their order; see above.
  return m;
}

/** Server: An edit: the first segments of its base stay, `segments` come next, then those of the base from `tail` on. */
function checkChange(m) {
  map(m, "change");
  if (m.type !== undefined && m.type !== "change") fail("change", "change");
  whole(m.edit, 1, WHOLE, "change.edit"); // Its number.
  whole(m.first, 0, WHOLE, "change.first"); // So many segments of the base stay as they are.
  real(m.end, -1e9, 1e9, "change.end"); // End of the new timeline [s], for a check, to 10⁻⁹.
  m.command_id = m.command_id === undefined || m.command_id === null ? null : whole(m.command_id, -WHOLE, WHOLE, "change.command_id"); // The command that made it, where that's known.
  m.base = m.base === undefined || m.base === null ? m.edit - 1 : whole(m.base, 0, WHOLE, "change.base"); // Number of the edit that it builds on.
  m.tail = m.tail === undefined || m.tail === null ? null : whole(m.tail, 0, WHOLE, "change.tail"); // Index, in the base, of the first segment that comes after the new ones; None: none does.
  m.tail_start = m.tail_start === undefined || m.tail_start === null ? m.end : real(m.tail_start, -1e9, 1e9, "change.tail_start"); // When that one starts now [s]; it and all after it are shifted alike, to rounding (10⁻¹² s).
  m.dof = m.dof === undefined ? 0 : whole(m.dof, 0, 64, "change.dof"); // Joints of the segments.
  m.start = m.start === undefined ? 0.0 : real(m.start, -1e9, 1e9, "change.start"); // Start of the first segment [s].
  m.segments = m.segments === undefined ? [] : list(m.segments, 0, 256, "change.segments", checkSegmentRow); // These come after the first ones.
  m.name = m.name === undefined || m.name === null ? null : checkCommandName(m.name); // What the command is called, where that's new.
  return m;
}

/** Server: Every 0.1 s: up to `past`, the timeline with this edit is what happened. */
function checkPulse(m) {
  map(m, "pulse");
  if (m.type !== undefined && m.type !== "pulse") fail("pulse", "pulse");
  whole(m.edit, 0, WHOLE, "pulse.edit"); // The newest.
  real(m.now, -1e9, 1e9, "pulse.now"); // The engine's time [s].
  m.past = m.past === undefined ? m.now : m.past === null ? null : real(m.past, -1e9, 1e9, "pulse.past"); // What lies before doesn't change any more [s]; null: −∞, of an offline engine.
  return m;
}

/** Either side: An answer at once, please; it also measures the round trip. */
function checkPing(m) {
  map(m, "ping");
  if (m.type !== undefined && m.type !== "ping") fail("ping", "ping");
  whole(m.number, 1, WHOLE, "ping.number");
  real(m.t, -1e12, 1e12, "ping.t"); // When it left, by the sender's clock [s].
  return m;
}

/** Either side: The answer to a `Ping`. */
function checkPong(m) {
  map(m, "pong");
  if (m.type !== undefined && m.type !== "pong") fail("pong", "pong");
  whole(m.number, 1, WHOLE, "pong.number");
  real(m.t, -1e12, 1e12, "pong.t"); // The ping's.
  real(m.received, -1e12, 1e12, "pong.received"); // When that arrived, by the answerer's clock [s].
  real(m.answered, -1e12, 1e12, "pong.answered"); // When this left, by the answerer's clock [s].
  return m;
}

/** Either side: What can't be taken, to its sender. */
function checkProblem(m) {
  map(m, "problem");
  if (m.type !== undefined && m.type !== "problem") fail("problem", "problem");
  word(m.code, PROBLEM_CODE, "problem.code"); // Why; see below.
  text(m.text, 0, 2000, "problem.text"); // For people.
  m.number = m.number === undefined || m.number === null ? null : whole(m.number, 1, WHOLE, "problem.number"); // Of what it's about, where that's known.
  m.fatal = m.fatal === undefined ? false : flag(m.fatal, "problem.fatal"); // Whether the connection ends.
  m.field = m.field === undefined ? "" : text(m.field, 0, 200, "problem.field"); // Of an `Impair`: which of `delay`, `loss` and `service` it's about; empty where it's none of them.
  return m;
}

/** Either side: Correct the path that a program alters on a channel. The answer is a `Corrected` or a `Problem`. The server hands it on to a client with `alters` that has control, which answers the server in its turn. */
function checkPathCorrection(m) {
  map(m, "correct");
  if (m.type !== undefined && m.type !== "correct") fail("correct", "correct");
  whole(m.number, 1, WHOLE, "correct.number"); // The sender's own; the answer has it, too.
  whole(m.channel, 0, 255, "correct.channel"); // Of the program's ALTER.
  numbers(m.offset, 6, 6, -1e9, 1e9, "correct.offset"); // Translation [m], then rotation vector [rad], (6,): along which axes, and whether it adds up, says ALTER.
  m.epoch = m.epoch === undefined || m.epoch === null ? null : like(m.epoch, /^[1-9][0-9]{0,19}$/, "correct.epoch"); // Of who has control, or shares it; others may correct a program of a client with `alters`.
  m.at = m.at === undefined || m.at === null ? null : real(m.at, -1e9, 1e9, "correct.at"); // For when it's meant [s], within 0.2 s of now; absent: for when it comes.
  return m;
}

/** Either side: A correction is on the path. */
function checkCorrected(m) {
  map(m, "corrected");
  if (m.type !== undefined && m.type !== "corrected") fail("corrected", "corrected");
  whole(m.number, 1, WHOLE, "corrected.number"); // Of the `PathCorrection`.
  m.late = m.late === undefined ? "" : text(m.late, 0, 2000, "corrected.late"); // What keeps the arm from following in time; empty where nothing does.
  return m;
}

/** Joint limits, each of shape (n,); of prismatic joints in m for rad. */
function checkLimits(m) {
  map(m, "Limits");
  numbers(m.q_min, 1, 64, -1e9, 1e9, "Limits.q_min"); // Lowest position [rad].
  numbers(m.q_max, 1, 64, -1e9, 1e9, "Limits.q_max"); // Highest position [rad], above q_min.
  numbers(m.qd_max, 1, 64, -1e9, 1e9, "Limits.qd_max"); // Largest speed [rad/s], positive.
  numbers(m.qdd_max, 1, 64, -1e9, 1e9, "Limits.qdd_max"); // Largest acceleration [rad/s²], positive.
  m.qddd_max = m.qddd_max === undefined ? [] : numbers(m.qddd_max, 1, 64, -1e9, 1e9, "Limits.qddd_max"); // Largest jerk [rad/s³], positive; qdd_max / 0.1 s unless given (an assumption).
  return m;
}

/** Server: Who may command; sent when it changes. */
function checkLease(m) {
  map(m, "lease");
  if (m.type !== undefined && m.type !== "lease") fail("lease", "lease");
  word(m.state, LEASE_STATE, "lease.state"); // `ending`: it's over, and the robot isn't at rest yet; ask again later.
  m.epoch = m.epoch === undefined || m.epoch === null ? null : like(m.epoch, /^[1-9][0-9]{0,19}$/, "lease.epoch"); // Of the lease in force; told to the holder, and to who shares it.
  m.holder = m.holder === undefined || m.holder === null ? null : text(m.holder, 1, 100, "lease.holder"); // Name of the holder.
  m.yours = m.yours === undefined ? false : flag(m.yours, "lease.yours"); // Whether the receiver holds it.
  m.answers = m.answers === undefined || m.answers === null ? null : whole(m.answers, 1, WHOLE, "lease.answers"); // Number of the receiver's request that this answers.
  m.ended = m.ended === undefined || m.ended === null ? null : word(m.ended, LEASE_END, "lease.ended"); // How the one before ended; absent: there was none.
  m.shared = m.shared === undefined ? false : flag(m.shared, "lease.shared"); // Whether the receiver shares it: it commands under the epoch, but doesn't keep it.
  m.member = m.member === undefined ? 0 : whole(m.member, 0, WHOLE, "lease.member"); // In a class, the receiver's number in `Present`; 0: there's no class.
  m.waiting = m.waiting === undefined ? 0 : whole(m.waiting, 0, WHOLE, "lease.waiting"); // In a class, the receiver's place in the queue, from 1; 0: it isn't in it.
  m.offered_until = m.offered_until === undefined || m.offered_until === null ? null : real(m.offered_until, -1e9, 1e9, "lease.offered_until"); // In a class: the lease is offered to the receiver, to be acquired until then [s]; absent: it isn't.
  return m;
}

/** Server: The client may go on; what there is. */
function checkWelcome(m) {
  map(m, "welcome");
  if (m.type !== undefined && m.type !== "welcome") fail("welcome", "welcome");
  whole(m.protocol, 1, WHOLE, "welcome.protocol"); // Version of the protocol that is spoken.
  text(m.session, 0, 200, "welcome.session"); // Secret: names this session, for a later `Hello`.
  word(m.role, ROLE, "welcome.role"); // What the client may do.
  text(m.robot, 0, 200, "welcome.robot"); // Name of its model.
  whole(m.dof, 1, 64, "welcome.dof"); // Its joints, n.
  checkLimits(m.limits); // Position [rad], speed, acceleration, jerk [rad/s, /s², /s³].
  map(m.poses, "welcome.poses", (x) => numbers(x, 1, 64, -1e9, 1e9, "welcome.poses")); // Named joint values [rad].
  real(m.now, -1e9, 1e9, "welcome.now"); // Session time when this was sent [s].
  checkLease(m.lease); // As it is now.
  real(m.lease_timeout, 5e-324, 3600, "welcome.lease_timeout"); // It expires so long after the last beat or order [s].
  m.rates = m.rates === undefined ? [] : numbers(m.rates, 0, 100, 5e-324, 10000, "welcome.rates"); // Rates at which frames are broadcast [1/s].
  m.resumed = m.resumed === undefined ? false : flag(m.resumed, "welcome.resumed"); // Whether the session that was asked for goes on.
  m.instance = m.instance === undefined ? "" : text(m.instance, 0, 200, "welcome.instance"); // Names this run of the server; with another one the timeline is another: forget all.
  m.server = m.server === undefined ? "" : text(m.server, 0, 200, "welcome.server"); // Name and version of the program.
  return m;
}

/** A hand with fingers as it was measured, and what it can reach. */
function checkHandReport(m) {
  map(m, "HandReport");
  real(m.opening, 0, 1e9, "HandReport.opening"); // Between the fingers [m].
  real(m.goal, 0, 1e9, "HandReport.goal"); // What they were told to go to, as far as they go [m].
  m.holds = m.holds === undefined || m.holds === null ? null : whole(m.holds, 0, WHOLE, "HandReport.holds"); // Which of the things that move both fingers press on, from 0, as in the scene; absent: none.
  m.things = m.things === undefined ? [] : list(m.things, 0, 32, "HandReport.things", (x) => tuple(x, "HandReport.things", (x) => whole(x, 0, WHOLE, "HandReport.things"), (x) => tuple(x, "HandReport.things", (x) => real(x, -REAL, REAL, "HandReport.things"), (x) => real(x, -REAL, REAL, "HandReport.things"), (x) => real(x, -REAL, REAL, "HandReport.things"), (x) => real(x, -2, 2, "HandReport.things"), (x) => real(x, -2, 2, "HandReport.things"), (x) => real(x, -2, 2, "HandReport.things"), (x) => real(x, -2, 2, "HandReport.things")))); // [number, pose]: where things are that have moved lately, x, y, z [m] and a quaternion x, y, z, w in the arm's base frame; now and then all of them.
  return m;
}

/** Server: The real robot as it was last heard of; the newest one counts. */
function checkState(m) {
  map(m, "state");
  if (m.type !== undefined && m.type !== "state") fail("state", "state");
  whole(m.number, 1, WHOLE, "state.number"); // Counts up.
  real(m.t, -1e9, 1e9, "state.t"); // Session time of the measurement [s].
  numbers(m.q, 1, 64, -1e9, 1e9, "state.q"); // Measured joints [rad].
  real(m.play, -1e9, 1e9, "state.play"); // Time on the timeline that it plays [s].
  real(m.pace, -1e9, 1e9, "state.pace"); // How fast; 1: as planned, 0: it waits.
  real(m.D, -1e9, 1e9, "state.D"); // The robot's timeline less session time [s].
  real(m.following_error, -1e9, 1e9, "state.following_error"); // Largest deviation of a joint from its reference [rad].
  m.epoch = m.epoch === undefined || m.epoch === null ? null : like(m.epoch, /^[1-9][0-9]{0,19}$/, "state.epoch"); // Of the lease that it follows; absent: none.
  m.connected = m.connected === undefined ? true : flag(m.connected, "state.connected"); // Whether the robot is heard of.
  m.halted = m.halted === undefined ? "" : text(m.halted, 0, 2000, "state.halted"); // Why it stopped by itself: it takes no command until the holder sends `Resume`, once it's at rest.
  m.corrections = m.corrections === undefined ? 0 : whole(m.corrections, 0, WHOLE, "state.corrections"); // How often the virtual robot was put where the real one goes.
  m.reference = m.reference === undefined || m.reference === null ? null : numbers(m.reference, 1, 64, -1e9, 1e9, "state.reference"); // What the robot's own timeline asked for at `t` [rad]; absent: it hasn't said. Equal to the virtual robot at `play` unless the two plans have parted.
  m.round_trip = m.round_trip === undefined || m.round_trip === null ? null : real(m.round_trip, -1e9, 1e9, "state.round_trip"); // Newest time that a message to the robot and the answer were under way, what the robot took in between left out [s]; absent before the first.
  m.messages = m.messages === undefined ? [] : list(m.messages, 0, 64, "state.messages", (x) => tuple(x, "state.messages", (x) => real(x, -1e9, 1e9, "state.messages"), (x) => x === null ? x : real(x, -1e9, 1e9, "state.messages"))); // [sent, arrived]: messages to the robot that the emulated link has delivered or lost (null) since the state before, session time [s]. What the real network adds isn't in it.
  m.late = m.late === undefined ? [] : list(m.late, 0, 128, "state.late", (x) => tuple(x, "state.late", (x) => real(x, -1e9, 1e9, "state.late"), (x) => numbers(x, 1, 64, -1e9, 1e9, "state.late"))); // [t, joints]: measurements that came after later ones, one of six; each for 0.2 s, so some come twice.
  m.hand = m.hand === undefined || m.hand === null ? null : checkHandReport(m.hand); // Its hand, and the things around it, measured with `q`; absent where it's in no scene.
  return m;
}

/** What is emulated in one direction, as the command line spells it. */
function checkDirectionConditions(m) {
  map(m, "DirectionConditions");
  text(m.delay, 0, 200, "DirectionConditions.delay"); // A delay profile: `interfaces.link.delay_profile`.
  m.loss = m.loss === undefined ? "0" : text(m.loss, 0, 200, "DirectionConditions.loss"); // A loss model: `interfaces.link.loss_model`.
  m.service = m.service === undefined ? "datagram" : text(m.service, 0, 200, "DirectionConditions.service"); // `datagram` or `in-order`.
  return m;
}

/** Sums over the newest packets. */
function checkLinkFigures(m) {
  map(m, "LinkFigures");
  m.packets = m.packets === undefined ? 0 : whole(m.packets, 0, WHOLE, "LinkFigures.packets"); // Sent in the last `span`, those still under way among them.
  m.lost = m.lost === undefined || m.lost === null ? null : real(m.lost, 0, 1, "LinkFigures.lost"); // Share of them; absent: nothing is known.
  m.median = m.median === undefined || m.median === null ? null : real(m.median, 0, 1e9, "LinkFigures.median"); // Delay of those that arrived [s].
  m.p95 = m.p95 === undefined || m.p95 === null ? null : real(m.p95, 0, 1e9, "LinkFigures.p95"); // Delay that 95 % of those kept within [s].
  m.span = m.span === undefined || m.span === null ? null : real(m.span, 0, 1e9, "LinkFigures.span"); // How long they were sent, up to now [s].
  return m;
}

/** Server: How the way to the robot is. */
function checkNetwork(m) {
  map(m, "network");
  if (m.type !== undefined && m.type !== "network") fail("network", "network");
  checkDirectionConditions(m.forward); // What is emulated to the robot, as in `Impair`.
  checkDirectionConditions(m.backward); // What is emulated back.
  checkLinkFigures(m.there); // What it did to the packets of the last 30 s, since it changed: `packets` sent in the last `span` [s], those still under way among them; `lost`: share of them; `median`, `p95`: delay of those that arrived [s]. Absent where nothing is known.
  checkLinkFigures(m.back); // The same of the way back.
  checkLinkFigures(m.round_trip); // The same, without `lost` and `span`, of round trips between the sites with the network beneath.
  m.seed = m.seed === undefined ? 0 : whole(m.seed, 0, WHOLE, "network.seed"); // Of what is random in the emulation.
  m.changed_at = m.changed_at === undefined || m.changed_at === null ? null : real(m.changed_at, -1e9, 1e9, "network.changed_at"); // Session time of the last change [s]; absent: there was none.
  m.changed_by = m.changed_by === undefined ? "" : text(m.changed_by, 0, 200, "network.changed_by"); // Name of who made it.
  m.robot = m.robot === undefined ? "" : text(m.robot, 0, 200, "network.robot"); // Where the robot's site is.
  m.problem = m.problem === undefined ? "" : text(m.problem, 0, 2000, "network.problem"); // Why there's no connection to it.
  m.clock = m.clock === undefined || m.clock === null ? null : real(m.clock, 0, 1e9, "network.clock"); // By how much the robot may err about session time [s].
  m.link_loss = m.link_loss === undefined ? "" : text(m.link_loss, 0, 200, "network.link_loss"); // What the robot does when nothing is heard, `halt` or `hold`; empty while that isn't known.
  m.timeout = m.timeout === undefined || m.timeout === null ? null : real(m.timeout, 0, 1e9, "network.timeout"); // So long after the last message that counts it does that [s].
  m.max_age = m.max_age === undefined || m.max_age === null ? null : real(m.max_age, 0, 1e9, "network.max_age"); // Older messages don't count under `halt` [s].
  m.offset = m.offset === undefined || m.offset === null ? null : real(m.offset, -1e9, 1e9, "network.offset"); // D, where it's fixed [s]; absent: it adapts, or isn't known.
  m.advice = m.advice === undefined ? "" : text(m.advice, 0, 2000, "network.advice"); // What is likely to go wrong under these conditions, for people.
  m.answers = m.answers === undefined || m.answers === null ? null : whole(m.answers, 1, WHOLE, "network.answers"); // Number of the receiver's request that this answers.
  return m;
}

/** A client of a class. */
function checkMember(m) {
  map(m, "Member");
  whole(m.number, 1, WHOLE, "Member.number"); // Its own, as long as its session goes on.
  text(m.name, 1, 100, "Member.name"); // No two have the same.
  word(m.role, ROLE, "Member.role");
  m.waiting = m.waiting === undefined ? 0 : whole(m.waiting, 0, WHOLE, "Member.waiting"); // Its place in the queue, from 1; 0: it isn't in it.
  return m;
}

/** Server: Who is here; the newest one counts. */
function checkPresent(m) {
  map(m, "present");
  if (m.type !== undefined && m.type !== "present") fail("present", "present");
  m.members = m.members === undefined ? [] : list(m.members, 0, 100, "present.members", checkMember); // Who has the lease comes first, then who waits, in order, then the others.
  m.others = m.others === undefined ? 0 : whole(m.others, 0, WHOLE, "present.others"); // So many more are here.
  m.holder = m.holder === undefined ? 0 : whole(m.holder, 0, WHOLE, "present.holder"); // Number of who has the lease; 0: nobody of them.
  m.offered = m.offered === undefined ? 0 : whole(m.offered, 0, WHOLE, "present.offered"); // Number of who it's offered to; 0: nobody.
  m.offered_until = m.offered_until === undefined || m.offered_until === null ? null : real(m.offered_until, -1e9, 1e9, "present.offered_until"); // The offer stands until then [s].
  m.answers = m.answers === undefined || m.answers === null ? null : whole(m.answers, 1, WHOLE, "present.answers"); // Number of the receiver's request that this answers.
  return m;
}

/** Server: Sent by a relay: where else the same is relayed. The newest one counts. */
function checkRelays(m) {
  map(m, "relays");
  if (m.type !== undefined && m.type !== "relays") fail("relays", "relays");
  m.pages = m.pages === undefined ? [] : list(m.pages, 0, 64, "relays.pages", (x) => text(x, 0, 200, "relays.pages")); // Addresses of the other relays' pages, by http or https.
  return m;
}

/** How fast a mobile robot may be commanded, and how fast that may change. */
function checkDriveLimits(m) {
  map(m, "DriveLimits");
  real(m.v_max, 5e-324, REAL, "DriveLimits.v_max"); // Largest linear speed [m/s], either way, positive.
  real(m.w_max, 5e-324, REAL, "DriveLimits.w_max"); // Largest angular speed [rad/s], either way, positive.
  real(m.a_max, 5e-324, REAL, "DriveLimits.a_max"); // Largest linear acceleration [m/s²], positive.
  real(m.alpha_max, 5e-324, REAL, "DriveLimits.alpha_max"); // Largest angular acceleration [rad/s²], positive.
  return m;
}

/** Server: The client may go on; what there is. */
function checkMobileWelcome(m) {
  map(m, "mobile-welcome");
  if (m.type !== undefined && m.type !== "mobile-welcome") fail("mobile-welcome", "mobile-welcome");
  whole(m.protocol, 1, WHOLE, "mobile-welcome.protocol"); // Version of the protocol that is spoken.
  text(m.session, 0, 200, "mobile-welcome.session"); // Secret: names this session, for a later `Hello`.
  word(m.role, ROLE, "mobile-welcome.role"); // What the client may do.
  text(m.robot, 0, 200, "mobile-welcome.robot"); // Name of the robot's model.
  checkDriveLimits(m.limits); // `v_max` [m/s], `w_max` [rad/s], `a_max` [m/s²], `alpha_max` [rad/s²].
  real(m.period, 5e-324, 1e9, "mobile-welcome.period"); // T: the virtual robot takes a command so often [s].
  real(m.holds, 5e-324, 1e9, "mobile-welcome.holds"); // A `drive` order counts for so long after it was issued [s].
  real(m.now, -1e9, 1e9, "mobile-welcome.now"); // Session time [s].
  checkLease(m.lease); // As it is now.
  real(m.lease_timeout, 5e-324, 3600, "mobile-welcome.lease_timeout"); // It expires so long after the last beat or order [s].
  m.resumed = m.resumed === undefined ? false : flag(m.resumed, "mobile-welcome.resumed"); // Whether the session that was asked for goes on.
  m.instance = m.instance === undefined ? "" : text(m.instance, 0, 200, "mobile-welcome.instance"); // Names this run of the server; with another one forget all.
  m.server = m.server === undefined ? "" : text(m.server, 0, 200, "mobile-welcome.server"); // Name and version of the program.
  m.room = m.room === undefined ? "" : text(m.room, 0, 200, "mobile-welcome.room"); // Name of the room.
  return m;
}

/** Where the middle of the driving axle is, in the world frame. */
function checkPosture(m) {
  list(m, 3, 3, "Posture");
  real(m[0], -1e9, 1e9, "Posture.x"); // [m].
  real(m[1], -1e9, 1e9, "Posture.y"); // [m].
  real(m[2], -1e9, 1e9, "Posture.theta"); // Heading [rad], not wrapped.
  return m;
}

/** What a mobile robot is told to do. */
function checkDrive(m) {
  list(m, 2, 2, "Drive");
  real(m[0], -1e6, 1e6, "Drive.v"); // Linear speed [m/s], forward positive.
  real(m[1], -1e6, 1e6, "Drive.w"); // Angular speed [rad/s], to the left positive.
  return m;
}

/** Server: Where both robots are; the newest one counts. */
function checkPostures(m) {
  map(m, "postures");
  if (m.type !== undefined && m.type !== "postures") fail("postures", "postures");
  whole(m.number, 1, WHOLE, "postures.number"); // Counts up.
  real(m.now, -1e9, 1e9, "postures.now"); // Session time when it was made [s].
  checkPosture(m.virtual); // Of the virtual robot, now [m, m, rad].
  checkDrive(m.command); // What it drives [m/s, rad/s].
  checkPosture(m.estimate); // Where the real robot is thought to come to with all commands so far (the posture estimator). Source: Han et al., eq. (8)–(10).
  m.t = m.t === undefined || m.t === null ? null : real(m.t, -1e9, 1e9, "postures.t"); // Session time of the newest measurement [s]; absent before the first, as the next two.
  m.real = m.real === undefined || m.real === null ? null : checkPosture(m.real); // Where the real robot took itself to be.
  m.drive = m.drive === undefined || m.drive === null ? null : checkDrive(m.drive); // What its motors are told.
  m.D = m.D === undefined || m.D === null ? null : real(m.D, -1e9, 1e9, "postures.D"); // The time of the path that it's to play less session time, by the clock as the robot has it, without what braking needs [s]; absent where its architecture has none.
  m.starved = m.starved === undefined ? false : flag(m.starved, "postures.starved"); // Whether it's slower than it should be, as it knows nothing newer.
  m.path_error = m.path_error === undefined || m.path_error === null ? null : real(m.path_error, 0, 1e9, "postures.path_error"); // Distance from the nearest place of the virtual robot's path near the one before [m]; absent while it doesn't follow.
  m.time_difference = m.time_difference === undefined || m.time_difference === null ? null : real(m.time_difference, 0, 1e9, "postures.time_difference"); // How much later it is there [s]; 0 where both stand.
  m.epoch = m.epoch === undefined || m.epoch === null ? null : like(m.epoch, /^[1-9][0-9]{0,19}$/, "postures.epoch"); // Of the drive that it follows; absent: none.
  m.connected = m.connected === undefined ? true : flag(m.connected, "postures.connected"); // Whether the robot is heard of.
  m.halted = m.halted === undefined ? "" : text(m.halted, 0, 2000, "postures.halted"); // As in `state`.
  m.drives = m.drives === undefined ? 0 : whole(m.drives, 0, WHOLE, "postures.drives"); // How often the virtual robot was put where the real one stood: a drive begins with each lease and `Resume`, and after a stop.
  m.round_trip = m.round_trip === undefined || m.round_trip === null ? null : real(m.round_trip, -1e9, 1e9, "postures.round_trip"); // As in `state`.
  m.messages = m.messages === undefined ? [] : list(m.messages, 0, 64, "postures.messages", (x) => tuple(x, "postures.messages", (x) => real(x, -1e9, 1e9, "postures.messages"), (x) => x === null ? x : real(x, -1e9, 1e9, "postures.messages"))); // As in `state`.
  m.drawn = m.drawn === undefined || m.drawn === null ? null : checkPosture(m.drawn); // Where the virtual robot is drawn, where the posture estimator has it now; absent where that's `virtual`, as in architectures without one.
  return m;
}

/** Where the robot is to go. */
function checkGoal(m) {
  map(m, "Goal");
  real(m.x, -1000, 1000, "Goal.x"); // [m].
  real(m.y, -1000, 1000, "Goal.y"); // [m].
  m.heading = m.heading === undefined || m.heading === null ? null : real(m.heading, -1000, 1000, "Goal.heading"); // In which it's to end [rad]; None for any.
  return m;
}

/** Go to a goal, or to the place of the list that has that name. */
function checkMoveJob(m) {
  map(m, "move");
  if (m.do !== undefined && m.do !== "move") fail("move", "move");
  whole(m.number, 1, 2147483647, "move.number"); // By which it's known; it stays the same where the job is put elsewhere.
  typeof m.to === "object" && m.to !== null ? checkGoal(m.to) // Where: a goal, or the name of a place of the list.
    : typeof m.to === "string" ? text(m.to, 1, 40, "move.to")
    : fail("move.to", "of a kind that is known");
  return m;
}

/** Say something. */
function checkVoiceJob(m) {
  map(m, "voice");
  if (m.do !== undefined && m.do !== "voice") fail("voice", "voice");
  whole(m.number, 1, 2147483647, "voice.number"); // By which it's known; it stays the same where the job is put elsewhere.
  text(m.text, 1, 400, "voice.text");
  return m;
}

/** Show something on the robot's screen; it stays there until something else is shown. */
function checkMessageJob(m) {
  map(m, "message");
  if (m.do !== undefined && m.do !== "message") fail("message", "message");
  whole(m.number, 1, 2147483647, "message.number"); // By which it's known; it stays the same where the job is put elsewhere.
  text(m.text, 1, 400, "message.text");
  return m;
}

/** Wait so many seconds; without a number until the key is pressed. */
function checkWaitJob(m) {
  map(m, "wait");
  if (m.do !== undefined && m.do !== "wait") fail("wait", "wait");
  whole(m.number, 1, 2147483647, "wait.number"); // By which it's known; it stays the same where the job is put elsewhere.
  m.seconds = m.seconds === undefined || m.seconds === null ? null : real(m.seconds, 0, 86400, "wait.seconds"); // For so long [s]; None: until the key is pressed.
  return m;
}

/** Let the arm carry out a VAL-II program of that name: the `source`'s, or one that the arm's site has. */
function checkArmJob(m) {
  map(m, "arm");
  if (m.do !== undefined && m.do !== "arm") fail("arm", "arm");
  whole(m.number, 1, 2147483647, "arm.number"); // By which it's known; it stays the same where the job is put elsewhere.
  text(m.program, 1, 40, "arm.program"); // Its name.
  m.source = m.source === undefined ? "" : text(m.source, 0, 16000, "arm.source"); // The file in which it is; empty for a program that the arm's site has.
  return m;
}

/** Jobs in their order, and the places that they name. Every edit makes another list. */
function checkJobList(m) {
  map(m, "JobList");
  m.jobs = m.jobs === undefined ? [] : list(m.jobs, 0, 64, "JobList.jobs", (x) => x?.do === "move" ? checkMoveJob(x) // Each number once.
    : x?.do === "voice" ? checkVoiceJob(x)
    : x?.do === "message" ? checkMessageJob(x)
    : x?.do === "wait" ? checkWaitJob(x)
    : x?.do === "arm" ? checkArmJob(x)
    : fail("JobList.jobs", "of a kind that is known"));
  m.places = map(m.places === undefined ? {} : m.places, "JobList.places", checkGoal); // By name.
  return m;
}

/** How far a job is. */
function checkJobProgress(m) {
  map(m, "JobProgress");
  whole(m.number, 1, 2147483647, "JobProgress.number"); // Of the job.
  m.stage = m.stage === undefined ? "planned" : word(m.stage, JOB_STAGE, "JobProgress.stage");
  m.reason = m.reason === undefined ? "" : text(m.reason, 0, 500, "JobProgress.reason"); // Why it's paused or has failed.
  m.left = m.left === undefined || m.left === null ? null : real(m.left, 0, 86400, "JobProgress.left"); // Of a WAIT that's paused, what is left of it [s].
  return m;
}

/** How far a list is. */
function checkProgress(m) {
  map(m, "Progress");
  m.stage = m.stage === undefined ? "planned" : word(m.stage, JOB_STAGE, "Progress.stage");
  m.jobs = m.jobs === undefined ? [] : list(m.jobs, 0, 64, "Progress.jobs", checkJobProgress); // In the list's order.
  m.reason = m.reason === undefined ? "" : text(m.reason, 0, 500, "Progress.reason"); // Why it's paused, has failed, or was aborted.
  return m;
}

/** What is likely to become of a job. */
function checkJobForecast(m) {
  map(m, "JobForecast");
  whole(m.number, 1, WHOLE, "JobForecast.number");
  real(m.begins, 0, 1e9, "JobForecast.begins"); // After so long [s], times that nobody knows left out.
  m.lasts = m.lasts === undefined || m.lasts === null ? null : real(m.lasts, 0, 1e9, "JobForecast.lasts"); // For so long [s]; None where nobody knows.
  m.route = m.route === undefined ? [] : list(m.route, 0, 720, "JobForecast.route", (x) => numbers(x, 2, 2, -1e9, 1e9, "JobForecast.route")); // Of a move [m].
  m.problem = m.problem === undefined ? "" : text(m.problem, 0, 2000, "JobForecast.problem"); // Why it'd fail; the list ends there.
  return m;
}

/** Server: What the robot does by itself, and the list of jobs; the newest one counts. */
function checkTasks(m) {
  map(m, "tasks");
  if (m.type !== undefined && m.type !== "tasks") fail("tasks", "tasks");
  m.doing = m.doing === undefined ? "nothing" : word(m.doing, DOING, "tasks.doing"); // What that is.
  m.journey = m.journey === undefined ? "idle" : word(m.journey, JOURNEY_STATE, "tasks.journey");
  m.reason = m.reason === undefined ? "" : text(m.reason, 0, 2000, "tasks.reason"); // Why it waits or couldn't get there.
  m.goal = m.goal === undefined || m.goal === null ? null : checkGoal(m.goal); // Where to.
  m.route = m.route === undefined ? [] : list(m.route, 0, 720, "tasks.route", (x) => numbers(x, 2, 2, -1e9, 1e9, "tasks.route")); // The way there [m].
  m.left = m.left === undefined ? 0.0 : real(m.left, 0, 1e9, "tasks.left"); // How much of it is left [m].
  m.jobs = checkJobList(m.jobs === undefined ? {} : m.jobs); // The list.
  m.progress = checkProgress(m.progress === undefined ? {} : m.progress); // How far that is.
  m.forecast = m.forecast === undefined || m.forecast === null ? null : list(m.forecast, 0, 64, "tasks.forecast", checkJobForecast); // What the dry run said of this list; None where there was none since it was changed.
  m.loss = m.loss === undefined || m.loss === null ? null : word(m.loss, OPERATOR_LOSS, "tasks.loss"); // What follows when the operator is lost; None before the robot is met.
  m.shows = m.shows === undefined ? "" : text(m.shows, 0, 2000, "tasks.shows"); // What stands on its screen.
  m.says = m.says === undefined ? "" : text(m.says, 0, 2000, "tasks.says"); // What it's saying.
  m.problem = m.problem === undefined ? "" : text(m.problem, 0, 2000, "tasks.problem"); // What is wrong with the file of the list; empty if nothing is.
  m.answers = m.answers === undefined || m.answers === null ? null : whole(m.answers, 0, WHOLE, "tasks.answers"); // Number of the receiver's order that this answers.
  return m;
}

/** Server: What the robot sees of its surroundings; the newest one counts. */
function checkSeen(m) {
  map(m, "seen");
  if (m.type !== undefined && m.type !== "seen") fail("seen", "seen");
  real(m.time, -1e12, 1e12, "seen.time"); // By the robot's own clock [s].
  m.points = m.points === undefined ? [] : list(m.points, 0, 720, "seen.points", (x) => numbers(x, 2, 2, -1e9, 1e9, "seen.points")); // Where its laser's beams ended, on the map [m].
  m.doubt = m.doubt === undefined || m.doubt === null ? null : numbers(m.doubt, 3, 3, -1e9, 1e9, "seen.doubt"); // Of its place: variance of x, covariance, variance of y [m²]; None where nobody knows.
  return m;
}

/** Server: The known map of where the robot drives. */
function checkPlan(m) {
  map(m, "plan");
  if (m.type !== undefined && m.type !== "plan") fail("plan", "plan");
  numbers(m.size, 2, 2, -1e9, 1e9, "plan.size"); // Length and width of the floor [m].
  m.things = m.things === undefined ? [] : list(m.things, 0, 1000, "plan.things", (x) => list(x, 0, 64, "plan.things", (x) => numbers(x, 2, 2, -1e9, 1e9, "plan.things"))); // Outlines of what the map knows [m].
  m.via = m.via === undefined ? [] : list(m.via, 0, 720, "plan.via", (x) => numbers(x, 2, 2, -1e9, 1e9, "plan.via")); // Via points [m].
  m.robot = m.robot === undefined ? [0.0, 0.0, 0.0] : numbers(m.robot, 3, 3, 0, 1e9, "plan.robot"); // What it reaches ahead and back from its axle, and its width [m].
  return m;
}

const CHECKS = new Map([
  ["outcome", checkOutcome],
  ["answer", checkAnswer],
  ["broadcast", checkBroadcast],
  ["compact", checkCompact],
  ["scene", checkScene],
  ["history", checkHistory],
  ["change", checkChange],
  ["pulse", checkPulse],
  ["ping", checkPing],
  ["pong", checkPong],
  ["problem", checkProblem],
  ["correct", checkPathCorrection],
  ["corrected", checkCorrected],
  ["welcome", checkWelcome],
  ["lease", checkLease],
  ["state", checkState],
  ["network", checkNetwork],
  ["present", checkPresent],
  ["relays", checkRelays],
  ["mobile-welcome", checkMobileWelcome],
  ["postures", checkPostures],
  ["tasks", checkTasks],
  ["seen", checkSeen],
  ["plan", checkPlan],
]);

/** Types of messages that bear the epoch of the lease under which they're sent. */
export const LEASED = new Set(["order", "release", "resume", "beat", "impair", "task"]);

const told = new Set();

/**
 * Check a message, and fill in what was left out.
 * @param {object} message as it came, parsed; it's changed in place
 * @param {(problem: string) => void} tell is told, once for each, what can't be taken
 * @returns {?object} the message; null for one of a type that isn't known, or that can't be taken
 */
export function check(message, tell = console.warn) {
  try {
    map(message, "a message");
    const checkIt = CHECKS.get(message.type);
    if (checkIt === undefined) return null;
    checkIt(message);
    return message;
  } catch (problem) {
    if (!(problem instanceof Misfit)) throw problem;
    if (!told.has(problem.message)) tell(problem.message);
    told.add(problem.message);
    return null;
  }
}

/** As `check`, of a frame as it came. */
export function decode(frame, tell = console.warn) {
  let message = null;
  try {
    message = JSON.parse(frame);
  } catch {
    // What is no JSON is no map, either.
  }
  return check(message, tell);
}
