"""Where a mobile robot takes itself to be: odometry, corrected by an overhead camera's late postures or a laser.

Dead reckoning is smooth and drifts; a camera doesn't drift, but is noisy and late. So the map's frame is kept as a
transform of the odometry's: a picture is compared with where the odometry says that the robot was *when it was
taken*, and the transform takes a share of the difference. Nothing is replayed, and nothing jumps by more than that.
"""

from __future__ import annotations

import math
from collections import deque

from robots.mobile.floor_plan import plan_map
from robots.mobile.robot import MobileRobot
from robots.onboard.driving import Posture
from robots.onboard.gsp_map import GspMap
from robots.onboard.line_filter import MotionConfig
from robots.onboard.localization import LocalizationConfig
from robots.onboard.localizer import Localizer, LocalizerConfig
from vrs.checks import number_in
from vrs.errors import InvalidValueError
from vrs.mobile import wrapped
from vrs.mobile.model import composed

_KEPT = 2.0
"""How much odometry is kept [s]: older pictures don't count."""


class TruePosition:
    """Knows where a robot really is: for comparison."""

    def __init__(self, robot: MobileRobot) -> None:
        """Take the robot."""
        self._robot = robot

    def posture(self) -> Posture:
        """Where the robot is now, (x, y, θ) [m, m, rad]."""
        return Posture(*self._robot.truth)


class OdometryPosition:
    """Takes a robot to be where its odometry says: smooth, and further off the longer it drives."""

    def __init__(self, robot: MobileRobot) -> None:
        """Take the robot; its odometry starts where it really is."""
        self._robot = robot

    def posture(self) -> Posture:
        """Where the robot takes itself to be now, (x, y, θ) [m, m, rad]."""
        return Posture(*self._robot.reckoned)


class LaserPosition:
    """Follows a robot's odometry and finds it on the map by its laser; call it once a control period."""

    def __init__(self, robot: MobileRobot, known: GspMap | None = None) -> None:
        """Take the robot; where it begins is known.

        Args:
            robot: With a laser scanner.
            known: The map; that of its room's floor plan, as far as that is known, unless given.

        Raises:
            InvalidValueError: If it has no laser scanner.
        """
        laser = robot.senses.laser
        if laser is None:
            raise InvalidValueError("robot", "no laser scanner", "one whose senses have a laser")
        self._robot = robot
        known = plan_map(robot.room, laser.height) if known is None else known
        motion = MotionConfig(base=robot.chassis.wheel_base)
        config = LocalizerConfig(localization=LocalizationConfig(motion=motion))
        self.localizer = Localizer(known, robot.reckoned, config=config)
        """What follows the robot: its status, covariance, candidates."""

    def posture(self) -> Posture:
        """Where the robot takes itself to be now, (x, y, θ) [m, m, rad]."""
        robot, localizer = self._robot, self.localizer
        localizer.move(robot.time, robot.reckoned)
        if robot.laser is not None:
            localizer.see(robot.laser)
        assert localizer.posture is not None
        return Posture(*localizer.posture)


class FusedPosition:
    """Follows a robot's odometry and camera; call it once a control period."""

    def __init__(self, robot: MobileRobot, *, share: float = 0.1, turn_share: float = 0.05) -> None:
        """Take the robot; its odometry starts where it really is.

        Args:
            robot: With an overhead camera.
            share: Share of a difference in position that one picture takes away, in [0, 1].
            turn_share: The same of the heading, whose noise moves what is ahead, in [0, 1].

        Raises:
            InvalidValueError: If a share isn't in its range.
        """
        self._robot = robot
        self._share = number_in("share", share, 0.0, 1.0)
        self._turn_share = number_in("turn_share", turn_share, 0.0, 1.0)
        self._x = self._y = self._turn = 0.0
        self._past: deque[tuple[float, float, float, float]] = deque()
        self._seen = -math.inf

    def posture(self) -> Posture:
        """Where the robot takes itself to be now, (x, y, θ) [m, m, rad]."""
        robot, past = self._robot, self._past
        now = robot.time
        x, y, theta = robot.reckoned
        past.append((now, x, y, theta))
        while past[0][0] < now - _KEPT:
            past.popleft()
        fix = robot.camera
        if fix is not None and fix.time > self._seen:
            self._seen = fix.time
            self._correct(fix.time, fix.posture.tolist())
        return self._placed(x, y, theta)

    def _placed(self, x: float, y: float, theta: float) -> Posture:
        return Posture(*composed((self._x, self._y, self._turn), (x, y, theta)))

    def _correct(self, t: float, seen: list[float]) -> None:
        then = self._then(t)
        if then is None:
            return
        x, y, theta = then
        was = self._placed(x, y, theta)
        share, turn_share = self._share, self._turn_share
        self._turn += turn_share * wrapped(seen[2] - was.theta)
        # About where the robot was: turning the map's frame doesn't move that.
        cos, sin = math.cos(self._turn), math.sin(self._turn)
        self._x = was.x + share * (seen[0] - was.x) - (cos * x - sin * y)
        self._y = was.y + share * (seen[1] - was.y) - (sin * x + cos * y)

    def _then(self, t: float) -> tuple[float, float, float] | None:
        """The odometry at a time [s], linear in between; None if that's not kept."""
        past = self._past
        after = past[-1]
        if t > after[0]:
            return None
        for k in range(len(past) - 2, -1, -1):
            before = past[k]
            if before[0] <= t:
                share = (t - before[0]) / (after[0] - before[0])
                _, x, y, theta = before
                return x + share * (after[1] - x), y + share * (after[2] - y), theta + share * (after[3] - theta)
            after = before
        return (after[1], after[2], after[3]) if t == after[0] else None
