"""The bare mobile robot: exact arcs and no physics, with the interface of the simulated one."""

from __future__ import annotations

import math

from robots.ipr.floor_plan import FloorPlan
from robots.ipr.robot import MobileRobot
from vrs.model import Array

_CHECKS = 60.0
"""How often overlaps are looked for near a thing [Hz]: the robot goes 8 mm in between."""


class BareBody(MobileRobot):
    """A robot on wheels that always roll: ramps, lag, slip and wrong radii, but neither mass nor friction.

    What would overlap a thing doesn't happen: the robot goes back to where it was free 1/60 s before, while its
    wheels turn. Friction, torques and payload of its reality mean nothing to it.
    """

    _STEP = 1 / 60

    def _begin(self) -> None:
        self._angle_right = self._angle_left = 0.0
        self._speed = (0.0, 0.0)
        self._every_check = self._every(_CHECKS)
        self._free_until = 0
        self._free = self._truth
        self._seen: dict[float, FloorPlan] = {}

    @property
    def motion(self) -> tuple[float, float]:
        """True speed v of the middle of the axle, forward [m/s], and ω [rad/s]."""
        return self._speed

    def _advance(self, n: int) -> None:
        every = self._every_check
        while n:
            # Up to the next check, or to the first one after which something may be near.
            first = max(self._steps + 1, self._free_until)
            part = min(n, -(-first // every) * every - self._steps)
            self._roll(part)
            if self._steps % every == 0:
                if self._steps >= self._free_until:
                    self._look_out()
                self._free = self._truth
            n -= part

    def _roll(self, n: int) -> None:
        train, dt = self._train, self.reality.dt
        slip_right, slip_left = train.slips
        k_right, k_left = train.radii[0] * (1 - slip_right), train.radii[1] * (1 - slip_left)
        base, step, cos, sin = train.base, train.step, math.cos, math.sin
        x, y, theta = self._truth
        angle_right, angle_left = self._angle_right, self._angle_left
        v = w = 0.0
        for _ in range(n):
            right, left = step()
            angle_right += right * dt
            angle_left += left * dt
            a, b = k_right * right, k_left * left
            v, w = 0.5 * (a + b), (a - b) / base
            # An exact arc, as `arc` has it, without the calls.
            half = 0.5 * w * dt
            chord = v * dt * (sin(half) / half) if abs(half) > 1e-8 else v * dt
            x += chord * cos(theta + half)
            y += chord * sin(theta + half)
            theta += w * dt
        self._angle_right, self._angle_left = angle_right, angle_left
        self._truth, self._speed = (x, y, theta), (v, w)
        self._steps += n

    def _look_out(self) -> None:
        """Stay where the way leads into something; or work out how long nothing can be met."""
        x, y, theta = self._truth
        body = self.chassis
        middle_x, middle_y = x + body.centre_x * math.cos(theta), y + body.centre_x * math.sin(theta)
        space = self._plan.clearance(middle_x, middle_y, self.time) - body.reach
        if space > 0:
            self._touch("")
            # Slip and wrong wheels add a few percent to the speeds; half as much again is beyond any of them.
            fastest = 1.5 * (self.limits.v_max + abs(body.centre_x) * self.limits.w_max) + self._plan.fastest
            changes = min((change for change in self._plan.changes if change > self.time), default=math.inf)
            steps = min(space / fastest, changes - self.time) / self.reality.dt
            self._free_until = self._steps + int(min(steps, 1e9))
            return
        thing = self._overlap(self._truth)
        self._touch(thing)
        if thing:
            self._truth = self._free
            self._speed = 0.0, 0.0

    def _shafts(self) -> tuple[float, float]:
        return self._angle_right, self._angle_left

    def _put(self, posture: tuple[float, float, float]) -> None:
        self._truth = self._free = posture
        self._speed, self._free_until = (0.0, 0.0), 0

    def _distances(self, origins: Array, directions: Array, reach: float, height: float) -> Array:
        if height not in self._seen:
            self._seen[height] = FloorPlan(self.room, height)
        return self._seen[height].cast(origins, directions, self.time, reach)
