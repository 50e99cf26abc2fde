"""Worlds of PyBullet, which is imported when one is made."""

from robots.bullet.world import World, WorldClosedError

__all__ = ["World", "WorldClosedError"]
