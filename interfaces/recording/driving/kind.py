"""A mobile robot as a kind of robot that recordings are of."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, ClassVar

from interfaces.recording.driving.arcs import edit_entries
from interfaces.recording.driving.pursuit import Pursuit
from interfaces.recording.kinds import Kind
from interfaces.recording.messages import Begin
from interfaces.recording.track import REAL_POSTURE, VIRTUAL_POSTURE
from robots.ipr.model import Ipr
from robots.ipr.model import model as ipr_model
from vrs.clock import ManualClock
from vrs.commands import Lateness
from vrs.engine import Engine
from vrs.errors import FormatError
from vrs.mobile import ArcTimeline

if TYPE_CHECKING:
    from interfaces.recording.driving.stage import DriveStage
    from interfaces.recording.export import Table
    from interfaces.recording.history import AnyChange, AnyHistory, AnyTimeline
    from interfaces.recording.recording import Recording

POSTURE = 3
"""Numbers of a posture."""
NAME = "ipr"
"""The mobile robot that is known here."""


class Mobile(Kind):
    """A mobile robot: postures, and arcs on its timeline."""

    name: ClassVar[str] = "a mobile robot"
    word: ClassVar[str] = "mobile"
    virtual: ClassVar[str] = VIRTUAL_POSTURE
    real: ClassVar[str] = REAL_POSTURE
    unit: ClassVar[str] = "m"

    def told(self, begin: Begin) -> int:  # noqa: ARG002 - it's always v and ω
        """See `Kind`: v and ω."""
        return 2

    def shows(self, begin: Begin) -> list[str]:
        """See `Kind`: the paths, and what was learned of the room."""
        learns = begin.drive is not None and begin.drive.grid is not None
        return ["driven", "learned"] if learns else ["driven"]

    def begun(self, recording: Recording) -> tuple[Engine, ManualClock]:
        """See `Kind`."""
        begin, where = recording.session, str(recording.path)
        model = mobile_model(recording)
        if begin.late is not None:
            raise FormatError(where, "it begins in the middle of a session, which isn't known of mobile robots")
        try:
            clock = ManualClock(begin.t)
            return Engine(model, posture=begin.q, clock=clock, lateness=Lateness(begin.lateness)), clock
        except ValueError as error:
            raise FormatError(where, f"its beginning: {error}") from None

    def edit_entries(
        self, before: AnyTimeline, after: AnyTimeline, edit: int, at: float, command_id: int | None
    ) -> tuple[AnyChange | AnyHistory, ...]:
        """See `Kind`."""
        assert isinstance(before, ArcTimeline)
        assert isinstance(after, ArcTimeline)
        return edit_entries(before, after, edit, at, command_id)

    def follower(self, recording: Recording) -> Pursuit:
        """See `Kind`."""
        return Pursuit(recording)

    def prepare(self, recording: Recording) -> None:
        """See `Kind`."""
        from interfaces.view_parts import link_shapes

        link_shapes(mobile_model(recording))
        recording.virtual(recording.span[0])

    def stage(self, recording: Recording) -> DriveStage:
        """See `Kind`."""
        from interfaces.recording.driving.stage import DriveStage

        return DriveStage(recording, mobile_model(recording))

    def summary(self, recording: Recording) -> dict[str, Any]:
        """See `Kind`."""
        from interfaces.recording.driving.figures import summary

        return summary(recording)

    def tables(self, recording: Recording) -> tuple[Table, ...]:
        """See `Kind`."""
        from interfaces.recording.driving.tables import mobile_tables

        return mobile_tables(recording)


def mobile_model(recording: Recording) -> Ipr:
    """The mobile robot of a recording.

    Raises:
        FormatError: If it's none that is known here.
    """
    begin = recording.session
    facts = begin.drive
    if facts is None or begin.robot != NAME or len(begin.q) != POSTURE:
        raise FormatError(str(recording.path), f"of a robot that isn't known here: {begin.robot!r}")
    return ipr_model("micro" if facts.body == "micro" else "ipr", period=facts.period)


MOBILE = Mobile()
"""The one object of its kind."""
