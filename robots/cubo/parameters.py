"""What CUBO is: sizes, masses, servos and sensors.

The paper gives 20 cm × 21.8 cm × 30.9 cm, about 2 kg, two driven wheels, an omni caster, two arms with one axis
each, a tilt unit, six kinds of sensor, a 3 inch screen, a loudspeaker, two buttons. The rest is chosen here.

Source: Kim, Suh, Kim, Oh, section IV-A, Fig. 9.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Final

from robots.mobile.chassis import Chassis, Limb, Lump
from vrs.mobile import DriveLimits

MODEL_FILE: Final = Path(__file__).with_name("cubo.xmi")
"""CUBO's robot model for RSP, XMI."""
LENGTH: Final = 0.200
"""Along x [m]."""
WIDTH: Final = 0.218
"""Along y, arms included [m]."""
HEIGHT: Final = 0.309
"""[m]."""
MASS: Final = 2.0
"""[kg]."""
WHEEL_RADIUS: Final = 0.034
"""[m]."""
WHEEL_BASE: Final = 0.150
"""L [m]."""
LIMITS: Final = DriveLimits(0.4, 3.0, 0.8, 2.0 * 0.8 / WHEEL_BASE)
"""How fast it can drive: 0.4 m/s, 3 rad/s, 0.8 m/s², and what that makes of turning. Chosen."""
SHOULDER: Final = (-0.010, 0.099, 0.150)
"""Axis of the left arm [m]."""
NECK: Final = (0.0, 0.0, 0.205)
"""Axis of the tilt unit [m]."""
ARM_LENGTH: Final = 0.085
"""Of an arm, below its axis [m]."""
SONAR_REACH: Final = (0.02, 0.8)
"""Nearest and farthest that its proximity sensors tell [m]."""
PROXIMITY: Final = 8
"""Proximity sensors, evenly around."""
BATTERY: Final = (12.6, 9.6)
"""Voltage when full and when empty [V]."""
CAPACITY: Final = 80_000.0
"""Of the battery [J]: 11 V, 2 Ah."""
IDLE_POWER: Final = 6.0
"""What processor, radio and screen take [W]."""


def _arm(name: str, side: int) -> Limb:
    x, y, z = SHOULDER
    return Limb(
        name,
        (x, side * y, z),
        (0.0, -1.0, 0.0),
        (0.026, 0.018, ARM_LENGTH),
        (0.0, 0.0, -0.35 * ARM_LENGTH),
        0.06,
        math.radians(-60),
        math.radians(170),
        4.0,
        0.25,
    )


CUBO: Final = Chassis(
    kind="cubo",
    length=LENGTH,
    width=WIDTH,
    height=HEIGHT,
    centre_x=-0.015,
    ground_clearance=0.012,
    lumps=(
        Lump("battery", (0.075, 0.110, 0.040), (-0.060, 0.0, 0.058), 0.42),
        Lump("right motor", (0.040, 0.045, 0.035), (0.0, -0.040, 0.036), 0.11),
        Lump("left motor", (0.040, 0.045, 0.035), (0.0, 0.040, 0.036), 0.11),
        Lump("boards", (0.090, 0.110, 0.050), (-0.010, 0.0, 0.100), 0.21),
        Lump("loudspeaker", (0.040, 0.070, 0.070), (0.040, 0.0, 0.110), 0.16),
        Lump("shell", (0.190, 0.170, 0.180), (-0.015, 0.0, 0.110), 0.45),
    ),
    wheel_radius=WHEEL_RADIUS,
    wheel_base=WHEEL_BASE,
    wheel_width=0.018,
    wheel_mass=0.05,
    casters=((-0.085, 0.0),),
    caster_radius=0.016,
    caster_trail=0.0,
    caster_mass=0.04,
    caster_lift=0.0,
    caster_rolling=0.0,
    torque=0.35,
    gear=30.0,
    rotor=4.0e-7,
    encoder_counts=64,
    servo_time=0.03,
    sonars=PROXIMITY,
    sonar_height=0.08,
    sonar_reach=SONAR_REACH,
    limbs=(
        _arm("right arm", -1),
        _arm("left arm", 1),
        Limb(
            "head", NECK, (0.0, 1.0, 0.0), (0.150, 0.160, 0.090), (-0.010, 0.0, 0.055), 0.28,
            math.radians(-20), math.radians(25), 1.5, 0.8,
        ),
    ),
)  # fmt: skip
"""Two driven wheels under the middle, one omni caster behind: three contacts, whatever the floor.

The battery lies behind the axle, so that the robot, which has nothing to lean on in front, can brake at twice its
limit.
"""
