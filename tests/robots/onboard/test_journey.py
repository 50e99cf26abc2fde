"""Journeys: a point robot on exact arcs, told what stands there; routes, waits, reasons."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robots.onboard.driving import IPR_LIMITS, STAND, Drive, Posture, kept
from robots.onboard.journey import GOING, Goal, Journey, JourneyConfig, JourneyState, way_out
from robots.onboard.path_following import PathFollowingConfig
from robots.onboard.routes import Route, RouteConfig, RouteMap, RouteProblem
from vrs.errors import InvalidValueError
from vrs.mobile import advanced, wrapped
from vrs.model import Array

DT = 0.05
CONFIG = RouteConfig(0.4, 0.23)
NOTHING = np.empty((0, 2))
DIVIDED = [[(2.95, 0), (3.05, 0), (3.05, 1.5), (2.95, 1.5)], [(2.95, 2.5), (3.05, 2.5), (3.05, 4), (2.95, 4)]]
"""A wall across the floor with a doorway of 1 m in its middle."""
DOOR = np.column_stack([np.full(21, 3.0), np.linspace(1.5, 2.5, 21)])


class World:
    """A robot that does what it's told, within its limits, and things that come and go."""

    def __init__(self, start: Posture, things: list[list[tuple[float, float]]], config: JourneyConfig) -> None:
        self.seen: Array = NOTHING
        self.roads = RouteMap((6.0, 4.0), things, CONFIG)
        self.journey = Journey(self.roads, lambda: self.seen, config)
        self.posture, self.now, self.before = start, 0.0, STAND

    def run(self, seconds: float) -> None:
        end = self.now + seconds
        while self.now < end - 1e-9 and self.journey.state in GOING:
            wanted = self.journey.control(self.posture, now=self.now, v_before=self.before.v)
            assert kept(*wanted, self.before.v, DT, IPR_LIMITS) == wanted or wanted == STAND
            self.before = kept(wanted.v, wanted.w, self.before.v, DT, IPR_LIMITS)
            self.posture = moved(self.posture, self.before)
            self.now += DT


def moved(posture: Posture, drive: Drive) -> Posture:
    x, y, theta = posture
    if abs(drive.v) < 1e-12:
        return Posture(x, y, theta + drive.w * DT)
    return Posture(*advanced(posture, 1, drive.w / drive.v, drive.v * DT))


@settings(deadline=None, max_examples=12)
@given(
    st.floats(0.6, 2.3),
    st.floats(0.6, 3.4),
    st.floats(3.7, 5.4),
    st.floats(0.6, 3.4),
    st.floats(-3, 3),
    st.floats(-3, 3),
)
def test_a_goal_behind_a_doorway_is_reached(
    x: float, y: float, gx: float, gy: float, theta: float, heading: float
) -> None:
    world = World(Posture(x, y, theta), DIVIDED, JourneyConfig())
    assert world.journey.go(Goal(gx, gy, heading), world.posture, now=0.0) is JourneyState.DRIVING
    assert isinstance(world.journey.route, Route)
    world.run(90.0)
    assert world.journey.state is JourneyState.ARRIVED
    assert math.dist(world.posture[:2], (gx, gy)) < 0.03
    assert abs(wrapped(world.posture.theta - heading)) < math.radians(1.2)
    assert world.journey.control(world.posture, now=world.now, v_before=0.0) == STAND


def test_a_door_that_opens_is_waited_for_and_one_that_stays_closed_is_a_reason() -> None:
    for patience, state in ((20.0, JourneyState.ARRIVED), (3.0, JourneyState.FAILED)):
        world = World(Posture(1.0, 2.0, 0.0), DIVIDED, JourneyConfig(patience=patience))
        world.seen = DOOR
        world.journey.go(Goal(5.0, 2.0), world.posture, now=0.0)
        world.run(12.0)
        assert world.journey.state is (JourneyState.WAITING if state is JourneyState.ARRIVED else state)
        assert "no way" in world.journey.reason
        assert world.journey.problem is RouteProblem.NO_WAY
        assert world.posture.x < 3.0 - CONFIG.half_width
        world.seen = NOTHING
        world.run(60.0)
        assert world.journey.state is state


def test_what_comes_into_the_way_is_gone_round() -> None:
    world = World(Posture(1.0, 2.0, 0.0), [], JourneyConfig())
    world.journey.go(Goal(5.0, 2.0), world.posture, now=0.0)
    world.run(2.0)
    assert world.journey.routes == 1
    chair = np.array([(3.5, 2.0), (3.55, 2.05), (3.5, 1.95)])
    world.seen = chair
    nearest = math.inf
    while world.journey.state in GOING and world.now < 60:
        world.run(DT)
        nearest = min(nearest, float(np.hypot(*(chair - world.posture[:2]).T).min()))
    assert world.journey.state is JourneyState.ARRIVED
    assert world.journey.routes == 2
    assert nearest > CONFIG.half_width


def test_who_is_ended_or_carried_off_does_what_is_right() -> None:
    world = World(Posture(1.0, 2.0, 0.0), [], JourneyConfig())
    assert world.journey.control(world.posture, now=0.0, v_before=0.0) == STAND
    world.journey.go(Goal(5.0, 2.0), world.posture, now=0.0)
    world.run(3.0)
    world.posture = Posture(2.0, 3.0, 1.0)
    world.run(60.0)
    assert world.journey.state is JourneyState.ARRIVED
    world.journey.go(Goal(1.0, 1.0), world.posture, now=world.now)
    world.run(2.0)
    assert world.journey.way_left > 1.0
    world.journey.end()
    assert world.journey.state is JourneyState.ENDED
    assert world.journey.problem is None
    assert world.journey.control(world.posture, now=world.now, v_before=0.3) == STAND
    assert world.journey.way_left == 0.0


def test_where_the_map_has_no_way_it_fails_at_once() -> None:
    wall = [[(2.9, 0), (3.1, 0), (3.1, 4), (2.9, 4)]]
    world = World(Posture(1.0, 2.0, 0.0), wall, JourneyConfig())
    for world.seen in (NOTHING, np.array([[1.0, 3.5]])):
        assert world.journey.go(Goal(5.0, 2.0), world.posture, now=0.0) is JourneyState.FAILED
        assert "no way" in world.journey.reason
        assert world.journey.problem is RouteProblem.NO_WAY
        assert world.journey.go(Goal(3.0, 2.0), world.posture, now=0.0) is JourneyState.FAILED
        assert "too near to something" in world.journey.reason
        assert world.journey.problem is RouteProblem.GOAL


def test_out_of_a_narrow_place_leads_the_shortest_free_curve() -> None:
    roads = RouteMap((6.0, 4.0), [], CONFIG)
    posture = Posture(3.0, 0.3, math.pi / 2)
    arc = way_out(roads, posture, NOTHING, lambda _, __, sense: 1.0 if sense > 0 else 0.0)
    assert arc is not None
    assert arc.direction == 1
    assert roads.turns_at([advanced(posture, 1, arc.curvature, arc.length)[:2]])[0]
    assert arc.length < 0.25
    assert way_out(roads, posture, NOTHING, lambda _, __, ___: 0.0) is None


@pytest.mark.parametrize(
    "bad", [{"look": 0.0}, {"tries": 0}, {"tries": True}, {"patience": -1.0}, {"near": math.inf}]
)
def test_what_makes_no_sense_is_refused(bad: dict[str, float]) -> None:
    with pytest.raises(InvalidValueError):
        JourneyConfig(**bad)  # type: ignore[arg-type]
    with pytest.raises(InvalidValueError):
        Goal(math.nan, 0.0)


def test_who_stands_there_but_looks_elsewhere_has_not_arrived() -> None:
    """A controller that leaves off turning early, and a goal that's strict: it sets out again, and gives up."""
    following = PathFollowingConfig(arrival_angle=0.4)
    world = World(Posture(1.0, 2.0, 0.0), [], JourneyConfig(following=following, tries=3))
    world.journey.go(Goal(3.0, 2.0, 1.0), world.posture, now=0.0)
    world.run(30.0)
    off = abs(wrapped(world.posture.theta - 1.0))
    assert (world.journey.state is JourneyState.ARRIVED) == (off <= math.radians(1.2))
    assert world.journey.routes > 1


def test_a_journey_that_takes_too_long_is_given_up() -> None:
    world = World(Posture(1.0, 2.0, 0.0), [], JourneyConfig(longest=2.0))
    world.journey.go(Goal(5.0, 2.0), world.posture, now=0.0)
    world.run(10.0)
    assert world.journey.state is JourneyState.FAILED
    assert world.now == pytest.approx(2.0, abs=3 * DT)
    assert "2 s" in world.journey.reason


def test_who_is_pushed_aside_takes_another_way() -> None:
    """He doesn't drive back across what he was pushed over."""
    world = World(Posture(1.0, 2.0, 0.0), [], JourneyConfig())
    world.journey.go(Goal(5.0, 2.0), world.posture, now=0.0)
    world.run(3.0)
    x, _, theta = world.posture
    world.posture = Posture(x, 2.3, theta)
    world.run(4.0)
    assert world.journey.routes == 2
    assert world.journey.route is not None
    assert world.journey.route.points[0][1] == pytest.approx(2.3, abs=0.1)


def test_who_gets_no_further_looks_for_another_way_and_gives_up_in_the_end() -> None:
    world = World(Posture(1.0, 2.0, 0.0), [], JourneyConfig(stuck=1.0, tries=2))
    world.journey.go(Goal(5.0, 2.0), world.posture, now=0.0)
    stood = world.posture
    while world.journey.state in GOING and world.now < 20.0:
        # Its wheels slip: it's told to drive, and doesn't.
        world.journey.control(stood, now=world.now, v_before=0.0)
        world.now += DT
    assert world.journey.state is JourneyState.FAILED
    assert "no further in 2 tries" in world.journey.reason
    assert 2.0 < world.now < 6.0
