"""Why a real robot doesn't follow its operator's site, as that site knows it."""

from __future__ import annotations

import enum
from typing import NamedTuple

from interfaces.messages import Refusal, RefusalCode

NOT_FOLLOWING = "the robot doesn't follow"
"""How refusals begin while it doesn't."""


class HaltCause(enum.StrEnum):
    """Why the real robot doesn't follow, as people are told where nothing says more."""

    NOT_MET = "the robot hasn't been met yet"
    """Nothing has come from it."""
    FREE = "nobody has control"
    """Between two drives."""
    STOPPED = "stopped"
    """Somebody stopped it; the next drive begins once both robots rest."""
    BY_ITSELF = "the robot drives by itself"
    """It does what it was told to do by itself."""
    REPORTED = "the robot stopped by itself"
    """It said why."""
    STUCK = "the robot makes no progress"
    """It hears what it's sent, and makes nothing of it."""
    GONE = "there's no robot any more"
    """Nothing that anybody does brings it back."""


class Halt(NamedTuple):
    """That the real robot doesn't follow."""

    cause: HaltCause
    detail: str = ""
    """What is known of it, for people; empty where the cause says it all."""

    @property
    def text(self) -> str:
        """Why, for people."""
        return self.detail or self.cause.value


def text_of(halt: Halt | None) -> str:
    """Why the real robot doesn't follow, for people; empty while it does."""
    return "" if halt is None else halt.text


def not_following(why: str) -> Refusal:
    """What a command is refused with while the robot doesn't follow, for that reason."""
    return Refusal(f"{NOT_FOLLOWING}: {why}", RefusalCode.NOT_FOLLOWING)
