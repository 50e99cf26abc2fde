"""The robot side: models, kinematics, simulated bodies, and what runs on board. `from robots import puma560`.

A robot is a `Robot`; `robots.load("puma560")` finds one.
"""

from robots.robot import Robot, load, names

__all__ = ["Robot", "load", "names"]
