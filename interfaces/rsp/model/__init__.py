"""Robot models: elements as values, and their form as XMI."""

from interfaces.rsp.model.elements import (
    Command,
    Effector,
    Element,
    Event,
    Filling,
    MemoryCommand,
    MemoryEvent,
    Module,
    Monitor,
    OnLoss,
    RobotModel,
    Scalar,
    Sensor,
    example,
)
from interfaces.rsp.model.xmi import parse_model, read_model, write_model

__all__ = [
    "Command",
    "Effector",
    "Element",
    "Event",
    "Filling",
    "MemoryCommand",
    "MemoryEvent",
    "Module",
    "Monitor",
    "OnLoss",
    "RobotModel",
    "Scalar",
    "Sensor",
    "example",
    "parse_model",
    "read_model",
    "write_model",
]
