"""Drives to a goal by itself: a route, the path-following controller along it, another route where it's blocked.

The supervisory mode of the paper: the operator says where to, the robot finds the way. What newly stands on the way
makes it stop and look for another one; where there's none it waits, as people go on and doors open, and gives up
with a reason when its patience is over. Where it couldn't turn it first drives a curve to a place where it can.

Source: Kim, Han, Kim, Kim, section 4.1.

Detours aren't to the goal: they lead out of where the robot can't turn, and near to what blocks its way.
"""

from __future__ import annotations

import enum
import math
from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Annotated

import msgspec
import numpy as np
from numpy.typing import ArrayLike

from robots.onboard.driving import STAND, Drive, Posture
from robots.onboard.path import Arc, MovingPath
from robots.onboard.path_following import PathFollowingConfig, PathFollowingController
from robots.onboard.routes import NoRoute, Point, Route, RouteMap, RouteProblem
from vrs.checks import check_fields, finite, validated, within
from vrs.mobile import advanced, wrapped

_CURVES = (0.0, 0.6, -0.6, 1.2, -1.2, 2.0, -2.0, 3.5, -3.5)
"""Curvatures that are tried to get out of a narrow place [1/m]."""
_STEP, _FARTHEST = 0.04, 1.6
"""Ways on them [m]: between two, and the longest."""
_ALONG = 0.1
"""Between places on a way at which it's looked whether it's free [m]."""
_EACH = 5
"""Of so many of them one is tried."""
_NEAR = 0.5
"""Who is so near to where he looks from [m], and turned there within as much [rad], stays."""


def way_out(
    roads: RouteMap,
    posture: Posture,
    seen: ArrayLike,
    room: Callable[[Posture, float, int], float],
    *,
    least: float = 0.0,
) -> Arc | None:
    """The shortest curve to a place where the robot can turn.

    Args:
        roads: The known ways.
        posture: Where it is.
        seen: Places at which something newly stands [m], (k, 2).
        room: Tells how far [m] there's room from a posture along a curvature [1/m], forward (1) or back (−1).
        least: Shorter ones aren't taken [m], unless there's no other: those that didn't help.

    Returns:
        A curve; None if there's none.
    """
    curves = [
        Arc(k * sense, s, sense)
        for k in _CURVES
        for sense in (1, -1)
        for s in np.arange(2 * _STEP, min(room(posture, k, sense) - _STEP, _FARTHEST), _STEP).tolist()
    ]
    if not curves:
        return None
    ends = [advanced(posture, arc.direction, arc.curvature, arc.length)[:2] for arc in curves]
    free = np.flatnonzero(roads.turns_at(ends, blocked=seen)).tolist()
    return min((curves[k] for k in free), key=lambda arc: (arc.length < least, arc.length), default=None)


def approach(
    roads: RouteMap, start: tuple[float, float, float], goal: Point, seen: ArrayLike
) -> tuple[Route, float] | None:
    """The way to where the robot sees whether what blocks its way is still there.

    Args:
        roads: The known ways.
        start: Posture of the robot, (x, y, θ) [m, m, rad].
        goal: Where it can't go as things stand [m].
        seen: Places at which something newly stands [m], (k, 2).

    Returns:
        A route, and the heading at its end [rad]; None if the robot is there, or can't get nearer.
    """
    here = start[:2]
    known = roads.route(here, goal)
    if not isinstance(known, Route):
        return None
    places = known.places(_ALONG)
    free = roads.turns_at(places, blocked=seen)
    # Up to where it's blocked, and back to where there's a way to; in narrow places it can't turn anyway.
    shut = ~free & roads.turns_at(places)
    last = int(np.argmax(shut)) if shut.any() else len(places)
    for k in np.flatnonzero(free[:last])[::-_EACH].tolist():
        place = float(places[k, 0]), float(places[k, 1])
        dx, dy = (places[min(k + _EACH, len(places) - 1)] - places[k]).tolist()
        heading = math.atan2(dy, dx) if dx or dy else start[2]
        near = math.dist(place, here) < _NEAR
        if near and abs(wrapped(heading - start[2])) < _NEAR:
            return None
        found = roads.route(here, here if near else place, blocked=seen)
        if isinstance(found, Route):
            return found, heading
    return None


_FURTHER = 0.12
"""By so much more it drives out of where it's stuck at each try [m]."""
_AWAY = 0.5
"""Who gets so far from where he waited, or was stuck, has got on [m]."""


class Goal(msgspec.Struct, frozen=True, omit_defaults=True, gc=False):
    """Where the robot is to go."""

    x: Annotated[float, within(-1000.0, 1000.0, "m")]
    """[m]."""
    y: Annotated[float, within(-1000.0, 1000.0, "m")]
    """[m]."""
    heading: Annotated[float, within(-1000.0, 1000.0, "rad")] | None = None
    """In which it's to end [rad]; None for any."""

    def __post_init__(self) -> None:
        check_fields(self)


class JourneyState(enum.StrEnum):
    """How far a journey is."""

    IDLE = "idle"
    """No goal was given."""
    DRIVING = "driving"
    WAITING = "waiting"
    """Every way is blocked."""
    ARRIVED = "arrived"
    FAILED = "failed"
    """It has given up; the reason says why."""
    ENDED = "ended"
    """Somebody ended it."""


GOING = frozenset({JourneyState.DRIVING, JourneyState.WAITING})
"""States in which it's under way."""


@dataclass(frozen=True, slots=True)
@validated
class JourneyConfig:
    """How it drives, and how long it tries."""

    following: PathFollowingConfig = field(default_factory=lambda: PathFollowingConfig(arrival_angle=0.01))
    """Of the controller."""
    look: Annotated[float, within(0.05, 10.0)] = 0.25
    """Between two looks at what stands on the way [s], in [0.05, 10]."""
    again: Annotated[float, within(0.05, 60.0)] = 2.5
    """Between two searches for a way while every one is blocked [s], in [0.05, 60]."""
    patience: Annotated[float, within(0.0, 3600.0)] = 30.0
    """So long it waits where every way is blocked [s], in [0, 3600]."""
    stuck: Annotated[float, within(1.0, 600.0)] = 6.0
    """Without getting on for so long it looks for another way [s], in [1, 600]."""
    nearer: Annotated[float, within(1e-3, 1.0)] = 0.03
    """What counts as getting on [m of way], in [1e-3, 1]."""
    aside: Annotated[float, within(0.01, 10.0)] = 0.15
    """So far from its way it looks for another one [m], in [0.01, 10]."""
    near: Annotated[float, within(1e-3, 1.0)] = 0.03
    """So near to the goal it has arrived [m], in [1e-3, 1]."""
    near_angle: Annotated[float, within(1e-3, 1.0)] = math.radians(1.2)
    """And turned so near to its heading [rad], in [1e-3, 1]."""
    tries: Annotated[int, within(1, 1000)] = 12
    """So often in a row it may be stuck, or arrive beside the goal, before it gives up, 1 to 1000."""
    longest: Annotated[float, within(1.0, 86400.0)] = 900.0
    """After so long it gives up [s], in [1, 86400]."""


def _nothing() -> ArrayLike:
    return ()


def _anywhere(_posture: Posture, _curvature: float, _sense: int) -> float:
    return math.inf


class Journey:
    """Takes the robot to a goal; it knows no clock, and is called once a control period."""

    def __init__(
        self,
        roads: RouteMap,
        seen: Callable[[], ArrayLike] = _nothing,
        config: JourneyConfig | None = None,
        *,
        room: Callable[[Posture, float, int], float] = _anywhere,
    ) -> None:
        """Stand.

        Args:
            roads: The known ways.
            seen: Tells at which places something newly stands [m], (k, 2).
            config: How to drive, and how long to try.
            room: Tells how far [m] there's room from a posture along a curvature [1/m], forward (1) or back (−1).
        """
        self._roads, self._seen, self._room = roads, seen, room
        self._config = JourneyConfig() if config is None else config
        self.state = JourneyState.IDLE
        self.reason = ""
        """Why it waits or has failed."""
        self.problem: RouteProblem | None = None
        """What a route to the goal fails for while it waits or has failed so; None where it's something else."""
        self.goal: Goal | None = None
        self.route: Route | None = None
        """The way that's being driven."""
        self.routes = 0
        """How many ways it took on this journey."""
        self._controller: PathFollowingController | None = None
        self._begun = self._looked = self._advanced = -math.inf
        self._waiting_since = math.inf
        self._left = math.inf
        self._turning = self._approaches = False
        self._tried = 0
        self._tried_at: Point = (math.inf, math.inf)
        self._waited_at: Point = (math.inf, math.inf)

    def go(self, goal: Goal, posture: Posture, *, now: float) -> JourneyState:
        """Set out for a goal, in place of any other.

        Args:
            goal: Where to.
            posture: Where the robot is.
            now: Time [s].
        """
        self._begun = finite("now", now, "finite seconds")
        self.goal, self._tried, self.routes = goal, 0, 0
        self.state, self.reason, self.problem = JourneyState.IDLE, "", None
        self._waiting_since = math.inf
        return self._set_out(posture, now)

    def end(self) -> None:
        """Stop where it is, and forget the goal."""
        if self.state in GOING:
            self._become(JourneyState.ENDED, "somebody ended it")

    def control(self, posture: Posture, *, now: float, v_before: float) -> Drive:
        """Say what to drive until the next call.

        Args:
            posture: Where the robot takes itself to be.
            now: Time [s].
            v_before: Linear speed that it was told to drive last [m/s].

        Returns:
            A drive; its limits are for the caller to keep.
        """
        if self.state not in GOING:
            return STAND
        if now - self._begun > self._config.longest:
            self._become(JourneyState.FAILED, f"not there after {self._config.longest:g} s")
            return STAND
        if now >= self._looked + self._config.look - 1e-9:
            self._look(posture, now, v_before)
        controller = self._controller
        if self.state is not JourneyState.DRIVING or controller is None:
            return STAND
        drive = controller.control(posture, v_before=v_before)
        if self._is_at_end(controller) and abs(v_before) < 1e-3:
            self._arrive(posture, now)
            return STAND
        return drive

    @property
    def way_left(self) -> float:
        """Way to the goal [m]; 0 without one."""
        place = None if self._controller is None else self._controller.projection
        if self.state not in GOING or place is None:
            return 0.0
        return place.left

    def _become(self, state: JourneyState, reason: str = "", problem: RouteProblem | None = None) -> JourneyState:
        self.state, self.reason, self.problem = state, reason, problem
        if state is not JourneyState.DRIVING:
            self.route = self._controller = None
        return state

    def _set_out(self, posture: Posture, now: float, *, stuck: bool = False) -> JourneyState:
        """Take the best way from here, or wait for one."""
        goal, path, start = self.goal, MovingPath(posture), (posture.x, posture.y)
        assert goal is not None
        self._looked = self._advanced = now
        self._left = math.inf
        if stuck and self._gives_up(start):
            return self._become(JourneyState.FAILED, f"got no further in {self._config.tries} tries")
        seen = np.asarray(self._seen(), np.float64).reshape(-1, 2)
        if stuck or not self._roads.turns_at([start], blocked=seen)[0]:
            curve = way_out(self._roads, posture, seen, self._room, least=_FURTHER * self._tried if stuck else 0.0)
            if curve is None and not stuck:
                return self._wait(f"no room to turn at ({start[0]:.2f}, {start[1]:.2f})", start, now)
            if curve is not None:
                path.append(curve)
                start = path.end[:2]
        found = self._roads.route(start, (goal.x, goal.y), blocked=seen)
        heading, self._approaches = goal.heading, False
        if isinstance(found, NoRoute):
            known = self._roads.route(start, (goal.x, goal.y))
            if isinstance(known, NoRoute) and (not len(seen) or self._roads.turns_at([start])[0]):
                return self._become(JourneyState.FAILED, known.reason, known.problem)
            self.reason = f"{found.reason}, with what stands there now"
            nearer = approach(self._roads, (*start, path.end.theta), (goal.x, goal.y), seen)
            if nearer is None:
                return self._wait(self.reason, start, now, found.problem)
            found, heading, self._approaches = *nearer, True
        self.route, self.routes = found, self.routes + 1
        for piece in found.pieces(path.end.theta, heading):
            path.append(piece)
        self._controller = PathFollowingController(path, self._config.following)
        return self._become(JourneyState.DRIVING, self.reason if self._approaches else "")

    def _gives_up(self, here: Point) -> bool:
        """Count one more try, unless the robot got somewhere since the last."""
        if math.dist(here, self._tried_at) > _AWAY:
            self._tried, self._tried_at = 0, here
        self._tried += 1
        return self._tried > self._config.tries

    def _wait(self, why: str, here: Point, now: float, problem: RouteProblem | None = None) -> JourneyState:
        if not math.isfinite(self._waiting_since):
            self._waiting_since = now
        self._waited_at = here
        gives_up = now - self._waiting_since > self._config.patience
        return self._become(JourneyState.FAILED if gives_up else JourneyState.WAITING, why, problem)

    def _look(self, posture: Posture, now: float, v_before: float) -> None:
        """See whether the way ahead is still free, and whether the robot gets on."""
        self._looked = now
        if self.state is JourneyState.WAITING:
            self._looked += self._config.again - self._config.look
            self._set_out(posture, now)
            return
        if not self._approaches and math.dist(posture[:2], self._waited_at) > _AWAY:
            self._waiting_since = math.inf
        stuck = now - self._advanced > self._config.stuck
        if not (self._strays(posture, now) or stuck or self._roads.crosses(self._ahead(posture), self._seen())):
            return
        if abs(v_before) > 1e-3:
            # It stands before it turns to another way.
            self._controller, self._looked = None, -math.inf
        else:
            self._set_out(posture, now, stuck=stuck)

    def _strays(self, posture: Posture, now: float) -> bool:
        """Whether the robot isn't on its way any more; notes whether it gets on."""
        place = None if self._controller is None else self._controller.projection
        if place is None:
            return self._controller is None
        left = place.left + (0.0 if place.turn is None else abs(place.turn))
        turning = place.turn is not None
        if left < self._left - self._config.nearer or turning != self._turning:
            self._left, self._advanced, self._turning = left, now, turning
        return math.dist((place.x, place.y), posture[:2]) > self._config.aside

    def _ahead(self, posture: Posture) -> list[Point]:
        """What is left of the way, from here on."""
        route, controller = self.route, self._controller
        if route is None:
            return []
        place = None if controller is None else controller.projection
        left = route.length if place is None else place.left
        found: list[Point] = []
        for a, b in pairwise(reversed(route.points)):
            found.append(a)
            left -= math.dist(a, b)
            if left <= 0:
                break
        return [(posture.x, posture.y), *reversed(found)]

    @staticmethod
    def _is_at_end(controller: PathFollowingController) -> bool:
        place, config = controller.projection, controller.config
        if place is None or place.left > config.arrival:
            return False
        return place.turn is None or abs(place.turn) <= config.arrival_angle

    def _arrive(self, posture: Posture, now: float) -> None:
        """It's where its way ends: at the goal, or beside it after a detour."""
        goal, config = self.goal, self._config
        assert goal is not None
        off = math.hypot(goal.x - posture.x, goal.y - posture.y)
        turned = 0.0 if goal.heading is None else abs(wrapped(goal.heading - posture.theta))
        if off <= config.near and turned <= config.near_angle:
            self._become(JourneyState.ARRIVED)
        elif not self._approaches and self._gives_up((posture.x, posture.y)):
            self._become(JourneyState.FAILED, f"{100 * off:.1f} cm beside the goal after {config.tries} tries")
        else:
            self._set_out(posture, now)
