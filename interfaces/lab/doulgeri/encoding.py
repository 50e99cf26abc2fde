"""Open problem (b): compact encoding. Segments, commands, frames of the same motion, in bytes."""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING, Any, Final

import msgspec
import numpy as np

from interfaces.engine_server.broadcast import Broadcaster
from interfaces.engine_server.journal import Journal, changed
from interfaces.lab.claims import OWN_BAR, Findings, Results, Study, Table, above, at_least, at_most
from interfaces.lab.doulgeri.script import HOME, MODEL, Act, arrivals, target, tool
from interfaces.lab.output import GOOD, MUTED, REAL, VIRTUAL, draw
from interfaces.lab.statistics import bootstrap
from interfaces.messages import Change, Compact, Frame
from interfaces.messages.compact import STEPS, CompactDecoder
from interfaces.messages.requests import LONGEST_DELAY
from interfaces.stream import Encoding, encode
from vrs import Engine, JointTarget, ManualClock, MotionCommand, PolynomialSegment, SteerCommand, Timeline
from vrs.model import Array, frozen_array

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Canvas

RATE: Final = 50.0
"""Frames a second."""
PULSE: Final = 0.1
"""Period at which a reader of segments is told how far they are complete [s], as servlets do."""
SKETCH: Final = 434.0
"""What frames of these motions, quantised and predicted, need at least in a sketch by others [B/s]."""
SMALLER: Final = 5.0
"""So many times smaller than frames an encoding is to be."""
MUCH_SMALLER: Final = 20.0
"""So many times smaller commands of moves are to be."""
QUANTISED: Final = 1e-5
"""How far a joint of a compact frame may be off [rad]."""
SOURCE: Final = f"Section VII, (b); {OWN_BAR}"
MOTIONS: Final = ("moves", "rates", "twist")
NAMES: Final = {
    "moves": "a move every 2 s",
    "rates": "joint rates by hand, 50 inputs a second",
    "twist": "tool twist by hand, 50 inputs a second",
}


def sent_compact(messages: list[tuple[Compact, Timeline]]) -> tuple[float, float, float]:
    """What compact frames cost by the bytes that a server sends, and what their reader gets wrong.

    Args:
        messages: In their order, each with the timeline whose g its frames should be.

    Returns:
        Bytes a second; what they would be without prediction; largest error of a joint [rad].
    """
    decoder, size, bare, count, error = CompactDecoder(), 0, 0, 0, 0.0
    for message, timeline in messages:
        frames = [broadcast.frame for broadcast in decoder.receive(message)]
        size += len(encode(message, Encoding.MSGPACK))
        bare += absolute(frames)
        count += len(frames)
        g = timeline.sample(np.array([frame.t for frame in frames]))
        error = max(error, float(np.abs(np.array([frame.q for frame in frames]) - g).max()))
    return size / (count / RATE), bare / (count / RATE), error


def absolute(frames: list[Frame]) -> int:
    """Bytes of a compact message if its joints were written as they are, each in digits of three bits."""
    steps = [round(2 * STEPS * abs(q)) for frame in frames for q in frame.q.tolist()]
    head = 5 + len(frames)
    digits = head + sum(max(1, -(-step.bit_length() // 3)) for step in steps)
    return len(encode(Compact(bytes(-(-digits // 2))), Encoding.MSGPACK))


def encoded(change: Change) -> bytes:
    """An edit's values as msgpack, without any names."""
    segments = [(s.start, s.duration, s.coefficients.tolist(), s.command_id) for s in change.segments]
    return msgspec.msgpack.encode(
        (
            change.base,
            change.edit,
            change.command_id,
            change.first,
            segments,
            change.tail,
            change.tail_start,
            change.end,
        )
    )


def decoded(data: bytes) -> Change:
    """What `encoded` wrote."""
    base, edit, command_id, first, rows, tail, tail_start, end = msgspec.msgpack.decode(data)
    segments = tuple(PolynomialSegment(start, span, frozen_array(a), owner) for start, span, a, owner in rows)
    return Change(edit, first, end, command_id, base, tail, tail_start, segments=segments)


def acts(kind: str, rng: np.random.Generator, length: float) -> list[Act]:
    """Commands of one kind, one at least."""
    if kind == "moves":
        times = [float(t) for t in arrivals(rng, 0.5, 0.0, length)] or [0.0]
        return [Act(t, MotionCommand(target(rng), t, speed=0.6)) for t in times]
    size = 0.3 * MODEL.limits.qd_max if kind == "rates" else np.repeat((0.12, 0.3), 3)
    goals = rng.uniform(-size, size, (int(2 * length) + 2, 6))
    goals[1::2] = -goals[::2][: len(goals[1::2])]
    found = []
    for k in range(int(length * RATE)):
        t = k / RATE
        i, share = int(2 * t), (2 * t) % 1.0
        wish = (1 - share) * goals[i] + share * goals[i + 1]
        found.append(
            Act(
                t,
                SteerCommand(rates=wish, issued_at=t) if kind == "rates" else SteerCommand(twist=wish, issued_at=t),
            )
        )
    return found


def measure(kind: str, seed: int, length: float) -> Results:
    """One run: an engine does it, a reader rebuilds it from the bytes."""
    rng = np.random.default_rng((seed, 7))
    clock = ManualClock(0.0)
    engine = Engine(MODEL, q=HOME, clock=clock)
    journal = Journal(engine)
    reader: Timeline = engine.timeline
    size = {"segments": 0, "commands": 0}
    t = np.arange(int(length * RATE) + 1) / RATE
    source = Broadcaster(journal, rate=RATE)
    slots = source.join_compact(LONGEST_DELAY), source.join_compact(0.0)
    sent: tuple[list[tuple[Compact, Timeline]], ...] = ([], [])
    coming = deque(acts(kind, rng, length))
    for now in t.tolist():
        while coming and coming[0].t <= now:
            act = coming.popleft()
            clock.set(act.t)
            before = journal.number
            journal.execute(act.command)
            size["commands"] += len(msgspec.msgpack.encode(_said(act)))
            for edit in journal.since(before):
                assert edit.change is not None
                data = encoded(edit.change)
                size["segments"] += len(data)
                reader = changed(reader, decoded(data))
        clock.set(now)
        source.advance(now=now)
        for slot, messages in zip(slots, sent, strict=True):
            if (message := slot.take()) is not None:
                messages.append((message, engine.timeline))
    (several, bare, error), (each, _, error_each) = (sent_compact(messages) for messages in sent)
    pulse = len(msgspec.msgpack.encode((journal.number, length, length)))
    frame = msgspec.msgpack.encode((int(length * RATE), length, HOME.tolist()))
    # msgpack marks a float32 and a float64 with one byte each.
    single = len(frame) - 4 * len(HOME)
    frames = engine.timeline.sample(t)
    middle = engine.timeline.sample(0.5 * (t[1:] + t[:-1]))
    straight = 0.5 * (frames[1:] + frames[:-1])
    dense = np.linspace(0.0, length, int(200 * length))
    truth = engine.timeline.sample(dense)
    few = max(1, round(RATE * len(frame) / several))
    sparse = engine.timeline.sample(t[::few])
    return Results(
        frames=RATE * len(frame),  # number, time and six joints, 50 times a second, as float64 [B/s]
        frames_single=RATE * single,  # the same as float32: half the digits
        segments=size["segments"] / length + pulse / PULSE,  # edits with what they put in, and pulses [B/s]
        commands=size["commands"] / length,  # what the operator said; the reader needs an engine [B/s]
        compact=several,  # all that a message holds, six frames to one: the first comes 0.1 s later [B/s]
        compact_each=each,  # one frame to a message
        absolute=bare,  # as `compact`, quantised, but not predicted
        # Largest error of the tool in frames joined by straight lines in the joints [m].
        between=float(np.linalg.norm(tool(middle) - tool(straight), axis=1).max()),
        # Largest error of the joints that the segments' reader has, and that of compact frames [rad].
        rebuilt=float(np.abs(truth - reader.sample(dense)).max()),
        compact_error=max(error, error_each),
        # That of frames joined by straight lines: all, and as few as cost what compact frames cost.
        joined=_joined(truth, dense, t, frames),
        joined_few=_joined(frames, t, t[::few], sparse),
    )


def _joined(truth: Array, at: Array, t: Array, q: Array) -> float:
    """How far joints at times t are off at others if straight lines join them, at most [rad]."""
    lines = np.column_stack([np.interp(at, t, column) for column in q.T])
    return float(np.abs(truth - lines).max())


def _said(act: Act) -> tuple[Any, ...]:
    """A command's values: which kind, stamps, and what was asked."""
    command = act.command
    if isinstance(command, SteerCommand):
        wish = command.rates if command.rates is not None else command.twist
        assert wish is not None
        return (int(command.rates is None), act.t, wish.tolist())
    assert isinstance(command, MotionCommand)
    assert isinstance(command.target, JointTarget)
    words = str(command.motion), str(command.profile), str(command.insertion)
    return (2, act.t, command.target.q.tolist(), command.execute_at, command.speed, *words)


def work(study: Study, case: str) -> list[Results]:
    """Measure one kind of motion; a hand's, which costs more, for a shorter time and in fewer runs."""
    moves = case == "moves"
    runs, length = (study.runs, study.length) if moves else (min(study.runs, 3), min(study.length, 4.0))
    return [measure(case, study.seed + k, length) for k in range(runs)]


def conclude(study: Study, found: tuple[list[Results], ...]) -> Findings:
    """Compare bytes."""
    claims, means, rows = [], [], []
    for kind, sizes in zip(MOTIONS, found, strict=True):
        better = [min(s.segments, s.compact) for s in sizes]
        plain = [min(s.segments, s.absolute) for s in sizes]
        unpredicted = "the better of segments and quantised frames, not predicted"
        name = f"{NAMES[kind]}: bytes of frames at 50 a second over bytes of"
        ratio, other = (
            bootstrap([s.frames / x for s, x in zip(sizes, y, strict=True)], study.seed)
            for y in (better, [s.frames_single for s in sizes])
        )
        claims.append(
            above(
                f"{name} the better of segments and compact frames",
                SOURCE,
                SMALLER,
                ratio,
                ("frames as float32", other),
            )
        )
        ratio, other = (
            bootstrap([s.frames / getattr(s, what) for s in sizes], study.seed) for what in ("commands", "segments")
        )
        text = f"{name} commands, where the reader has an engine"
        beside = "segments, where it has none", other
        claims.append(
            above(text, SOURCE, MUCH_SMALLER, ratio, beside)
            if kind == "moves"
            else at_least(text, SOURCE, 0.9, ratio, beside, note=": no more than frames")
        )
        cost, other = bootstrap(better, study.seed), bootstrap(plain, study.seed)
        text = f"{NAMES[kind]}: the better of segments and compact frames, six in a message, costs [B/s]"
        claims.append(
            at_most(text, SOURCE, SKETCH, cost, (unpredicted, other), note=", the least of an independent sketch")
        )
        rebuilt, off = max(s.rebuilt for s in sizes), max(s.compact_error for s in sizes)
        text = f"{NAMES[kind]}: who has the segments has the joints at every time, off by at most [rad]"
        joined = "frames at 50 a second, joined by straight lines", max(s.joined for s in sizes)
        claims.append(at_most(text, SOURCE, 1e-12, rebuilt, joined))
        text = f"{NAMES[kind]}: who gets compact frames has their joints, off by at most [rad]"
        few = "so few frames that they cost as much, joined by straight lines", max(s.joined_few for s in sizes)
        claims.append(at_most(text, SOURCE, QUANTISED, off, few))
        mean = Results(**{what: float(np.mean([vars(s)[what] for s in sizes])) for what in vars(sizes[0])})
        means.append(mean)
        rows.append(
            (
                ("motion", NAMES[kind]),
                ("frames B/s", mean.frames),
                ("as float32", mean.frames_single),
                ("quantised, six in a message", mean.absolute),
                ("compact, one in a message", mean.compact_each),
                ("compact, six in a message", mean.compact),
                ("segments B/s", mean.segments),
                ("commands B/s", mean.commands),
                ("between frames, tool mm", 1e3 * max(s.between for s in sizes)),
                ("segments, joints rad", rebuilt),
                ("compact, joints rad", off),
            )
        )
    title = "(b) msgpack of the values, no names; of compact frames all that crosses"
    table = Table.of("encoding", title, rows)
    picture = draw("b-encoding", "(b) bytes a second for the same motion", _paint, means)
    return Findings(tuple(claims), (table,), (picture,))


def _paint(canvas: Canvas, means: list[Results]) -> None:
    ax = canvas.add_subplot()
    y = np.arange(len(means))[::-1]
    bars = (
        (0.3, "frames", MUTED, "frames, 50 a second"),
        (0.1, "compact", GOOD, "compact frames"),
        (-0.1, "segments", VIRTUAL, "segments"),
        (-0.3, "commands", REAL, "commands"),
    )
    for shift, what, colour, name in bars:
        values = np.array([getattr(mean, what) for mean in means])
        ax.barh(y + shift, values, 0.18, color=colour, label=name)
        for place, value in zip(y + shift, values, strict=True):
            ax.annotate(
                f"{value:,.0f}", (value, place), (3, 0), textcoords="offset points", va="center", fontsize=8
            )
    ax.set_yticks(y, [NAMES[kind].replace(", ", ",\n") for kind in MOTIONS])
    ax.set_xscale("log")
    ax.set_xlim(right=6 * max(max(vars(mean).values()) for mean in means))
    ax.set_xlabel("bytes a second (logarithmic)")
    ax.grid(visible=False, axis="y")
    ax.legend(loc="upper right", fontsize=8)
