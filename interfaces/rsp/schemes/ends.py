"""What the two ends of every scheme do, so that a run doesn't know which it has."""

from __future__ import annotations

from typing import NamedTuple, Protocol

Rims = tuple[int, int]
"""Speeds of the left and the right wheel at the rim [mm/s]."""


class ReportedPosition(NamedTuple):
    """The newest position that the local system has."""

    x: float
    """[m]."""
    y: float
    """[m]."""
    theta: float
    """[rad]."""


class LocalEnd(Protocol):
    """The local system's end."""

    seen: ReportedPosition | None
    """Newest position that came."""

    def write(self, rims: Rims, *, now: float) -> None:
        """Set what the wheels are to do."""

    def fire(self, *, now: float) -> None:
        """Give a command: something that is to be done once."""

    def receive(self, data: bytes, *, now: float) -> None:
        """Take a packet."""

    def to_send(self, *, now: float) -> list[bytes]:
        """Packets that are due by now [s]."""


class RobotEnd(Protocol):
    """The robot's end."""

    def receive(self, data: bytes, *, now: float) -> None:
        """Take a packet."""

    def drive(self, *, now: float) -> Rims:
        """What the wheels do from now on [s]."""

    def fired(self) -> list[int]:
        """Numbers of the commands that came since the last call, from 0."""

    def measure(self, position: ReportedPosition) -> None:
        """Set where the robot is."""

    def to_send(self, *, now: float) -> list[bytes]:
        """Packets that are due by now [s]."""

    @property
    def stamp(self) -> float | None:
        """When what the wheels do was given, on the local system's clock [s]; None before anything came."""
