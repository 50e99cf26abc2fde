"""The engine of a mobile robot: the arm's, with arcs on its timeline."""

from __future__ import annotations

from dataclasses import fields
from math import cos, sin
from typing import Any, NoReturn, overload

import numpy as np
from numpy.typing import ArrayLike

from vrs.archive import Keeper
from vrs.checks import finite
from vrs.clock import Clock
from vrs.commands import DriveCommand, Lateness, ParameterChange, Position, PositionQuery, Stop
from vrs.engine import Engine, lateness_of
from vrs.errors import InvalidValueError
from vrs.ledger import Ledger
from vrs.mobile.driver import Driver
from vrs.mobile.model import DriveLimits, MobileModel
from vrs.mobile.timeline import ArcTimeline
from vrs.model import Array, frozen_array
from vrs.receipt import Receipt


class MobileEngine(Engine):
    """A virtual mobile robot: `Engine(model, posture=...)` makes one.

    It takes `DriveCommand`, `Stop`, `PositionQuery` and `ParameterChange`. What is about joints raises.
    """

    _model: MobileModel  # type: ignore[assignment]
    _plan: Driver  # type: ignore[assignment]
    _limit_names = tuple(item.name for item in fields(DriveLimits))

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
        self._model = model
        self._clock = clock
        ledger: Ledger[ArcTimeline] = Ledger(max(timeline.owners(0, len(timeline)), default=0))
        self._plan = Driver(model, timeline, ledger, lateness_of(lateness))
        self._keeper = Keeper()

    @property
    def model(self) -> MobileModel:  # type: ignore[override]
        """The robot."""
        return self._model

    @property
    def timeline(self) -> ArcTimeline:  # type: ignore[override]
        """The timeline as it is now; a value that later commands don't change."""
        return self._plan.timeline

    @property
    def limits(self) -> DriveLimits:  # type: ignore[override]
        """The limits in force: the model's, as parameter changes left them."""
        return self._plan.limits

    def posture(self, t: ArrayLike | None = None) -> Array:
        """g: (x, y, θ) at t, or now, [m, m, rad]: (3,), or (k, 3) for t of shape (k,). θ isn't wrapped.

        Raises:
            NonFiniteTimeError: If t holds NaN or infinity.
        """
        return self._plan.timeline.sample(self.now() if t is None else t)

    @overload  # type: ignore[override]
    def execute(self, command: DriveCommand | Stop) -> Receipt: ...
    @overload
    def execute(self, command: PositionQuery) -> Position: ...
    @overload
    def execute(self, command: ParameterChange) -> None: ...
    def execute(self, command: object) -> Receipt | Position | None:
        """Carry out a command: a drive command or a stop is f, a position query is g.

        A drive command without an execution time begins at the end of what is planned, or now if that's past. One
        within the plan replaces what is left of the command that it interrupts; the commands after that keep their
        speeds and durations, are shifted as a whole by one Δ ≥ 0, and go on from where the robot then is.

        Args:
            command: A DriveCommand, Stop, PositionQuery or ParameterChange; stamps are in this engine's time.

        Returns:
            A Receipt; a Position, whose q is the posture, (3,), and X the robot's pose in the world frame; or
            nothing for a parameter change. What can't be, speeds past the limits among it, is a receipt with
            Status.REJECTED and the reason; the timeline is then untouched.

        Raises:
            InvalidValueError: If it's no command for a mobile robot; nothing is changed.
        """
        if isinstance(command, DriveCommand):
            with self.atomic():
                return self._plan.drive(command, self._present())
        if isinstance(command, Stop):
            with self.atomic():
                return self._plan.stop(command, self._present())
        if isinstance(command, PositionQuery):
            t = self.now() if command.t is None else command.t
            posture = frozen_array(self.posture(t))
            return Position(t, posture, frozen_array(_pose(*posture.tolist())))
        if isinstance(command, ParameterChange):
            self._set_parameter(command)
            return None
        allowed = (
            f"a DriveCommand, Stop, PositionQuery or ParameterChange: {self._model.name} has wheels, no joints"
        )
        raise InvalidValueError("command", command, allowed)

    def _limit(self, change: ParameterChange) -> float:
        return finite(change.name, change.value, "a positive number")

    def joints(self, t: ArrayLike | None = None) -> NoReturn:
        """Not for a mobile robot; see `posture`.

        Raises:
            InvalidValueError: Always.
        """
        raise InvalidValueError("query", f"joints({t!r})", f"posture(t): {self._model.name} has no joints")

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
        raise InvalidValueError("query", f"links({t!r})", f"pose(t): {self._model.name} has no links")

    def anchor(self, truth: Any) -> NoReturn:
        """Not for a mobile robot; see `vrs.mobile.PostureEstimator`.

        Raises:
            InvalidValueError: Always.
        """
        raise InvalidValueError("correction", truth, f"made by a PostureEstimator for {self._model.name}")


def _pose(x: float, y: float, theta: float) -> list[list[float]]:
    c, s = cos(theta), sin(theta)
    return [[c, -s, 0.0, x], [s, c, 0.0, y], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]]
