"""A vehicle beside a room, in a world of physics."""

from __future__ import annotations

from contextlib import AbstractContextManager, closing

from robots.ipr.parameters import MICRO
from robots.mobile.body import vehicle_of
from robots.mobile.chassis import MobileReality
from robots.rooms import Room
from robots.simulated import WORLDS
from robots.vehicle import RigidVehicle


def in_room(world: str, room: Room) -> AbstractContextManager[RigidVehicle]:
    """A vehicle that stands outside, so that rays can go through the room."""
    vehicle = vehicle_of(MICRO, MobileReality(), (MICRO.wheel_radius,) * 2, MICRO.wheel_base)
    return closing(WORLDS[world].vehicle(vehicle, room, (-5.0, -5.0, 0.0), gravity=9.81, dt=1 / 240))
