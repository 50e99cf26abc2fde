"""Open problem (b): compact encoding. Segments, commands and frames of the same motion, in bytes."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final, NamedTuple

import msgspec
import numpy as np

from interfaces.engine_server.journal import Journal, changed
from interfaces.lab.claims import OWN_BAR, Claim, Findings, Study, Table
from interfaces.lab.doulgeri.script import HOME, MODEL, Act, arrivals, target, tool
from interfaces.lab.output import MUTED, REAL, VIRTUAL, draw
from interfaces.lab.statistics import bootstrap
from interfaces.messages import Change
from vrs import Engine, JointTarget, ManualClock, MotionCommand, PolynomialSegment, SteerCommand, Timeline
from vrs.model import frozen_array

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Canvas

RATE: Final = 50.0
"""Frames a second."""
PULSE: Final = 0.1
"""Period at which a reader of segments is told how far they are complete [s], as servlets do."""
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
    for act in acts(kind, rng, length):
        clock.set(act.t)
        before = journal.number
        journal.execute(act.command)
        size["commands"] += len(msgspec.msgpack.encode(_said(act)))
        for edit in journal.since(before):
            assert edit.change is not None
            data = encoded(edit.change)
            size["segments"] += len(data)
            reader = changed(reader, decoded(data))
    pulse = len(msgspec.msgpack.encode((journal.number, length, length)))
    frame = msgspec.msgpack.encode((int(length * RATE), length, HOME.tolist()))
    # msgpack marks a float32 and a float64 with one byte each.
    single = len(frame) - 4 * len(HOME)
    t = np.arange(int(length * RATE) + 1) / RATE
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
        for name, least, ratios in (
            ("segments", "> 1.1", [s.frames / s.segments for s in sizes]),
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
        rebuilt = max(s.rebuilt for s in sizes)
        claims.append(
            Claim(
                f"{NAMES[kind]}: who has the segments has the joints at every time, off by at most [rad]",
                SOURCE,
                "≤ 1e-12",
                rebuilt,
                rebuilt <= 1e-12,
            )
        )
        mean = Sizes(*(float(np.mean(column)) for column in zip(*sizes, strict=True)))
        worst = max(s.between for s in sizes)
        rows.append(
            (NAMES[kind], mean.frames, mean.frames_single, mean.segments, mean.commands, 1e3 * worst, rebuilt)
        )
    columns = (
        "motion",
        "frames B/s",
        "as float32",
        "segments B/s",
        "commands B/s",
        "between frames, tool mm",
        "segments, joints rad",
    )
    table = Table("encoding", "(b) msgpack of the values, no names", columns, tuple(rows))
    picture = draw(
        "b-encoding", "(b) bytes a second for the same motion", lambda canvas: _paint(canvas, rows), height=2.8
    )
    return Findings(tuple(claims), (table,), (picture,))


def _paint(canvas: Canvas, rows: list[tuple[Any, ...]]) -> None:
    ax = canvas.add_subplot()
    y = np.arange(len(rows))[::-1]
    bars = ((0.25, 1, MUTED, "frames, 50 a second"), (0.0, 3, VIRTUAL, "segments"), (-0.25, 4, REAL, "commands"))
    for shift, column, colour, name in bars:
        values = np.array([row[column] for row in rows])
        ax.barh(y + shift, values, 0.22, color=colour, label=name)
        for place, value in zip(y + shift, values, strict=True):
            ax.annotate(
                f"{value:,.0f}", (value, place), (3, 0), textcoords="offset points", va="center", fontsize=8
            )
    ax.set_yticks(y, [row[0].replace(", ", ",\n") for row in rows])
    ax.set_xscale("log")
    ax.set_xlim(right=6 * max(max(row[1:5]) for row in rows))
    ax.set_xlabel("bytes a second (logarithmic)")
    ax.grid(visible=False, axis="y")
    ax.legend(loc="upper right", fontsize=8)
