"""The engine: trajectory generation f and current position g under a clock.

Source: Doulgeri, Zikos, Delopoulos, section II.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import overload

import numpy as np
from numpy.typing import ArrayLike

from vrs import planning
from vrs.analyzer import check, solve
from vrs.chunk import HOLD, Piece
from vrs.clock import Clock
from vrs.commands import (
    Command,
    Insertion,
    Lateness,
    MotionCommand,
    ParameterChange,
    Position,
    PositionQuery,
    Receipt,
    Status,
    finite_array,
)
from vrs.errors import InvalidValueError, PlanningError, UnknownCommandError, UnreachablePoseError
from vrs.insertion import Edit, insert
from vrs.model import Array, Limits, RobotModel, frozen_array
from vrs.planning.parabolic import brake
from vrs.timeline import Timeline

_LIMIT_NAMES = ("qd_max", "qdd_max", "qddd_max")

UNDO_DEPTH = 1000
"""Commands that can be taken back, one after the other; each keeps a timeline alive."""


@dataclass(frozen=True, slots=True)
class _Change:
    """What an accepted command changed, so that it can be undone."""

    command_id: int
    before: Timeline
    receipts: tuple[Receipt, ...]
    """Receipts of other commands as they were before it."""


class Engine:
    """A virtual robot: commands edit the future of its timeline, queries read any time.

    With a clock it runs in real-time mode and the past can't be changed; without one it's offline and every
    time is open to edits.
    """

    def __init__(
        self,
        model: RobotModel,
        *,
        q: ArrayLike | None = None,
        timeline: Timeline | None = None,
        clock: Clock | None = None,
        lateness: Lateness = Lateness.POSTPONE,
    ) -> None:
        """Make an engine at rest at q, or a branch that goes on from a timeline.

        Args:
            model: The robot.
            q: Initial joints [rad], (n,), within the limits; `nominal`, else the middle of the range, by default.
            timeline: What to branch from, instead of q.
            clock: Real-time mode under this clock; None is the offline mode.
            lateness: What happens to commands whose execution time has passed.

        Raises:
            InvalidValueError: If both q and a timeline are given, or one doesn't fit the robot.
        """
        self._model = model
        self._limits = model.limits
        self._clock = clock
        self._lateness = _lateness(lateness)
        n = model.limits.dof
        if timeline is None:
            start = frozen_array(
                model.poses["nominal"]
                if q is None and "nominal" in model.poses
                else 0.5 * (model.limits.q_min + model.limits.q_max)
                if q is None
                else finite_array("q", q, (n,), f"finite joint values [rad], shape ({n},)")
            )
            model.limits.check(start)
            timeline = Timeline(start, clock.now() if clock is not None else 0.0)
        elif q is not None:
            raise InvalidValueError("q", q, "left out where a timeline is given")
        elif not isinstance(timeline, Timeline) or timeline.dof != n:
            raise InvalidValueError("timeline", timeline, f"a Timeline of {n} joints")
        self._timeline = timeline
        self._receipts: dict[int, Receipt] = {}
        self._changes: deque[_Change] = deque(maxlen=UNDO_DEPTH)
        self._newest = max(timeline.owners(0, len(timeline)), default=0)
        self._stills: list[int] = []

    @property
    def model(self) -> RobotModel:
        """The robot."""
        return self._model

    @property
    def clock(self) -> Clock | None:
        """The clock, None when offline."""
        return self._clock

    @property
    def timeline(self) -> Timeline:
        """The timeline as it is now; a value that later commands don't change."""
        return self._timeline

    @property
    def limits(self) -> Limits:
        """The limits in force: the model's, as parameter changes left them."""
        return self._limits

    @property
    def parameters(self) -> Mapping[str, object]:
        """Internal simulation parameters by name, with their values."""
        return {"lateness": self._lateness, **{name: getattr(self._limits, name) for name in _LIMIT_NAMES}}

    @property
    def receipts(self) -> tuple[Receipt, ...]:
        """The current truth of every command of this engine, in the order of their ids."""
        return tuple(self._receipts.values())

    def receipt(self, command_id: int) -> Receipt:
        """The current truth of a command.

        Raises:
            UnknownCommandError: If this engine gave no receipt of that id.
        """
        try:
            return self._receipts[command_id]
        except (KeyError, TypeError):
            raise UnknownCommandError(command_id, self._newest) from None

    def now(self) -> float:
        """Present time [s]; offline, the end of the plan."""
        return self._timeline.end if self._clock is None else self._clock.now()

    def joints(self, t: ArrayLike | None = None) -> Array:
        """g: joints at t, or now, [rad]: (n,), or (k, n) for t of shape (k,). Source: eq. (4).

        Raises:
            NonFiniteTimeError: If t holds NaN or infinity.
        """
        return self._timeline.sample(self.now() if t is None else t)

    def pose(self, t: ArrayLike | None = None) -> Array:
        """Pose of the last link in the base frame at t, or now: (4, 4) or (k, 4, 4)."""
        return self._model.forward(self.joints(t))

    def links(self, t: ArrayLike | None = None) -> Array:
        """Poses of base and links at t, or now: (n + 1, 4, 4) or (k, n + 1, 4, 4)."""
        return self._model.links(self.joints(t))

    @overload
    def execute(self, command: MotionCommand) -> Receipt: ...
    @overload
    def execute(self, command: PositionQuery) -> Position: ...
    @overload
    def execute(self, command: ParameterChange) -> None: ...
    def execute(self, command: Command) -> Receipt | Position | None:
        """Carry out a command: a motion is f, eq. (1); a position query is g, eq. (4).

        Args:
            command: What to do. Stamps are in this engine's time.

        Returns:
            A receipt, a position, or nothing for a parameter change. A motion that can't be is a receipt with
            Status.REJECTED and the reason; the timeline is then untouched.

        Raises:
            InvalidValueError: If the command's form doesn't fit the robot; nothing is changed.
        """
        checked = check(command, self._model)
        if isinstance(checked, PositionQuery):
            t = self.now() if checked.t is None else checked.t
            q = frozen_array(self.joints(t))
            return Position(t, q, frozen_array(self._model.forward(q)))
        if isinstance(checked, ParameterChange):
            self._set_parameter(checked)
            return None
        return self._move(checked)

    def undo(self) -> Receipt | None:
        """Take back the newest accepted command, as far as it lies in the future.

        A command that hasn't begun is taken back whole: the timeline is again what it was. One under way is
        taken back from now on: the arm brakes as fast as the limits allow, and what else was scheduled is
        dropped. One that is over stays.

        Returns:
            The receipt of the command that was taken back, as it is now; None where there's none.
        """
        if not self._changes:
            return None
        change = self._changes[-1]
        receipt = self._receipts[change.command_id]
        now = None if self._clock is None else self._clock.now()
        version = self._timeline.version + 1
        if now is None or (receipt.execute_at is not None and now <= receipt.execute_at):
            self._timeline = change.before.with_version(version)
            for old in change.receipts:
                self._receipts[old.command_id] = old
            reason = "undone"
        elif now < self._timeline.end:
            dropped = self._timeline.owners(max(self._timeline.index_at(now), 0), len(self._timeline))
            stop = brake(self._timeline.state_before(now), self._limits)
            piece = Piece(stop.durations.tolist(), stop.rows(), change.command_id)
            self._timeline = self._timeline.edited(now, [piece])
            for command_id in dropped:
                if self._arrives_after(command_id, now):
                    self._supersede(command_id, change.command_id)
            reason = f"undone from {now:.6g} s on"
        else:
            return None
        self._changes.pop()
        undone = replace(self._receipts[change.command_id], reason=reason, version=version, undone=True)
        self._receipts[change.command_id] = undone
        return undone

    def _move(self, command: MotionCommand) -> Receipt:
        now = None if self._clock is None else self._clock.now()
        issued = command.issued_at if command.issued_at is not None else now
        asked = command.execute_at
        status, reason = Status.ACCEPTED, ""
        if now is None:
            t = self._timeline.end if asked is None else asked
        else:
            t = max(now, issued if issued is not None else now) if asked is None else asked
            if issued is not None and t < issued:
                return self._reject(command, issued, f"t_exec = {t:.9g} s lies before t_iss = {issued:.9g} s")
            if t < now:
                late = f"t_exec = {t:.9g} s had passed at {now:.9g} s"
                if self._lateness is Lateness.REJECT:
                    return self._reject(command, issued, late)
                t = self._end_of_active(now)
                status, reason = Status.POSTPONED, f"{late}: postponed to {t:.9g} s"
        if command.insertion is Insertion.APPEND and t < self._timeline.end:
            t = self._timeline.end
            if asked is not None:
                status = Status.POSTPONED
                reason = f"{reason}; " if reason else ""
                reason += f"appended at the end of the plan, {t:.9g} s"
        command_id = self._newest + 1
        try:
            target, edit = self._plan(command, t, command_id)
        except (PlanningError, UnreachablePoseError, InvalidValueError) as error:
            return self._reject(command, issued, str(error))
        if edit.notes:
            reason = f"{reason}; {edit.notes}" if reason else edit.notes
        return self._accept(
            command_id,
            edit,
            Receipt(
                command_id=command_id,
                status=status,
                issued_at=issued,
                asked_at=asked,
                execute_at=t,
                end=edit.arrival,
                q=frozen_array(target),
                reason=reason,
                version=edit.timeline.version,
                shift=edit.shift,
            ),
        )

    def _plan(self, command: MotionCommand, t: float, command_id: int) -> tuple[Array, Edit]:
        limits, speed, profile = self._limits, command.speed, command.profile
        # The arm solution is chosen from where the arm will be at the final execution time.
        target = solve(command.target, command.motion, self._model, self._timeline.state_before(t).q)
        edit = insert(
            self._timeline,
            t,
            command.insertion,
            command_id,
            lambda state: planning.move(state, target, speed, profile, limits),
            lambda q, goal: planning.run_up(q, goal, speed, profile, limits),
        )
        return target, edit

    def _accept(self, command_id: int, edit: Edit, receipt: Receipt) -> Receipt:
        start = receipt.execute_at if receipt.execute_at is not None else edit.timeline.end
        # Commands to where the arm stood anyway have no segments that an edit could cut.
        stills = tuple(i for i in self._stills if self._stands_from(i, start))
        touched = [self._receipts[i] for i in {*edit.cut, *edit.shifted, *stills} if i in self._receipts]
        self._changes.append(_Change(command_id, self._timeline, tuple(touched)))
        superseded = (*(i for i in edit.cut if self._arrives_after(i, start)), *stills)
        for other in superseded:
            self._supersede(other, command_id)
        # A joining move can stand in the tail whose command has arrived before the cut.
        shifted = tuple(i for i in edit.shifted if self._arrives_after(i, start))
        for other in shifted:
            self._shift(other, edit.shift, edit.timeline.version)
        self._newest = command_id
        self._timeline = edit.timeline
        if receipt.end == start:
            self._stills.append(command_id)
        self._receipts[command_id] = replace(receipt, superseded=superseded, shifted=shifted)
        return self._receipts[command_id]

    def _arrives_after(self, command_id: int, t: float) -> bool:
        known = self._receipts.get(command_id)
        return known is None or (known.end is not None and known.end > t)

    def _stands_from(self, command_id: int, t: float) -> bool:
        known = self._receipts[command_id]
        return known.superseded_by is None and known.execute_at is not None and known.execute_at >= t

    def _supersede(self, command_id: int, by: int) -> None:
        known = self._receipts.get(command_id)
        if known is not None:
            self._receipts[command_id] = replace(known, superseded_by=by, version=self._timeline.version + 1)

    def _shift(self, command_id: int, delta: float, version: int) -> None:
        known = self._receipts.get(command_id)
        if known is None or known.execute_at is None or known.end is None:
            return
        self._receipts[command_id] = replace(
            known, execute_at=known.execute_at + delta, end=known.end + delta, version=version
        )

    def _reject(self, command: MotionCommand, issued: float | None, reason: str) -> Receipt:
        self._newest += 1
        receipt = Receipt(
            command_id=self._newest,
            status=Status.REJECTED,
            issued_at=issued,
            asked_at=command.execute_at,
            reason=reason,
            version=self._timeline.version,
        )
        self._receipts[self._newest] = receipt
        return receipt

    def _end_of_active(self, now: float) -> float:
        """End of the segment that is valid now; in a hold, or where none is, now."""
        index = self._timeline.index_at(now)
        if 0 <= index < len(self._timeline) and self._timeline.owner_of(index) != HOLD:
            return self._timeline.start_of(index + 1)
        return now

    def _set_parameter(self, change: ParameterChange) -> None:
        if change.name == "lateness":
            self._lateness = _lateness(change.value)
            return
        if change.name not in _LIMIT_NAMES:
            raise InvalidValueError("parameter", change.name, f"one of {', '.join(self.parameters)}")
        if self._clock is not None and self._clock.now() < self._timeline.end:
            until = f"changed at rest, with nothing scheduled (the plan ends at {self._timeline.end:.6g} s)"
            raise InvalidValueError(change.name, change.value, until)
        n = self._limits.dof
        allowed = f"a positive number, or {n} of them"
        value = finite_array(change.name, change.value, None, allowed)
        if value.ndim > 1 or (value.ndim == 1 and len(value) != n) or not (value > 0).all():
            raise InvalidValueError(change.name, change.value, allowed)
        self._limits = replace(self._limits, **{change.name: np.broadcast_to(value, (n,))})


def _lateness(value: object) -> Lateness:
    try:
        return Lateness(value)  # type: ignore[arg-type]
    except ValueError:
        raise InvalidValueError("lateness", value, f"one of {', '.join(Lateness)}") from None
