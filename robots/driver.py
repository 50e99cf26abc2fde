"""Real hardware behind three methods, as the body of an arm.

A driver may wait for its bus: a thread of the body calls it, at the rate that it states, and nobody else does. What
it reads is the measurement until it has read again. What is older than `STALE` periods is told as not a number, so
that the robot's site knows that it doesn't see, and brakes. Watchdog, lease, stops and what is looked at are the
site's, as of any body.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Annotated, Any, Final, Protocol

import numpy as np
from numpy.typing import ArrayLike

from robots.robot import Closing, Measured, Prepared, module_of
from vrs.checks import finite_array, validated, within
from vrs.clock import WallClock
from vrs.errors import InvalidValueError, VrsError
from vrs.model import Array, Limits

STALE: Final = 3.0
"""Periods after which a reading isn't one any more."""
PATIENCE: Final = 0.5
"""For so long a driver may fail without a break [s]."""
START_TIME: Final = 5.0
"""How long the first reading may take [s]."""
AWAY: Final = 0.05
"""How far the arm may stand from where it's believed to stand as it's taken over [rad], [m]."""


@dataclass(frozen=True, slots=True)
@validated
class DriverDescriptor:
    """What a driver says of its hardware."""

    joints: tuple[str, ...]
    """Names of its joints, from the base outwards: those of the robot's model."""
    rate: Annotated[float, within(1.0, 1000.0)]
    """How often joints can be read and written [Hz], in [1, 1000]."""


class Driver(Protocol):
    """Hardware. Joint values are in rad, of prismatic joints in m, with the model's signs and zeros.

    Every method may raise what it likes. An OSError, as a lost packet or a time-out is, is taken for passing: the
    call is made again a period later, for `PATIENCE` seconds. In the end `close` is called, where there is one.
    """

    def descriptor(self) -> DriverDescriptor:
        """Say what there is."""

    def read_joints(self) -> Sequence[float]:
        """Read where the joints are, n numbers."""

    def write_joints(self, q: Sequence[float]) -> None:
        """Let the joints go to where they are to be a period later, n numbers; it doesn't wait for that."""


class DriverError(VrsError):
    """A driver that can't go on."""


def load_driver(what: str) -> Callable[[], Driver]:
    """Find what makes a driver.

    Args:
        what: `MODULE:NAME` of a function or class without arguments; the module may lie in the working directory.

    Raises:
        FormatError: If the module can't be imported.
        InvalidValueError: If there's no such thing in it.
    """
    module, name = module_of(what, "a driver")
    made = getattr(module, name, None)
    if not callable(made):
        raise InvalidValueError(
            f"driver in {module.__name__}", name, "a function or class there, without arguments"
        )
    found: Callable[[], Driver] = made
    return found


@contextmanager
def opened(make: Callable[[], Driver], n: int) -> Iterator[tuple[Driver, DriverDescriptor]]:
    """Make a driver, and close it in the end.

    Args:
        make: Makes it.
        n: Joints of the arm.

    Raises:
        DriverError: If it can't be made, or doesn't say what a driver says.
    """
    # A stranger's driver may raise anything.
    try:
        driver = make()
        said = driver.descriptor()
    except Exception as error:
        raise DriverError(f"the driver can't be made: {type(error).__name__}: {error}") from error
    missing = [name for name in ("read_joints", "write_joints") if not callable(getattr(driver, name, None))]
    if missing or not isinstance(said, DriverDescriptor):
        raise DriverError(
            f"{type(driver).__name__} is no driver: it has no {', '.join(missing) or 'DriverDescriptor'}"
        )
    if len(said.joints) != n:
        raise DriverError(f"the driver has {len(said.joints)} joints ({', '.join(said.joints)}), the robot {n}")
    try:
        yield driver, said
    finally:
        close: Any = getattr(driver, "close", None)
        if callable(close):
            close()


def standing(make: Callable[[], Driver], limits: Limits) -> Array:
    """Where the joints of an arm behind a driver are, (n,), or where its limits are next to that.

    Raises:
        DriverError: If that can't be read.
    """
    n = limits.dof
    with opened(make, n) as (driver, said):
        clock, problem = WallClock(0.0), ""
        while clock.now() < START_TIME:
            try:
                return np.clip(_joints(driver.read_joints(), n), limits.q_min, limits.q_max)
            except OSError as error:
                problem = str(error)
                threading.Event().wait(1.0 / said.rate)
    raise DriverError(f"the joints can't be read: {problem}")


class DriverArm(Closing):
    """An arm behind a driver; see `robots.robot.ArmBody`."""

    def __init__(self, driver: Driver, said: DriverDescriptor, q: Array) -> None:
        """Take it over where it stands; its thread begins.

        Args:
            driver: The driver, which nobody else calls.
            said: What it says.
            q: Where it's believed to stand [rad], [m], (n,).

        Raises:
            DriverError: If it isn't there, or can't be read.
        """
        self._driver, self._n, self._period = driver, len(q), 1.0 / said.rate
        self._clock = WallClock(0.0)
        self._target: list[float] | None = None
        self._readings: tuple[tuple[float, Array], ...] = ()
        """The newest two, with when they were had [s]."""
        self._problem = ""
        self._ended, self._began = threading.Event(), threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()
        self._began.wait(START_TIME)
        if not self._readings:
            self.close()
            raise DriverError(f"the joints can't be read: {self._problem or 'no answer'}")
        away = np.abs(self._readings[-1][1] - q)
        if away.max() > AWAY:
            self.close()
            joint = int(away.argmax())
            there = self._readings[-1][1][joint]
            raise DriverError(
                f"joint {said.joints[joint]} stands at {there:.4g}, not at {q[joint]:.4g} as believed"
            )

    @property
    def q(self) -> Array:
        """What was read last [rad], [m], (n,): more isn't known."""
        return self._readings[-1][1]

    def prepare(self, q_ref: ArrayLike, qd_ref: ArrayLike, _qdd_ref: ArrayLike) -> Prepared:
        """Take references as they are: hardware has servos of its own."""
        q = np.asarray(q_ref)
        return Prepared(q, np.asarray(qd_ref), np.empty((len(q), 0)))

    def follow(self, prepared: Prepared) -> Measured:
        """Let it go where they are; what was read last is measured.

        Raises:
            DriverError: If the driver failed.
        """
        if self._problem:
            raise DriverError(self._problem)
        k = len(prepared.q)
        if k:
            self._target = prepared.q[-1].tolist()
        (before, first), (at, q) = self._readings
        fresh = self._clock.now() - at <= STALE * self._period
        q = q if fresh else np.full(self._n, math.nan)
        qd = (q - first) / (at - before) if at > before else np.zeros(self._n)
        return Measured(
            np.tile(q, (k, 1)), np.tile(qd, (k, 1)), np.empty((k, 0)), np.zeros(self._n, dtype=np.int64)
        )

    def attach(self, mass: float) -> None:
        """Nothing: what it holds is real."""

    def release(self) -> None:
        """Nothing: what it holds is real."""

    def close(self) -> None:
        """End its thread."""
        self._ended.set()
        self._thread.join(START_TIME)

    def _run(self) -> None:
        """Read, write and wait in turn, until the end."""
        clock, due, sound = self._clock, 0.0, 0.0
        while not self._ended.wait(max(due - clock.now(), 0.0)):
            due = max(due + self._period, clock.now())
            # A stranger's driver may raise anything.
            try:
                q = _joints(self._driver.read_joints(), self._n)
                sound = clock.now()
                self._readings = (self._readings[-1] if self._readings else (sound, q)), (sound, q)
                self._began.set()
                if (target := self._target) is not None:
                    self._driver.write_joints(target)
            except OSError as error:
                if clock.now() - sound > (PATIENCE if self._began.is_set() else START_TIME):
                    self._problem = f"the driver fails: {error}"
            except Exception as error:  # noqa: BLE001 - told by follow
                self._problem = f"the driver failed: {type(error).__name__}: {error}"
            if self._problem:
                self._began.set()
                return


@dataclass(frozen=True, slots=True)
class DriverCheck:
    """What was tried of a driver."""

    name: str
    """What it must do."""
    holds: bool
    said: str
    """What was seen."""


READINGS: Final = 100
"""How often joints are read to see how reliably."""
LOST_MOST: Final = 0.2
"""Share of calls that may fail."""
STEP: Final = 0.05
"""How far each joint goes to and fro [rad], [m]; less where its range is smaller than ten times that."""
FOLLOWS: Final = 0.3
"""How far it may stay behind in the end, as a share of the step."""


def conformance(make: Callable[[], Driver], limits: Limits, *, move: bool) -> Iterator[DriverCheck]:
    """Try what a driver must do, a check at a time; it ends with the first that leaves nothing to try.

    Args:
        make: Makes the driver.
        limits: Of the robot's joints.
        move: Whether its joints may be moved, each by `STEP` to and fro, at a tenth of its speed.
    """
    n, clock = limits.dof, WallClock(0.0)
    try:
        with opened(make, n) as (driver, said):
            yield DriverCheck("says what it has", True, f"{', '.join(said.joints)}; {said.rate:g} Hz")
            values, failed, problem = [], 0, ""
            times: list[float] = []
            # One that is much too slow is known to be so before all of its readings are made.
            enough = clock.now() + 2.0 * READINGS / said.rate
            while len(times) < READINGS and (began := clock.now()) < enough:
                try:
                    values.append(_joints(driver.read_joints(), n))
                except OSError as error:
                    failed, problem = failed + 1, f"; {error}"
                times.append(clock.now() - began)
                threading.Event().wait(max(1.0 / said.rate - times[-1], 0.0))
            lost = f"{failed} of {len(times)} calls failed{problem}"
            yield DriverCheck("reads its joints", failed <= LOST_MOST * len(times), lost)
            if not values:
                return
            q = np.median(values, axis=0)
            took = float(np.median(times))
            yield DriverCheck(
                "keeps its rate",
                took <= 0.5 / said.rate,
                f"a call takes {1e3 * took:.3g} ms of {1e3 / said.rate:.3g} ms",
            )
            outside = ((q < limits.q_min - AWAY) | (q > limits.q_max + AWAY)).nonzero()[0]
            where = ", ".join(f"{said.joints[j]} at {q[j]:.4g}" for j in outside)
            yield DriverCheck("stands within its limits", not len(outside), where or "all joints do")
            noise = float(np.ptp(values, axis=0).max())
            yield DriverCheck("reads the same while it stands", noise <= AWAY, f"within {noise:.2g}")
        if move:
            q = np.clip(q, limits.q_min, limits.q_max)
            with opened(make, n) as (driver, said), DriverArm(driver, said, q) as arm:
                for joint in range(n):
                    yield _moved(arm, said, limits, q, joint)
    except DriverError as error:
        yield DriverCheck("works", False, str(error))


def _moved(arm: DriverArm, said: DriverDescriptor, limits: Limits, q: Array, joint: int) -> DriverCheck:
    """Move a joint to and fro, and see that it and no other went."""
    low, high = limits.q_min[joint], limits.q_max[joint]
    step = min(STEP, 0.1 * (high - low)) * (1.0 if q[joint] <= 0.5 * (low + high) else -1.0)
    count = max(math.ceil(10.0 * abs(step) / limits.qd_max[joint] * said.rate), 1)
    seen, worst = [], 0.0
    for goal in (step, 0.0):
        begin = step - goal
        for share in (*np.linspace(0.0, 1.0, count), *np.ones(round(0.5 * said.rate) + 1)):
            wanted = q.copy()
            wanted[joint] += begin + share * (goal - begin)
            measured = arm.follow(Prepared(wanted[None], np.zeros((1, len(q))), np.empty((1, 0)))).q[0]
            worst = max(worst, float(np.abs(np.delete(measured - q, joint)).max(initial=0.0)))
            threading.Event().wait(1.0 / said.rate)
        seen.append(float(measured[joint] - q[joint]))
    holds = abs(seen[0] - step) <= FOLLOWS * abs(step) and abs(seen[1]) <= FOLLOWS * abs(step) and worst <= AWAY
    went = f"went to {seen[0]:+.3g} of {step:+.3g}, and back to {seen[1]:+.2g}; others within {worst:.2g}"
    return DriverCheck(f"moves {said.joints[joint]}", bool(holds), went)


def _joints(values: Sequence[float], n: int) -> Array:
    """What was read, (n,).

    Raises:
        InvalidValueError: If it isn't n finite numbers.
    """
    return finite_array("joints", values, (n,), f"{n} finite numbers")


@contextmanager
def driver_arm(make: Callable[[], Driver], q: ArrayLike, **_: object) -> Iterator[DriverArm]:
    """Make the body of an arm behind a driver, as `robots.robot.ArmMaker` does."""
    there = np.asarray(q, dtype=np.float64)
    with opened(make, len(there)) as (driver, said), DriverArm(driver, said, there) as arm:
        yield arm
