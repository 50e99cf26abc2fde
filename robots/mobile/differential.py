"""Any mobile robot on two driven wheels, from a few numbers: what isn't said is assumed, and said."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import msgspec

from robots.base import PERIOD, MobileBase
from robots.description.numbers import BaseNumbers
from robots.mobile.body import bodies_of
from robots.mobile.chassis import Chassis, Lump
from robots.mobile.robot import MobileRobot
from vrs.mobile import DriveLimits, Wheels

_SPEED: Final = 0.5
"""Largest speed where none is said [m/s]."""
_TURN: Final = 2.0
"""Largest angular speed that's assumed [rad/s]."""
_STARTING: Final = 1.0
"""In what time the largest speed is reached, where no acceleration is said [s]."""
_ACCELERATION: Final = 1.0
"""Largest acceleration that's assumed [m/s²]."""
_DENSITY: Final = 250.0
"""Mass of the box that the robot fills, where none is said [kg/m³]."""


def whole(given: BaseNumbers) -> BaseNumbers:
    """Return numbers of which none is missing.

    Args:
        given: At least with `wheelbase` and `wheel`.
    """
    base, radius = given.wheelbase, given.wheel
    assert base is not None
    assert radius is not None
    width = given.width or base + 2 * _wheel_width(radius)
    length, height = given.length or 1.2 * width, given.height or max(2.5 * radius, 0.5 * width)
    v = given.v or _SPEED
    a = given.a or min(v / _STARTING, _ACCELERATION)
    return BaseNumbers(
        wheelbase=base,
        wheel=radius,
        length=length,
        width=width,
        height=height,
        mass=given.mass or _DENSITY * length * width * height,
        axle=given.axle or 0.0,
        v=v,
        w=given.w or min(2 * v / base, _TURN),
        a=a,
        alpha=given.alpha or 2 * a / base,
    )


def lines_to_state(given: BaseNumbers) -> list[str]:
    """Lines of TOML that state what was assumed."""
    known = msgspec.structs.asdict(whole(given))
    return [f"{name} = {value:.4g}" for name, value in known.items() if getattr(given, name) is None]


@dataclass(frozen=True, slots=True, eq=False)
class Differential:
    """A mobile robot from numbers."""

    model: MobileBase
    """Its limits, wheels and footprint."""
    chassis: Chassis
    """What its body is made of."""

    def bodies(self) -> dict[str, Callable[..., MobileRobot]]:
        """What can be real of it, by name."""
        return bodies_of(self.chassis, limits=self.model.limits)


def differential(name: str, given: BaseNumbers) -> Differential:
    """Make a mobile robot: a box with two wheels of its own width, and a ball to lean on before and behind them.

    Args:
        name: Short name.
        given: At least with `wheelbase` and `wheel`.
    """
    known: dict[str, float] = msgspec.structs.asdict(whole(given))
    radius, length, height, mass = (known[key] for key in ("wheel", "length", "height", "mass"))
    wheel_width = min(_wheel_width(radius), 0.4 * known["wheelbase"])
    clearance = 0.3 * radius
    middle = -known["axle"]
    inner = max(known["wheelbase"] - wheel_width, 0.2 * known["wheelbase"])
    wheel_mass, caster_mass = 0.03 * mass, 0.01 * mass
    lump = Lump(
        "body",
        (length, inner, 0.6 * height),
        (middle, 0.0, clearance + 0.3 * height),
        mass - 2 * wheel_mass - 2 * caster_mass,
    )
    ball = 0.35 * radius
    gear = 40.0
    chassis = Chassis(
        kind=name,
        length=length,
        width=known["width"],
        height=height,
        centre_x=middle,
        ground_clearance=clearance,
        lumps=(lump,),
        wheel_radius=radius,
        wheel_base=known["wheelbase"],
        wheel_width=wheel_width,
        wheel_mass=wheel_mass,
        casters=((middle + 0.4 * length, 0.0), (middle - 0.4 * length, 0.0)),
        caster_radius=ball,
        caster_trail=0.0,
        caster_mass=caster_mass,
        caster_lift=0.01 * ball,
        caster_rolling=0.0,
        torque=1.5 * mass * (known["a"] + 1.0) * radius,
        gear=gear,
        rotor=0.02 * mass * radius**2 / gear**2,
        encoder_counts=8000,
        servo_time=0.03,
        sonars=16,
        sonar_height=0.6 * height,
    )
    limits = DriveLimits(known["v"], known["w"], known["a"], known["alpha"])
    model = MobileBase(limits, Wheels(known["wheelbase"], radius), chassis.footprint, PERIOD, name)
    return Differential(model, chassis)


def _wheel_width(radius: float) -> float:
    """Of a wheel [m]."""
    return 0.4 * radius
