"""The emulated network between operator and robot."""

from interfaces.link.channel import Channel, Delivery
from interfaces.link.clock_sync import ClockEstimate, ClockEvidence, ClockSync, ClockSyncConfig, DriftEstimate
from interfaces.link.conditions import Conditions, LinkConditions, Service
from interfaces.link.delay import ConstantDelay, DelayProfile, DelaySource
from interfaces.link.gamma import GammaDelay
from interfaces.link.gauge import Gauge, LinkFigures
from interfaces.link.lane import Lane
from interfaces.link.link import Direction, Link, LinkTotals, direction
from interfaces.link.losses import BernoulliLoss, GilbertElliottLoss, LossModel, loss_model, spelled_loss
from interfaces.link.measured import HeavyTailedDelay
from interfaces.link.packets import LossReason, PacketLog, PacketRecord, Totals
from interfaces.link.path import LinkPath, PacketOutcome
from interfaces.link.profiles import delay_profile
from interfaces.link.quantiles import SlidingQuantiles
from interfaces.link.repeater import Bundle, Repeater, RepeatReceiver
from interfaces.link.round_trip import (
    DelayStatistics,
    Echo,
    EchoRefusal,
    LinkStatistics,
    Probe,
    ProbeConfig,
    RelativeDelays,
    RoundTrip,
    RoundTripEstimator,
    WindowConfig,
)
from interfaces.link.route import Hop, RouteDelay
from interfaces.link.stream import Stream
from interfaces.link.trace import TraceDelay

__all__ = [
    "BernoulliLoss",
    "Bundle",
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
    "DriftEstimate",
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
    "LinkFigures",
    "LinkPath",
    "LinkStatistics",
    "LinkTotals",
    "LossModel",
    "LossReason",
    "PacketLog",
    "PacketOutcome",
    "PacketRecord",
    "Probe",
    "ProbeConfig",
    "RelativeDelays",
    "RepeatReceiver",
    "Repeater",
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
    "direction",
    "loss_model",
    "spelled_loss",
]
