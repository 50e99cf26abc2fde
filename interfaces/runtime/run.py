"""The record of one run of the twins: what both robots did, in the user's time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vrs.errors import InvalidValueError
from vrs.model import Array, RobotModel, frozen_array
from vrs.receipt import Receipt


@dataclass(frozen=True, slots=True)
class Packet:
    """One motion command on its way across the link."""

    command_id: int
    """Id that the operator's engine gave the command, from 1."""
    sent: float
    """User time of sending [s]."""
    arrived: float | None
    """User time of arrival [s]; None when the packet was lost."""
    real_id: int | None = None
    """Id that the real robot's engine gave the command; None when it never arrived."""


@dataclass(frozen=True, slots=True)
class Event:
    """Something that happened to the real robot or the link."""

    t: float
    """User time [s]."""
    kind: str
    """`payload`, `release`, `late`, `lost` or `diverged`."""
    text: str
    """What happened, one line."""


@dataclass(frozen=True, slots=True, eq=False)
class TwinRun:
    """Both twins over one run, sampled on a common grid of user time.

    The real robot's clock reads t_robot = t_user + D with D = −D_f (Doulgeri, Zikos, Delopoulos, section
    IV-A), so equal timeline time τ is row t = τ of the virtual robot and row t = τ − D of the real one.
    """

    model: RobotModel
    """The robot that both twins are."""
    title: str
    """Title of the plan."""
    seed: int
    """Seed of everything random in the run."""
    delay: str
    """Delay profile, as it was asked for."""
    D: float
    """Clock offset of the real robot [s], ≤ 0."""
    t: Array
    """User time [s], (k,), evenly spaced, ascending."""
    q_virtual: Array
    """Joints of the virtual robot at user time t [rad], (k, 6)."""
    q_real: Array
    """Joints of the real robot as measured at user time t [rad], (k, 6)."""
    q_reference: Array
    """What the real robot's own timeline asked for at that moment [rad], (k, 6)."""
    receipts_virtual: tuple[Receipt, ...]
    """Receipts of the operator's engine."""
    receipts_real: tuple[Receipt, ...]
    """Receipts of the real robot's engine; its ids follow the order of arrival."""
    packets: tuple[Packet, ...]
    """Every command that was sent, in the order of sending."""
    events: tuple[Event, ...]
    """Everything else that happened, by time."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "t", frozen_array(self.t))
        if self.t.ndim != 1 or len(self.t) < 2 or not (np.diff(self.t) > 0).all():
            raise InvalidValueError("t", self.t.shape, "at least two ascending times, shape (k,)")
        for name in ("q_virtual", "q_real", "q_reference"):
            value = frozen_array(getattr(self, name))
            if value.ndim != 2 or len(value) != len(self.t):
                raise InvalidValueError(name, value.shape, f"of shape ({len(self.t)}, n)")
            object.__setattr__(self, name, value)

    @property
    def dt(self) -> float:
        """Step of the grid [s]."""
        return float(self.t[1] - self.t[0])
