"""Simulated bodies of real robots in PyBullet, which is imported when a world is made."""

from robots.bullet.serial_arm import Payload, Reality, RigidLink, load_arm
from robots.bullet.world import World, WorldClosedError

__all__ = ["Payload", "Reality", "RigidLink", "World", "WorldClosedError", "load_arm"]
