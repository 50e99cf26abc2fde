"""What crosses the network between the control agent and the robot, beside probes and their echoes."""

from __future__ import annotations

from dataclasses import dataclass

from robots.onboard.driving import Drive, Posture


@dataclass(frozen=True, slots=True)
class DriveSetpoint:
    """What the robot is to drive until it hears otherwise."""

    number: int
    """It rises from command to command: one that arrives behind a newer one is stale."""
    drive: Drive

    size = 28
    """What it takes on the wire [byte]."""


@dataclass(frozen=True, slots=True)
class DriveFeedback:
    """What the robot reports at each of its sampling times."""

    number: int
    """It rises from report to report."""
    posture: Posture
    """Where the robot takes itself to be."""
    drive: Drive
    """What it drives from then on; A and K of eq. (20) follow from it."""

    size = 52
    """What it takes on the wire [byte]."""
