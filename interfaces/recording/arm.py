"""What of a recording is an arm's own."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from interfaces.recording.capture import edit_entries
from interfaces.recording.kinds import Kind
from interfaces.recording.messages import Begin, Late
from interfaces.recording.track import REAL, VIRTUAL
from interfaces.stream.meshcat import Committed, MeshcatScene
from vrs.clock import ManualClock
from vrs.commands import Lateness
from vrs.engine import Engine
from vrs.errors import FormatError
from vrs.model import Array
from vrs.standing import Standing
from vrs.timeline import Timeline

if TYPE_CHECKING:
    from interfaces.recording.export import Table
    from interfaces.recording.history import AnyChange, AnyHistory, AnyTimeline
    from interfaces.recording.playback import Frame
    from interfaces.recording.recording import Recording


class _Follower:
    """Compares with the virtual robot at equal timeline time."""

    def __init__(self, recording: Recording) -> None:
        self._recording = recording

    def play(self, t: float) -> float | None:
        """See `Follower`."""
        return float(self._recording.play(t))

    def error(self, t: float, q_real: Array, play: float) -> float | None:  # noqa: ARG002 - play says it all
        """See `Follower`: the largest difference of a joint [rad]."""
        q = self._recording.virtual(play)
        return float(np.abs(q_real - q).max()) if np.isfinite(q).all() else None


class _Stage:
    """Two arms."""

    def __init__(self, recording: Recording) -> None:
        self._model = recording.model
        self.scene: MeshcatScene = MeshcatScene(recording.model)

    def show(self, frame: Frame, committed: Committed | None, *, now: float) -> None:
        """See `Stage`."""
        links = self._model.links
        assert frame.q_virtual is not None
        real = None if frame.q_real is None else links(frame.q_real)
        self.scene.show(virtual=links(frame.q_virtual), real=real, path=committed, now=now)


class Arm(Kind):
    """An arm: joints, and polynomials on its timeline."""

    name: ClassVar[str] = "an arm"
    word: ClassVar[str] = "arm"
    virtual: ClassVar[str] = VIRTUAL
    real: ClassVar[str] = REAL
    unit: ClassVar[str] = "rad"

    def told(self, begin: Begin) -> int:
        """See `Kind`: a reference a joint."""
        return len(begin.q)

    def begun(self, recording: Recording) -> tuple[Engine, ManualClock]:
        """See `Kind`."""
        begin, where = recording.session, str(recording.path)
        try:
            clock, lateness = ManualClock(begin.t), Lateness(begin.lateness)
            if begin.late is None:
                return Engine(recording.model, q=begin.q, clock=clock, lateness=lateness), clock
            edits = recording.edits
            if not edits or edits[0].number or not isinstance(edits[0].timeline, Timeline):
                raise FormatError(where, "the timeline that it begins with is destroyed")
            engine = Engine(recording.model, timeline=edits[0].timeline, clock=clock, lateness=lateness)
            engine.take_up(_stand(recording, begin.late, engine))
        except FormatError:
            raise
        except ValueError as error:
            raise FormatError(where, f"its beginning: {error}") from None
        return engine, clock

    def edit_entries(
        self, before: AnyTimeline, after: AnyTimeline, edit: int, at: float, command_id: int | None
    ) -> tuple[AnyChange | AnyHistory, ...]:
        """See `Kind`."""
        assert isinstance(before, Timeline)
        assert isinstance(after, Timeline)
        return edit_entries(before, after, edit, at, command_id)

    def follower(self, recording: Recording) -> _Follower:
        """See `Kind`."""
        return _Follower(recording)

    def prepare(self, recording: Recording) -> None:
        """See `Kind`."""
        recording.model.links(recording.virtual(recording.span[0]))

    def stage(self, recording: Recording) -> _Stage:
        """See `Kind`."""
        return _Stage(recording)

    def summary(self, recording: Recording) -> dict[str, Any]:
        """See `Kind`."""
        from interfaces.recording.figures import summary

        return summary(recording)

    def tables(self, recording: Recording) -> tuple[Table, ...]:
        """See `Kind`."""
        from interfaces.recording.export import arm_tables

        return arm_tables(recording)


def _stand(recording: Recording, late: Late, engine: Engine) -> Standing:
    limits = replace(
        engine.limits, **{name: np.array(getattr(late, name)) for name in ("qd_max", "qdd_max", "qddd_max")}
    )
    steered = None if late.steered is None else (late.steered, late.steered_at)
    return Standing(late.newest, Lateness(recording.session.lateness), limits, steered, recording.given)


ARM = Arm()
"""The one object of its kind."""
