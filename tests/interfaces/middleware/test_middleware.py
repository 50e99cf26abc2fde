"""The middleware and the robot's end: what is probed, predicted, slowed, dropped; any controller, unchanged."""

from __future__ import annotations

import math

import pytest

from interfaces.link import ProbeConfig
from interfaces.link.round_trip import Probe
from interfaces.middleware import (
    ActionAgent,
    DriveFeedback,
    DriveSetpoint,
    GainSchedulingMiddleware,
    MiddlewareConfig,
    default_network,
    drive_measure,
    predicted,
)
from robots.onboard.curve import Curve
from robots.onboard.curve_trackers import PurePursuit, QuadraticCurveTracker
from robots.onboard.driving import STAND, Drive, Posture
from robots.onboard.path import Arc, MovingPath
from robots.onboard.path_following import PathFollowingController
from vrs.errors import InvalidValueError

HERE = Posture(1.0, 2.0, 0.3)


class Seen:
    """A controller that tells what it was told."""

    def __init__(self, drive=(2.0, 1.0)):
        self.drive, self.postures = drive, []

    def __call__(self, posture):
        self.postures.append(posture)
        return self.drive


def probed(middleware, delays, *, start=0.0):
    """Let probes come back, each after its delay [s]; returns when the last one did."""
    now = start
    for delay in delays:
        now = max(middleware.next_deadline(), now)
        probe = middleware.to_send(now=now)
        now += delay
        middleware.receive(probe.echo(now - delay / 2), now=now)
    return now


def test_probes_go_out_every_5_ms_and_ten_round_trips_count():
    middleware = GainSchedulingMiddleware(Seen())
    assert [middleware.to_send(now=0.001 * k) is not None for k in range(11)] == [k % 5 == 0 for k in range(11)]
    assert middleware.config.probing.window.capacity == 10
    middleware = GainSchedulingMiddleware(Seen())
    now = probed(middleware, [9.0 - 4.9] * 3 + [0.1, 0.1, 0.1, 0.1, 0.1, 0.2, 0.2, 0.3, 0.3, 0.5])
    assert middleware.traffic.delays.median == pytest.approx(0.15)
    assert middleware.traffic.delays.mean == pytest.approx(0.2)
    assert now > 0


def test_the_median_predicts_and_the_mean_slows():
    controller = Seen()
    middleware = GainSchedulingMiddleware(controller)
    now = probed(middleware, [0.1] * 9 + [1.1])
    driving = Drive(0.5, 0.4)
    command = middleware.receive(DriveFeedback(0, HERE, driving), now=now)
    assert controller.postures == [predicted(HERE, driving, 0.1)]
    assert drive_measure(command.drive, 0.2) == pytest.approx(0.25)
    assert command.drive.w / command.drive.v == pytest.approx(0.5)
    assert middleware.scheduler.slowed == 1


@pytest.mark.parametrize(("predicts", "schedules"), [(True, False), (False, True), (False, False)])
def test_each_half_goes_without_the_other(predicts, schedules):
    controller = Seen()
    middleware = GainSchedulingMiddleware(controller, MiddlewareConfig(predicts=predicts, schedules=schedules))
    if predicts or schedules:
        assert middleware.receive(DriveFeedback(0, HERE, STAND), now=0.0) is None
        now = probed(middleware, [0.2] * 3)
    else:
        assert middleware.next_deadline() is None
        assert middleware.to_send(now=0.0) is None
        now = 0.0
    command = middleware.receive(DriveFeedback(1, HERE, Drive(1.0, 0.0)), now=now)
    moved = (HERE[0] + 0.2 * math.cos(0.3), HERE[1] + 0.2 * math.sin(0.3), 0.3)
    assert controller.postures[-1] == pytest.approx(moved if predicts else HERE)
    assert (command.drive == (2.0, 1.0)) is not schedules


def test_until_a_round_trip_is_known_nothing_is_sent():
    middleware = GainSchedulingMiddleware(Seen())
    assert middleware.receive(DriveFeedback(0, HERE, STAND), now=0.0) is None
    now = probed(middleware, [0.2])
    assert middleware.receive(DriveFeedback(1, HERE, STAND), now=now) == DriveSetpoint(
        0, pytest.approx((1.118, 0.559), rel=1e-2)
    )


def test_stale_and_senseless_reports_are_dropped():
    controller = Seen()
    middleware = GainSchedulingMiddleware(controller, MiddlewareConfig(predicts=False, schedules=False))
    numbers = [3, 2, 3, 5]
    answers = [middleware.receive(DriveFeedback(n, HERE, STAND), now=0.01 * k) for k, n in enumerate(numbers)]
    assert [answer and answer.number for answer in answers] == [0, None, None, 1]
    for bad in (Posture(math.nan, 0, 0), Posture(0, math.inf, -math.inf)):
        assert middleware.receive(DriveFeedback(9, bad, STAND), now=1.0) is None
    assert middleware.receive(DriveFeedback(9, HERE, Drive(0.0, math.nan)), now=1.0) is None
    assert len(controller.postures) == 2


def test_a_command_behind_a_newer_one_is_stale():
    robot = ActionAgent()
    assert robot.sample(HERE, now=0.0) == DriveFeedback(0, HERE, STAND)
    for number, v in ((4, 0.4), (3, 0.3), (4, 0.9), (6, math.nan), (5, 0.5)):
        assert robot.receive(DriveSetpoint(number, Drive(v, 0.0)), now=0.01) is None
    assert robot.sample(HERE, now=0.01) == DriveFeedback(1, HERE, Drive(0.5, 0.0))
    assert robot.stale == 2


def test_a_starved_robot_stands_and_goes_on_with_the_next_command():
    robot = ActionAgent(starved=0.3)
    robot.receive(DriveSetpoint(0, Drive(0.4, 0.0)), now=1.0)
    assert robot.driving(now=1.29) == (0.4, 0.0)
    assert robot.driving(now=1.31) == STAND
    robot.receive(DriveSetpoint(1, Drive(0.6, 0.0)), now=9.0)
    assert robot.driving(now=9.0) == (0.6, 0.0)


def test_a_probe_is_echoed_at_once():
    echo = ActionAgent().receive(Probe(7, 1, 0.5), now=3.0)
    assert (echo.session, echo.sequence, echo.sent, echo.received, echo.replied) == (7, 1, 0.5, 3.0, 3.0)


def test_any_controller_goes_behind_it_unchanged():
    curve = Curve([(0, 1), (1, 1.5), (2, 1)])
    path = MovingPath((0.0, 1.0, 0.0))
    path.append(Arc(0.2, 2.0))
    for make in (
        lambda: QuadraticCurveTracker(curve).control,
        lambda: PurePursuit(curve).control,
        lambda: PathFollowingController(path).control,
    ):
        there, alone = make(), make()
        middleware = GainSchedulingMiddleware(there, network=default_network())
        now = probed(middleware, [0.8] * 4)
        found = middleware.receive(DriveFeedback(0, HERE, Drive(0.2, 0.1)), now=now).drive
        wanted = alone(predicted(HERE, Drive(0.2, 0.1), 0.8))
        assert drive_measure(found, 0.8) <= 0.25 * (1 + 1e-9)
        if drive_measure(Drive(*wanted), 0.8) <= 0.25:
            assert found == wanted
        else:
            assert found.w * wanted[0] == pytest.approx(wanted[1] * found.v)


@pytest.mark.parametrize(("make", "bad"), [
    (MiddlewareConfig, {"epsilon": 0.0}), (ProbeConfig, {"period": 0.0}), (ActionAgent, {"starved": math.nan}),
])  # fmt: skip
def test_impossible_configurations_are_refused(make, bad):
    with pytest.raises(InvalidValueError):
        make(**bad)


@pytest.mark.parametrize("schedules", [True, False])
def test_a_controller_that_says_nan_is_told_so(schedules):
    middleware = GainSchedulingMiddleware(Seen((math.nan, 0.0)), MiddlewareConfig(schedules=schedules))
    now = probed(middleware, [0.2])
    with pytest.raises(InvalidValueError, match="from the controller"):
        middleware.receive(DriveFeedback(0, HERE, STAND), now=now)


def test_a_network_of_another_tolerance_is_refused():
    with pytest.raises(InvalidValueError, match="network must be"):
        GainSchedulingMiddleware(Seen(), MiddlewareConfig(epsilon=0.5), network=default_network())
