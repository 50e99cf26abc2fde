"""Plan files: what the operator does, a JSON object a line. `docs/plan-files.md` is the reference."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Any, Literal, TypeAlias

import msgspec
import numpy as np

from interfaces.system import read_within
from robots.things import Scene, Thing
from vrs.checks import one_of
from vrs.commands import (
    Grip,
    Insertion,
    JointTarget,
    Motion,
    MotionCommand,
    PlanEdit,
    PoseTarget,
    Profile,
    SteerCommand,
    Target,
)
from vrs.engine import Engine
from vrs.errors import FormatError, InvalidValueError, OutOfLimitsError, UnreachablePoseError
from vrs.model import Array, RobotModel, for_people, home
from vrs.notes import NoteCode

SCHEMA = "vrs-plan/1"
LATEST = 3600.0
"""Latest time that a plan may hold [s]."""
HEAVIEST = 20.0
"""Heaviest payload that a plan may hold [kg]."""
MAX_BYTES = 4 * 1024 * 1024
MAX_COMMANDS = 5000

ALLOWED = (
    'a line is a JSON object: {"issue": seconds, "move": target} with optional execute, register, speed, '
    "motion, profile, insertion, deviation_mm, pace, acceleration, tool; or "
    '{"issue": seconds, "payload": {"mass_kg": number}}; or {"issue": seconds, '
    '"release": true}; or {"issue": seconds, "grip_mm": opening, or "open"} with optional execute, register; '
    'or {"thing": {name, at, box or cylinder, mass}}, with a header that has floor; '
    "or, first, a header with schema, title, start, floor; each with an optional comment"
)


PlannedCommand: TypeAlias = MotionCommand | SteerCommand | PlanEdit | Grip
"""What an operator may do; plan files hold motion commands and grips alone."""


@dataclass(frozen=True, slots=True)
class PlannedMotion:
    """A command of a plan."""

    where: str
    """File and line, for messages."""
    registered_at: float
    """User time at which the command reaches the operator's engine [s], ≥ its issue time."""
    command: PlannedCommand


@dataclass(frozen=True, slots=True)
class PlannedPayload:
    """The real gripper takes or releases a load, when the robot's own clock reads t."""

    where: str
    """File and line, for messages."""
    t: float
    """Timeline time [s]."""
    mass: float | None
    """Mass [kg], > 0; None releases what is held."""


@dataclass(frozen=True, slots=True, eq=False)
class RunPlan:
    """What happens in a run, by time; equal times keep the order of the file."""

    title: str
    start: Array
    """Joints at the start [rad], (n,)."""
    motions: tuple[PlannedMotion, ...]
    """A plan file holds at least one."""
    payloads: tuple[PlannedPayload, ...]
    scene: Scene | None = None
    """What is around the real robot; None for nothing that it could grasp."""


class _Where(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    pose: str | None = None
    xyz: list[float] | None = None
    zyz_deg: list[float] | None = None
    configuration: str | None = None


class _Load(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    mass_kg: float


_Move: TypeAlias = list[float] | _Where


class _Line(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    schema: Literal["vrs-plan/1"] | None = None
    title: str | None = None
    start: _Move | None = None
    issue: float | None = None
    register: float | None = None
    execute: float | None = None
    move: _Move | None = None
    speed: float | None = None
    motion: Motion | None = None
    profile: Profile | None = None
    insertion: Insertion | None = None
    deviation_mm: float | Literal["inf"] | None = None
    pace: float | None = None
    acceleration: float | None = None
    tool: _Where | None = None
    payload: _Load | None = None
    release: bool | None = None
    grip_mm: float | Literal["open"] | None = None
    floor: float | None = None
    thing: Thing | None = None
    comment: str | None = None


_HEADER = ("schema", "title", "start", "floor")
_HOW = ("deviation_mm", "pace", "acceleration", "tool")
_MOTION = ("register", "execute", "speed", "motion", "profile", "insertion", *_HOW)


def default_plan(model: RobotModel) -> RunPlan:
    """The plan of the demo: an arm that can't do the usual one goes round its named poses, or to and fro."""
    source = resources.files("interfaces.runtime").joinpath("default_plan.jsonl")
    try:
        return parse_plan(source.read_bytes(), "default_plan.jsonl", model)
    except FormatError:
        return _round_trip(model)


def _round_trip(model: RobotModel) -> RunPlan:
    """Twelve moves; those that take longer than 2.5 s are redirected in motion."""
    start, span = home(model), model.limits.q_max - model.limits.q_min
    places = list(model.poses.values()) if len(model.poses) > 1 else []
    places += [model.limits.q_min + share * span for share in (0.35, 0.65)]
    motions = tuple(
        PlannedMotion(f"move {k + 1}", at, MotionCommand(JointTarget(places[k % len(places)]), at, at + 0.5, 0.6))
        for k, at in enumerate((0.5 + 2.5 * np.arange(12)).tolist())
    )
    return RunPlan("Round trip", start, motions, ())


def read_plan(path: Path, model: RobotModel) -> RunPlan:
    """Read a plan file.

    Raises:
        FormatError: If it can't be read, or a line is not what it should be; the message names file, line
            and what is allowed.
    """
    return parse_plan(read_within(path, MAX_BYTES), str(path), model)


def parse_plan(data: bytes, name: str, model: RobotModel) -> RunPlan:
    """Parse the bytes of a plan file.

    Args:
        data: UTF-8 text, at most 4 MiB and 5000 commands.
        name: Name of the file, for messages.
        model: The robot, for its limits, named poses and kinematics.

    Raises:
        FormatError: As `read_plan`.
    """
    if len(data) > MAX_BYTES:
        raise FormatError(name, f"is longer than the {MAX_BYTES} bytes allowed")
    title, start = Path(name).stem, home(model)
    motions: list[PlannedMotion] = []
    payloads: list[PlannedPayload] = []
    floor: float | None = None
    things: list[Thing] = []
    for i, (where, line) in enumerate(_lines(data, name)):
        try:
            if any(getattr(line, key) is not None for key in _HEADER):
                _check_header(line, first=i == 0)
                title = line.title or title
                start = start if line.start is None else _start(line.start, model)
                floor = line.floor
            elif line.move is not None:
                motions.append(_motion(line, line.move, where, model))
            elif line.payload is not None or line.release is not None:
                payloads.append(_payload(line, where))
            elif line.grip_mm is not None:
                motions.append(_grip(line, line.grip_mm, where))
            elif line.thing is not None:
                things.append(_thing(line, line.thing, floor))
            elif any(getattr(line, key) is not None for key in ("issue", *_MOTION)):
                raise InvalidValueError("line", "issue without an action", "one of move, payload, release, grip_mm")
        except (InvalidValueError, UnreachablePoseError) as error:
            raise FormatError(where, str(error)) from None
        if len(motions) + len(payloads) > MAX_COMMANDS:
            raise FormatError(where, f"more than the {MAX_COMMANDS} commands allowed")
    if not motions:
        raise FormatError(name, f"holds no move; {ALLOWED}")
    try:
        scene = None if floor is None else msgspec.convert({"floor": floor, "things": things}, Scene)
    except msgspec.ValidationError as error:
        raise FormatError(name, str(error)) from None
    motions.sort(key=lambda motion: motion.registered_at)
    payloads.sort(key=lambda payload: payload.t)
    _check_hand(payloads)
    return RunPlan(title, start, tuple(motions), tuple(payloads), scene)


def _lines(data: bytes, name: str) -> Iterator[tuple[str, _Line]]:
    decoder = msgspec.json.Decoder(_Line)
    for number, raw in enumerate(data.removeprefix(b"\xef\xbb\xbf").split(b"\n"), start=1):
        where = f"{name}:{number}"
        if not raw.strip():
            continue
        try:
            raw.decode("utf-8")
            yield where, decoder.decode(raw)
        except UnicodeDecodeError:
            raise FormatError(where, f"isn't UTF-8 text; {ALLOWED}") from None
        except (msgspec.DecodeError, RecursionError) as error:
            raise FormatError(where, f"{error}; {ALLOWED}") from None


def _check_header(line: _Line, *, first: bool) -> None:
    if not first:
        raise InvalidValueError("line", "a header below the first line", f"a command; {ALLOWED}")
    _only(line, (*_HEADER, "comment"), "a header")


def _only(line: _Line, allowed: tuple[str, ...], kind: str) -> None:
    extra = [key for key in line.__struct_fields__ if key not in allowed and getattr(line, key) is not None]
    if extra:
        raise InvalidValueError(kind, extra, f"without these fields; it may hold {', '.join(allowed)}")


def _time(name: str, value: float | None, earliest: float = 0.0) -> float:
    if value is None or not earliest <= value <= LATEST:
        raise InvalidValueError(name, value, f"seconds in [{earliest:g}, {LATEST:g}]")
    return value


def _motion(line: _Line, move: _Move, where: str, model: RobotModel) -> PlannedMotion:
    _only(line, ("issue", "move", *_MOTION, "comment"), "a move")
    issue = _time("issue", line.issue)
    registered = issue if line.register is None else _time("register", line.register, issue)
    command = MotionCommand(
        target=_target(move, model),
        issued_at=issue,
        execute_at=None if line.execute is None else _time("execute", line.execute),
        speed=1.0 if line.speed is None else line.speed,
        motion=line.motion or Motion.JOINT,
        profile=line.profile or Profile.PARABOLIC,
        insertion=line.insertion or Insertion.SPLICE,
        deviation=0.0 if line.deviation_mm is None else float(line.deviation_mm) / 1000.0,
        pace=1.0 if line.pace is None else line.pace,
        acceleration=1.0 if line.acceleration is None else line.acceleration,
        tool=None if line.tool is None else _pose(line.tool.xyz, line.tool.zyz_deg),
    )
    return PlannedMotion(where, registered, command)


def _grip(line: _Line, opening: float | str, where: str) -> PlannedMotion:
    _only(line, ("issue", "grip_mm", "register", "execute", "comment"), "a grip")
    issue = _time("issue", line.issue)
    command = Grip(
        opening=math.inf if isinstance(opening, str) else opening / 1000.0,
        issued_at=issue,
        execute_at=None if line.execute is None else _time("execute", line.execute),
    )
    return PlannedMotion(
        where, issue if line.register is None else _time("register", line.register, issue), command
    )


def _thing(line: _Line, thing: Thing, floor: float | None) -> Thing:
    _only(line, ("thing", "comment"), "a thing")
    if floor is None:
        raise InvalidValueError("thing", thing.name, "below a header with the floor's height [m], as floor: -0.672")
    return thing


def _payload(line: _Line, where: str) -> PlannedPayload:
    kind = "payload" if line.payload is not None else "release"
    _only(line, ("issue", kind, "comment"), f"a {kind}")
    t = _time("issue", line.issue)
    if line.payload is None:
        if line.release is not True:
            raise InvalidValueError("release", line.release, "true")
        return PlannedPayload(where, t, None)
    if not 0 < line.payload.mass_kg <= HEAVIEST:
        raise InvalidValueError("mass_kg", line.payload.mass_kg, f"in (0, {HEAVIEST:g}] kg")
    return PlannedPayload(where, t, line.payload.mass_kg)


def _check_hand(payloads: list[PlannedPayload]) -> None:
    held = False
    for payload in payloads:
        if held and payload.mass is not None:
            raise FormatError(payload.where, "a payload is already held: allowed is a release")
        if not held and payload.mass is None:
            raise FormatError(payload.where, "nothing is held: allowed is a payload")
        held = payload.mass is not None


def _start(move: _Move, model: RobotModel) -> Array:
    target = _target(move, model)
    if isinstance(target, JointTarget):
        return target.q
    return model.inverse_near(target.X, home(model), target.configuration)


def _target(move: _Move, model: RobotModel) -> Target:
    if isinstance(move, list):
        n = model.limits.dof
        if len(move) != n or not np.isfinite(move).all():
            units = "deg" if not model.prismatic else "deg, of prismatic joints m"
            raise InvalidValueError("move", move, f"{n} finite joint values [{units}]")
        target = JointTarget([x if j in model.prismatic else math.radians(x) for j, x in enumerate(move)])
        try:
            model.limits.check(target.q, model.prismatic)
        except OutOfLimitsError as error:
            (low, unit), (high, _) = (
                for_people(error.joint, limit, model.prismatic) for limit in (error.low, error.high)
            )
            raise OutOfLimitsError(error.joint, move[error.joint], low, high, unit) from None
        return target
    if move.pose is not None:
        if move.xyz is not None or move.zyz_deg is not None or move.configuration is not None:
            raise InvalidValueError("move", "pose beside other fields", "pose alone, or xyz with zyz_deg")
        return JointTarget(model.poses[one_of("pose", move.pose, sorted(model.poses))])
    X = _pose(move.xyz, move.zyz_deg)
    target_pose = PoseTarget(X, move.configuration)
    model.inverse_near(X, home(model), move.configuration)
    return target_pose


def _pose(xyz: list[float] | None, zyz_deg: list[float] | None) -> Array:
    for name, values, unit in (("xyz", xyz, "m"), ("zyz_deg", zyz_deg, "deg")):
        if values is None or len(values) != 3 or not np.isfinite(values).all():
            raise InvalidValueError(name, values, f"three finite numbers [{unit}], beside its partner")
    X = np.eye(4)
    X[:3, 3] = xyz or ()
    a, b, c = (math.radians(angle) for angle in zyz_deg or ())
    X[:3, :3] = _rot_z(a) @ _rot_y(b) @ _rot_z(c)
    return X


def _rot_z(angle: float) -> Array:
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def _rot_y(angle: float) -> Array:
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])


FIRST = 0.5
"""When the first move of a plan that was written begins [s]."""
_BEFORE = 1000
"""So many commands before one that rounds a corner, the one that it passes is looked for."""
_ROUNDED = frozenset({NoteCode.PASSES_VIA, NoteCode.BEGINS_BEFORE})
_RESTS = 1e-9
"""Speed [rad/s, m/s] that counts as none."""
_THERE = 1e-6
"""Joints that differ by less [rad, m] are the same place."""


def written_plan(engine: Engine, title: str, labels: Mapping[int, str]) -> bytes:
    """Write what an engine is still to do as a plan file: the moves and grips that begin after its present.

    A run of it takes the same path as far as that begins at rest: a move by a via is written as two, of which the
    second passes the via; one that interrupted another as it was commanded.

    Args:
        engine: Of an arm.
        title: Of the plan.
        labels: What commands are called, by their ids.

    Raises:
        InvalidValueError: If nothing is planned, or for longer than a plan file may hold.
    """
    now, timeline = engine.now(), engine.timeline
    spans: dict[int, tuple[float, float]] = {}
    for segment in timeline.segments[max(timeline.index_at(now), 0) :]:
        if segment.command_id is not None:
            start, _ = spans.get(segment.command_id, (segment.start, 0.0))
            spans[segment.command_id] = start, segment.start + segment.duration
    moves = {command_id: span for command_id, span in spans.items() if span[0] > now}
    grips = [goal for goal in engine.scheduler.grips if goal.t > now]
    if not moves:
        raise InvalidValueError("plan", "nothing", "moves that are still to come")
    begin = min(start for start, _ in moves.values())
    zero = min([begin, *(goal.t for goal in grips)]) - FIRST
    legs: list[tuple[int, float, _Leg]] = []
    for command_id, (start, end) in moves.items():
        rounds = _rounds(engine, command_id)
        passed = _passed(engine, command_id, now) if rounds else None
        if passed is not None and passed not in spans:
            # It was planned anew with less of the limits, as part of what passes its end.
            legs += [(passed, start, leg) for leg in _legs(engine, passed, start, start, first=not legs)]
        legs += [(command_id, start, leg) for leg in _legs(engine, command_id, start, end, first=not legs)]
    header = {"schema": SCHEMA, "title": title, "start": _people(timeline.sample(begin), engine)}
    lines: list[dict[str, Any]] = [header]
    for command_id, start, leg in legs:
        label = {"comment": labels[command_id]} if labels.get(command_id) else {}
        lines.append({"issue": 0.0, "execute": start - zero, **leg, **label})
    for goal in grips:
        opening = "open" if goal.opening == math.inf else 1000.0 * goal.opening
        lines.append({"issue": 0.0, "execute": goal.t - zero, "grip_mm": opening})
    if (latest := max(line["execute"] for line in lines[1:])) > LATEST:
        raise InvalidValueError("plan", f"moves for {latest:.0f} s", f"up to {LATEST:g} s")
    return "".join(json.dumps(line, allow_nan=False) + "\n" for line in lines).encode()


_Leg: TypeAlias = dict[str, Any]
"""Fields of a move's line beside its times."""


def _rounds(engine: Engine, command_id: int) -> bool:
    """Whether a move passes the end of the one before it."""
    command, codes = engine.command(command_id), {note.code for note in engine.notes(command_id)}
    rounded = command is not None and command.deviation > 0 and NoteCode.BY_A_VIA not in codes
    return rounded and not codes.isdisjoint(_ROUNDED)


def _passed(engine: Engine, command_id: int, now: float) -> int | None:
    """The command whose end a move passes, where that was still to begin."""
    for other in range(command_id - 1, max(0, command_id - _BEFORE), -1):
        if engine.command(other) is not None:
            receipt = engine.receipt(other)
            if receipt.superseded_by == command_id and receipt.execute_at is not None:
                return other if receipt.execute_at > now else None
    return None


def _legs(engine: Engine, command_id: int, start: float, end: float, *, first: bool) -> list[_Leg]:
    """A planned move as lines' fields: two where it goes by a via, one more where it leads on to the next one."""
    timeline, command, append = engine.timeline, engine.command(command_id), {"insertion": Insertion.APPEND.value}
    at_end = timeline.sample(end)
    target = None if command is None else engine.receipt(command_id).q
    target = at_end if target is None else target
    joined: _Leg = append
    if not first and _rounds(engine, command_id):
        joined = {**append, **_deviating(0.0 if command is None else command.deviation)}
    elif not first and np.abs(timeline.state_before(start).qd).max() > _RESTS:
        joined = {"insertion": Insertion.SPLICE.value}
    ways: list[tuple[Array, _Leg]] = [(target, joined)]
    for note in engine.notes(command_id):
        if note.code is NoteCode.BY_A_VIA:
            deviation, *via = (float(value) for value in note.values)
            ways = [(np.array(via), joined), (target, {**append, **_deviating(deviation)})]
    how = {} if command is None else _how(command)
    legs: list[_Leg] = [{"move": _people(q, engine), **how, **joins} for q, joins in ways]
    rests = np.abs(timeline.sample(end, derivative=1)).max() <= _RESTS
    if end > start and rests and np.abs(at_end - target).max() > _THERE:
        legs.append({"move": _people(at_end, engine), **how, "motion": Motion.JOINT.value, **append})
    return legs


def _how(command: MotionCommand) -> _Leg:
    """How a command moves: fields of a line that aren't what they are without it."""
    how: _Leg = {"speed": command.speed, "motion": command.motion.value, "profile": command.profile.value}
    how |= {name: getattr(command, name) for name in ("pace", "acceleration") if getattr(command, name) != 1.0}
    if command.tool is not None:
        how["tool"] = {"xyz": command.tool[:3, 3].tolist(), "zyz_deg": _zyz_deg(command.tool[:3, :3])}
    return how


def _deviating(deviation: float) -> _Leg:
    if deviation == 0.0:
        return {}
    return {"deviation_mm": "inf" if deviation == math.inf else 1000.0 * deviation}


def _people(q: Array, engine: Engine) -> list[float]:
    """Joints in degrees, of prismatic ones in metres."""
    return [x if j in engine.model.prismatic else math.degrees(x) for j, x in enumerate(q.tolist())]


def _zyz_deg(R: Array) -> list[float]:
    """ZYZ Euler angles of a rotation [deg]."""
    across = math.hypot(R[0, 2], R[1, 2])
    if across < _THERE:
        a, c = 0.0, math.atan2(R[1, 0], R[1, 1])
    else:
        a, c = math.atan2(R[1, 2], R[0, 2]), math.atan2(R[2, 1], -R[2, 0])
    return [math.degrees(angle) for angle in (a, math.atan2(across, R[2, 2]), c)]
