"""The emulated network between operator and robot."""

from interfaces.link.clock_sync import ClockSync
from interfaces.link.conditions import Conditions, LinkConditions, LinkPath, Service
from interfaces.link.delays import (
    ConstantDelay,
    DelayProfile,
    GammaDelay,
    HeavyTailedDelay,
    Hop,
    RouteDelay,
    TraceDelay,
    delay_profile,
)
from interfaces.link.link import Channel, Link
from interfaces.link.losses import BernoulliLoss, GilbertElliottLoss, loss_model, spelled_loss
from interfaces.link.packets import Gauge, LossReason, PacketLog, PacketRecord
from interfaces.link.round_trip import (
    Echo,
    Probe,
    ProbeConfig,
    RoundTrip,
    RoundTripEstimator,
)

__all__ = [
    "BernoulliLoss",
    "Channel",
    "ClockSync",
    "Conditions",
    "ConstantDelay",
    "DelayProfile",
    "Echo",
    "GammaDelay",
    "Gauge",
    "GilbertElliottLoss",
    "HeavyTailedDelay",
    "Hop",
    "Link",
    "LinkConditions",
    "LinkPath",
    "LossReason",
    "PacketLog",
    "PacketRecord",
    "Probe",
    "ProbeConfig",
    "RoundTrip",
    "RoundTripEstimator",
    "RouteDelay",
    "Service",
    "TraceDelay",
    "delay_profile",
    "loss_model",
    "spelled_loss",
]
