"""The emulated network between operator and robot."""

from interfaces.link.clock_sync import ClockEstimate, ClockEvidence, ClockSync, ClockSyncConfig
from interfaces.link.conditions import Conditions, LinkConditions, LinkPath, PacketOutcome, Service
from interfaces.link.delays import (
    ConstantDelay,
    DelayProfile,
    DelaySource,
    GammaDelay,
    HeavyTailedDelay,
    Hop,
    RouteDelay,
    TraceDelay,
    delay_profile,
)
from interfaces.link.link import Channel, Delivery, Direction, Lane, Link, Stream
from interfaces.link.losses import BernoulliLoss, GilbertElliottLoss, LossModel, loss_model, spelled_loss
from interfaces.link.packets import Gauge, LossReason, PacketLog, PacketRecord, Totals
from interfaces.link.quantiles import SlidingQuantiles
from interfaces.link.round_trip import (
    DelayStatistics,
    Echo,
    EchoRefusal,
    Probe,
    ProbeConfig,
    RelativeDelays,
    RoundTrip,
    RoundTripEstimator,
    WindowConfig,
)

__all__ = [
    "BernoulliLoss",
    "Channel",
    "ClockEstimate",
    "ClockEvidence",
    "ClockSync",
    "ClockSyncConfig",
    "Conditions",
    "ConstantDelay",
    "DelayProfile",
    "DelaySource",
    "DelayStatistics",
    "Delivery",
    "Direction",
    "Echo",
    "EchoRefusal",
    "GammaDelay",
    "Gauge",
    "GilbertElliottLoss",
    "HeavyTailedDelay",
    "Hop",
    "Lane",
    "Link",
    "LinkConditions",
    "LinkPath",
    "LossModel",
    "LossReason",
    "PacketLog",
    "PacketOutcome",
    "PacketRecord",
    "Probe",
    "ProbeConfig",
    "RelativeDelays",
    "RoundTrip",
    "RoundTripEstimator",
    "RouteDelay",
    "Service",
    "SlidingQuantiles",
    "Stream",
    "Totals",
    "TraceDelay",
    "WindowConfig",
    "delay_profile",
    "loss_model",
    "spelled_loss",
]
