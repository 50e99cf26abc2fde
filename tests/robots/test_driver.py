"""Hardware behind a driver: it follows, it's looked at, and what fails is told."""

from __future__ import annotations

import importlib
import math
import threading
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import Any

import numpy as np
import pytest

from robots import puma560
from robots.driver import DriverArm, DriverDescriptor, DriverError, conformance, driver_arm, load_driver, standing
from robots.robot import Prepared, load
from vrs.errors import InvalidValueError
from vrs.model import Array, Limits

LIMITS = Limits(-1.5 * np.ones(2), 1.5 * np.ones(2), 4.0 * np.ones(2), 20.0 * np.ones(2))
HOME = np.array([0.1, -0.2])


class Servos:
    """Two joints that are where they're told to be; what it's to do otherwise is set from outside."""

    def __init__(self) -> None:
        self.q, self.closed = HOME.tolist(), False
        self.reading: Callable[[list[float]], Any] = list
        self.writing: Callable[[Sequence[float]], Any] = list

    def descriptor(self) -> DriverDescriptor:
        return DriverDescriptor(("one", "two"), 200.0)

    def read_joints(self) -> Any:
        return self.reading(self.q)

    def write_joints(self, q: Sequence[float]) -> None:
        self.q = self.writing(q)

    def close(self) -> None:
        self.closed = True


def fails(error: Exception) -> Callable[..., Any]:
    def act(*_: object) -> Any:
        raise error

    return act


def told(q: Array) -> Prepared:
    return Prepared(np.atleast_2d(q), np.zeros((1, 2)), np.empty((1, 0)))


def within(seconds: float, arm: DriverArm, q: Array, seen: Callable[[Array], bool]) -> bool:
    """Follow a reference until something is measured; whether it was in time."""
    for _ in range(round(200 * seconds)):
        if seen(arm.follow(told(q)).q[0]):
            return True
        threading.Event().wait(0.005)
    return False


def test_it_goes_where_the_references_are_and_is_closed_in_the_end() -> None:
    driver, goal = Servos(), HOME + 0.5
    with driver_arm(lambda: driver, HOME) as arm:
        assert within(2.0, arm, goal, lambda q: bool((q == goal).all()))
        measured = arm.follow(Prepared(np.tile(goal, (3, 1)), np.zeros((3, 2)), np.empty((3, 0))))
        assert (measured.q.shape, measured.tau.shape) == ((3, 2), (3, 0))
        assert not driver.closed
    assert driver.closed


def test_a_lost_packet_is_nothing_and_a_dead_bus_ends_it() -> None:
    driver = Servos()
    with driver_arm(lambda: driver, HOME) as arm:
        lost = [TimeoutError("lost"), OSError("damaged")]
        driver.reading = lambda q: fails(lost.pop())() if lost else list(q)
        assert within(2.0, arm, HOME + 0.1, lambda q: not lost and bool((q == HOME + 0.1).all()))
        driver.reading = fails(TimeoutError("the bus doesn't answer"))
        # Nobody sees: not a number, which the site stops for.
        assert within(1.0, arm, HOME, lambda q: bool(np.isnan(q).all()))
        with pytest.raises(DriverError, match="the driver fails: the bus doesn't answer"):
            within(3.0, arm, HOME, lambda _: False)


@pytest.mark.parametrize("values", [[0.1], [0.1, math.nan], [0.1, "x"], None])
def test_what_is_no_reading_ends_it(values: Any) -> None:
    driver = Servos()
    with driver_arm(lambda: driver, HOME) as arm:
        driver.reading = lambda _: values
        with pytest.raises(DriverError, match="the driver failed"):
            within(2.0, arm, HOME, lambda _: False)


def test_a_strangers_error_is_told_whatever_it_is() -> None:
    driver = Servos()
    with driver_arm(lambda: driver, HOME) as arm:
        driver.writing = fails(ZeroDivisionError("division by zero"))
        with pytest.raises(DriverError, match="ZeroDivisionError: division by zero"):
            within(2.0, arm, HOME, lambda _: False)
    assert driver.closed


def test_it_is_taken_over_only_where_it_stands() -> None:
    driver = Servos()
    with (
        pytest.raises(DriverError, match=r"joint two stands at -0\.2, not at 0\.1 as believed"),
        driver_arm(lambda: driver, HOME + np.array([0.0, 0.3])),
    ):
        pass
    assert driver.closed
    assert standing(lambda: driver, LIMITS).tolist() == HOME.tolist()
    beyond = Limits(np.array([0.11, -1.0]), np.ones(2), np.ones(2), np.ones(2))
    assert standing(lambda: driver, beyond).tolist() == [0.11, -0.2]


def test_what_is_no_driver_is_told_before_anything_moves() -> None:
    with pytest.raises(DriverError, match=r"2 joints \(one, two\), the robot 6"), driver_arm(Servos, np.zeros(6)):
        pass
    with (
        pytest.raises(DriverError, match="can't be made: OSError: no such port"),
        driver_arm(fails(OSError("no such port")), HOME),
    ):
        pass
    with pytest.raises(InvalidValueError, match="a function or class there"):
        load_driver("tests.robots.test_driver:HOME")
    assert load_driver("tests.robots.test_driver:Servos") is not None
    with pytest.raises(InvalidValueError, match="hardware runs live"):
        load("puma560").with_body("tests.robots.test_driver:Servos")


def tried(driver: Servos) -> dict[str, bool]:
    return {check.name: check.holds for check in conformance(lambda: driver, LIMITS, move=True)}


def test_a_sound_driver_does_what_one_must() -> None:
    found = tried(Servos())
    assert set(found.values()) == {True}
    assert list(found)[-2:] == ["moves one", "moves two"]
    assert len(list(conformance(Servos, LIMITS, move=False))) == 5


def test_a_driver_that_is_much_too_slow_is_found_out_soon() -> None:
    driver = Servos()
    driver.reading = lambda q: q if threading.Event().wait(0.6) else list(q)
    checks = {check.name: check for check in conformance(lambda: driver, LIMITS, move=False)}
    assert checks["reads its joints"].said == "0 of 2 calls failed"
    assert not checks["keeps its rate"].holds


def stuck(driver: Servos) -> None:
    driver.writing = lambda q: [q[0], HOME[1]]


def turned_round(driver: Servos) -> None:
    driver.writing = lambda q: [2 * HOME[0] - q[0], q[1]]


def swapped(driver: Servos) -> None:
    driver.writing = lambda q: [HOME[0] + q[1] - HOME[1], HOME[1] + q[0] - HOME[0]]


def lossy(driver: Servos) -> None:
    counted = iter(range(10_000))
    driver.reading = lambda q: fails(TimeoutError("lost"))() if next(counted) % 3 == 0 else list(q)


def in_degrees(driver: Servos) -> None:
    driver.reading = lambda q: np.degrees(q).tolist()


def slow(driver: Servos) -> None:
    driver.reading = lambda q: threading.Event().wait(0.004) or list(q)


@pytest.mark.parametrize(
    ("fault", "what"),
    [
        (stuck, "moves two"),
        (turned_round, "moves one"),
        (swapped, "moves one"),
        (lossy, "reads its joints"),
        (in_degrees, "stands within its limits"),
        (slow, "keeps its rate"),
    ],
)
def test_each_fault_of_a_driver_is_named(fault: Callable[[Servos], None], what: str) -> None:
    driver = Servos()
    fault(driver)
    found: dict[str, bool] = {}
    with suppress(DriverError):
        found = tried(driver)
    assert found[what] is False


def test_the_bus_of_the_example_does_what_a_driver_must() -> None:
    bus = importlib.import_module("examples.28_servo_bus").Bus
    checks = list(conformance(lambda: bus(lost=0.05), puma560.model().limits, move=False))
    assert [check.name for check in checks if not check.holds and "rate" not in check.name] == []
    assert "calls failed" in checks[1].said
