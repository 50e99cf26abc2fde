"""Random sessions: an engine under watch that's told this and that, and branches now and then."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

import numpy as np

from vrs.clock import ManualClock
from vrs.commands import Command, Lateness, ParameterChange
from vrs.engine import Engine
from vrs.errors import VrsError
from vrs.model import RobotModel
from vrs.receipt import Receipt
from vrs.testing.draws import Draws, Source
from vrs.testing.laws import Columns, Figures, LawBrokenError, check_run, columns
from vrs.testing.receipts import check_same
from vrs.testing.watch import Watch
from vrs.timeline import Timeline

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
