"""Sizes, masses and drives of the two robots of Han, Kim, Kim, Kim 2001: the IPR and the micro-robot.

The paper gives outer sizes, masses, motors and the number of sonars; the rest is chosen here and says so. The IPR's
axle is 6 cm ahead of its centre, so its D is −0.06 m.
"""

from __future__ import annotations

from typing import Final

from robots.ipr.model import (
    IPR_AXLE_OFFSET,
    IPR_HEIGHT,
    IPR_LENGTH,
    IPR_WHEEL_RADIUS,
    IPR_WIDTH,
    MICRO_AXLE_OFFSET,
    MICRO_SIDE,
    MICRO_WHEEL_BASE,
    MICRO_WHEEL_RADIUS,
    Kind,
)
from robots.mobile.chassis import Chassis, Lump
from robots.onboard.driving import IPR_WHEEL_BASE

IPR: Final = Chassis(
    kind=Kind.IPR,
    length=IPR_LENGTH,
    width=IPR_WIDTH,
    height=IPR_HEIGHT,
    centre_x=-IPR_AXLE_OFFSET,
    ground_clearance=0.05,
    lumps=(
        Lump("battery, 12 V 100 Ah", (0.30, 0.20, 0.20), (-0.12, 0.0, 0.18), 28.0),
        Lump("computer", (0.35, 0.30, 0.15), (-0.09, 0.0, 0.42), 10.0),
        Lump("right servo and gear", (0.12, 0.14, 0.10), (0.0, -0.09, 0.12), 4.5),
        Lump("left servo and gear", (0.12, 0.14, 0.10), (0.0, 0.09, 0.12), 4.5),
        Lump("base plate", (0.50, 0.43, 0.02), (-0.06, 0.0, 0.09), 8.0),
        Lump("housing", (0.46, 0.38, 0.50), (-0.06, 0.0, 0.40), 8.0),
        Lump("head with two cameras", (0.12, 0.22, 0.08), (0.04, 0.0, 0.70), 3.5),
        Lump("display", (0.04, 0.30, 0.24), (0.11, 0.0, 0.55), 3.1),
    ),
    wheel_radius=IPR_WHEEL_RADIUS,
    wheel_base=IPR_WHEEL_BASE,
    wheel_width=0.05,
    wheel_mass=1.8,
    casters=((-0.25, 0.15), (-0.25, -0.15)),
    caster_radius=0.04,
    caster_trail=0.035,
    caster_mass=0.9,
    caster_lift=0.0,
    caster_rolling=0.06,
    # 200 W at 3000/min is 0.64 N m; through 40 : 1 with 0.8 of it left.
    torque=20.0,
    gear=40.0,
    rotor=1.8e-5,
    encoder_counts=8000,
    servo_time=0.03,
    sonars=16,
    sonar_height=0.45,
)
"""The robot of section 2.1: 45 × 52 × 75 cm, 75 kg, two AC servos of 200 W, 16 sonars.

Two driven wheels in front, two trailing casters behind: four contacts at one height on two lines, so that each
line bears its share and the robot can't rock.
"""

MICRO: Final = Chassis(
    kind=Kind.MICRO,
    length=MICRO_SIDE,
    width=MICRO_SIDE,
    height=MICRO_SIDE,
    centre_x=-MICRO_AXLE_OFFSET,
    ground_clearance=0.004,
    lumps=(
        Lump("battery", (0.030, 0.050, 0.015), (-0.016, 0.0, 0.018), 0.120),
        Lump("right motor", (0.020, 0.026, 0.020), (0.0, -0.014, 0.020), 0.060),
        Lump("left motor", (0.020, 0.026, 0.020), (0.0, 0.014, 0.020), 0.060),
        Lump("boards", (0.060, 0.060, 0.016), (0.0, 0.0, 0.052), 0.060),
        Lump("shell", (0.070, 0.056, 0.066), (0.0, 0.0, 0.038), 0.080),
    ),
    wheel_radius=MICRO_WHEEL_RADIUS,
    wheel_base=MICRO_WHEEL_BASE,
    wheel_width=0.007,
    wheel_mass=0.020,
    casters=((0.028, 0.0), (-0.028, 0.0)),
    caster_radius=0.005,
    caster_trail=0.0,
    caster_mass=0.005,
    caster_lift=0.0003,
    caster_rolling=0.0,
    torque=0.05,
    gear=8.0,
    rotor=2.7e-7,
    encoder_counts=2048,
    servo_time=0.02,
    sonars=16,
    sonar_height=0.06,
)
"""The robot of section 4.2: 7.5 cm, 430 g, LM629 speed control, two centred casters, before and behind.

The casters end 0.3 mm above the floor and the battery sits behind the axle, so that the driven wheels bear most of
the weight and the robot leans on its rear caster. The paper's micro-robot has no sonars; those here see a room
from where its overhead camera's software would.
"""
