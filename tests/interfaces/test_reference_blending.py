"""Going over onto references that came late, a joint at a time: its limits, its ends, what is near enough."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from interfaces.runtime.tick_loop import ASTRAY, BEGIN, ReferenceBlending
from vrs.model import Array, Limits

TICK = 0.001
SPEED, ACCELERATION = 2.0, 10.0
LIMITS = Limits(
    np.array([-1.0]), np.array([1.0]), np.array([SPEED]), np.array([ACCELERATION]), np.array([100.0])
)  # fmt: skip


def row(q: float, qd: float = 0.0, qdd: float = 0.0) -> Array:
    return np.array([[q], [qd], [qdd]])


def went(q: float, qd: float, references: Sequence[Array]) -> Array:
    """Positions and speeds tick by tick, (k, 2)."""
    merging, found = ReferenceBlending(LIMITS, TICK), []
    for reference in references:
        ((q,), (qd,)) = merging.step((q,), (qd,), reference)
        found.append((q, qd))
    return np.array(found)


@pytest.mark.parametrize(("begun", "span"), [(False, BEGIN), (True, ASTRAY)])
def test_what_has_been_one_motion_until_lately_is_near(begun: bool, span: float) -> None:
    merging, far = ReferenceBlending(LIMITS, TICK), ACCELERATION * span**2
    for sign in (1.0, -1.0):
        assert merging.near((0.0,), (0.0,), row(sign * 0.99 * far), begun=begun)
        assert not merging.near((0.0,), (0.0,), row(sign * 1.01 * far), begun=begun)
        fast = 2.0 * ACCELERATION * BEGIN
        assert merging.near((0.0,), (0.0,), row(0.0, sign * 0.99 * fast), begun=begun)
        assert merging.near((0.0,), (0.0,), row(0.0, sign * 1.01 * fast), begun=begun) is begun


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_joint_comes_to_rest_before_its_end_whatever_it_is_to_follow(sign: float) -> None:
    """It moves at full speed with just the room to brake, and its references go on beyond the end."""
    room = 0.5 * SPEED**2 / ACCELERATION + 2.0 * SPEED * TICK
    references = [row(sign * (1.0 - room + SPEED * TICK * k), sign * SPEED) for k in range(1, 800)]
    path = went(sign * (1.0 - room), sign * SPEED, references)
    assert (sign * path[:, 0]).max() <= 1.0 + ACCELERATION * TICK**2
    assert sign * path[-1, 0] > 0.99
    assert np.abs(np.diff(path[:, 1])).max() <= ACCELERATION * TICK * (1 + 1e-9)


def test_where_the_references_need_all_of_the_acceleration_it_waits() -> None:
    merging = ReferenceBlending(LIMITS, TICK)
    for ahead in (0.01, -0.01):
        for taken, waits in ((0.0, False), (1.0, True), (-1.0, False)):
            turning = np.sign(ahead) * taken * ACCELERATION
            _, (speed,) = merging.step((ahead,), (0.0,), row(0.0, 0.0, turning))
            assert (speed == 0.0) is waits
            assert speed * ahead <= 0.0


def test_it_comes_onto_references_that_stand_and_onto_those_that_move() -> None:
    for speed in (0.0, 0.3, -0.3):
        references = [row(speed * TICK * k, speed) for k in range(1, 2000)]
        path = went(0.02, speed, references)
        assert path[-1] == pytest.approx([speed * TICK * 1999, speed], abs=1e-9)
        assert ReferenceBlending(LIMITS, TICK).there(path[-2, :1], path[-2, 1:], references[-1])
        assert not ReferenceBlending(LIMITS, TICK).there((0.02,), (speed,), references[0])
