"""Bodies that the driver can run: the simulated PUMA 560, and one that follows exactly."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from interfaces.runtime.session import ArmBody, ArmFactory
from interfaces.teleop import JointReference
from vrs.model import Array

if TYPE_CHECKING:
    from robots.puma560.body import RealArm


class ExactArm:
    """A body with no dynamics: it is where its reference is, whatever it holds."""

    def follow(self, reference: JointReference) -> Array:
        """Return the references (m, n) [rad]."""
        return reference.q

    def attach(self, mass: float) -> None:
        """Take a load, which changes nothing."""

    def release(self) -> None:
        """Drop the load, which changes nothing."""


class _Puma:
    """The PyBullet PUMA 560 behind the driver's interface."""

    def __init__(self, arm: RealArm) -> None:
        self._arm = arm

    def follow(self, reference: JointReference) -> Array:
        return self._arm.run(*reference).q

    def attach(self, mass: float) -> None:
        from robots.bullet import Payload

        self._arm.attach(Payload(mass=mass))

    def release(self) -> None:
        self._arm.release()


@contextmanager
def exact_arm(q: Array) -> Iterator[ArmBody]:  # noqa: ARG001
    """Make a body that follows exactly."""
    yield ExactArm()


def simulated_puma(*, friction: bool = True) -> ArmFactory:
    """Say how to make a PyBullet PUMA 560, with or without friction in its joints."""

    @contextmanager
    def make(q: Array) -> Iterator[ArmBody]:
        from robots.bullet import Reality
        from robots.puma560.body import RealArm

        with RealArm(reality=Reality(friction=friction), q=q) as arm:
            yield _Puma(arm)

    return make
