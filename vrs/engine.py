"""The engines of arms and of mobile robots: trajectory generation f and current position g under a clock.

Source: Doulgeri, Zikos, Delopoulos, section II.
"""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import AbstractContextManager
from dataclasses import replace
from enum import Enum
from math import cos, inf, sin
from typing import TYPE_CHECKING, Any, ClassVar, NoReturn, Self, cast, overload

import numpy as np
from numpy.typing import ArrayLike
from typing_extensions import override

from vrs.archive import Keeper
from vrs.checks import finite, finite_array, word
from vrs.clock import Clock
from vrs.commands import (
    Cancel,
    Command,
    DriveCommand,
    InsertVia,
    Lateness,
    MotionCommand,
    ParameterChange,
    Position,
    PositionQuery,
    Redo,
    Resume,
    Retime,
    ScaleTime,
    Stop,
    Target,
)
from vrs.errors import InvalidValueError
from vrs.ledger import Ledger, Receipt
from vrs.model import Array, Limits, RobotModel, frozen_array, home
from vrs.moves import check
from vrs.notes import Notes
from vrs.scheduler import Edited, HandGoal, Scheduler
from vrs.timeline import Timeline

if TYPE_CHECKING:
    from vrs.anchoring import Anchored
    from vrs.ledger import Standing
    from vrs.mobile.model import DriveLimits, MobileModel
    from vrs.mobile.scheduler import DriveScheduler
    from vrs.mobile.timeline import ArcTimeline


class Engine:
    """A virtual robot: commands edit the future of its timeline, queries read any time.

    With a clock it runs in real-time mode and the past can't be changed; without one it's offline and every
    time is open to edits. Of a mobile robot's model it makes a `MobileEngine`.
    """

    _limit_names: ClassVar[tuple[str, ...]] = ("qd_max", "qdd_max", "qddd_max")
    """Limits that a `ParameterChange` changes."""

    def __new__(cls, *given: object, **named: object) -> Self:
        """Choose the kind of engine for a robot; copies of an engine have their kind, and so have other classes."""
        model = given[0] if given else named.get("model")
        if cls is Engine and model is not None and not isinstance(getattr(model, "limits", None), Limits):
            return cast("Self", object.__new__(MobileEngine))
        return object.__new__(cls)

    @overload
    def __init__(  # type: ignore[misc]
        self: MobileEngine,
        model: MobileModel,
        *,
        posture: ArrayLike | None = None,
        timeline: ArcTimeline | None = None,
        clock: Clock | None = None,
        lateness: Lateness = Lateness.POSTPONE,
    ) -> None: ...
    @overload
    def __init__(
        self,
        model: RobotModel,
        *,
        q: ArrayLike | None = None,
        timeline: Timeline | None = None,
        clock: Clock | None = None,
        lateness: Lateness = Lateness.POSTPONE,
    ) -> None: ...
    def __init__(
        self,
        model: Any,
        *,
        q: ArrayLike | None = None,
        timeline: Any = None,
        clock: Clock | None = None,
        lateness: Lateness = Lateness.POSTPONE,
        posture: object = None,
    ) -> None:
        """Make an engine at rest at q, or a branch that goes on from a timeline.

        Args:
            model: The robot.
            q: Initial joints [rad], (n,), within the limits; `nominal`, else the middle of the range, by default.
            timeline: What to branch from, instead of q.
            clock: Real-time mode under this clock; None is the offline mode.
            lateness: What happens to commands whose execution time has passed.
            posture: For mobile robots; see `MobileEngine`.

        Raises:
            InvalidValueError: If both q and a timeline are given, or one doesn't fit the robot.
        """
        if posture is not None:
            raise InvalidValueError("posture", posture, f"left out: {model.name} has joints and no wheels")
        n = model.limits.dof
        if timeline is None:
            allowed = f"finite joint values [rad], shape ({n},)"
            start = home(model) if q is None else frozen_array(finite_array("q", q, (n,), allowed))
            model.limits.check(start, model.prismatic)
            timeline = Timeline(start, clock.now() if clock is not None else 0.0)
        elif q is not None:
            raise InvalidValueError("q", q, "left out where a timeline is given")
        elif not isinstance(timeline, Timeline) or timeline.dof != n:
            raise InvalidValueError("timeline", timeline, f"a Timeline of {n} joints")
        self.model: RobotModel = model
        """The robot."""
        self.clock = clock
        """The clock, None when offline."""
        ledger: Ledger[Timeline] = Ledger(max(timeline.owners(0, len(timeline)), default=0))
        self.scheduler = Scheduler(model, timeline, ledger, word("lateness", lateness, Lateness))
        """Plans the commands."""
        self._keeper = Keeper()

    @property
    def timeline(self) -> Timeline:
        """The timeline as it is now; a value that later commands don't change."""
        return self.scheduler.timeline

    @property
    def limits(self) -> Limits:
        """The limits in force: the model's, as parameter changes left them."""
        return self.scheduler.limits

    @property
    def parameters(self) -> Mapping[str, object]:
        """Internal simulation parameters by name, with their values."""
        return {
            "lateness": self.scheduler.lateness,
            **{name: getattr(self.scheduler.limits, name) for name in self._limit_names},
        }

    @property
    def receipts(self) -> tuple[Receipt, ...]:
        """The current truth of every command of this engine, in the order of their ids."""
        return self.scheduler.ledger.all()

    def receipt(self, command_id: int) -> Receipt:
        """The current truth of a command.

        Raises:
            UnknownCommandError: If this engine gave no receipt of that id.
        """
        return self.scheduler.ledger.receipt(command_id)

    def command(self, command_id: int) -> MotionCommand | None:
        """The motion command of an id; None where it was something else or isn't known."""
        return self.scheduler.ledger.command(command_id)

    def notes(self, command_id: int) -> Notes:
        """What the reason of a command's receipt is the text of; empty where it was rejected or isn't known."""
        return self.scheduler.ledger.notes(command_id)

    def now(self) -> float:
        """Present time [s]; offline, the end of the plan."""
        return self.scheduler.timeline.end if self.clock is None else self.clock.now()

    def joints(self, t: ArrayLike | None = None) -> Array:
        """g: joints at t, or now, [rad]: (n,), or (k, n) for t of shape (k,). Source: eq. (4).

        Raises:
            NonFiniteTimeError: If t holds NaN or infinity.
        """
        return self.scheduler.timeline.sample(self.now() if t is None else t)

    def pose(self, t: ArrayLike | None = None) -> Array:
        """Pose of the last link in the base frame at t, or now: (4, 4) or (k, 4, 4)."""
        return self.model.forward(self.joints(t))

    def opening(self, t: ArrayLike | None = None) -> Array:
        """What the hand is told at t, or now [m], () or (k,); infinity for as far open as it goes, as at first."""
        return self.scheduler.opening(self.now() if t is None else t)

    def begin_with(self, opening: float) -> None:
        """Let the hand have been told an opening [m] before all else; an engine that was just made begins so."""
        self.scheduler.grips = (HandGoal(-inf, opening),)

    def links(self, t: ArrayLike | None = None) -> Array:
        """Poses of base and links at t, or now: (n + 1, 4, 4) or (k, n + 1, 4, 4)."""
        return self.model.links(self.joints(t))

    @overload
    def execute(self, command: Edited | Redo) -> Receipt: ...
    @overload
    def execute(self, command: PositionQuery) -> Position: ...
    @overload
    def execute(self, command: ParameterChange) -> None: ...
    def execute(self, command: Command) -> Receipt | Position | None:
        """Carry out a command: a motion is f, eq. (1); a position query is g, eq. (4).

        Args:
            command: What to do. Stamps are in this engine's time.

        Returns:
            A receipt, a position, or nothing for a parameter change. What can't be is a receipt with
            Status.REJECTED and the reason; the timeline is then untouched. Edits of a command (retime, cancel,
            via) are answered with that command's receipt.

        Raises:
            InvalidValueError: If the command's form doesn't fit the robot; nothing is changed.
            UnknownCommandError: If it names a command that this engine gave no receipt of.
        """
        checked = self._checked(command)
        if isinstance(checked, PositionQuery):
            return self._position(self.now() if checked.t is None else checked.t)
        with self.atomic():
            if isinstance(checked, ParameterChange):
                self._set_parameter(checked)
                return None
            if isinstance(checked, Redo):
                return self.scheduler.redo(self._present())
            return self.scheduler.execute(checked, self._present())

    def _checked(self, command: object) -> Edited | Redo | PositionQuery | ParameterChange:
        """The command, of a form that fits the robot."""
        return check(command, self.model)

    def _position(self, t: float) -> Position:
        """The answer to a query about a time [s]."""
        q = frozen_array(self.joints(t))
        return Position(t, q, frozen_array(self.model.forward(q)))

    def atomic(self) -> AbstractContextManager[None]:
        """Put timeline, receipts and parameters back as they were, if what is done meanwhile raises.

        Every command and edit is carried out so; a caller that has something to add to one, which may fail, does
        both inside.
        """
        return self.scheduler.atomic()

    def _present(self) -> float | None:
        if self.clock is None:
            return None
        now = self.clock.now()
        self._keeper.tidy(self.scheduler.timeline, now)
        return now

    def retime(self, command_id: int, t: float, *, issued_at: float | None = None) -> Receipt:
        """Let a scheduled move begin at t [s]; see `vrs.commands.Retime` and `execute`."""
        return self.execute(Retime(command_id, t, issued_at))

    def cancel(
        self, command_id: int, *, issued_at: float | None = None, execute_at: float | None = None
    ) -> Receipt:
        """Take a scheduled move out of the plan; see `vrs.commands.Cancel` and `execute`."""
        return self.execute(Cancel(command_id, issued_at, execute_at))

    def insert_via(
        self,
        command_id: int,
        target: Target,
        *,
        deviation: float = 0.0,
        issued_at: float | None = None,
        execute_at: float | None = None,
    ) -> Receipt:
        """Let a scheduled move go by another place; see `vrs.commands.InsertVia` and `execute`."""
        return self.execute(InsertVia(command_id, target, deviation, issued_at, execute_at))

    def scale_time(
        self, factor: float, *, issued_at: float | None = None, execute_at: float | None = None
    ) -> Receipt:
        """Run what is scheduled `factor` times as fast; see `vrs.commands.ScaleTime` and `execute`."""
        return self.execute(ScaleTime(factor, issued_at, execute_at))

    def stop(self, *, issued_at: float | None = None, execute_at: float | None = None) -> Receipt:
        """Stop along the present motion, drop what is scheduled; see `vrs.commands.Stop` and `execute`."""
        return self.execute(Stop(issued_at, execute_at))

    def resume(self, *, issued_at: float | None = None, execute_at: float | None = None) -> Receipt:
        """Go on with what a stop interrupted; see `vrs.commands.Resume` and `execute`."""
        return self.execute(Resume(issued_at, execute_at))

    @property
    def newest(self) -> int:
        """Highest command id given out; 0 while there's none."""
        return self.scheduler.ledger.newest

    def count_from(self, command_id: int) -> None:
        """Give the next command the id after this one; a replica numbers as the engine that it follows.

        An id that was given out before must not come again.
        """
        self.scheduler.ledger.newest = command_id

    def standing(self) -> Standing:
        """What the next commands depend on besides the timeline; see `vrs.ledger.Standing`."""
        return self.scheduler.standing(self.now())

    def take_up(self, stand: Standing) -> None:
        """Let an engine that was just made on a timeline go on as the one did that stood so."""
        self.scheduler.take_up(stand)

    def refuse(self, command: Command, reason: str, refusal: Enum | None = None) -> Receipt:
        """Answer a command that something outside the engine forbids; `refusal` is the reason as a code."""
        issued, asked = getattr(command, "issued_at", None), getattr(command, "execute_at", None)
        return self.scheduler.reject(issued, asked, reason, refusal)

    def refusal(self, command_id: int) -> Enum | None:
        """The code with which something outside the engine refused a command; None for any other."""
        entry = self.scheduler.ledger.entries.get(command_id)
        return None if entry is None else entry.refusal

    def anchor(self, truth: Timeline) -> Anchored:
        """Go over from now on into a timeline that turned out to be the true one; see `vrs.anchoring.anchored`.

        Raises:
            InvalidValueError: If the timeline is of another number of joints.
            PlanningError: If no way to it keeps the limits.
        """
        with self.atomic():
            return self.scheduler.anchor(truth, self.now())

    def undo(self) -> Receipt | None:
        """Take back the newest accepted command or edit, as far as it lies in the future.

        What hasn't begun is taken back whole: the timeline is again what it was. What is under way is taken
        back from now on: the arm brakes as fast as the limits allow, and what else was scheduled is dropped.
        What is over stays.

        Returns:
            The receipt of the command that was taken back, as it is now; None where there's none.
        """
        with self.atomic():
            return self.scheduler.undo(self._present())

    def undo_refusal(self) -> str:
        """Why `undo` takes nothing back now; empty where it does, or where nothing was ever commanded."""
        return self.scheduler.undo_refusal(self._present())

    def redo(self) -> Receipt:
        """Take back the newest undo: the plan is again what it was before, as far as nothing of it has passed.

        Returns:
            The receipt of the command that was undone, as it is now; or a rejection: nothing was undone, or
            something was commanded since.
        """
        return self.execute(Redo())

    def _set_parameter(self, change: ParameterChange) -> None:
        plan = self.scheduler
        # What was planned keeps the limits of then.
        plan.ledger.redo_steps.clear()
        if change.name == "lateness":
            plan.lateness = word("lateness", change.value, Lateness)
            return
        if change.name not in self._limit_names:
            raise InvalidValueError("parameter", change.name, f"one of {', '.join(self.parameters)}")
        if self.clock is not None and self.clock.now() < plan.timeline.end:
            until = f"changed at rest, with nothing scheduled (the plan ends at {plan.timeline.end:.6g} s)"
            raise InvalidValueError(change.name, change.value, until)
        plan.limits = replace(plan.limits, **{change.name: self._limit(change)})

    def _limit(self, change: ParameterChange) -> Any:
        """A limit as it's to be."""
        n = self.scheduler.limits.dof
        allowed = f"a positive number, or {n} of them"
        value = finite_array(change.name, change.value, None, allowed)
        if value.ndim > 1 or (value.ndim == 1 and len(value) != n) or not (value > 0).all():
            raise InvalidValueError(change.name, change.value, allowed)
        return np.broadcast_to(value, (n,))


class MobileEngine(Engine):
    """A virtual mobile robot: `Engine(model, posture=...)` makes one.

    It takes `DriveCommand`, `Stop`, `PositionQuery` and `ParameterChange`; a position's q is the posture, (3,), its
    X the robot's pose in the world frame. What is about joints raises.

    A drive command without an execution time begins at the end of what is planned, or now if that's past. One
    within the plan replaces what is left of the command that it interrupts; the commands after that keep their
    speeds and durations, are shifted as a whole by one Δ ≥ 0, and go on from where the robot then is. One whose
    speeds pass the limits is rejected.
    """

    model: MobileModel  # type: ignore[assignment]
    scheduler: DriveScheduler  # type: ignore[assignment]
    _limit_names: ClassVar[tuple[str, ...]] = ("v_max", "w_max", "a_max", "alpha_max")

    def __init__(
        self,
        model: MobileModel,
        *,
        posture: ArrayLike | None = None,
        timeline: ArcTimeline | None = None,
        clock: Clock | None = None,
        lateness: Lateness = Lateness.POSTPONE,
        q: None = None,
    ) -> None:
        """Make an engine that stands at a posture, or a branch that goes on from a timeline.

        Args:
            model: The robot.
            posture: Initial (x, y, θ) [m, m, rad] in the world frame, (3,); the origin by default.
            timeline: What to branch from, instead of a posture.
            clock: Real-time mode under this clock; None is the offline mode.
            lateness: What happens to commands whose execution time has passed.
            q: For arms.

        Raises:
            InvalidValueError: If both a posture and a timeline are given, or one isn't sound.
        """
        # Arms don't wait for what is about wheels.
        from vrs.mobile.model import DriveLimits, MobileModel
        from vrs.mobile.scheduler import DriveScheduler
        from vrs.mobile.timeline import ArcTimeline

        if not isinstance(model, MobileModel) or not isinstance(model.limits, DriveLimits):
            raise InvalidValueError("model", model, "an arm's, or a mobile robot's")
        if q is not None:
            raise InvalidValueError("q", q, f"left out: {model.name} has wheels and no joints")
        if timeline is None:
            at = (0.0, 0.0, 0.0) if posture is None else posture
            timeline = ArcTimeline(at, clock.now() if clock is not None else 0.0)
        elif posture is not None:
            raise InvalidValueError("posture", posture, "left out where a timeline is given")
        elif not isinstance(timeline, ArcTimeline):
            raise InvalidValueError("timeline", timeline, "an ArcTimeline")
        self.model = model
        self.clock = clock
        ledger: Ledger[ArcTimeline] = Ledger(max(timeline.owners(0, len(timeline)), default=0))
        self.scheduler = DriveScheduler(model, timeline, ledger, word("lateness", lateness, Lateness))
        """Plans the commands."""
        self._keeper = Keeper()

    @property
    def timeline(self) -> ArcTimeline:  # type: ignore[override]
        """The timeline as it is now; a value that later commands don't change."""
        return self.scheduler.timeline

    @property
    def limits(self) -> DriveLimits:  # type: ignore[override]
        """The limits in force: the model's, as parameter changes left them."""
        return self.scheduler.limits

    def posture(self, t: ArrayLike | None = None) -> Array:
        """g: (x, y, θ) at t, or now, [m, m, rad]: (3,), or (k, 3) for t of shape (k,). θ isn't wrapped.

        Raises:
            NonFiniteTimeError: If t holds NaN or infinity.
        """
        return self.scheduler.timeline.sample(self.now() if t is None else t)

    @override
    def _checked(self, command: object) -> Edited | PositionQuery | ParameterChange:
        if isinstance(command, (DriveCommand, Stop, PositionQuery, ParameterChange)):
            return command
        allowed = f"a DriveCommand, Stop, PositionQuery or ParameterChange: {self.model.name} has wheels, no joints"
        raise InvalidValueError("command", command, allowed)

    @override
    def _position(self, t: float) -> Position:
        posture = frozen_array(self.posture(t))
        return Position(t, posture, frozen_array(_pose(*posture.tolist())))

    def _limit(self, change: ParameterChange) -> float:
        return finite(change.name, change.value, "a positive number")

    def joints(self, t: ArrayLike | None = None) -> NoReturn:
        """Not for a mobile robot; see `posture`.

        Raises:
            InvalidValueError: Always.
        """
        raise InvalidValueError("query", f"joints({t!r})", f"posture(t): {self.model.name} has no joints")

    def pose(self, t: ArrayLike | None = None) -> Array:
        """Pose of the robot in the world frame at t, or now: (4, 4) or (k, 4, 4)."""
        postures = self.posture(t)
        if postures.ndim == 1:
            return np.array(_pose(*postures.tolist()))
        return np.array([_pose(*row) for row in postures.tolist()]).reshape(-1, 4, 4)

    def links(self, t: ArrayLike | None = None) -> NoReturn:
        """Not for a mobile robot; see `pose`.

        Raises:
            InvalidValueError: Always.
        """
        raise InvalidValueError("query", f"links({t!r})", f"pose(t): {self.model.name} has no links")

    def anchor(self, truth: Any) -> NoReturn:
        """Not for a mobile robot; see `vrs.mobile.PostureEstimator`.

        Raises:
            InvalidValueError: Always.
        """
        raise InvalidValueError("correction", truth, f"made by a PostureEstimator for {self.model.name}")


def _pose(x: float, y: float, theta: float) -> list[list[float]]:
    c, s = cos(theta), sin(theta)
    return [[c, -s, 0.0, x], [s, c, 0.0, y], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]]
