"""The kinds of robots that recordings are of: an arm, or a mobile robot."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from interfaces.recording.messages import Begin
from interfaces.recording.track import REAL, REAL_POSTURE, VIRTUAL, VIRTUAL_POSTURE


@dataclass(frozen=True, slots=True)
class RecordingKind:
    """A kind of robot, as recordings know it."""

    name: str
    """For people, with its article."""
    word: str
    """For programs."""
    virtual: str
    """Topic of the virtual robot's samples."""
    real: str
    """Topic of the real robot's."""
    unit: str
    """Of how far the real robot is from the virtual one: `rad` or `m`."""


ARM: Final = RecordingKind("an arm", "arm", VIRTUAL, REAL, "rad")
"""Joints, and polynomials on its timeline."""
MOBILE: Final = RecordingKind("a mobile robot", "mobile", VIRTUAL_POSTURE, REAL_POSTURE, "m")
"""Postures, and arcs on its timeline."""


def kind_of(begin: Begin) -> RecordingKind:
    """The kind of a recording's robot."""
    return ARM if begin.drive is None else MOBILE


def references(begin: Begin) -> int:
    """How many numbers the real robot was told at a time: a reference a joint; v and ω."""
    return len(begin.q) if begin.drive is None else 2


def shows(begin: Begin) -> list[str]:
    """What a page shows besides both robots and the committed path: the paths, and what was learned of the room."""
    if begin.drive is None:
        return []
    return ["driven"] if begin.drive.grid is None else ["driven", "learned"]
