"""What of a recording depends on the kind of its robot: an arm, or a mobile robot."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, ClassVar, Protocol

from vrs.errors import InvalidValueError

if TYPE_CHECKING:
    from interfaces.recording.export import Table
    from interfaces.recording.history import AnyChange, AnyHistory, AnyTimeline
    from interfaces.recording.messages import Begin
    from interfaces.recording.playback import Frame
    from interfaces.recording.recording import Recording
    from interfaces.stream.meshcat import Committed
    from interfaces.stream.meshcat.twins import TwinScene
    from vrs.clock import ManualClock
    from vrs.engine import Engine
    from vrs.model import Array


class Follower(Protocol):
    """Says of a real robot how it follows the virtual one."""

    def play(self, t: float) -> float | None:
        """The time of the timeline at which the real robot is at a time [s]; None where nobody knows."""

    def error(self, t: float, q_real: Array, play: float) -> float | None:
        """How far it's then from where the virtual robot was, or from its path, in the kind's `unit`."""


class Stage(Protocol):
    """A recording's robots on a page."""

    @property
    def scene(self) -> TwinScene:
        """What pages look at."""

    def show(self, frame: Frame, committed: Committed | None, *, now: float) -> None:
        """Show a frame whose virtual robot is known."""


class Kind(ABC):
    """A kind of robot."""

    name: ClassVar[str]
    """For people, with its article."""
    word: ClassVar[str]
    """For programs."""
    virtual: ClassVar[str]
    """Topic of the virtual robot's samples."""
    real: ClassVar[str]
    """Topic of the real robot's."""
    unit: ClassVar[str]
    """Of a follower's error: `rad` or `m`."""

    @abstractmethod
    def told(self, begin: Begin) -> int:
        """How many numbers the real robot was told at a time."""

    def shows(self, begin: Begin) -> list[str]:  # noqa: ARG002 - an arm shows nothing more
        """What a page shows of it besides both robots and the committed path."""
        return []

    @abstractmethod
    def begun(self, recording: Recording) -> tuple[Engine, ManualClock]:
        """An engine that stands as the recorded one did when the recording began, and its clock.

        Raises:
            FormatError: If it can't stand so, or what it needs for that is missing from the file.
        """

    @abstractmethod
    def edit_entries(
        self, before: AnyTimeline, after: AnyTimeline, edit: int, at: float, command_id: int | None
    ) -> tuple[AnyChange | AnyHistory, ...]:
        """An edit as it stands in a recording."""

    @abstractmethod
    def follower(self, recording: Recording) -> Follower:
        """How the real robot of a recording follows."""

    @abstractmethod
    def prepare(self, recording: Recording) -> None:
        """Read and load what takes long before a recording can be shown; from any thread."""

    @abstractmethod
    def stage(self, recording: Recording) -> Stage:
        """The robots of a recording for a page."""

    @abstractmethod
    def summary(self, recording: Recording) -> dict[str, Any]:
        """The run's figures from its recording alone.

        Raises:
            FormatError: If the recording has too little of it.
        """

    @abstractmethod
    def tables(self, recording: Recording) -> tuple[Table, ...]:
        """What is exported.

        Raises:
            FormatError: If the recording's robot isn't known.
        """


def kind_of(begin: Begin) -> Kind:
    """The kind of a recording's robot."""
    if begin.drive is None:
        from interfaces.recording.arm import ARM

        return ARM
    from interfaces.recording.driving.kind import MOBILE

    return MOBILE


def check_alike(recordings: Sequence[Recording]) -> None:
    """Refuse recordings of robots of different kinds.

    Raises:
        InvalidValueError: If they are.
    """
    names = [recording.kind.name for recording in recordings]
    if len(set(names)) > 1:
        given = f"{recordings[0].path} of {names[0]} and {recordings[1].path} of {names[1]}"
        raise InvalidValueError("recordings", given, "of one kind of robot")
