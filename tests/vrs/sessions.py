"""Random sessions: an engine under watch that's told this and that, and branches now and then.

Its commands are random, of every kind, with the values that find faults: limits, knots, tiny moves, late stamps.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from math import inf, log
from typing import Protocol, TypeVar

import numpy as np

from tests.vrs.laws import Columns, Figures, LawBrokenError, check_run, check_same, columns
from tests.vrs.watch import Watch
from vrs.clock import ManualClock
from vrs.commands import (
    Cancel,
    Command,
    Frame,
    Insertion,
    InsertVia,
    JointTarget,
    Lateness,
    Motion,
    MotionCommand,
    ParameterChange,
    PoseTarget,
    PositionQuery,
    Profile,
    Resume,
    Retime,
    ScaleTime,
    SteerCommand,
    Stop,
    Target,
)
from vrs.engine import Engine
from vrs.errors import VrsError
from vrs.ledger import Receipt
from vrs.model import Array, RobotModel, frozen_array
from vrs.timeline import Timeline

Item = TypeVar("Item")

KINDS = {
    "move": 34, "steer": 15, "retime": 12, "cancel": 8, "via": 8, "scale": 5, "stop": 5, "resume": 2, "undo": 7,
    "parameter": 2, "query": 2,
}  # fmt: skip
"""How often each kind is drawn, of 100."""

_TINY = 1e-9
"""How far beside a knot times are drawn [s]."""


class Source(Protocol):
    """Where chance comes from: a random generator, or a test tool that shrinks what it drew."""

    def share(self) -> float:
        """A number from 0 to 1."""

    def pick(self, count: int) -> int:
        """A number from 0 to count − 1."""


class Generator:
    """Chance from NumPy."""

    def __init__(self, seed: int | list[int]) -> None:
        self._rng = np.random.default_rng(seed)

    def share(self) -> float:
        """A number from 0 to 1."""
        return float(self._rng.random())

    def pick(self, count: int) -> int:
        """A number from 0 to count − 1."""
        return int(self._rng.random() * count)


class Draws:
    """Draws commands for an engine under watch."""

    def __init__(self, source: Source, model: RobotModel, *, lines: bool = True) -> None:
        """Draw for a robot.

        Args:
            source: Where chance comes from.
            model: The robot.
            lines: Whether straight lines are drawn.
        """
        self._source = source
        self._model = model
        self._lines = lines
        self._last = 0.0
        self._before = ""

    def one_of(self, *items: Item) -> Item:
        """One of some things."""
        return items[self._source.pick(len(items))]

    def chance(self, share: float) -> bool:
        """Whether something of this probability happens."""
        return self._source.share() >= 1.0 - share

    def exponential(self, mean: float) -> float:
        """A number ≥ 0 of an exponential distribution."""
        return -mean * log(1.0 - 0.999999 * self._source.share())

    def share(self) -> float:
        """A number from 0 to 1."""
        return self._source.share()

    def vector(self, low: Array, high: Array) -> Array:
        """Numbers between bounds."""
        return low + np.array([self._source.share() for _ in low]) * (high - low)

    def configuration(self) -> Array:
        """Joints within the limits, often at one [rad], (n,)."""
        limits = self._model.limits
        q = self.vector(limits.q_min, limits.q_max)
        return np.where([self.chance(0.1) for _ in q], limits.q_min, q)

    def joints(self, present: Array) -> Array:
        """A target within the limits [rad], (n,): anywhere, at limits, at or next to the present."""
        limits = self._model.limits
        q = self.vector(limits.q_min, limits.q_max)
        how = self._source.pick(8)
        if how == 0:
            q = np.where([self.chance(0.5) for _ in q], limits.q_min, limits.q_max)
        elif how == 1:
            q = np.where([self.chance(0.5) for _ in q], present, q)
        elif how == 2:
            away = (2.0 * self.vector(np.zeros_like(q), np.ones_like(q)) - 1.0) * 10.0 ** -self._source.pick(9)
            q = present + away
        elif how == 3:
            edge = np.where([self.chance(0.5) for _ in q], limits.q_min, limits.q_max)
            q = edge + 1e-6 * self.vector(-np.ones_like(q), np.ones_like(q))
        elif how == 4:
            q = np.array(present)
        return np.clip(q, limits.q_min, limits.q_max)

    def target(self, present: Array) -> Target:
        """Joints, or a pose that some arm solution reaches, or that none does."""
        if not self.chance(0.2):
            return JointTarget(self.joints(present))
        return self._pose(self._model.forward(self.joints(present)), 2.0 if self.chance(0.03) else 0.0)

    def near(self, present: Array) -> Target:
        """A pose that may lie on a straight line from the present one, or joints near the present ones."""
        if self.chance(0.3):
            away = 0.4 * self.vector(-np.ones_like(present), np.ones_like(present))
            return JointTarget(np.clip(present + away, self._model.limits.q_min, self._model.limits.q_max))
        return self._pose(self._model.forward(present), self.one_of(0.3, 0.1, 0.01, 1e-6))

    def _pose(self, X: Array, reach: float) -> PoseTarget:
        moved = np.array(X)
        moved[:3, 3] += reach * self.vector(-np.ones(3), np.ones(3))
        angle = min(reach, 1.0) * (2.0 * self._source.share() - 1.0)
        moved[:3, :3] = moved[:3, :3] @ _turn(angle)
        return PoseTarget(moved)

    def time(self, watch: Watch) -> float:
        """A time [s]: anywhere in the plan, past its end, at knots or beside them, in the past."""
        timeline = watch.engine.timeline
        clock = watch.engine.clock
        now = float(timeline.start) if clock is None else clock.now()
        low = max(timeline.index_at(now), 0)
        knot = timeline.start_of(low + self._source.pick(max(len(timeline) - low, 1))) if len(timeline) else now
        beside = self.one_of(0.0, _TINY, -_TINY)
        how = self._source.pick(9)
        if how < 3:
            t = now + max(timeline.end - now, 0.5) * self._source.share()
        elif how == 3:
            t = now + self.exponential(0.3)
        elif how == 4:
            t = timeline.end + self.one_of(0.0, self.exponential(0.5))
        elif how < 7:
            t = knot + beside
        elif how == 7:
            t = self._last + beside
        else:
            t = now - self.exponential(0.2)
        if clock is None and t < timeline.start and not self.chance(0.05):
            t = timeline.start
        self._last = t
        return float(t)

    def stamps(self, watch: Watch, soon: float = 0.3) -> tuple[float | None, float | None]:
        """Issue and execution time [s], or None."""
        clock = watch.engine.clock
        t = None if self.chance(soon) else self.time(watch)
        if clock is None or self.chance(0.3):
            return None, t
        issued = clock.now() - self.one_of(0.0, self.exponential(0.3))
        return (issued if t is None or self.chance(0.05) else min(issued, t)), t

    def move(self, watch: Watch) -> MotionCommand:
        """A motion command."""
        issued, t = self.stamps(watch, 0.15)
        present = watch.engine.timeline.sample(watch.engine.timeline.end if t is None else t)
        line = self._lines and self.chance(0.15)
        return MotionCommand(
            self.near(present) if line else self.target(present),
            issued,
            t,
            speed=self.one_of(1.0, 0.05 + 0.95 * self._source.share(), 0.01),
            motion=Motion.LINE if line else Motion.JOINT,
            profile=self.one_of(*Profile),
            insertion=self.one_of(
                Insertion.SPLICE, Insertion.APPEND, Insertion.SPLICE, Insertion.APPEND, Insertion.REPLACE
            ),
            deviation=self.deviation(),
            pace=self.one_of(0.5, 0.25, 0.05 + 0.95 * self._source.share()) if self.chance(0.2) else 1.0,
            acceleration=0.01 + 0.99 * self._source.share() if self.chance(0.15) else 1.0,
            tool=self.tool() if self.chance(0.3) else None,
        )

    def deviation(self) -> float:
        """How far from the end of the move before it a move may stay [m]."""
        how = self._source.pick(20)
        return inf if how >= 16 else self.exponential(0.1) if how >= 12 else 0.0

    def tool(self) -> Array:
        """A frame up to 0.3 m from the last link, (4, 4)."""
        a, b = (2.0 * self.vector(np.zeros(2), np.ones(2)) - 1.0) * np.pi
        X = np.eye(4)
        X[:3, :3] = _turn(a) @ _turn(b)[:, [2, 0, 1]][[2, 0, 1]]
        X[:3, 3] = 0.3 * self.vector(-np.ones(3), np.ones(3)) * self.one_of(1.0, 0.0, 0.1)
        return X

    def steer(self, watch: Watch) -> SteerCommand:
        """A steering input, fresh most of the time."""
        clock, engine = watch.engine.clock, watch.engine
        t = None if self.chance(0.6) else self.time(watch)
        now = clock.now() if clock is not None else engine.timeline.end if t is None else t
        begin = now if t is None else t
        issued = None if self.chance(0.4) else min(begin, now) - self.one_of(0.0, 0.25 * self._source.share())
        limits = engine.limits
        if self.chance(0.5):
            u = self.one_of(0.0, 0.3, 1.0, 1.5) * self.vector(-limits.qd_max, limits.qd_max)
            return SteerCommand(rates=u, issued_at=issued, execute_at=t)
        twist = self.vector(-np.ones(6), np.ones(6)) * self.one_of(0.0, 0.1, 0.5, 2.0)
        return SteerCommand(twist=twist, frame=self.one_of(*Frame), issued_at=issued, execute_at=t)

    def command_id(self, watch: Watch) -> int:
        """A move that's scheduled, most of the time; else any id, perhaps of no command."""
        clock = watch.engine.clock
        now = -np.inf if clock is None else clock.now()
        moves = watch.receipts.keys() if self.chance(0.1) else watch.moves.keys()
        scheduled = (watch.receipts[i] for i in moves)
        ids = [r.command_id for r in scheduled if r.stands and r.end is not None and r.end >= now]
        if ids and not self.chance(0.07):
            return self.one_of(*ids)
        return 1 + self._source.pick(max(watch.receipts, default=0) + 2)

    def retime(self, watch: Watch) -> Retime:
        """A move at another time."""
        issued, _ = self.stamps(watch)
        i = self.command_id(watch)
        receipt = watch.receipts.get(i)
        start = receipt.execute_at if receipt is not None else None
        if start is not None and self.chance(0.5):
            t = start + self.exponential(0.5) * self.one_of(1.0, -1.0, 1e-6)
        else:
            t = self.time(watch)
        return Retime(i, t, issued if issued is None or self.chance(0.05) else min(issued, t))

    def cancel(self, watch: Watch) -> Cancel:
        """A move taken out."""
        return Cancel(self.command_id(watch), *self.stamps(watch, 0.6))

    def via(self, watch: Watch) -> InsertVia:
        """A move by another place."""
        i = self.command_id(watch)
        deviation = self.exponential(0.1) if self.chance(0.6) else 0.0
        present = watch.engine.timeline.sample(self.time(watch))
        return InsertVia(i, self.target(present), deviation, *self.stamps(watch, 0.6))

    def scale(self, watch: Watch) -> ScaleTime:
        """Another pace."""
        factor = self.one_of(0.5, 2.0, 0.3 + 2.7 * self._source.share(), 0.8, 1.25, 0.1, 1.0, 20.0)
        return ScaleTime(factor, *self.stamps(watch, 0.5))

    def parameter(self) -> ParameterChange:
        """Other limits, half to one and a half times the model's; or the other policy."""
        if self.chance(0.4):
            return ParameterChange("lateness", self.one_of(*Lateness))
        name = self.one_of("qd_max", "qdd_max", "qddd_max")
        usual: Array = getattr(self._model.limits, name)
        return ParameterChange(name, frozen_array(self.vector(0.5 * usual, 1.5 * usual)))

    def command(self, watch: Watch, kind: str) -> Command | None:
        """A command of a kind; None to undo."""
        if kind == "undo":
            return None
        if kind == "stop":
            return Stop(*self.stamps(watch, 0.5))
        if kind == "resume":
            return Resume(*self.stamps(watch, 0.6))
        if kind == "query":
            return PositionQuery(self.one_of(None, self.time(watch)))
        if kind == "parameter":
            return self.parameter()
        draws: dict[str, Callable[[Watch], Command]] = {
            "move": self.move, "steer": self.steer, "retime": self.retime, "cancel": self.cancel, "via": self.via,
            "scale": self.scale,
        }  # fmt: skip
        return draws[kind](watch)

    def kind(self) -> str:
        """A kind of command: stops are often resumed, and steering goes on."""
        if self._before == "stop" and self.chance(0.5):
            self._before = "resume"
        elif not (self._before == "steer" and self.chance(0.6)):
            place = self._source.pick(sum(KINDS.values()))
            for name, share in KINDS.items():
                place -= share
                if place < 0:
                    self._before = name
                    break
        return self._before

    def pause(self, engine: Engine) -> float:
        """How long until the next command [s]."""
        now, end = engine.now(), engine.timeline.end
        how = self._source.pick(10)
        if how == 0:
            return 0.0
        if how == 1:
            return max(end - now, 0.0) * self.one_of(1.0, self._source.share())
        if self._before == "steer":
            return 0.05 * self._source.share()
        return self.exponential(0.3)


def _turn(angle: float) -> Array:
    """Rotation about z, (3, 3)."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def lines_are_planned(model: RobotModel) -> bool:
    """Whether engines for a robot take straight lines."""
    engine = Engine(model, clock=ManualClock(0.0))
    X = np.array(model.forward(engine.joints()))
    X[2, 3] += 0.01
    return engine.execute(MotionCommand(PoseTarget(X), motion=Motion.LINE)).stands


_BRANCHES = 0.01
"""How often a session goes on on a branch, a command."""
_AT_ONCE = 64
"""Knots that an audit looks at together."""


@dataclass(frozen=True, slots=True, eq=False)
class _Left:
    """An engine that a session branched from, as it then was."""

    engine: Engine
    timeline: Timeline
    segments: Columns
    receipts: dict[int, Receipt]


class Session:
    """An engine, what it was told, and how it answered."""

    def __init__(self, model: RobotModel, source: Source, figures: Figures, *, lines: bool = True) -> None:
        """Begin with an engine at rest somewhere, offline or with a clock.

        Args:
            model: The robot.
            source: Where chance comes from.
            figures: Where the worst figures are kept.
            lines: Whether straight lines are drawn.
        """
        self._model = model
        self._draws = draws = Draws(source, model, lines=lines)
        self._left: list[_Left] = []
        self.script: list[tuple[float | None, Command | None]] = []
        """What was told, and when [s]; None for undo, and None offline."""
        self.answers: Counter[tuple[str, str]] = Counter()
        """How often a kind of command had an outcome."""
        self.reasons: Counter[tuple[str, str]] = Counter()
        """Why kinds of commands were rejected, figures left out."""
        q = draws.configuration()
        self._clock = ManualClock(draws.one_of(0.0, 1e3)) if draws.chance(0.6) else None
        lateness = draws.one_of(*Lateness)
        engine = Engine(model, q=q, clock=self._clock, lateness=lateness)
        self.watch = Watch(engine, figures, self.answers, self.reasons)

    def go_on(self, edits: int) -> None:
        """Tell the engine this and that.

        Raises:
            LawBrokenError: If a law is broken.
        """
        for _ in range(edits):
            self.tell(self._draws.kind())
            if self._draws.chance(_BRANCHES):
                self.branch()

    def tell(self, kind: str) -> None:
        """Draw a command of a kind, and pass it on; with a clock, let some time pass.

        Raises:
            LawBrokenError: If a law is broken.
        """
        engine, clock = self.watch.engine, self._clock
        command = self._draws.command(self.watch, kind)
        if (
            isinstance(command, ParameterChange)
            and command.name != "lateness"
            and clock is None
            and len(engine.timeline)
        ):
            # Offline there's no rest: what was planned under other limits stays open to edits.
            return
        self.script.append((None if clock is None else clock.now(), command))
        try:
            if command is None:
                self.watch.undo()
            else:
                self.watch.execute(command)
        except VrsError:
            # Misuse, drawn on purpose: the watch has seen that nothing changed.
            pass
        if clock is not None:
            clock.advance(self._draws.pause(engine))

    def branch(self) -> None:
        """Go on on a branch of the timeline, with an engine of its own.

        Not where limits were changed: a branch has the model's, and its past may have passed those.
        """
        engine = self.watch.engine
        if any(
            not np.array_equal(getattr(engine.limits, name), getattr(self._model.limits, name))
            for name in ("qd_max", "qdd_max", "qddd_max")
        ):
            return
        receipts = {r.command_id: r for r in engine.receipts}
        self._left.append(_Left(engine, engine.timeline, columns(engine.timeline), receipts))
        draws, t = self._draws, engine.timeline
        if draws.chance(0.6):
            self._clock = ManualClock(t.start + draws.one_of(0.0, 1.0, draws.share()) * (t.end - t.start))
        else:
            self._clock = None
        branch = Engine(self._model, timeline=t, clock=self._clock, lateness=draws.one_of(*Lateness))
        self.answers["branch", "made"] += 1
        self.watch = Watch(branch, self.watch.figures, self.answers, self.reasons)

    def audit(self) -> None:
        """Look at the whole timeline once more, and at what was branched from.

        Raises:
            LawBrokenError: If a law is broken.
        """
        engine = self.watch.engine
        run = columns(engine.timeline)
        for low in range(0, len(run), _AT_ONCE):
            check_run(run, low, low, engine.limits, set(), self.watch.figures)
        for left in self._left:
            receipts = {r.command_id: r for r in left.engine.receipts}
            check_same(left.receipts, receipts, "branch")
            now = columns(left.timeline)
            same = left.segments.rows == now.rows and left.segments.owners == now.owners
            if left.engine.timeline is not left.timeline or not same:
                raise LawBrokenError("branch", "the timeline that was branched from is another")
