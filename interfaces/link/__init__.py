"""The emulated network between operator and robot."""

from interfaces.link.channel import Channel, Delivery, Service
from interfaces.link.profiles import (
    ConstantDelay,
    DelayProfile,
    DelaySource,
    HeavyTailedDelay,
    TraceDelay,
    delay_profile,
)

__all__ = [
    "Channel",
    "ConstantDelay",
    "DelayProfile",
    "DelaySource",
    "Delivery",
    "HeavyTailedDelay",
    "Service",
    "TraceDelay",
    "delay_profile",
]
