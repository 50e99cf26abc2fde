"""The module creator: middleware and packet handlers of a robot, generated from its model."""

from interfaces.rsp.creator.package import package, write_package

__all__ = ["package", "write_package"]
