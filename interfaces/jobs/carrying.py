"""Who carries jobs out at a robot's site, and those that do without a loudspeaker and a screen."""

from __future__ import annotations

import math
from typing import Final, Protocol

SYLLABLE: Final = 0.065
"""So long a character takes to be spoken, about 170 words a minute [s]."""
BREATH: Final = 0.3
"""And each text besides [s]."""


def speaking_time(text: str) -> float:
    """About how long it takes to say something [s]."""
    return BREATH + SYLLABLE * len(text)


class Speaker(Protocol):
    """Whatever says something aloud, one text at a time."""

    def speak(self, text: str, *, now: float) -> None:
        """Begin to say something, in place of anything else, at a time [s]."""

    def hush(self) -> None:
        """Be silent at once."""

    def is_speaking(self, *, now: float) -> bool:
        """Whether what was begun isn't over yet."""


class Screen(Protocol):
    """Whatever shows a text."""

    def show(self, text: str) -> None:
        """Show a text in place of any other; an empty one clears it."""


class ArmControl(Protocol):
    """Whatever carries out VAL-II programs on an arm, one at a time."""

    def run(self, program: str, source: str, *, now: float) -> str:
        """Begin a program at a time [s]; why it can't be, empty if it has begun."""

    def end(self, *, now: float) -> None:
        """Stop the arm."""

    def outcome(self, *, now: float) -> str | None:
        """What became of the program: None while it runs, empty if it came to its end, else why not."""


class SilentSpeaker:
    """Says nothing, and takes as long as saying it would: where there's no loudspeaker."""

    def __init__(self) -> None:
        """Be silent."""
        self.text = ""
        """What is being said."""
        self._until = -math.inf

    def speak(self, text: str, *, now: float) -> None:
        """See `Speaker`."""
        self.text, self._until = text, now + speaking_time(text)

    def hush(self) -> None:
        """See `Speaker`."""
        self.text, self._until = "", -math.inf

    def is_speaking(self, *, now: float) -> bool:
        """See `Speaker`."""
        if now >= self._until:
            self.text = ""
        return now < self._until


class TextScreen:
    """Keeps what is shown, for others to read."""

    def __init__(self) -> None:
        """Show nothing."""
        self.text = ""

    def show(self, text: str) -> None:
        """See `Screen`."""
        self.text = text


class NoArm:
    """There's no arm here."""

    def run(self, program: str, source: str, *, now: float) -> str:  # noqa: ARG002 - it's an ArmControl's
        """See `ArmControl`."""
        return "there's no arm here that could carry out a program"

    def end(self, *, now: float) -> None:
        """See `ArmControl`."""

    def outcome(self, *, now: float) -> str | None:  # noqa: ARG002 - the same
        """See `ArmControl`."""
        return ""
