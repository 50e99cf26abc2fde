"""What a receipt says for people, as values: code decides by their codes, and their texts are made from them."""

from __future__ import annotations

from enum import Enum
from typing import NamedTuple, TypeAlias


class NoteCode(Enum):
    """What a user must know of a command: its value is the text, with places for figures."""

    LATE_AT_ONCE = "{}: at once"
    LATE_POSTPONED = "{}: postponed to {:.9g} s"
    APPENDED = "appended at the end of the plan, {:.9g} s"
    RETIMED = "retimed from {:.6g} s"
    CANCELLED = "cancelled"
    CANCELLED_FROM = "cancelled from {:.6g} s on"
    REPLANNED = "goes from elsewhere, as command {} was cancelled"
    LEADS_ON = "the arm still goes to where command {} begins"
    BY_A_VIA = "goes by a via"
    """Its values are the deviation [m], and the joints of the via [rad]."""
    AT_A_PACE = "{:g} times as fast"
    STOOD = "stood"
    STOPPED_ON_WAY = "stopped on its way"
    STOPPED_ON_ARC = "stopped on its arc"
    EACH_JOINT_BRAKED = "each joint braked: the limits don't let it keep to its way"
    RESUMED = "resumed"
    GOES_ON = "goes on after a stop"
    UNDONE = "undone"
    UNDONE_FROM = "undone from {:.6g} s on"

    FULL_LIMITS = "planned with all of the limits: the arm is too fast for the command's pace or acceleration"
    BRAKED_FIRST = "braked with parabolas first: no jerk-limited plan from this state keeps the limits"
    JOINED_BY_PARABOLAS = "the joining move accelerates with parabolas"
    NO_SMOOTH_STOP = "braked with parabolas: no jerk-limited stop from this state keeps the limits"
    NO_SMOOTH_STEERING = "braked with parabolas: no jerk-limited plan from this state keeps the limits"
    ACCELERATIONS_DROPPED = (
        "accelerations dropped at the start: bounded jerk would pass a speed limit from this state"
    )

    JOINS_LINE = "on the line from {} on"
    BRAKED_BEFORE_LINE = "braked first, then the line from rest at the place where the arm stopped"
    NO_SMOOTH_STOP_BEFORE_LINE = "braked with parabolas, as no jerk-limited stop keeps the limits"
    TURNS_ON_THE_SPOT = "joints {} turn on the spot first: the line leaves a singular pose"

    OFFSET_LATE = "the limits don't let the offset be reached in time"

    PASSES_VIA = "passes the via within {:.3g} m"
    STOPS_AT_VIA = "stops at the via: no overlap keeps the limits"
    NOTHING_TO_ROUND = "no move ends where this one begins: nothing to round"
    ROUNDED_WITH_PARABOLAS = "rounded with a move of parabolas"
    BEGINS_BEFORE = "begins {:.3g} s before command {} is over"


ROUGH = frozenset(
    {
        NoteCode.BRAKED_FIRST,
        NoteCode.JOINED_BY_PARABOLAS,
        NoteCode.NO_SMOOTH_STOP,
        NoteCode.NO_SMOOTH_STEERING,
        NoteCode.ACCELERATIONS_DROPPED,
        NoteCode.NO_SMOOTH_STOP_BEFORE_LINE,
        NoteCode.ROUNDED_WITH_PARABOLAS,
    }
)
"""Where jerk limits don't hold throughout."""


class Note(NamedTuple):
    """One thing that a user must know of a command."""

    code: NoteCode
    values: tuple[float | str, ...] = ()
    """What its text has places for, in their order."""


Notes: TypeAlias = tuple[Note, ...]
"""What a user must know of a command, in the order in which it's said; empty if nothing."""


def text_of(notes: Notes) -> str:
    """What notes say to people; empty where there are none."""
    return "; ".join([code.value.format(*values) for code, values in notes]) if notes else ""


def rough_in(text: str) -> Notes:
    """The notes of a stored receipt, which has their text alone, that say where jerk limits don't hold."""
    return tuple(Note(code) for code in NoteCode if code in ROUGH and code.value in text)


def is_rough(notes: Notes) -> bool:
    """Whether they say that jerk limits don't hold throughout."""
    return any(note.code in ROUGH for note in notes)
