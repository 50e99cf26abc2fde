"""How real a simulated arm is, and what it may carry."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import ArrayLike

from vrs.checks import finite, finite_array, number_in
from vrs.errors import InvalidValueError
from vrs.model import Array


@dataclass(frozen=True, slots=True)
class Reality:
    """What the simulated arm has of a real one. The default is all of it."""

    friction: bool | float = True
    """Joint friction, Coulomb and viscous: True is nominal, False none, a number in [0, 10] scales it."""
    rotor_inertia: bool = True
    """Whether the joints feel the motors' rotors, G² J_m."""
    torque_limits: bool = True
    """Whether the drives' torques end at their limits."""
    encoder_counts: int | None = 1000
    """Encoder counts a motor turn, after quadrature, 1 to 10,000,000; None reads positions exactly."""
    gravity: float = 9.81
    """Acceleration of free fall [m/s²], along -z of the base, 0 to 100; the servo knows it."""
    dt: float = 1e-3
    """Step of physics, servo and references [s], 1e-5 to 0.01."""
    ideal: bool = False
    """Kinematic following: positions and speeds are the references', without physics (counterfactuals)."""

    def __post_init__(self) -> None:
        for item in fields(self):
            value = getattr(self, item.name)
            if item.type == "bool" and not isinstance(value, bool):
                raise InvalidValueError(item.name, value, "True or False")
        if not isinstance(self.friction, bool):
            self._range("friction", 0.0, 10.0)
        self._range("gravity", 0.0, 100.0)
        self._range("dt", 1e-5, 0.01)
        counts = self.encoder_counts
        if counts is not None and (
            isinstance(counts, bool) or not isinstance(counts, int) or not 1 <= counts <= 10_000_000
        ):
            raise InvalidValueError("encoder_counts", counts, "None or an integer in [1, 10000000]")

    def _range(self, name: str, low: float, high: float) -> None:
        object.__setattr__(self, name, number_in(name, getattr(self, name), low, high))

    @property
    def friction_scale(self) -> float:
        """Friction as a multiple of the nominal."""
        return float(self.friction)


@dataclass(frozen=True, slots=True, eq=False)
class Payload:
    """A rigid body held at the flange."""

    mass: float
    """Mass [kg], in (0, 50]."""
    centre: Array
    """Centre of mass in the flange's frame [m], (3,), each within ±1."""
    inertia: Array
    """Inertia about the centre of mass along the flange's axes [kg m²], (3, 3), one that a body can have."""

    def __init__(self, mass: float, centre: ArrayLike = (0.0, 0.0, 0.0), inertia: ArrayLike | None = None) -> None:
        """Take mass [kg], centre [m], inertia [kg m²], (3, 3) or the (3,) diagonal; without it a point mass.

        Raises:
            InvalidValueError: If a value isn't finite or out of range, or no body has such an inertia.
        """
        allowed = "a mass in (0, 50] kg"
        value = finite("mass", mass, allowed)
        if not 0 < value <= 50:
            raise InvalidValueError("mass", mass, allowed)
        allowed = "three numbers within ±1 m"
        point = finite_array("centre", centre, (3,), allowed)
        if np.abs(point).max() > 1:
            raise InvalidValueError("centre", centre, allowed)
        allowed = "a (3,) diagonal or a symmetric (3, 3) whose principal values are those of a body [kg m²]"
        tensor = finite_array("inertia", np.zeros((3, 3)) if inertia is None else inertia, None, allowed)
        if tensor.shape == (3,):
            tensor = finite_array("inertia", np.diag(tensor), (3, 3), allowed)
        if tensor.shape != (3, 3) or not np.allclose(tensor, tensor.T, rtol=1e-9, atol=1e-15):
            raise InvalidValueError("inertia", inertia, allowed)
        small, middle, large = np.linalg.eigvalsh(tensor)
        tolerance = 1e-9 * max(abs(small), abs(large))
        if small < -tolerance or small + middle < large - tolerance:
            raise InvalidValueError("inertia", inertia, allowed)
        object.__setattr__(self, "mass", value)
        object.__setattr__(self, "centre", point)
        object.__setattr__(self, "inertia", tensor)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Payload):
            return False
        same = self.mass == other.mass and np.array_equal(self.centre, other.centre)
        return same and np.array_equal(self.inertia, other.inertia)

    def __hash__(self) -> int:
        return hash((self.mass, self.centre.tobytes(), self.inertia.tobytes()))
