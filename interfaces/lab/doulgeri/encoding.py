"""Open problem (b): compact encoding. Segments, commands, frames of the same motion, in bytes."""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import msgspec
import numpy as np

from interfaces.engine_server.broadcast import Broadcaster
from interfaces.engine_server.journal import Journal, changed
from interfaces.lab.claims import OWN_BAR, Claim, Findings, Study, Table
from interfaces.lab.doulgeri.script import HOME, MODEL, Act, arrivals, target, tool
from interfaces.lab.output import GOOD, MUTED, REAL, VIRTUAL, draw
from interfaces.lab.statistics import bootstrap
from interfaces.messages import Change, Compact, Frame
from interfaces.messages.compact import STEPS, CompactDecoder
from interfaces.messages.requests import LONGEST_DELAY
from interfaces.stream import Encoding, encode
from vrs import Engine, JointTarget, ManualClock, MotionCommand, PolynomialSegment, SteerCommand, Timeline
from vrs.model import frozen_array

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Canvas

RATE: Final = 50.0
"""Frames a second."""
PULSE: Final = 0.1
"""Period at which a reader of segments is told how far they are complete [s], as servlets do."""
SKETCH: Final = 434.0
"""What frames of these motions, quantised and predicted, need at least in a sketch by others [B/s]."""
QUANTISED: Final = 1e-5
"""How far a joint of a compact frame may be off [rad]."""
SOURCE: Final = f"Section VII, (b); {OWN_BAR}"
MOTIONS: Final = ("moves", "rates", "twist")
NAMES: Final = {
    "moves": "a move every 2 s",
    "rates": "joint rates by hand, 50 inputs a second",
    "twist": "tool twist by hand, 50 inputs a second",
}


class Sizes(NamedTuple):
    """Of one motion, in bytes a second; and what the reader gets wrong."""

    frames: float
    """Number, time and six joints, 50 times a second, as float64."""
    frames_single: float
    """The same as float32: half the digits."""
    segments: float
    """Edits with the segments that they put in, and pulses."""
    commands: float
    """What the operator said; the reader needs an engine."""
    between: float
    """Largest tool error of frames joined by straight lines in the joints [m]."""
    rebuilt: float
    """Largest error of the joints that the segments' reader has [rad]."""
    compact: float
    """Compact frames as they cross, all that a message holds, six to one: the first of them comes 0.1 s later."""
    compact_each: float
    """The same, one to a message."""
    absolute: float
    """The same as `compact`, quantised, but not predicted."""
    compact_error: float
    """Largest error of the joints that their readers have [rad]."""


class CompactFollower:
    """Follows a broadcaster's compact frames, by the bytes that a server would send, and counts them."""

    def __init__(self, source: Broadcaster, delay: float) -> None:
        self._slot, self._decoder = source.join_compact(delay), CompactDecoder()
        self._bytes = self._absolute = 0
        self._count = 0
        self.error = 0.0
        """Largest error of a joint so far [rad]."""

    def take(self, timeline: Timeline) -> None:
        """Take what is sent now; g of the timeline is what it should be."""
        message = self._slot.take()
        if message is None:
            return
        self._bytes += len(encode(message, Encoding.MSGPACK))
        frames = [broadcast.frame for broadcast in self._decoder.receive(message)]
        self._absolute += absolute(frames)
        self._count += len(frames)
        g = timeline.sample(np.array([frame.t for frame in frames]))
        self.error = max(self.error, float(np.abs(np.array([frame.q for frame in frames]) - g).max()))

    def rates(self) -> tuple[float, float]:
        """Bytes a second, and what they would be without prediction."""
        seconds = self._count / RATE
        return self._bytes / seconds, self._absolute / seconds


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


def measure(kind: str, seed: int, length: float) -> Sizes:
    """One run: an engine does it, a reader rebuilds it from the bytes."""
    rng = np.random.default_rng((seed, 7))
    clock = ManualClock(0.0)
    engine = Engine(MODEL, q=HOME, clock=clock)
    journal = Journal(engine)
    reader: Timeline = engine.timeline
    size = {"segments": 0, "commands": 0}
    t = np.arange(int(length * RATE) + 1) / RATE
    source = Broadcaster(journal, rate=RATE)
    several, each = CompactFollower(source, LONGEST_DELAY), CompactFollower(source, 0.0)
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
        for follower in (several, each):
            follower.take(engine.timeline)
    compact, bare = several.rates()
    pulse = len(msgspec.msgpack.encode((journal.number, length, length)))
    frame = msgspec.msgpack.encode((int(length * RATE), length, HOME.tolist()))
    # msgpack marks a float32 and a float64 with one byte each.
    single = len(frame) - 4 * len(HOME)
    frames = engine.timeline.sample(t)
    middle = engine.timeline.sample(0.5 * (t[1:] + t[:-1]))
    straight = 0.5 * (frames[1:] + frames[:-1])
    dense = np.linspace(0.0, length, int(200 * length))
    return Sizes(
        RATE * len(frame),
        RATE * single,
        size["segments"] / length + pulse / PULSE,
        size["commands"] / length,
        float(np.linalg.norm(tool(middle) - tool(straight), axis=1).max()),
        float(np.abs(engine.timeline.sample(dense) - reader.sample(dense)).max()),
        compact,
        each.rates()[0],
        bare,
        max(several.error, each.error),
    )


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


def work(study: Study, case: str) -> list[Sizes]:
    """Measure one kind of motion; a hand's, which costs more, for a shorter time and in fewer runs."""
    moves = case == "moves"
    runs, length = (study.runs, study.length) if moves else (min(study.runs, 3), min(study.length, 4.0))
    return [measure(case, study.seed + k, length) for k in range(runs)]


def conclude(study: Study, found: tuple[list[Sizes], ...]) -> Findings:
    """Compare bytes."""
    claims, rows = [], []
    for kind, sizes in zip(MOTIONS, found, strict=True):
        better = [min(s.segments, s.compact) for s in sizes]
        for name, least, ratios in (
            (
                "the better of segments and compact frames",
                "> 1.1",
                [s.frames / b for s, b in zip(sizes, better, strict=True)],
            ),
            (
                "commands, where the reader has an engine",
                "> 1.1" if kind == "moves" else "≥ 0.9: no more than frames",
                [s.frames / s.commands for s in sizes],
            ),
        ):
            ratio = bootstrap(ratios, study.seed)
            holds = ratio.low > 1.1 if least == "> 1.1" else ratio.low >= 0.9
            text = f"{NAMES[kind]}: bytes of frames at 50 a second over bytes of {name}"
            claims.append(Claim(text, SOURCE, least, ratio.value, holds, ratio.interval))
        cost = bootstrap(better, study.seed)
        text = f"{NAMES[kind]}: the better of segments and compact frames, six in a message, costs [B/s]"
        bar = f"≤ {SKETCH:g}, the least of an independent sketch"
        claims.append(Claim(text, SOURCE, bar, cost.value, cost.high <= SKETCH, cost.interval))
        for who, least, error, most in (
            ("who has the segments has the joints at every time", "≤ 1e-12", max(s.rebuilt for s in sizes), 1e-12),
            ("who gets compact frames has their joints", "≤ 1e-5", max(s.compact_error for s in sizes), QUANTISED),
        ):
            text = f"{NAMES[kind]}: {who}, off by at most [rad]"
            claims.append(Claim(text, SOURCE, least, error, error <= most))
        mean = Sizes(*(float(np.mean(column)) for column in zip(*sizes, strict=True)))
        worst = max(s.between for s in sizes)
        rows.append(
            (
                NAMES[kind],
                mean.frames,
                mean.frames_single,
                mean.absolute,
                mean.compact_each,
                mean.compact,
                mean.segments,
                mean.commands,
                1e3 * worst,
                max(s.rebuilt for s in sizes),
                max(s.compact_error for s in sizes),
            )
        )
    columns = (
        "motion",
        "frames B/s",
        "as float32",
        "quantised, six in a message",
        "compact, one in a message",
        "compact, six in a message",
        "segments B/s",
        "commands B/s",
        "between frames, tool mm",
        "segments, joints rad",
        "compact, joints rad",
    )
    title = "(b) msgpack of the values, no names; of compact frames all that crosses"
    table = Table("encoding", title, columns, tuple(rows))
    picture = draw(
        "b-encoding", "(b) bytes a second for the same motion", lambda canvas: _paint(canvas, rows), height=3.2
    )
    return Findings(tuple(claims), (table,), (picture,))


def _paint(canvas: Canvas, rows: list[tuple[Any, ...]]) -> None:
    ax = canvas.add_subplot()
    y = np.arange(len(rows))[::-1]
    bars = (
        (0.3, 1, MUTED, "frames, 50 a second"),
        (0.1, 5, GOOD, "compact frames"),
        (-0.1, 6, VIRTUAL, "segments"),
        (-0.3, 7, REAL, "commands"),
    )
    for shift, column, colour, name in bars:
        values = np.array([row[column] for row in rows])
        ax.barh(y + shift, values, 0.18, color=colour, label=name)
        for place, value in zip(y + shift, values, strict=True):
            ax.annotate(
                f"{value:,.0f}", (value, place), (3, 0), textcoords="offset points", va="center", fontsize=8
            )
    ax.set_yticks(y, [row[0].replace(", ", ",\n") for row in rows])
    ax.set_xscale("log")
    ax.set_xlim(right=6 * max(max(row[1:8]) for row in rows))
    ax.set_xlabel("bytes a second (logarithmic)")
    ax.grid(visible=False, axis="y")
    ax.legend(loc="upper right", fontsize=8)
