"""What clients are told of two robots, and where the virtual one is drawn."""

from __future__ import annotations

import math

import pytest

from interfaces.link import LinkConditions
from interfaces.messages.control import PROTOCOL, Attached, Postures
from interfaces.messages.sites import DriveReport
from interfaces.runtime.live.base_twins import BaseTwins
from interfaces.teleop.architectures.compositions import ARCHITECTURES
from robots import load
from robots.mobile.robot import place
from robots.onboard.driving import STAND, Drive, Posture
from vrs.model import frozen_array

HERE, BESIDE = Posture(1.5, 3.0, 0.0), Posture(1.5, 3.2, 0.1)


def attached(architecture: str) -> Attached:
    estimates = architecture in ARCHITECTURES and ARCHITECTURES[architecture].estimates
    return Attached(
        PROTOCOL, "ipr", frozen_array(HERE), "hold", 0.5, architecture=architecture, estimates=estimates
    )


def driving() -> BaseTwins:
    """Two robots in a drive, the virtual one half a second on its way."""
    twins = BaseTwins(load("ipr"), LinkConditions(), 0, place("empty"))
    twins.operator.receive(DriveReport(None, 1, 0.05, 0.05, HERE, STAND), now=0.1)
    assert twins.operator.resume(now=0.2) == ""
    for k in range(30, 70):
        twins.operator.robot.wish(0.4, 0.0, issued_at=0.01 * k, now=0.01 * k)
        twins.operator.advance(now=0.01 * k)
    return twins


def told(twins: BaseTwins, architecture: str, now: float) -> Postures:
    twins.draw(attached(architecture), now=now)
    return twins.state(1, connected=True, now=now)


@pytest.mark.parametrize("architecture", ["II", "extended"])
def test_the_posture_estimator_moves_the_virtual_robot_where_there_is_one(architecture: str) -> None:
    twins = driving()
    first = told(twins, architecture, 0.72)
    assert first.drawn is None, "nothing was fed back: it's where the commands lead"
    estimator = twins.operator.robot.architecture.estimator
    for number in range(20):
        estimator.feedback(1, BESIDE, number)
    then = told(twins, architecture, 0.72)
    assert then.virtual == first.virtual, "what is compared is what the commands make"
    assert then.drawn is not None
    assert then.drawn.y - then.virtual.y == pytest.approx(0.2, abs=0.05)
    # It comes to where the estimator has it after all commands.
    assert math.dist(then.drawn[:2], then.estimate[:2]) < 0.04
    assert told(twins, architecture, 9.0).drawn == pytest.approx(then.estimate)


def test_of_a_path_that_is_played_as_it_is_the_commands_say_where_it_is() -> None:
    twins = driving()
    twins.operator.robot.architecture.estimator.feedback(1, BESIDE, 1)
    assert told(twins, "timeline", 0.72).drawn is None
    assert told(twins, "own:Controller", 0.72).drawn is None
    assert (
        twins.state(1, connected=True, now=0.72).command
        == twins.operator.robot.architecture.before
        != Drive(0.0, 0.0)
    )
