"""One trip: a robot in a room, told where to go, until it's there or says that it can't."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from robots.mobile.chassis import MobileReality, Senses
from robots.mobile.navigation import BodyNavigator, route_map
from robots.mobile.position import LaserPosition, OdometryPosition
from robots.mobile.robot import Collision, MobileRobot
from robots.onboard.driving import STAND, Drive, kept
from robots.onboard.journey import GOING, Goal, JourneyState
from robots.onboard.laser import LaserModel
from robots.onboard.navigator import Navigator
from robots.onboard.routes import Route, RouteMap, RouteProblem
from robots.robot import BARE, USUAL_BASE, load
from robots.rooms import Room
from vrs.mobile import wrapped
from vrs.model import Array

CONTROL = 0.05
"""Between two drives [s]."""
FIRST_LOOK = 0.5
"""So long the robot looks about before it's told where to go [s]."""
NOISES = (0.01, 0.02)
"""Of the laser's ranges, in turns [m]."""


@dataclass(frozen=True, slots=True)
class TripSetting:
    """Who is to go where."""

    room: Room
    start: tuple[float, float, float]
    goal: Goal
    seed: tuple[int, ...]
    """Of the robot's noise and slip."""
    body: str = BARE
    """One of the usual mobile robot's."""


@dataclass(frozen=True, slots=True, eq=False)
class Trip:
    """What came of it, and the yardsticks of its length."""

    group: str
    setting: TripSetting
    mapped: float
    """Length of the shortest way on the map [m]."""
    true: float
    """Of the shortest way as things stood at first [m]; infinite where there was none."""
    state: JourneyState
    reason: str
    way: float
    """How far it drove [m]."""
    time: float
    """How long it took [s]."""
    routes: int
    """How many ways it took."""
    planned: float
    """Length of the way that the map alone has [m]; nan without one."""
    off: float
    """From the goal to where it really is [m]."""
    turned: float
    """From the goal's heading to its true one [rad]."""
    lost: float
    """Largest error of the position that it took itself to be at [m]."""
    touched: tuple[Collision, ...]
    """What it ran into, or who into it."""
    track: Array
    """True postures, (k, 3)."""
    problem: RouteProblem | None = None
    """What a route failed for; None where the trip didn't fail so."""

    @property
    def arrived(self) -> bool:
        """Whether it's at the goal within 5 cm and 2 deg."""
        return self.state is JourneyState.ARRIVED and self.off <= 0.05 and self.turned <= math.radians(2.0)

    @property
    def ratio(self) -> float:
        """Length of the route on the map, by the shortest; nan where either of them is unknown."""
        return self.planned / self.mapped if math.isfinite(self.mapped) else math.nan


def body_of(setting: TripSetting, reality: MobileReality | None = None) -> MobileRobot:
    """The robot where it begins, with laser and sonars."""
    noise = NOISES[setting.seed[-1] % len(NOISES)]
    senses = Senses(camera=None, laser=LaserModel(noise=noise))
    rng = np.random.default_rng([*setting.seed, 2])
    make = load(USUAL_BASE).body(setting.body)
    body: MobileRobot = make(setting.start, room=setting.room, reality=reality, rng=rng, senses=senses)
    return body


@dataclass(frozen=True, slots=True)
class Aboard:
    """What a robot finds its way with; the product's own, but for what a counterfactual has in its place."""

    position: type[LaserPosition | OdometryPosition] = LaserPosition
    """Says where it is."""
    ways: type[RouteMap] = RouteMap
    """Finds its ways."""
    navigator: Callable[..., Navigator] = Navigator
    """Decides."""


class TrialPilot:
    """Drives a robot with its navigator, on the posture that its laser gives; notes what happens."""

    def __init__(self, body: MobileRobot, aboard: Aboard | None = None) -> None:
        """Take a robot with a laser scanner and sonars."""
        self.body = body
        aboard = Aboard() if aboard is None else aboard
        self._position = aboard.position(body)
        self._on_board = BodyNavigator(body, CONTROL, aboard.ways, aboard.navigator)
        self.journey = self._on_board.navigator.journey
        """Its goal, its route, how far it is."""
        self.posture = self._position.posture()
        """Where the robot takes itself to be."""
        self._before = STAND
        self._steps = round(CONTROL / body.reality.dt)
        self.lost = 0.0
        """Largest error of its position [m]."""
        self.track: list[tuple[float, float, float]] = [body.truth]
        """True postures."""

    def go(self, goal: Goal) -> None:
        """Set out."""
        self._on_board.navigator.go(goal, self.posture, now=self.body.time)

    def step(self) -> Drive:
        """Go on by a control period; returns what was driven."""
        body = self.body
        self.posture = self._position.posture()
        self.lost = max(self.lost, math.dist(self.posture[:2], body.truth[:2]))
        wanted = self._on_board.drive(self.posture, v_before=self._before.v)
        self._before = kept(wanted.v, wanted.w, self._before.v, CONTROL, body.limits)
        body.drive(self._before.v, self._before.w, self._steps)
        self.track.append(body.truth)
        return self._before


def travel(
    group: str,
    setting: TripSetting,
    mapped: float,
    true: float,
    aboard: Aboard | None = None,
    limit: float = math.inf,
) -> Trip:
    """Let a robot look about, tell it where to go, and drive until it's there or gives up.

    Args:
        group: Of the trip.
        setting: Who is to go where.
        mapped: Length of the shortest way on the map [m].
        true: Of the shortest way as things stood at first [m].
        aboard: What another robot has on board for comparison; its trip ends where it touches something.
        limit: And after so long [s].
    """
    with body_of(setting) as body:
        pilot = TrialPilot(body, aboard)
        while body.time < FIRST_LOOK - 1e-9:
            pilot.step()
        begun, goal = body.time, setting.goal
        pilot.go(goal)
        journey = pilot.journey
        planned = route_map(setting.room, body.chassis.footprint).route(body.truth[:2], (goal.x, goal.y))
        while journey.state in GOING and body.time < begun + limit:
            if aboard is not None and body.collisions:
                break
            pilot.step()
        x, y, theta = body.truth
        track = np.array(pilot.track)
        return Trip(
            group=group,
            setting=setting,
            mapped=mapped,
            true=true,
            state=journey.state,
            reason=journey.reason,
            problem=journey.problem,
            way=float(np.hypot(*np.diff(track[:, :2], axis=0).T).sum()),
            time=body.time - begun,
            routes=journey.routes,
            planned=planned.length if isinstance(planned, Route) else math.nan,
            off=math.hypot(goal.x - x, goal.y - y),
            turned=0.0 if goal.heading is None else abs(wrapped(goal.heading - theta)),
            lost=pilot.lost,
            touched=body.collisions,
            track=track,
        )


def seen_all(room: Room) -> Room:
    """A room of which the map has everything that stands there for good, as doors do at time 0; nobody in it."""
    doors = tuple(replace(door.at(0.0), known=True) for door in room.doors)
    return replace(
        room,
        blocks=(*(replace(block, known=True) for block in room.blocks), *doors),
        columns=tuple(replace(column, known=True) for column in room.columns),
        people=(),
        doors=(),
    )
