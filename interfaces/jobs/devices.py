"""Who carries jobs out at a robot's site, and one that does without a loudspeaker."""

from __future__ import annotations

import math
from typing import Final, Protocol

from typing_extensions import override

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


class ArmControl(Protocol):
    """Whatever carries out VAL-II programs on an arm, one at a time."""

    def run(self, program: str, source: str, *, now: float) -> str:
        """Begin a program at a time [s]; why it can't be, empty if it has begun."""

    def end(self, *, now: float) -> None:
        """Stop the arm."""

    def outcome(self, *, now: float) -> str | None:
        """What became of the program: None while it runs, empty if it came to its end, else why not."""


class SilentSpeaker(Speaker):
    """Says nothing, and takes as long as saying it would: where there's no loudspeaker."""

    def __init__(self) -> None:
        """Be silent."""
        self.text = ""
        """What is being said."""
        self._until = -math.inf

    @override
    def speak(self, text: str, *, now: float) -> None:
        self.text, self._until = text, now + speaking_time(text)

    @override
    def hush(self) -> None:
        self.text, self._until = "", -math.inf

    @override
    def is_speaking(self, *, now: float) -> bool:
        if now >= self._until:
            self.text = ""
        return now < self._until
