// Generated from the definitions of messages by `make generate`: don't edit.
// What may cross between a page and the server (docs/protocol.md), and what checks it where it comes in.

/** The ends of whole numbers and of real ones: JSON has no infinity. */
const WHOLE = 2 ** 63;
const REAL = Number.MAX_VALUE;

/** A message that can't be taken. */
class Misfit extends Error {}

function fail(where, wanted) {
  throw new Misfit(`${where} isn't ${wanted}`);
}

function whole(x, low, high, where) {
  if (!Number.isInteger(x) || x < low || x > high) fail(where, `a whole number from ${low} to ${high}`);
}

function real(x, low, high, where) {
  if (typeof x !== "number" || !(x >= low && x <= high)) fail(where, `a number from ${low} to ${high}`);
}

function text(x, least, most, where) {
  if (typeof x !== "string" || x.length < least || (x.length > most && [...x].length > most))
    fail(where, `a text of ${least} to ${most} characters`);
}

function like(x, pattern, where) {
  if (typeof x !== "string" || !pattern.test(x)) fail(where, `a text like ${pattern}`);
}

function flag(x, where) {
  if (typeof x !== "boolean") fail(where, "true or false");
}

function word(x, known, where) {
  if (!known.has(x)) fail(where, `one of ${[...known].join(", ")}`);
}

function list(x, least, most, where) {
  if (!Array.isArray(x) || x.length < least || x.length > most) fail(where, `an array of ${least} to ${most}`);
}

function map(x, where) {
  if (typeof x !== "object" || x === null || Array.isArray(x)) fail(where, "a map");
}

/**
 * A target in joint space.
 * @typedef {object} JointTarget
 * @property {"joints"} type
 * @property {Array<number>} q joints. Joint values [rad], shape (n,).
 */
/**
 * A target pose of the last link in the base frame.
 * @typedef {object} PoseTarget
 * @property {"pose"} type
 * @property {Array<Array<number>>} X 4 × 4 × real from −10⁶ to 10⁶. Homogeneous transform, (4, 4), by rows, with a proper rotation.
 * @property {string|null} [configuration] text of up to 200 characters (absent). Asked-for arm configuration, as `LEFTY BELOW FLIP` or a part of it; None: the arm's own.
 */
/**
 * Move to a target: (p, t, v) of eq. (1), Doulgeri, Zikos, Delopoulos.
 * @typedef {object} MotionCommand
 * @property {"move"} type
 * @property {JointTarget|PoseTarget} target `joints` or `pose`. Where to.
 * @property {number|null} [issued_at] real (absent). Issue time t_iss [s]; None: whoever registers the command stamps it. An engine in real-time mode stamps its present time; a command for an earlier t_exec then is rejected, so one that was issued in time and comes late must carry its own stamp to be postponed.
 * @property {number|null} [execute_at] real (absent). Execution time t_exec [s]; None: as soon as possible, which is now, or the end of the plan when offline.
 * @property {number} [speed] real from 0.001 to 1 (1). Share v of the nominal speeds, in (0, 1]. The paper's v = 0 would never arrive, so it is refused.
 * @property {"joint"|"line"} [motion] `joint`, `line` (`joint`).
 * @property {"parabolic"|"jerk-limited"} [profile] `parabolic`, `jerk-limited` (`parabolic`).
 * @property {"splice"|"replace"|"append"} [insertion] `splice`, `replace`, `append` (`splice`).
 * @property {number|"inf"} [deviation] real from 0 to 10⁶ or `inf` (0). How far the tool may stay away from where the move before it ends [m], so as not to stop there; 0 stops. Infinity, written as `inf`, is a continuous path: the move begins where the one before it begins to brake, or so late that it's at its speed when that one ends. Such moves take half of the acceleration, so that any two can overlap.
 * @property {number} [pace] real from 0.001 to 1 (1). Planned as at 1, a move takes 1/pace times as long on the same path, roundings included; in [0.001, 1].
 * @property {number} [acceleration] real from 0.01 to 1 (1). Share of the limits of acceleration and jerk that the move takes, in [0.01, 1].
 * @property {Array<Array<number>>|null} [tool] 4 × 4 × real from −10⁶ to 10⁶ (absent). What goes straight and keeps the deviation: a frame in the last link's, (4, 4), by rows; None: that link. Targets stay the last link's.
 */
/**
 * Move as a hand on a joystick asks: joint rates, or a twist of the tool; it ends by itself.
 * @typedef {object} SteerCommand
 * @property {"steer"} type
 * @property {Array<number>|null} [rates] joints (absent). Joint rates [rad/s], (n,).
 * @property {Array<number>|null} [twist] 6 × real (absent). Twist of the tool, (6,): linear [m/s], then angular [rad/s]; instead of rates.
 * @property {"base"|"tool"} [frame] `base`, `tool` (`base`). Frame of the twist.
 * @property {number|null} [issued_at] real (absent). Issue time t_iss [s]; an input older than 0.2 s moves nothing.
 * @property {number|null} [execute_at] real (absent). Execution time t_exec [s]; None: as soon as possible.
 */
/**
 * Drive a mobile robot on an arc at constant speeds.
 * @typedef {object} DriveCommand
 * @property {"drive"} type
 * @property {number} v real. Linear speed [m/s], forward positive.
 * @property {number} w real. Angular speed [rad/s], to the left positive.
 * @property {number} duration real > 0. [s], positive.
 * @property {number|null} [issued_at] real (absent). Issue time t_iss [s]; None: whoever registers the command stamps it.
 * @property {number|null} [execute_at] real (absent). Execution time t_exec [s]; None: as soon as possible.
 */
/**
 * Let a scheduled move begin at another time.
 * @typedef {object} Retime
 * @property {"retime"} type
 * @property {number} command_id number.
 * @property {number} execute_at real. New start [s].
 * @property {number|null} [issued_at] real (absent).
 */
/**
 * Take a scheduled move out of the plan; one under way brakes.
 * @typedef {object} Cancel
 * @property {"cancel"} type
 * @property {number} command_id number.
 * @property {number|null} [issued_at] real (absent).
 * @property {number|null} [execute_at] real (absent). When [s]; None: as soon as possible.
 */
/**
 * Let a scheduled move, or what is left of one under way, go by another place.
 * @typedef {object} InsertVia
 * @property {"via"} type
 * @property {number} command_id number.
 * @property {JointTarget|PoseTarget} target `joints` or `pose`.
 * @property {number} [deviation] real from 0 to 10⁶ (0). How far the tool may stay away from the via [m], so as not to stop there; 0 stops.
 * @property {number|null} [issued_at] real (absent).
 * @property {number|null} [execute_at] real (absent). When a move under way turns to the via [s]; None: as soon as possible.
 */
/**
 * Run what is scheduled `factor` times as fast: the path stays, holds are scaled too.
 * @typedef {object} ScaleTime
 * @property {"scale"} type
 * @property {number} factor real from 0.001 to 1000. Ratio of the new pace to the present one, 0.001 to 1000.
 * @property {number|null} [issued_at] real (absent).
 * @property {number|null} [execute_at] real (absent). When it begins [s]; None: as soon as possible (offline: the start of the timeline).
 */
/**
 * Stop along the present motion as fast as the limits allow, and drop what is scheduled.
 * @typedef {object} Stop
 * @property {"stop"} type
 * @property {number|null} [issued_at] real (absent).
 * @property {number|null} [execute_at] real (absent). When [s]; None: as soon as possible. A late stop stops at once, whatever the lateness policy.
 */
/**
 * Holder: The robot goes on after it stopped by itself.
 * @typedef {object} Resume
 * @property {"resume"} type
 * @property {number} number number.
 * @property {string} epoch epoch.
 */
/**
 * Ask for the position at time t: g of eq. (4).
 * @typedef {object} PositionQuery
 * @property {"query"} type
 * @property {number|null} [t] real (absent). Timeline time [s]; None: now (offline: the end of the plan).
 */
/**
 * Change a parameter of the simulation, at rest; `Engine.parameters` names them.
 * @typedef {object} ParameterChange
 * @property {"parameter"} type
 * @property {string} name text of up to 200 characters.
 * @property {boolean|number|string|Array<number>|null} [value] boolean or integer from −10⁹ to 10⁹ or real or text of up to 200 characters or joints (absent).
 */
/**
 * Holder: Carry out a command. It's sent again until its outcome comes, and carried out once.
 * @typedef {object} Order
 * @property {"order"} type
 * @property {number} number number. Orders are carried out in the order of their numbers; a stop doesn't wait.
 * @property {MotionCommand|SteerCommand|DriveCommand|Retime|Cancel|InsertVia|ScaleTime|Stop|Resume|PositionQuery|ParameterChange|null} [command] `move` or `steer` or `drive` or `retime` or `cancel` or `via` or `scale` or `stop` or `resume` or `query` or `parameter` (absent). None: take back the newest accepted command.
 * @property {string|null} [epoch] epoch (absent). Of the control lease; None where none is needed, as on an engine in this process.
 */
/**
 * Client: g(t). Sent again with the same number, it asks what has become of that frame.
 * @typedef {object} Ask
 * @property {"ask"} type
 * @property {number} number number. The client's own, each used once.
 * @property {number|null} [t] real (absent). [s]; absent: now.
 */
/**
 * Client: The scene, then what follows; one at a time counts, another number replaces it.
 * @typedef {object} Follow
 * @property {"follow"} type
 * @property {number} number number.
 * @property {"segments"|"frames"|"compact"} form `segments`, `frames`, `compact`. `segments`: the timeline and each edit of it; `frames`: positions; `compact`: positions in few bytes.
 * @property {number|null} [rate] real > 0 up to 10⁴ (absent). Of frames [1/s]: the broadcaster with the nearest one is taken.
 * @property {number} [delay] real from 0 to 0.1 (0). Of compact frames: how long one may wait for others that go in the same message [s].
 */
/**
 * Client: Segments of the scene of that edit, from that one on; without `index` all edits after that one.
 * @typedef {object} Want
 * @property {"want"} type
 * @property {number} edit count. Of the newest edit that the client has, or of the scene.
 * @property {number|null} [index] count (absent). First segment that it lacks.
 */
/**
 * What became of a command; it belongs to one version of the timeline.
 * @typedef {object} Receipt
 * @property {number} command_id count. Names the command from now on, from 1; rejected commands have an id, too.
 * @property {"accepted"|"postponed"|"rejected"} status `accepted`, `postponed`, `rejected`.
 * @property {number|null} [issued_at] real (absent). Issue time [s]; None where none was given to an offline engine.
 * @property {number|null} [asked_at] real (absent). Execution time that was asked for [s]; None where none was.
 * @property {number|null} [execute_at] real (absent). Start of the motion [s]; None when rejected.
 * @property {number|null} [end] real (absent). Arrival [s]; None when rejected.
 * @property {Array<number>|null} [q] joints (absent). Joints of the target [rad], (n,), poses resolved; None when rejected, or where there's no target.
 * @property {string} [reason] text (empty). Why it was postponed or rejected, or what else the user must know.
 * @property {number} [version] count (0). Version of the timeline that the command made, or left when rejected.
 * @property {number} [shift] real (0). Δ by which the commands in `shifted` were shifted [s].
 * @property {number|null} [superseded_by] count (absent). Id of the later command that cut this one short or dropped it, 0 for a correction; None while it stands.
 * @property {boolean} [undone] boolean (false). Whether it was taken back or cancelled.
 * @property {Array<number>} [shifted] any number × number (none). Ids of commands whose moves now come at another time.
 * @property {Array<number>} [superseded] any number × number (none). Ids of commands that won't arrive any more, wholly or in part.
 * @property {string} [hindrance] text (empty). Of a steering input that's accepted: what keeps the arm from going as asked, and what leads away from it. That's a singularity or a joint's limit.
 */
/**
 * Server: What became of an order; again when a later command changed that.
 * @typedef {object} Outcome
 * @property {"outcome"} type
 * @property {number} number number. Of the order.
 * @property {number} made_at real. The engine's time [s].
 * @property {Receipt|null} [receipt] map of `command_id`, `status`, `issued_at` (absent), `asked_at` (absent), `execute_at` (absent), `end` (absent), `q` (absent), `reason` (empty), `version` (0), `shift` (0), `superseded_by` (absent), `undone` (false), `shifted` (none), `superseded` (none), `hindrance` (empty) (absent). None where it was refused, there was nothing to take back, or the command gives no receipt.
 * @property {string} [refusal] text (empty). Why it wasn't taken at all, `no lease: …` where the epoch isn't in force, or why nothing is taken back.
 * @property {number} [revision] count (0). Counts up with each change of the receipt, from 0.
 * @property {"other"|"overruled"|"not-following"} [code] `other`, `overruled`, `not-following`; any other word counts as `other` (`other`). Why it was refused or rejected, where clients decide by it.
 */
/**
 * Server: The frame that was asked for, with its status as it is now.
 * @typedef {object} Answer
 * @property {"answer"} type
 * @property {number} number count. Of the `Ask`.
 * @property {number} t real. Time that the frame shows [s].
 * @property {number} made_at real. The engine's time when it was made [s].
 * @property {Array<number>} q joints. Joints [rad].
 * @property {"predicted"|"confirmed"|"falsified"} status `predicted`, `confirmed`, `falsified`.
 * @property {number} now real. The engine's time when this was sent [s].
 * @property {number|null} [falsified_by] integer (absent). Id of the first command that changed what happens at `t`; None where none did, or nobody knows which.
 */
/**
 * Server: The newest frame of a broadcaster, and what became of earlier ones.
 * @typedef {object} Broadcast
 * @property {"broadcast"} type
 * @property {number} number count. Counts the broadcaster's frames.
 * @property {number} t real. Time that the frame shows [s].
 * @property {number} made_at real. The engine's time when it was made [s].
 * @property {Array<number>} q joints. Joints [rad].
 * @property {number} since count. Number of the first frame of which anything is known; what became of older ones isn't.
 * @property {number} through count. Frames from `since` to this one are confirmed, but for those in `falsified`; later ones are predicted.
 * @property {"predicted"|"confirmed"|"falsified"} [status] `predicted`, `confirmed`, `falsified` (`predicted`). How far it could be trusted when it was made.
 * @property {number|null} [falsified_by] integer (absent). Id of the first command that changed what happens at `t`; None where none did, or nobody knows which.
 * @property {Array<[number, number, number|null]>} [falsified] up to 256 × [count, count, integer or null] (none). [first, last, command]: numbers of frames that were falsified, and the command that did it, or null.
 */
/**
 * Server: The newest frames of a broadcaster in compact form, and what became of earlier ones.
 * @typedef {object} Compact
 * @property {"compact"} type
 * @property {string} q bytes. 1 to 16 frames that follow each other: *bin* in msgpack, in JSON base64 with padding (RFC 4648).
 * @property {number|null} [since] count (absent). As in `Broadcast`; absent: what was told last, with a key frame 1.
 * @property {Array<[number, number, number|null]>} [falsified] up to 256 × [count, count, integer or null] (none). As in `Broadcast`: what is new since the message before; with a key frame all that are known.
 */
/**
 * Server: What there is to see, for one who has just come.
 * @typedef {object} Scene
 * @property {"scene"} type
 * @property {number} number number. Of the `Follow`.
 * @property {string} robot text of up to 200 characters. Name of the robot's model.
 * @property {Array<number>} initial joints. Joints before the start [rad].
 * @property {number} start real. Origin of the timeline [s].
 * @property {number} end real. End of what is planned [s].
 * @property {number} segments count. How many it has; `Want` fetches them.
 * @property {number} edit count. Number of its newest edit.
 * @property {number} now real. Session time [s].
 * @property {number|null} [rate] real > 0 up to 10⁴ (absent). Of the frames that follow [1/s]; absent for segments.
 */
/** A segment as it crosses: an array of three or four. @typedef {[number, number|null, Array<Array<number>>, number|null]} SegmentRow */
/**
 * Server: A part of the timeline that a `Scene` named.
 * @typedef {object} History
 * @property {"history"} type
 * @property {number} edit count. Of that scene.
 * @property {number} index count. Index of the first segment.
 * @property {number} [dof] integer from 0 to 64 (0). Joints of the segments.
 * @property {number} [start] real (0). Start of the first segment [s].
 * @property {Array<SegmentRow>} [segments] up to 256 × [`duration`, `command_id`, `coefficients`, `start`] (none). In their order; see above.
 */
/**
 * Server: An edit: the first segments of its base stay, `segments` come next, then those of the base from `tail` on.
 * @typedef {object} Change
 * @property {"change"} type
 * @property {number} edit number. Its number.
 * @property {number} first count. So many segments of the base stay as they are.
 * @property {number} end real. End of the new timeline [s], for a check, to 10⁻⁹.
 * @property {number|null} [command_id] integer (absent). The command that made it, where that's known.
 * @property {number|null} [base] count (`edit` − 1). Number of the edit that it builds on.
 * @property {number|null} [tail] count (absent). Index, in the base, of the first segment that comes after the new ones; None: none does.
 * @property {number|null} [tail_start] real (`end`). When that one starts now [s]; it and all after it are shifted alike, to rounding (10⁻¹² s).
 * @property {number} [dof] integer from 0 to 64 (0). Joints of the segments.
 * @property {number} [start] real (0). Start of the first segment [s].
 * @property {Array<SegmentRow>} [segments] up to 256 × [`duration`, `command_id`, `coefficients`, `start`] (none). These come after the first ones.
 */
/**
 * Server: Every 0.1 s: up to `past`, the timeline with this edit is what happened.
 * @typedef {object} Pulse
 * @property {"pulse"} type
 * @property {number} edit count. The newest.
 * @property {number} now real. The engine's time [s].
 * @property {number|null} [past] real or null (`now`). What lies before doesn't change any more [s]; null: −∞, of an offline engine.
 */
/**
 * Client: Who it is; its first message.
 * @typedef {object} Hello
 * @property {"hello"} type
 * @property {number} protocol number. Highest version that the client speaks: 1.
 * @property {"viewer"|"operator"|"admin"|"site"} role `viewer`, `operator`, `admin`, `site`. What it wants to do; `site` is for sites.
 * @property {string} name text of 1 to 100 characters. For people.
 * @property {string|null} [token] text of up to 200 characters (absent). Of the role. Needed off loopback, and always for `admin`.
 * @property {string|null} [session] text of up to 200 characters (absent). Of an earlier `Welcome`, to go on with it.
 * @property {string|null} [link_loss] text of up to 200 characters (absent). Of an operator's site: what the robot is to do when nothing fresh is heard, `halt` or `hold`; absent: the robot's own.
 */
/**
 * Either side: An answer at once, please; it also measures the round trip.
 * @typedef {object} Ping
 * @property {"ping"} type
 * @property {number} number number.
 * @property {number} t real from −10¹² to 10¹². When it left, by the sender's clock [s].
 */
/**
 * Either side: The answer to a `Ping`.
 * @typedef {object} Pong
 * @property {"pong"} type
 * @property {number} number number.
 * @property {number} t real from −10¹² to 10¹². The ping's.
 * @property {number} received real from −10¹² to 10¹². When that arrived, by the answerer's clock [s].
 * @property {number} answered real from −10¹² to 10¹². When this left, by the answerer's clock [s].
 */
/**
 * Operator: The lease, if it's free.
 * @typedef {object} Acquire
 * @property {"acquire"} type
 * @property {number} number number.
 */
/**
 * Admin: The lease, whoever has it; the robot is stopped first.
 * @typedef {object} TakeOver
 * @property {"take-over"} type
 * @property {number} number number.
 */
/**
 * Operator: Commands under the lease of that session, too.
 * @typedef {object} Share
 * @property {"share"} type
 * @property {number} number number.
 * @property {string} session text of up to 200 characters. The holder's, from its `Welcome`: whoever knows it was told by the holder.
 */
/**
 * Holder: Gives it back; who shares it leaves it, and the robot goes on.
 * @typedef {object} Release
 * @property {"release"} type
 * @property {number} number number.
 * @property {string} epoch epoch.
 */
/**
 * Holder: Keeps it; send one every 0.5 s. It expires after `lease_timeout` without beat or order.
 * @typedef {object} Beat
 * @property {"beat"} type
 * @property {string} epoch epoch.
 */
/**
 * Client: How is the way to the robot? Another answer follows whenever the conditions change.
 * @typedef {object} Survey
 * @property {"survey"} type
 * @property {number} number number.
 */
/**
 * What is emulated in one direction, as the command line spells it.
 * @typedef {object} DirectionConditions
 * @property {string} delay text of up to 200 characters. A delay profile: `interfaces.link.delay_profile`.
 * @property {string} [loss] text of up to 200 characters ("0"). A loss model: `interfaces.link.loss_model`.
 * @property {string} [service] text of up to 200 characters ("datagram"). `datagram` or `in-order`.
 */
/**
 * Holder: Other conditions of the emulated way to the robot, from now on.
 * @typedef {object} Impair
 * @property {"impair"} type
 * @property {number} number number.
 * @property {string} epoch epoch.
 * @property {DirectionConditions|null} [forward] map of `delay`, `loss` ("0"), `service` ("datagram") (absent). To the robot; absent: as it is.
 * @property {DirectionConditions|null} [backward] map of `delay`, `loss` ("0"), `service` ("datagram") (absent). Back, the same.
 */
/**
 * Either side: What can't be taken, to its sender.
 * @typedef {object} Problem
 * @property {"problem"} type
 * @property {"malformed"|"unknown-type"|"not-allowed"|"out-of-range"|"too-large"|"too-fast"|"hello-expected"|"hello-late"|"version"|"refused"|"full"|"lease"|"stale-epoch"|"stopping"|"failed"} code `malformed`, `unknown-type`, `not-allowed`, `out-of-range`, `too-large`, `too-fast`, `hello-expected`, `hello-late`, `version`, `refused`, `full`, `lease`, `stale-epoch`, `stopping`, `failed`. Why; see below.
 * @property {string} text text. For people.
 * @property {number|null} [number] number (absent). Of what it's about, where that's known.
 * @property {boolean} [fatal] boolean (false). Whether the connection ends.
 * @property {string} [field] text of up to 200 characters (empty). Of an `Impair`: which of `delay`, `loss` and `service` it's about; empty where it's none of them.
 */
/**
 * Joint limits, each of shape (n,); of prismatic joints in m for rad.
 * @typedef {object} Limits
 * @property {Array<number>} q_min joints. Lowest position [rad].
 * @property {Array<number>} q_max joints. Highest position [rad], above q_min.
 * @property {Array<number>} qd_max joints. Largest speed [rad/s], positive.
 * @property {Array<number>} qdd_max joints. Largest acceleration [rad/s²], positive.
 * @property {Array<number>} [qddd_max] joints (none). Largest jerk [rad/s³], positive; qdd_max / 0.1 s unless given (an assumption).
 */
/**
 * Server: Who may command; sent when it changes.
 * @typedef {object} Lease
 * @property {"lease"} type
 * @property {"free"|"held"|"ending"} state `free`, `held`, `ending`. `ending`: it's over, and the robot isn't at rest yet; ask again later.
 * @property {string|null} [epoch] epoch (absent). Of the lease in force; told to the holder, and to who shares it.
 * @property {string|null} [holder] text of 1 to 100 characters (absent). Name of the holder.
 * @property {boolean} [yours] boolean (false). Whether the receiver holds it.
 * @property {number|null} [answers] number (absent). Number of the receiver's request that this answers.
 * @property {"released"|"expired"|"taken over"|null} [ended] `released`, `expired`, `taken over` (absent). How the one before ended; absent: there was none.
 * @property {boolean} [shared] boolean (false). Whether the receiver shares it: it commands under the epoch, but doesn't keep it.
 */
/**
 * Server: The client may go on; what there is.
 * @typedef {object} Welcome
 * @property {"welcome"} type
 * @property {number} protocol number. Version of the protocol that is spoken.
 * @property {string} session text of up to 200 characters. Secret: names this session, for a later `Hello`.
 * @property {"viewer"|"operator"|"admin"|"site"} role `viewer`, `operator`, `admin`, `site`. What the client may do.
 * @property {string} robot text of up to 200 characters. Name of its model.
 * @property {number} dof integer from 1 to 64. Its joints, n.
 * @property {Limits} limits map of `q_min`, `q_max`, `qd_max`, `qdd_max`, `qddd_max` (none). Position [rad], speed, acceleration, jerk [rad/s, /s², /s³].
 * @property {Object<string, Array<number>>} poses map of joints. Named joint values [rad].
 * @property {number} now real. Session time when this was sent [s].
 * @property {Lease} lease `lease`. As it is now.
 * @property {number} lease_timeout real > 0 up to 3600. It expires so long after the last beat or order [s].
 * @property {Array<number>} [rates] up to 100 × real > 0 up to 10⁴ (none). Rates at which frames are broadcast [1/s].
 * @property {boolean} [resumed] boolean (false). Whether the session that was asked for goes on.
 * @property {string} [instance] text of up to 200 characters (empty). Names this run of the server; with another one the timeline is another: forget all.
 * @property {string} [server] text of up to 200 characters (empty). Name and version of the program.
 */
/**
 * Server: The real robot as it was last heard of; the newest one counts.
 * @typedef {object} State
 * @property {"state"} type
 * @property {number} number number. Counts up.
 * @property {number} t real. Session time of the measurement [s].
 * @property {Array<number>} q joints. Measured joints [rad].
 * @property {number} play real. Time on the timeline that it plays [s].
 * @property {number} pace real. How fast; 1: as planned, 0: it waits.
 * @property {number} D real. The robot's timeline less session time [s].
 * @property {number} following_error real. Largest deviation of a joint from its reference [rad].
 * @property {string|null} [epoch] epoch (absent). Of the lease that it follows; absent: none.
 * @property {boolean} [connected] boolean (true). Whether the robot is heard of.
 * @property {string} [halted] text (empty). Why it stopped by itself: it takes no command until the holder sends `Resume`, once it's at rest.
 * @property {number} [corrections] count (0). How often the virtual robot was put where the real one goes.
 * @property {Array<number>|null} [reference] joints (absent). What the robot's own timeline asked for at `t` [rad]; absent: it hasn't said. Equal to the virtual robot at `play` unless the two plans have parted.
 * @property {number|null} [round_trip] real (absent). Newest time that a message to the robot and the answer were under way, what the robot took in between left out [s]; absent before the first.
 * @property {Array<[number, number|null]>} [messages] up to 64 × [real, real or null] (none). [sent, arrived]: messages to the robot that the emulated link has delivered or lost (null) since the state before, session time [s]. What the real network adds isn't in it.
 * @property {Array<[number, Array<number>]>} [late] up to 128 × [real, joints] (none). [t, joints]: measurements that came after later ones, one of six; each for 0.2 s, so some come twice.
 */
/**
 * Sums over the newest packets.
 * @typedef {object} LinkFigures
 * @property {number} [packets] count (0). Sent in the last `span`, those still under way among them.
 * @property {number|null} [lost] real from 0 to 1 (absent). Share of them; absent: nothing is known.
 * @property {number|null} [median] real ≥ 0 (absent). Delay of those that arrived [s].
 * @property {number|null} [p95] real ≥ 0 (absent). Delay that 95 % of those kept within [s].
 * @property {number|null} [span] real ≥ 0 (absent). How long they were sent, up to now [s].
 */
/**
 * Server: How the way to the robot is.
 * @typedef {object} Network
 * @property {"network"} type
 * @property {DirectionConditions} forward map of `delay`, `loss` ("0"), `service` ("datagram"). What is emulated to the robot, as in `Impair`.
 * @property {DirectionConditions} backward map of `delay`, `loss` ("0"), `service` ("datagram"). What is emulated back.
 * @property {LinkFigures} there map of `packets` (0), `lost` (absent), `median` (absent), `p95` (absent), `span` (absent). What it did to the packets of the last 30 s, since it changed: `packets` sent in the last `span` [s], those still under way among them; `lost`: share of them; `median`, `p95`: delay of those that arrived [s]. Absent where nothing is known.
 * @property {LinkFigures} back map of `packets` (0), `lost` (absent), `median` (absent), `p95` (absent), `span` (absent). The same of the way back.
 * @property {LinkFigures} round_trip map of `packets` (0), `lost` (absent), `median` (absent), `p95` (absent), `span` (absent). The same, without `lost` and `span`, of round trips between the sites with the network beneath.
 * @property {number} [seed] count (0). Of what is random in the emulation.
 * @property {number|null} [changed_at] real (absent). Session time of the last change [s]; absent: there was none.
 * @property {string} [changed_by] text of up to 200 characters (empty). Name of who made it.
 * @property {string} [robot] text of up to 200 characters (empty). Where the robot's site is.
 * @property {string} [problem] text (empty). Why there's no connection to it.
 * @property {number|null} [clock] real ≥ 0 (absent). By how much the robot may err about session time [s].
 * @property {string} [link_loss] text of up to 200 characters (empty). What the robot does when nothing is heard, `halt` or `hold`; empty while that isn't known.
 * @property {number|null} [timeout] real ≥ 0 (absent). So long after the last message that counts it does that [s].
 * @property {number|null} [max_age] real ≥ 0 (absent). Older messages don't count under `halt` [s].
 * @property {number|null} [offset] real (absent). D, where it's fixed [s]; absent: it adapts, or isn't known.
 * @property {string} [advice] text (empty). What is likely to go wrong under these conditions, for people.
 * @property {number|null} [answers] number (absent). Number of the receiver's request that this answers.
 */
/**
 * How fast a mobile robot may be commanded, and how fast that may change.
 * @typedef {object} DriveLimits
 * @property {number} v_max real. Largest linear speed [m/s], either way, positive.
 * @property {number} w_max real. Largest angular speed [rad/s], either way, positive.
 * @property {number} a_max real. Largest linear acceleration [m/s²], positive.
 * @property {number} alpha_max real. Largest angular acceleration [rad/s²], positive.
 */
/**
 * Server: The client may go on; what there is.
 * @typedef {object} MobileWelcome
 * @property {"mobile-welcome"} type
 * @property {number} protocol number. Version of the protocol that is spoken.
 * @property {string} session text of up to 200 characters. Secret: names this session, for a later `Hello`.
 * @property {"viewer"|"operator"|"admin"|"site"} role `viewer`, `operator`, `admin`, `site`. What the client may do.
 * @property {string} robot text of up to 200 characters. Name of the robot's model.
 * @property {DriveLimits} limits map of `v_max`, `w_max`, `a_max`, `alpha_max`. `v_max` [m/s], `w_max` [rad/s], `a_max` [m/s²], `alpha_max` [rad/s²].
 * @property {number} period real > 0. T: the virtual robot takes a command so often [s].
 * @property {number} holds real > 0. A `drive` order counts for so long after it was issued [s].
 * @property {number} now real. Session time [s].
 * @property {Lease} lease `lease`. As it is now.
 * @property {number} lease_timeout real > 0 up to 3600. It expires so long after the last beat or order [s].
 * @property {boolean} [resumed] boolean (false). Whether the session that was asked for goes on.
 * @property {string} [instance] text of up to 200 characters (empty). Names this run of the server; with another one forget all.
 * @property {string} [server] text of up to 200 characters (empty). Name and version of the program.
 * @property {string} [room] text of up to 200 characters (empty). Name of the room.
 */
/** Where the middle of the driving axle is, in the world frame. @typedef {[number, number, number]} Posture */
/** What a mobile robot is told to do. @typedef {[number, number]} Drive */
/**
 * Server: Where both robots are; the newest one counts.
 * @typedef {object} Postures
 * @property {"postures"} type
 * @property {number} number number. Counts up.
 * @property {number} now real. Session time when it was made [s].
 * @property {Posture} virtual [`x`, `y`, `theta`]. Of the virtual robot, now [m, m, rad].
 * @property {Drive} command [`v`, `w`]. What it drives [m/s, rad/s].
 * @property {Posture} estimate [`x`, `y`, `theta`]. Where the real robot is thought to come to with all commands so far (the posture estimator). Source: Han et al., eq. (8)–(10).
 * @property {number|null} [t] real (absent). Session time of the newest measurement [s]; absent before the first, as the next two.
 * @property {Posture|null} [real] [`x`, `y`, `theta`] (absent). Where the real robot took itself to be.
 * @property {Drive|null} [drive] [`v`, `w`] (absent). What its motors are told.
 * @property {number|null} [D] real (absent). The time of the path that it's to play less session time, by the clock as the robot has it, without what braking needs [s]; absent where its architecture has none.
 * @property {boolean} [starved] boolean (false). Whether it's slower than it should be, as it knows nothing newer.
 * @property {number|null} [path_error] real ≥ 0 (absent). Distance from the nearest place of the virtual robot's path near the one before [m]; absent while it doesn't follow.
 * @property {number|null} [time_difference] real ≥ 0 (absent). How much later it is there [s]; 0 where both stand.
 * @property {string|null} [epoch] epoch (absent). Of the drive that it follows; absent: none.
 * @property {boolean} [connected] boolean (true). Whether the robot is heard of.
 * @property {string} [halted] text (empty). As in `state`.
 * @property {number} [drives] count (0). How often the virtual robot was put where the real one stood: a drive begins with each lease and `Resume`, and after a stop.
 * @property {number|null} [round_trip] real (absent). As in `state`.
 * @property {Array<[number, number|null]>} [messages] up to 64 × [real, real or null] (none). As in `state`.
 * @property {Posture|null} [drawn] [`x`, `y`, `theta`] (absent). Where the virtual robot is drawn, where the posture estimator has it now; absent where that's `virtual`, as in architectures without one.
 */
/**
 * Where the robot is to go.
 * @typedef {object} Goal
 * @property {number} x real from −1000 to 1000. [m].
 * @property {number} y real from −1000 to 1000. [m].
 * @property {number|null} [heading] real from −1000 to 1000 (absent). In which it's to end [rad]; None for any.
 */
/**
 * Go to a goal, or to the place of the list that has that name.
 * @typedef {object} MoveJob
 * @property {"move"} do
 * @property {number} number integer from 1 to 2147483647. By which it's known; it stays the same where the job is put elsewhere.
 * @property {Goal|string} to map of `x`, `y`, `heading` (absent) or text of 1 to 40 characters. Where: a goal, or the name of a place of the list.
 */
/**
 * Say something.
 * @typedef {object} VoiceJob
 * @property {"voice"} do
 * @property {number} number integer from 1 to 2147483647. By which it's known; it stays the same where the job is put elsewhere.
 * @property {string} text text of 1 to 400 characters.
 */
/**
 * Show something on the robot's screen; it stays there until something else is shown.
 * @typedef {object} MessageJob
 * @property {"message"} do
 * @property {number} number integer from 1 to 2147483647. By which it's known; it stays the same where the job is put elsewhere.
 * @property {string} text text of 1 to 400 characters.
 */
/**
 * Wait so many seconds; without a number until the key is pressed.
 * @typedef {object} WaitJob
 * @property {"wait"} do
 * @property {number} number integer from 1 to 2147483647. By which it's known; it stays the same where the job is put elsewhere.
 * @property {number|null} [seconds] real from 0 to 86400 (absent). For so long [s]; None: until the key is pressed.
 */
/**
 * Let the arm carry out a VAL-II program of that name: the `source`'s, or one that the arm's site has.
 * @typedef {object} ArmJob
 * @property {"arm"} do
 * @property {number} number integer from 1 to 2147483647. By which it's known; it stays the same where the job is put elsewhere.
 * @property {string} program text of 1 to 40 characters. Its name.
 * @property {string} [source] text of up to 16000 characters (empty). The file in which it is; empty for a program that the arm's site has.
 */
/**
 * Jobs in their order, and the places that they name. Every edit makes another list.
 * @typedef {object} JobList
 * @property {Array<MoveJob|VoiceJob|MessageJob|WaitJob|ArmJob>} [jobs] up to 64 × `move` or `voice` or `message` or `wait` or `arm` (none). Each number once.
 * @property {Object<string, Goal>} [places] map of map of `x`, `y`, `heading` (absent) (none). By name.
 */
/**
 * How far a job is.
 * @typedef {object} JobProgress
 * @property {number} number integer from 1 to 2147483647. Of the job.
 * @property {"planned"|"running"|"paused"|"done"|"failed"|"aborted"} [stage] `planned`, `running`, `paused`, `done`, `failed`, `aborted` (`planned`).
 * @property {string} [reason] text of up to 500 characters (empty). Why it's paused or has failed.
 * @property {number|null} [left] real from 0 to 86400 (absent). Of a WAIT that's paused, what is left of it [s].
 */
/**
 * How far a list is.
 * @typedef {object} Progress
 * @property {"planned"|"running"|"paused"|"done"|"failed"|"aborted"} [stage] `planned`, `running`, `paused`, `done`, `failed`, `aborted` (`planned`).
 * @property {Array<JobProgress>} [jobs] up to 64 × map of `number`, `stage` (`planned`), `reason` (empty), `left` (absent) (none). In the list's order.
 * @property {string} [reason] text of up to 500 characters (empty). Why it's paused, has failed, or was aborted.
 */
/**
 * What is likely to become of a job.
 * @typedef {object} JobForecast
 * @property {number} number number.
 * @property {number} begins real ≥ 0. After so long [s], times that nobody knows left out.
 * @property {number|null} [lasts] real ≥ 0 (absent). For so long [s]; None where nobody knows.
 * @property {Array<[number, number]>} [route] up to 720 × [real, real] (none). Of a move [m].
 * @property {string} [problem] text (empty). Why it'd fail; the list ends there.
 */
/**
 * Server: What the robot does by itself, and the list of jobs; the newest one counts.
 * @typedef {object} Tasks
 * @property {"tasks"} type
 * @property {"nothing"|"goal"|"jobs"} [doing] `nothing`, `goal`, `jobs` (`nothing`). What that is.
 * @property {"idle"|"driving"|"waiting"|"arrived"|"failed"|"ended"} [journey] `idle`, `driving`, `waiting`, `arrived`, `failed`, `ended` (`idle`).
 * @property {string} [reason] text (empty). Why it waits or couldn't get there.
 * @property {Goal|null} [goal] map of `x`, `y`, `heading` (absent) (absent). Where to.
 * @property {Array<[number, number]>} [route] up to 720 × [real, real] (none). The way there [m].
 * @property {number} [left] real ≥ 0 (0). How much of it is left [m].
 * @property {JobList} [jobs] map of `jobs` (none), `places` (none) (none). The list.
 * @property {Progress} [progress] map of `stage` (`planned`), `jobs` (none), `reason` (empty) (none). How far that is.
 * @property {Array<JobForecast>|null} [forecast] up to 64 × map of `number`, `begins`, `lasts` (absent), `route` (none), `problem` (empty) (absent). What the dry run said of this list; None where there was none since it was changed.
 * @property {"stop"|"carry-on"|null} [loss] `stop`, `carry-on` (absent). What follows when the operator is lost; None before the robot is met.
 * @property {string} [shows] text (empty). What stands on its screen.
 * @property {string} [says] text (empty). What it's saying.
 * @property {string} [problem] text (empty). What is wrong with the file of the list; empty if nothing is.
 * @property {number|null} [answers] count (absent). Number of the receiver's order that this answers.
 */
/**
 * Server: What the robot sees of its surroundings; the newest one counts.
 * @typedef {object} Seen
 * @property {"seen"} type
 * @property {number} time real from −10¹² to 10¹². By the robot's own clock [s].
 * @property {Array<[number, number]>} [points] up to 720 × [real, real] (none). Where its laser's beams ended, on the map [m].
 * @property {[number, number, number]|null} [doubt] [real, real, real] (absent). Of its place: variance of x, covariance, variance of y [m²]; None where nobody knows.
 */
/**
 * Server: The known map of where the robot drives.
 * @typedef {object} Plan
 * @property {"plan"} type
 * @property {[number, number]} size [real, real]. Length and width of the floor [m].
 * @property {Array<Array<[number, number]>>} [things] up to 1000 × up to 64 × [real, real] (none). Outlines of what the map knows [m].
 * @property {Array<[number, number]>} [via] up to 720 × [real, real] (none). Via points [m].
 * @property {[number, number, number]} [robot] [real ≥ 0, real ≥ 0, real ≥ 0] ([0, 0, 0]). What it reaches ahead and back from its axle, and its width [m].
 */
/**
 * What a robot, or a list of jobs, is asked to do: `go`, `do`, `jobs` or `halt`.
 * @typedef {object} RobotTask
 * @property {Goal|null} [go] map of `x`, `y`, `heading` (absent) (absent). Drive there; a list of jobs that is being done is paused.
 * @property {"run"|"pause"|"resume"|"abort"|"key"|"dry-run"|null} [do] `run`, `pause`, `resume`, `abort`, `key`, `dry-run` (absent).
 * @property {JobList|null} [jobs] map of `jobs` (none), `places` (none) (absent). Take this list in place of the one before; not while that is being done.
 * @property {Progress|null} [progress] map of `stage` (`planned`), `jobs` (none), `reason` (empty) (absent). How far that list is already; None: as far as is known of jobs with the same number that are unchanged.
 * @property {string|null} [halt] text (absent). Between sites: stop, and leave off whatever it does by itself, for this reason; a list of jobs is paused.
 */
/**
 * Holder: Let the robot do something by itself. The answer is a `Tasks` or a `Problem`.
 * @typedef {object} TaskOrder
 * @property {"task"} type
 * @property {number} number number. The client's own; the answer has it, too.
 * @property {RobotTask} task map of `go` (absent), `do` (absent), `jobs` (absent), `progress` (absent), `halt` (absent). What.
 * @property {string|null} [epoch] epoch (absent). Of the control lease.
 */
const WORDS_1 = new Set(["accepted", "postponed", "rejected"]);
const WORDS_2 = new Set(["other", "overruled", "not-following"]);
const WORDS_3 = new Set(["predicted", "confirmed", "falsified"]);
const WORDS_4 = new Set(["malformed", "unknown-type", "not-allowed", "out-of-range", "too-large", "too-fast", "hello-expected", "hello-late", "version", "refused", "full", "lease", "stale-epoch", "stopping", "failed"]);
const WORDS_5 = new Set(["free", "held", "ending"]);
const WORDS_6 = new Set(["released", "expired", "taken over"]);
const WORDS_7 = new Set(["viewer", "operator", "admin", "site"]);
const WORDS_8 = new Set(["planned", "running", "paused", "done", "failed", "aborted"]);
const WORDS_9 = new Set(["nothing", "goal", "jobs"]);
const WORDS_10 = new Set(["idle", "driving", "waiting", "arrived", "failed", "ended"]);
const WORDS_11 = new Set(["stop", "carry-on"]);
function checkReceipt(m) {
  map(m, "Receipt");
  whole(m.command_id, 0, WHOLE, "Receipt.command_id");
  word(m.status, WORDS_1, "Receipt.status");
  if (m.issued_at === undefined || m.issued_at === null) m.issued_at = null;
  else real(m.issued_at, -1e9, 1e9, "Receipt.issued_at");
  if (m.asked_at === undefined || m.asked_at === null) m.asked_at = null;
  else real(m.asked_at, -1e9, 1e9, "Receipt.asked_at");
  if (m.execute_at === undefined || m.execute_at === null) m.execute_at = null;
  else real(m.execute_at, -1e9, 1e9, "Receipt.execute_at");
  if (m.end === undefined || m.end === null) m.end = null;
  else real(m.end, -1e9, 1e9, "Receipt.end");
  if (m.q === undefined || m.q === null) m.q = null;
  else {
    list(m.q, 1, 64, "Receipt.q");
    for (const x of m.q) real(x, -1e9, 1e9, "Receipt.q");
  }
  if (m.reason === undefined) m.reason = "";
  else text(m.reason, 0, 2000, "Receipt.reason");
  if (m.version === undefined) m.version = 0;
  else whole(m.version, 0, WHOLE, "Receipt.version");
  if (m.shift === undefined) m.shift = 0.0;
  else real(m.shift, -1e9, 1e9, "Receipt.shift");
  if (m.superseded_by === undefined || m.superseded_by === null) m.superseded_by = null;
  else whole(m.superseded_by, 0, WHOLE, "Receipt.superseded_by");
  if (m.undone === undefined) m.undone = false;
  else flag(m.undone, "Receipt.undone");
  if (m.shifted === undefined) m.shifted = [];
  else {
    list(m.shifted, 0, Infinity, "Receipt.shifted");
    for (const x of m.shifted) whole(x, 1, WHOLE, "Receipt.shifted");
  }
  if (m.superseded === undefined) m.superseded = [];
  else {
    list(m.superseded, 0, Infinity, "Receipt.superseded");
    for (const x of m.superseded) whole(x, 1, WHOLE, "Receipt.superseded");
  }
  if (m.hindrance === undefined) m.hindrance = "";
  else text(m.hindrance, 0, 2000, "Receipt.hindrance");
}
function checkOutcome(m) {
  map(m, "outcome");
  if (m.type !== undefined && m.type !== "outcome") fail("outcome", "outcome");
  whole(m.number, 1, WHOLE, "outcome.number");
  real(m.made_at, -1e9, 1e9, "outcome.made_at");
  if (m.receipt === undefined || m.receipt === null) m.receipt = null;
  else checkReceipt(m.receipt);
  if (m.refusal === undefined) m.refusal = "";
  else text(m.refusal, 0, 2000, "outcome.refusal");
  if (m.revision === undefined) m.revision = 0;
  else whole(m.revision, 0, WHOLE, "outcome.revision");
  if (m.code === undefined) m.code = "other";
  else {
    if (typeof m.code === "string" && !WORDS_2.has(m.code)) m.code = "other";
    word(m.code, WORDS_2, "outcome.code");
  }
}
function checkAnswer(m) {
  map(m, "answer");
  if (m.type !== undefined && m.type !== "answer") fail("answer", "answer");
  whole(m.number, 0, WHOLE, "answer.number");
  real(m.t, -1e9, 1e9, "answer.t");
  real(m.made_at, -1e9, 1e9, "answer.made_at");
  list(m.q, 1, 64, "answer.q");
  for (const x of m.q) real(x, -1e9, 1e9, "answer.q");
  word(m.status, WORDS_3, "answer.status");
  real(m.now, -1e9, 1e9, "answer.now");
  if (m.falsified_by === undefined || m.falsified_by === null) m.falsified_by = null;
  else whole(m.falsified_by, -WHOLE, WHOLE, "answer.falsified_by");
}
function checkBroadcast(m) {
  map(m, "broadcast");
  if (m.type !== undefined && m.type !== "broadcast") fail("broadcast", "broadcast");
  whole(m.number, 0, WHOLE, "broadcast.number");
  real(m.t, -1e9, 1e9, "broadcast.t");
  real(m.made_at, -1e9, 1e9, "broadcast.made_at");
  list(m.q, 1, 64, "broadcast.q");
  for (const x of m.q) real(x, -1e9, 1e9, "broadcast.q");
  whole(m.since, 0, WHOLE, "broadcast.since");
  whole(m.through, 0, WHOLE, "broadcast.through");
  if (m.status === undefined) m.status = "predicted";
  else word(m.status, WORDS_3, "broadcast.status");
  if (m.falsified_by === undefined || m.falsified_by === null) m.falsified_by = null;
  else whole(m.falsified_by, -WHOLE, WHOLE, "broadcast.falsified_by");
  if (m.falsified === undefined) m.falsified = [];
  else {
    list(m.falsified, 0, 256, "broadcast.falsified");
    for (const x of m.falsified) {
      list(x, 3, 3, "broadcast.falsified");
      whole(x[0], 0, WHOLE, "broadcast.falsified");
      whole(x[1], 0, WHOLE, "broadcast.falsified");
      if (x[2] !== null) whole(x[2], -WHOLE, WHOLE, "broadcast.falsified");
    }
  }
}
function checkCompact(m) {
  map(m, "compact");
  if (m.type !== undefined && m.type !== "compact") fail("compact", "compact");
  like(m.q, /^(?:[A-Za-z0-9+/]{4})*(?:[A-Za-z0-9+/]{2}==|[A-Za-z0-9+/]{3}=)?$/, "compact.q");
  if (m.since === undefined || m.since === null) m.since = null;
  else whole(m.since, 0, WHOLE, "compact.since");
  if (m.falsified === undefined) m.falsified = [];
  else {
    list(m.falsified, 0, 256, "compact.falsified");
    for (const x of m.falsified) {
      list(x, 3, 3, "compact.falsified");
      whole(x[0], 0, WHOLE, "compact.falsified");
      whole(x[1], 0, WHOLE, "compact.falsified");
      if (x[2] !== null) whole(x[2], -WHOLE, WHOLE, "compact.falsified");
    }
  }
}
function checkScene(m) {
  map(m, "scene");
  if (m.type !== undefined && m.type !== "scene") fail("scene", "scene");
  whole(m.number, 1, WHOLE, "scene.number");
  text(m.robot, 0, 200, "scene.robot");
  list(m.initial, 1, 64, "scene.initial");
  for (const x of m.initial) real(x, -1e9, 1e9, "scene.initial");
  real(m.start, -1e9, 1e9, "scene.start");
  real(m.end, -1e9, 1e9, "scene.end");
  whole(m.segments, 0, WHOLE, "scene.segments");
  whole(m.edit, 0, WHOLE, "scene.edit");
  real(m.now, -1e9, 1e9, "scene.now");
  if (m.rate === undefined || m.rate === null) m.rate = null;
  else real(m.rate, 5e-324, 10000, "scene.rate");
}
function checkSegmentRow(m) {
  list(m, 3, Infinity, "SegmentRow");
  real(m[0], 5e-324, 1e9, "SegmentRow.duration");
  if (m[1] !== null) whole(m[1], -WHOLE, WHOLE, "SegmentRow.command_id");
  list(m[2], 1, 32, "SegmentRow.coefficients");
  for (const x of m[2]) {
    list(x, 1, 64, "SegmentRow.coefficients");
    for (const y of x) real(y, -REAL, REAL, "SegmentRow.coefficients");
  }
  if (m[3] !== undefined && m[3] !== null) real(m[3], -1e9, 1e9, "SegmentRow.start");
}
function checkHistory(m) {
  map(m, "history");
  if (m.type !== undefined && m.type !== "history") fail("history", "history");
  whole(m.edit, 0, WHOLE, "history.edit");
  whole(m.index, 0, WHOLE, "history.index");
  if (m.dof === undefined) m.dof = 0;
  else whole(m.dof, 0, 64, "history.dof");
  if (m.start === undefined) m.start = 0.0;
  else real(m.start, -1e9, 1e9, "history.start");
  if (m.segments === undefined) m.segments = [];
  else {
    list(m.segments, 0, 256, "history.segments");
    for (const x of m.segments) checkSegmentRow(x);
  }
}
function checkChange(m) {
  map(m, "change");
  if (m.type !== undefined && m.type !== "change") fail("change", "change");
  whole(m.edit, 1, WHOLE, "change.edit");
  whole(m.first, 0, WHOLE, "change.first");
  real(m.end, -1e9, 1e9, "change.end");
  if (m.command_id === undefined || m.command_id === null) m.command_id = null;
  else whole(m.command_id, -WHOLE, WHOLE, "change.command_id");
  if (m.base === undefined || m.base === null) m.base = m.edit - 1;
  else whole(m.base, 0, WHOLE, "change.base");
  if (m.tail === undefined || m.tail === null) m.tail = null;
  else whole(m.tail, 0, WHOLE, "change.tail");
  if (m.tail_start === undefined || m.tail_start === null) m.tail_start = m.end;
  else real(m.tail_start, -1e9, 1e9, "change.tail_start");
  if (m.dof === undefined) m.dof = 0;
  else whole(m.dof, 0, 64, "change.dof");
  if (m.start === undefined) m.start = 0.0;
  else real(m.start, -1e9, 1e9, "change.start");
  if (m.segments === undefined) m.segments = [];
  else {
    list(m.segments, 0, 256, "change.segments");
    for (const x of m.segments) checkSegmentRow(x);
  }
}
function checkPulse(m) {
  map(m, "pulse");
  if (m.type !== undefined && m.type !== "pulse") fail("pulse", "pulse");
  whole(m.edit, 0, WHOLE, "pulse.edit");
  real(m.now, -1e9, 1e9, "pulse.now");
  if (m.past === undefined) m.past = m.now;
  else if (m.past !== null) real(m.past, -1e9, 1e9, "pulse.past");
}
function checkPing(m) {
  map(m, "ping");
  if (m.type !== undefined && m.type !== "ping") fail("ping", "ping");
  whole(m.number, 1, WHOLE, "ping.number");
  real(m.t, -1e12, 1e12, "ping.t");
}
function checkPong(m) {
  map(m, "pong");
  if (m.type !== undefined && m.type !== "pong") fail("pong", "pong");
  whole(m.number, 1, WHOLE, "pong.number");
  real(m.t, -1e12, 1e12, "pong.t");
  real(m.received, -1e12, 1e12, "pong.received");
  real(m.answered, -1e12, 1e12, "pong.answered");
}
function checkProblem(m) {
  map(m, "problem");
  if (m.type !== undefined && m.type !== "problem") fail("problem", "problem");
  word(m.code, WORDS_4, "problem.code");
  text(m.text, 0, 2000, "problem.text");
  if (m.number === undefined || m.number === null) m.number = null;
  else whole(m.number, 1, WHOLE, "problem.number");
  if (m.fatal === undefined) m.fatal = false;
  else flag(m.fatal, "problem.fatal");
  if (m.field === undefined) m.field = "";
  else text(m.field, 0, 200, "problem.field");
}
function checkLimits(m) {
  map(m, "Limits");
  list(m.q_min, 1, 64, "Limits.q_min");
  for (const x of m.q_min) real(x, -1e9, 1e9, "Limits.q_min");
  list(m.q_max, 1, 64, "Limits.q_max");
  for (const x of m.q_max) real(x, -1e9, 1e9, "Limits.q_max");
  list(m.qd_max, 1, 64, "Limits.qd_max");
  for (const x of m.qd_max) real(x, -1e9, 1e9, "Limits.qd_max");
  list(m.qdd_max, 1, 64, "Limits.qdd_max");
  for (const x of m.qdd_max) real(x, -1e9, 1e9, "Limits.qdd_max");
  if (m.qddd_max === undefined) m.qddd_max = [];
  else {
    list(m.qddd_max, 1, 64, "Limits.qddd_max");
    for (const x of m.qddd_max) real(x, -1e9, 1e9, "Limits.qddd_max");
  }
}
function checkLease(m) {
  map(m, "lease");
  if (m.type !== undefined && m.type !== "lease") fail("lease", "lease");
  word(m.state, WORDS_5, "lease.state");
  if (m.epoch === undefined || m.epoch === null) m.epoch = null;
  else like(m.epoch, /^[1-9][0-9]{0,19}$/, "lease.epoch");
  if (m.holder === undefined || m.holder === null) m.holder = null;
  else text(m.holder, 1, 100, "lease.holder");
  if (m.yours === undefined) m.yours = false;
  else flag(m.yours, "lease.yours");
  if (m.answers === undefined || m.answers === null) m.answers = null;
  else whole(m.answers, 1, WHOLE, "lease.answers");
  if (m.ended === undefined || m.ended === null) m.ended = null;
  else word(m.ended, WORDS_6, "lease.ended");
  if (m.shared === undefined) m.shared = false;
  else flag(m.shared, "lease.shared");
}
function checkWelcome(m) {
  map(m, "welcome");
  if (m.type !== undefined && m.type !== "welcome") fail("welcome", "welcome");
  whole(m.protocol, 1, WHOLE, "welcome.protocol");
  text(m.session, 0, 200, "welcome.session");
  word(m.role, WORDS_7, "welcome.role");
  text(m.robot, 0, 200, "welcome.robot");
  whole(m.dof, 1, 64, "welcome.dof");
  checkLimits(m.limits);
  map(m.poses, "welcome.poses");
  for (const x of Object.values(m.poses)) {
    list(x, 1, 64, "welcome.poses");
    for (const y of x) real(y, -1e9, 1e9, "welcome.poses");
  }
  real(m.now, -1e9, 1e9, "welcome.now");
  checkLease(m.lease);
  real(m.lease_timeout, 5e-324, 3600, "welcome.lease_timeout");
  if (m.rates === undefined) m.rates = [];
  else {
    list(m.rates, 0, 100, "welcome.rates");
    for (const x of m.rates) real(x, 5e-324, 10000, "welcome.rates");
  }
  if (m.resumed === undefined) m.resumed = false;
  else flag(m.resumed, "welcome.resumed");
  if (m.instance === undefined) m.instance = "";
  else text(m.instance, 0, 200, "welcome.instance");
  if (m.server === undefined) m.server = "";
  else text(m.server, 0, 200, "welcome.server");
}
function checkState(m) {
  map(m, "state");
  if (m.type !== undefined && m.type !== "state") fail("state", "state");
  whole(m.number, 1, WHOLE, "state.number");
  real(m.t, -1e9, 1e9, "state.t");
  list(m.q, 1, 64, "state.q");
  for (const x of m.q) real(x, -1e9, 1e9, "state.q");
  real(m.play, -1e9, 1e9, "state.play");
  real(m.pace, -1e9, 1e9, "state.pace");
  real(m.D, -1e9, 1e9, "state.D");
  real(m.following_error, -1e9, 1e9, "state.following_error");
  if (m.epoch === undefined || m.epoch === null) m.epoch = null;
  else like(m.epoch, /^[1-9][0-9]{0,19}$/, "state.epoch");
  if (m.connected === undefined) m.connected = true;
  else flag(m.connected, "state.connected");
  if (m.halted === undefined) m.halted = "";
  else text(m.halted, 0, 2000, "state.halted");
  if (m.corrections === undefined) m.corrections = 0;
  else whole(m.corrections, 0, WHOLE, "state.corrections");
  if (m.reference === undefined || m.reference === null) m.reference = null;
  else {
    list(m.reference, 1, 64, "state.reference");
    for (const x of m.reference) real(x, -1e9, 1e9, "state.reference");
  }
  if (m.round_trip === undefined || m.round_trip === null) m.round_trip = null;
  else real(m.round_trip, -1e9, 1e9, "state.round_trip");
  if (m.messages === undefined) m.messages = [];
  else {
    list(m.messages, 0, 64, "state.messages");
    for (const x of m.messages) {
      list(x, 2, 2, "state.messages");
      real(x[0], -1e9, 1e9, "state.messages");
      if (x[1] !== null) real(x[1], -1e9, 1e9, "state.messages");
    }
  }
  if (m.late === undefined) m.late = [];
  else {
    list(m.late, 0, 128, "state.late");
    for (const x of m.late) {
      list(x, 2, 2, "state.late");
      real(x[0], -1e9, 1e9, "state.late");
      list(x[1], 1, 64, "state.late");
      for (const y of x[1]) real(y, -1e9, 1e9, "state.late");
    }
  }
}
function checkDirectionConditions(m) {
  map(m, "DirectionConditions");
  text(m.delay, 0, 200, "DirectionConditions.delay");
  if (m.loss === undefined) m.loss = "0";
  else text(m.loss, 0, 200, "DirectionConditions.loss");
  if (m.service === undefined) m.service = "datagram";
  else text(m.service, 0, 200, "DirectionConditions.service");
}
function checkLinkFigures(m) {
  map(m, "LinkFigures");
  if (m.packets === undefined) m.packets = 0;
  else whole(m.packets, 0, WHOLE, "LinkFigures.packets");
  if (m.lost === undefined || m.lost === null) m.lost = null;
  else real(m.lost, 0, 1, "LinkFigures.lost");
  if (m.median === undefined || m.median === null) m.median = null;
  else real(m.median, 0, 1e9, "LinkFigures.median");
  if (m.p95 === undefined || m.p95 === null) m.p95 = null;
  else real(m.p95, 0, 1e9, "LinkFigures.p95");
  if (m.span === undefined || m.span === null) m.span = null;
  else real(m.span, 0, 1e9, "LinkFigures.span");
}
function checkNetwork(m) {
  map(m, "network");
  if (m.type !== undefined && m.type !== "network") fail("network", "network");
  checkDirectionConditions(m.forward);
  checkDirectionConditions(m.backward);
  checkLinkFigures(m.there);
  checkLinkFigures(m.back);
  checkLinkFigures(m.round_trip);
  if (m.seed === undefined) m.seed = 0;
  else whole(m.seed, 0, WHOLE, "network.seed");
  if (m.changed_at === undefined || m.changed_at === null) m.changed_at = null;
  else real(m.changed_at, -1e9, 1e9, "network.changed_at");
  if (m.changed_by === undefined) m.changed_by = "";
  else text(m.changed_by, 0, 200, "network.changed_by");
  if (m.robot === undefined) m.robot = "";
  else text(m.robot, 0, 200, "network.robot");
  if (m.problem === undefined) m.problem = "";
  else text(m.problem, 0, 2000, "network.problem");
  if (m.clock === undefined || m.clock === null) m.clock = null;
  else real(m.clock, 0, 1e9, "network.clock");
  if (m.link_loss === undefined) m.link_loss = "";
  else text(m.link_loss, 0, 200, "network.link_loss");
  if (m.timeout === undefined || m.timeout === null) m.timeout = null;
  else real(m.timeout, 0, 1e9, "network.timeout");
  if (m.max_age === undefined || m.max_age === null) m.max_age = null;
  else real(m.max_age, 0, 1e9, "network.max_age");
  if (m.offset === undefined || m.offset === null) m.offset = null;
  else real(m.offset, -1e9, 1e9, "network.offset");
  if (m.advice === undefined) m.advice = "";
  else text(m.advice, 0, 2000, "network.advice");
  if (m.answers === undefined || m.answers === null) m.answers = null;
  else whole(m.answers, 1, WHOLE, "network.answers");
}
function checkDriveLimits(m) {
  map(m, "DriveLimits");
  real(m.v_max, -REAL, REAL, "DriveLimits.v_max");
  real(m.w_max, -REAL, REAL, "DriveLimits.w_max");
  real(m.a_max, -REAL, REAL, "DriveLimits.a_max");
  real(m.alpha_max, -REAL, REAL, "DriveLimits.alpha_max");
}
function checkMobileWelcome(m) {
  map(m, "mobile-welcome");
  if (m.type !== undefined && m.type !== "mobile-welcome") fail("mobile-welcome", "mobile-welcome");
  whole(m.protocol, 1, WHOLE, "mobile-welcome.protocol");
  text(m.session, 0, 200, "mobile-welcome.session");
  word(m.role, WORDS_7, "mobile-welcome.role");
  text(m.robot, 0, 200, "mobile-welcome.robot");
  checkDriveLimits(m.limits);
  real(m.period, 5e-324, 1e9, "mobile-welcome.period");
  real(m.holds, 5e-324, 1e9, "mobile-welcome.holds");
  real(m.now, -1e9, 1e9, "mobile-welcome.now");
  checkLease(m.lease);
  real(m.lease_timeout, 5e-324, 3600, "mobile-welcome.lease_timeout");
  if (m.resumed === undefined) m.resumed = false;
  else flag(m.resumed, "mobile-welcome.resumed");
  if (m.instance === undefined) m.instance = "";
  else text(m.instance, 0, 200, "mobile-welcome.instance");
  if (m.server === undefined) m.server = "";
  else text(m.server, 0, 200, "mobile-welcome.server");
  if (m.room === undefined) m.room = "";
  else text(m.room, 0, 200, "mobile-welcome.room");
}
function checkPosture(m) {
  list(m, 3, 3, "Posture");
  real(m[0], -1e9, 1e9, "Posture.x");
  real(m[1], -1e9, 1e9, "Posture.y");
  real(m[2], -1e9, 1e9, "Posture.theta");
}
function checkDrive(m) {
  list(m, 2, 2, "Drive");
  real(m[0], -1e6, 1e6, "Drive.v");
  real(m[1], -1e6, 1e6, "Drive.w");
}
function checkPostures(m) {
  map(m, "postures");
  if (m.type !== undefined && m.type !== "postures") fail("postures", "postures");
  whole(m.number, 1, WHOLE, "postures.number");
  real(m.now, -1e9, 1e9, "postures.now");
  checkPosture(m.virtual);
  checkDrive(m.command);
  checkPosture(m.estimate);
  if (m.t === undefined || m.t === null) m.t = null;
  else real(m.t, -1e9, 1e9, "postures.t");
  if (m.real === undefined || m.real === null) m.real = null;
  else checkPosture(m.real);
  if (m.drive === undefined || m.drive === null) m.drive = null;
  else checkDrive(m.drive);
  if (m.D === undefined || m.D === null) m.D = null;
  else real(m.D, -1e9, 1e9, "postures.D");
  if (m.starved === undefined) m.starved = false;
  else flag(m.starved, "postures.starved");
  if (m.path_error === undefined || m.path_error === null) m.path_error = null;
  else real(m.path_error, 0, 1e9, "postures.path_error");
  if (m.time_difference === undefined || m.time_difference === null) m.time_difference = null;
  else real(m.time_difference, 0, 1e9, "postures.time_difference");
  if (m.epoch === undefined || m.epoch === null) m.epoch = null;
  else like(m.epoch, /^[1-9][0-9]{0,19}$/, "postures.epoch");
  if (m.connected === undefined) m.connected = true;
  else flag(m.connected, "postures.connected");
  if (m.halted === undefined) m.halted = "";
  else text(m.halted, 0, 2000, "postures.halted");
  if (m.drives === undefined) m.drives = 0;
  else whole(m.drives, 0, WHOLE, "postures.drives");
  if (m.round_trip === undefined || m.round_trip === null) m.round_trip = null;
  else real(m.round_trip, -1e9, 1e9, "postures.round_trip");
  if (m.messages === undefined) m.messages = [];
  else {
    list(m.messages, 0, 64, "postures.messages");
    for (const x of m.messages) {
      list(x, 2, 2, "postures.messages");
      real(x[0], -1e9, 1e9, "postures.messages");
      if (x[1] !== null) real(x[1], -1e9, 1e9, "postures.messages");
    }
  }
  if (m.drawn === undefined || m.drawn === null) m.drawn = null;
  else checkPosture(m.drawn);
}
function checkGoal(m) {
  map(m, "Goal");
  real(m.x, -1000, 1000, "Goal.x");
  real(m.y, -1000, 1000, "Goal.y");
  if (m.heading === undefined || m.heading === null) m.heading = null;
  else real(m.heading, -1000, 1000, "Goal.heading");
}
function checkMoveJob(m) {
  map(m, "move");
  if (m.do !== undefined && m.do !== "move") fail("move", "move");
  whole(m.number, 1, 2147483647, "move.number");
  if (typeof m.to === "object" && m.to !== null) {
    checkGoal(m.to);
  }
  else if (typeof m.to === "string") {
    text(m.to, 1, 40, "move.to");
  }
  else fail("move.to", "of a kind that is known");
}
function checkVoiceJob(m) {
  map(m, "voice");
  if (m.do !== undefined && m.do !== "voice") fail("voice", "voice");
  whole(m.number, 1, 2147483647, "voice.number");
  text(m.text, 1, 400, "voice.text");
}
function checkMessageJob(m) {
  map(m, "message");
  if (m.do !== undefined && m.do !== "message") fail("message", "message");
  whole(m.number, 1, 2147483647, "message.number");
  text(m.text, 1, 400, "message.text");
}
function checkWaitJob(m) {
  map(m, "wait");
  if (m.do !== undefined && m.do !== "wait") fail("wait", "wait");
  whole(m.number, 1, 2147483647, "wait.number");
  if (m.seconds === undefined || m.seconds === null) m.seconds = null;
  else real(m.seconds, 0, 86400, "wait.seconds");
}
function checkArmJob(m) {
  map(m, "arm");
  if (m.do !== undefined && m.do !== "arm") fail("arm", "arm");
  whole(m.number, 1, 2147483647, "arm.number");
  text(m.program, 1, 40, "arm.program");
  if (m.source === undefined) m.source = "";
  else text(m.source, 0, 16000, "arm.source");
}
function checkJobList(m) {
  map(m, "JobList");
  if (m.jobs === undefined) m.jobs = [];
  else {
    list(m.jobs, 0, 64, "JobList.jobs");
    for (const x of m.jobs) {
      if (typeof x === "object" && x !== null && x.do === "move") {
        checkMoveJob(x);
      }
      else if (typeof x === "object" && x !== null && x.do === "voice") {
        checkVoiceJob(x);
      }
      else if (typeof x === "object" && x !== null && x.do === "message") {
        checkMessageJob(x);
      }
      else if (typeof x === "object" && x !== null && x.do === "wait") {
        checkWaitJob(x);
      }
      else if (typeof x === "object" && x !== null && x.do === "arm") {
        checkArmJob(x);
      }
      else fail("JobList.jobs", "of a kind that is known");
    }
  }
  if (m.places === undefined) m.places = {};
  map(m.places, "JobList.places");
  for (const x of Object.values(m.places)) checkGoal(x);
}
function checkJobProgress(m) {
  map(m, "JobProgress");
  whole(m.number, 1, 2147483647, "JobProgress.number");
  if (m.stage === undefined) m.stage = "planned";
  else word(m.stage, WORDS_8, "JobProgress.stage");
  if (m.reason === undefined) m.reason = "";
  else text(m.reason, 0, 500, "JobProgress.reason");
  if (m.left === undefined || m.left === null) m.left = null;
  else real(m.left, 0, 86400, "JobProgress.left");
}
function checkProgress(m) {
  map(m, "Progress");
  if (m.stage === undefined) m.stage = "planned";
  else word(m.stage, WORDS_8, "Progress.stage");
  if (m.jobs === undefined) m.jobs = [];
  else {
    list(m.jobs, 0, 64, "Progress.jobs");
    for (const x of m.jobs) checkJobProgress(x);
  }
  if (m.reason === undefined) m.reason = "";
  else text(m.reason, 0, 500, "Progress.reason");
}
function checkJobForecast(m) {
  map(m, "JobForecast");
  whole(m.number, 1, WHOLE, "JobForecast.number");
  real(m.begins, 0, 1e9, "JobForecast.begins");
  if (m.lasts === undefined || m.lasts === null) m.lasts = null;
  else real(m.lasts, 0, 1e9, "JobForecast.lasts");
  if (m.route === undefined) m.route = [];
  else {
    list(m.route, 0, 720, "JobForecast.route");
    for (const x of m.route) {
      list(x, 2, 2, "JobForecast.route");
      real(x[0], -1e9, 1e9, "JobForecast.route");
      real(x[1], -1e9, 1e9, "JobForecast.route");
    }
  }
  if (m.problem === undefined) m.problem = "";
  else text(m.problem, 0, 2000, "JobForecast.problem");
}
function checkTasks(m) {
  map(m, "tasks");
  if (m.type !== undefined && m.type !== "tasks") fail("tasks", "tasks");
  if (m.doing === undefined) m.doing = "nothing";
  else word(m.doing, WORDS_9, "tasks.doing");
  if (m.journey === undefined) m.journey = "idle";
  else word(m.journey, WORDS_10, "tasks.journey");
  if (m.reason === undefined) m.reason = "";
  else text(m.reason, 0, 2000, "tasks.reason");
  if (m.goal === undefined || m.goal === null) m.goal = null;
  else checkGoal(m.goal);
  if (m.route === undefined) m.route = [];
  else {
    list(m.route, 0, 720, "tasks.route");
    for (const x of m.route) {
      list(x, 2, 2, "tasks.route");
      real(x[0], -1e9, 1e9, "tasks.route");
      real(x[1], -1e9, 1e9, "tasks.route");
    }
  }
  if (m.left === undefined) m.left = 0.0;
  else real(m.left, 0, 1e9, "tasks.left");
  if (m.jobs === undefined) m.jobs = {};
  checkJobList(m.jobs);
  if (m.progress === undefined) m.progress = {};
  checkProgress(m.progress);
  if (m.forecast === undefined || m.forecast === null) m.forecast = null;
  else {
    list(m.forecast, 0, 64, "tasks.forecast");
    for (const x of m.forecast) checkJobForecast(x);
  }
  if (m.loss === undefined || m.loss === null) m.loss = null;
  else word(m.loss, WORDS_11, "tasks.loss");
  if (m.shows === undefined) m.shows = "";
  else text(m.shows, 0, 2000, "tasks.shows");
  if (m.says === undefined) m.says = "";
  else text(m.says, 0, 2000, "tasks.says");
  if (m.problem === undefined) m.problem = "";
  else text(m.problem, 0, 2000, "tasks.problem");
  if (m.answers === undefined || m.answers === null) m.answers = null;
  else whole(m.answers, 0, WHOLE, "tasks.answers");
}
function checkSeen(m) {
  map(m, "seen");
  if (m.type !== undefined && m.type !== "seen") fail("seen", "seen");
  real(m.time, -1e12, 1e12, "seen.time");
  if (m.points === undefined) m.points = [];
  else {
    list(m.points, 0, 720, "seen.points");
    for (const x of m.points) {
      list(x, 2, 2, "seen.points");
      real(x[0], -1e9, 1e9, "seen.points");
      real(x[1], -1e9, 1e9, "seen.points");
    }
  }
  if (m.doubt === undefined || m.doubt === null) m.doubt = null;
  else {
    list(m.doubt, 3, 3, "seen.doubt");
    real(m.doubt[0], -1e9, 1e9, "seen.doubt");
    real(m.doubt[1], -1e9, 1e9, "seen.doubt");
    real(m.doubt[2], -1e9, 1e9, "seen.doubt");
  }
}
function checkPlan(m) {
  map(m, "plan");
  if (m.type !== undefined && m.type !== "plan") fail("plan", "plan");
  list(m.size, 2, 2, "plan.size");
  real(m.size[0], -1e9, 1e9, "plan.size");
  real(m.size[1], -1e9, 1e9, "plan.size");
  if (m.things === undefined) m.things = [];
  else {
    list(m.things, 0, 1000, "plan.things");
    for (const x of m.things) {
      list(x, 0, 64, "plan.things");
      for (const y of x) {
        list(y, 2, 2, "plan.things");
        real(y[0], -1e9, 1e9, "plan.things");
        real(y[1], -1e9, 1e9, "plan.things");
      }
    }
  }
  if (m.via === undefined) m.via = [];
  else {
    list(m.via, 0, 720, "plan.via");
    for (const x of m.via) {
      list(x, 2, 2, "plan.via");
      real(x[0], -1e9, 1e9, "plan.via");
      real(x[1], -1e9, 1e9, "plan.via");
    }
  }
  if (m.robot === undefined) m.robot = [0.0, 0.0, 0.0];
  else {
    list(m.robot, 3, 3, "plan.robot");
    real(m.robot[0], 0, 1e9, "plan.robot");
    real(m.robot[1], 0, 1e9, "plan.robot");
    real(m.robot[2], 0, 1e9, "plan.robot");
  }
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
  ["welcome", checkWelcome],
  ["lease", checkLease],
  ["state", checkState],
  ["network", checkNetwork],
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
