"""The architectures by name: which controller each is, with one set of constants for every network."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Annotated, Final, TypeAlias

from interfaces.system import checked, is_own, own
from interfaces.teleop.architectures.controllers import (
    DriveController,
    Filtered,
    FollowingController,
    Immediate,
    PlayerConfig,
    TimelineController,
)
from robots.onboard.driving import Posture
from robots.onboard.path_following import FieldLaw, PathFollowingConfig
from vrs.checks import number_in, one_of, validated, within


@dataclass(frozen=True, slots=True)
@validated
class Constants:
    """Of all architectures; none is chosen by the network."""

    period: Annotated[float, within(0.01, 1.0, "s")] = 0.1
    """T: between the operator's commands [s]."""
    processing: float = 0.01
    """T_p: to make a piece of the path of one command [s], shorter than T."""
    following: PathFollowingConfig = field(default_factory=PathFollowingConfig)
    """Of the uni-vector field, III."""
    player: PlayerConfig = field(default_factory=PlayerConfig)
    """Of the `timeline` architecture."""

    def __post_init__(self) -> None:
        number_in("processing", self.processing, 1e-4, self.period, unit=" s")


Architecture: TypeAlias = Callable[[Constants, Posture], DriveController]
"""Makes a controller for a robot that begins at a posture at time 0."""


def _following(law: FieldLaw) -> Architecture:
    return lambda c, posture: FollowingController(
        posture, law, c.following, period=c.period, processing=c.processing
    )


ARCHITECTURES: Final[dict[str, Architecture]] = {
    "I": lambda _, __: Immediate(),
    "II": lambda c, _: Filtered(c.period),
    "III": _following(FieldLaw.LITERAL),
    "III-capped": _following(FieldLaw.CAPPED),
    "extended": _following(FieldLaw.CAPPED),
    "timeline": lambda c, posture: TimelineController(posture, now=0.0, config=c.player),
}
"""What makes each architecture's controller."""


def architecture(name: str) -> Architecture:
    """What makes the controllers of an architecture.

    Args:
        name: One of `ARCHITECTURES`, or `module:name` of one's own.

    Raises:
        InvalidValueError: If there's none of that name.
        FormatError: If the module can't be imported.
    """
    if is_own(name):
        return own("architecture", name, ("constants", "posture"))
    return ARCHITECTURES[one_of("architecture", name, ARCHITECTURES, "or MODULE:NAME of your own")]


def controller(name: str, posture: Posture, constants: Constants) -> DriveController:
    """Make an architecture's controller.

    Args:
        name: As of `architecture`.
        posture: Where both robots begin.
        constants: Of all architectures.

    Raises:
        InvalidValueError: If there's none of that name, or it makes something else.
        FormatError: If the module can't be imported.
    """
    made = architecture(name)(constants, posture)
    checked("architecture", name, made, ("receive", "control", "executed"))
    return made
