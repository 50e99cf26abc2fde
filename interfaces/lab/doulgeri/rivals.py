"""Robots that lack what ours have: what stands in the place of a mechanism in counterfactuals."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

import numpy as np
from typing_extensions import override

from interfaces.teleop import FollowingArm, RobotSiteConfig
from robots.onboard.playout import Playout, PlayState
from robots.onboard.watchdog import WatchdogConfig
from vrs.model import Array, Limits, RobotModel
from vrs.timeline import Timeline

RobotMaker: TypeAlias = Callable[[RobotModel, Array], FollowingArm]
"""Makes a robot's site of its model and its joints [rad], (n,)."""


def adaptive(model: RobotModel, q: Array) -> FollowingArm:
    """Ours: it carries out the operator's log, and adapts its offset."""
    return FollowingArm(model, q, now=0.0)


def postponing(D: float) -> RobotMaker:
    """The paper's: its clock has a fixed offset D [s], and it postpones what comes late."""

    def made(model: RobotModel, q: Array) -> FollowingArm:
        return FollowingArm(model, q, now=0.0, config=RobotSiteConfig(fixed_offset=D))

    return made


def halting(model: RobotModel, q: Array) -> FollowingArm:
    """One that halts for good when messages are too old."""
    return FollowingArm(model, q, now=0.0, config=RobotSiteConfig(watchdog=WatchdogConfig()))


class _WaitingPlay(Playout):
    """Play by the law of ours, at an offset that's fixed; as long as that isn't over, the arm doesn't begin."""

    def __init__(self, timeline: Timeline, limits: Limits, *, now: float, p: float, offset: float) -> None:
        """Wait at p, for an offset [s]; see `Playout`."""
        super().__init__(timeline, limits, now=now, p=p)
        self._offset = offset

    @override
    def aim(self, offset: float, *, now: float) -> None:
        """Learn nothing."""

    @override
    def _rest(self, t: float, p: float, wanted: float, until: float, behind: float) -> None:
        if not self._is_early(t, p):
            super()._rest(t, p, wanted, until, behind)

    @override
    def _depart(self, t: float, p: float, wanted: float) -> None:
        if not self._is_early(t, p):
            super()._depart(t, p, wanted)

    def _is_early(self, t: float, p: float) -> bool:
        """Whether an arm at rest is to wait; then it does."""
        early = p - t - self._offset
        if early <= self._config.tolerance:
            return False
        self._wait(t, p)
        self._due = t + early
        return True


class _WaitingArm(FollowingArm):
    """Plays the operator's log at a fixed offset; where it knows no more it waits, and changes nothing."""

    held: float
    """The offset [s]."""

    @override
    def _playing(self, p: float, now: float) -> Playout:
        return _WaitingPlay(self.engine.timeline, self.engine.limits, now=now, p=p, offset=self.held)


def waiting(D: float) -> RobotMaker:
    """One that waits without changing the path, at a fixed offset D [s]."""

    def made(model: RobotModel, q: Array) -> FollowingArm:
        arm = _WaitingArm(model, q, now=0.0)
        arm.held = D
        return arm

    return made


class _JumpingPlay(Playout):
    """Play without a law: it stands at once where it knows no more, and jumps to the present when that comes."""

    def __init__(self, timeline: Timeline, limits: Limits, *, now: float, p: float) -> None:
        """Stand at p; see `Playout`."""
        super().__init__(timeline, limits, now=now, p=p)
        self._known = [(-np.inf, p, p)]
        """From when on [s], up to where it's complete, and where it was at least [s]."""

    @override
    def hear(self, complete_until: float, timeline: Timeline, *, now: float) -> None:
        self._timeline, self._complete = timeline, max(complete_until, self._complete)
        self._known.append((now, self._complete, float(self.at(np.array([now])).p[0])))

    @override
    def aim(self, offset: float, *, now: float) -> None:
        """Aim at nothing but the present."""

    @override
    def advance(self, *, now: float) -> None:
        """Nothing is ever due."""

    @override
    def next_deadline(self) -> float | None:
        return None

    @override
    def at(self, t: Array) -> PlayState:
        since, complete, least = np.array(self._known).T
        rows = np.searchsorted(since, t, side="right") - 1
        p = np.maximum(np.minimum(t, complete[rows]), least[rows])
        return PlayState(p, np.ones_like(p), np.zeros_like(p))

    foreseen = at


class _JumpingArm(FollowingArm):
    """A robot that plays so."""

    @override
    def _playing(self, p: float, now: float) -> Playout:
        return _JumpingPlay(self.engine.timeline, self.engine.limits, now=now, p=p)


def jumping(model: RobotModel, q: Array) -> FollowingArm:
    """One that carries out the operator's log, too, but has no law by which it plays."""
    return _JumpingArm(model, q, now=0.0)
