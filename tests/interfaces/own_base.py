"""A cart, made up: twice as long as the IPR, faster, and light. A mobile robot of one's own."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

from robots import Robot
from robots.base import MobileBase
from robots.ipr.parameters import IPR
from robots.mobile.body import MobileBody
from robots.mobile.chassis import Lump
from robots.mobile.robot import BareBody
from vrs.mobile import DriveLimits, Wheels

CHASSIS = replace(
    IPR,
    kind="cart",
    length=1.0,
    width=0.6,
    height=0.4,
    centre_x=-0.2,
    lumps=(Lump("load", (0.8, 0.4, 0.2), (-0.15, 0.0, 0.2), 30.0),),
    wheel_base=0.54,
    casters=((-0.6, 0.2), (-0.6, -0.2)),
    sonar_height=0.3,
)
LIMITS = DriveLimits(0.8, 1.2, 0.6, 2.0)
ROBOT = Robot(
    "cart",
    MobileBase(LIMITS, Wheels(CHASSIS.wheel_base, CHASSIS.wheel_radius), CHASSIS.footprint, 0.1, "cart"),
    bodies={"bullet": partial(MobileBody, CHASSIS), "bare": partial(BareBody, CHASSIS)},
)
