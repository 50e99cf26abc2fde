"""The camera in the IPR's head: two axes with limits, speeds and accelerations, and where it looks from.

Source: Kim, Han, Kim, Kim, 2002, section 2.1: one colour camera in the head, which two DC motors turn about a
vertical and a horizontal axis; section 4.2: at most 5 pictures a second. What it doesn't say is an assumption; its
reason stands beside it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np

from robots.ipr.parameters import IPR_AXLE_OFFSET
from vrs.checks import finite, number_in
from vrs.errors import InvalidValueError
from vrs.insertion import piece
from vrs.model import Array, Limits, frozen_array
from vrs.planning import parabolic
from vrs.timeline import Timeline

NECK: Final = (-IPR_AXLE_OFFSET - 0.03, 0.0, 0.712)
"""Where the axes cross, in the robot's frame [m]: the middle of the head that `robots.ipr.shapes` draws."""
REACH: Final = 0.066
"""How far the lens is before that [m]: as far as the head's glass."""


@dataclass(frozen=True, slots=True)
class Lens:
    """What the camera sees of what is before it."""

    width: int = 352
    """Pixels across, a multiple of 16, 64 to 1920."""
    height: int = 264
    """Pixels down, a multiple of 2, 48 to 1080."""
    view: float = math.radians(65.0)
    """Horizontal angle of view [rad], 0.2 to 2.4; an assumption: a usual wide lens of such cameras."""
    near: float = 0.03
    """Nothing nearer is seen [m], 0.001 to 1."""
    far: float = 60.0
    """Nothing farther is seen [m], 2 to 1000."""

    def __post_init__(self) -> None:
        for name, low, high, step in (("width", 64, 1920, 16), ("height", 48, 1080, 2)):
            value = getattr(self, name)
            if isinstance(value, bool) or not isinstance(value, int) or not low <= value <= high or value % step:
                raise InvalidValueError(name, value, f"a multiple of {step} in [{low}, {high}]")
        for name, least, most in (("view", 0.2, 2.4), ("near", 0.001, 1.0), ("far", 2.0, 1000.0)):
            number_in(name, getattr(self, name), least, most)


@dataclass(frozen=True, slots=True)
class PanTiltConfig:
    """How the camera can be turned. Pan is positive to the left, tilt is positive upwards."""

    pan: float = math.radians(100.0)
    """Farthest to either side [rad], 0.1 to 3.1; an assumption: over both shoulders with the angle of view."""
    down: float = math.radians(35.0)
    """Farthest down [rad], 0.1 to 1.5; an assumption: farther down its own display fills the picture."""
    up: float = math.radians(45.0)
    """Farthest up [rad], 0.1 to 1.5; an assumption: the face of who stands before the robot is seen."""
    speed: float = math.radians(60.0)
    """Largest speed of each axis [rad/s], 0.01 to 20; an assumption: a look to the side takes two seconds."""
    acceleration: float = math.radians(180.0)
    """Largest acceleration of each axis [rad/s²], 0.01 to 200; an assumption: full speed in a third of a second."""

    def __post_init__(self) -> None:
        bounds = (("pan", 0.1, 3.1), ("down", 0.1, 1.5), ("up", 0.1, 1.5), ("speed", 0.01, 20.0))
        for name, low, high in (*bounds, ("acceleration", 0.01, 200.0)):
            number_in(name, getattr(self, name), low, high)

    @property
    def limits(self) -> Limits:
        """Of pan and tilt, as of two joints."""
        both = np.ones(2)
        return Limits(
            np.array([-self.pan, -self.down]),
            np.array([self.pan, self.up]),
            self.speed * both,
            self.acceleration * both,
        )


class Look(NamedTuple):
    """Where the camera looks."""

    pan: float
    """[rad], positive to the left."""
    tilt: float
    """[rad], positive upwards."""


class PanTilt:
    """Both axes: told where to look, they go there in the least time, also out of a motion. It's given the time."""

    def __init__(self, config: PanTiltConfig | None = None, *, now: float = 0.0) -> None:
        """Look straight ahead.

        Args:
            config: How it can be turned.
            now: [s].
        """
        self.config = PanTiltConfig() if config is None else config
        self._limits = self.config.limits
        self._now = finite("now", now)
        self._motion = Timeline(np.zeros(2), self._now)
        self.target = Look(0.0, 0.0)
        """Where it's to look."""

    def aim(self, pan: float, tilt: float, *, now: float) -> None:
        """Look elsewhere from now on.

        Args:
            pan: [rad], within the limits.
            tilt: [rad], within the limits.
            now: [s], not before the time of the last call.

        Raises:
            InvalidValueError: If an angle is outside its limits, or time runs back; it goes on as before then.
        """
        config = self.config
        pan = number_in("pan", pan, -config.pan, config.pan, unit=" rad")
        tilt = number_in("tilt", tilt, -config.down, config.up, unit=" rad")
        if not finite("now", now) >= self._now:
            raise InvalidValueError("now", now, f"at or after {self._now} s")
        target = np.array([pan, tilt])
        if now >= self._motion.end:
            # The way here is of no more use.
            self._motion = Timeline(self._motion.final(), now)
        plan = parabolic.to_rest(self._motion.state_before(now), target, 1.0, self._limits)
        self._motion = self._motion.edited(now, [piece(plan, 0)] if len(plan) else [])
        self._now, self.target = now, Look(pan, tilt)

    def look(self, now: float) -> Look:
        """Where it looks at a time from the last `aim` on [s]."""
        return Look(*self._motion.sample(now).tolist())

    def moves(self, now: float) -> bool:
        """Whether it's turning at a time [s]."""
        return now < self._motion.end


def lens_pose(look: Look) -> Array:
    """Pose of the lens in the robot's frame, (4, 4): x along the line of sight, y to the left, z up."""
    c, s = math.cos(look.pan), math.sin(look.pan)
    u, v = math.cos(look.tilt), math.sin(look.tilt)
    X = np.eye(4)
    X[:3, :3] = [[c * u, -s, -c * v], [s * u, c, -s * v], [v, 0.0, u]]
    X[:3, 3] = np.array(NECK) + REACH * X[:3, 0]
    return frozen_array(X)
