"""The emulated network between operator and robot."""

from interfaces.link.channel import Channel, Delivery
from interfaces.link.clock_sync import ClockEstimate, ClockSync, ClockSyncConfig, DriftEstimate, Evidence
from interfaces.link.conditions import Conditions, LinkConditions, Service
from interfaces.link.delay import ConstantDelay, DelayProfile, DelaySource
from interfaces.link.gamma import GammaDelay
from interfaces.link.gauge import Gauge, Measured
from interfaces.link.lane import Lane
from interfaces.link.link import Direction, Link, LinkTotals, direction
from interfaces.link.losses import BernoulliLoss, GilbertElliottLoss, LossModel, loss_model, spelled_loss
from interfaces.link.measured import HeavyTailedDelay
from interfaces.link.packets import LossReason, PacketLog, PacketRecord, Totals
from interfaces.link.path import Fate, Path
from interfaces.link.profiles import delay_profile
from interfaces.link.quantiles import SlidingQuantiles
from interfaces.link.repeater import Bundle, Repeater, RepeatReceiver
from interfaces.link.round_trip import (
    DelayStatistics,
    Echo,
    LinkStatistics,
    Probe,
    ProbeConfig,
    Refusal,
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
    "Evidence",
    "Fate",
    "GammaDelay",
    "Gauge",
    "GilbertElliottLoss",
    "HeavyTailedDelay",
    "Hop",
    "Lane",
    "Link",
    "LinkConditions",
    "LinkStatistics",
    "LinkTotals",
    "LossModel",
    "LossReason",
    "Measured",
    "PacketLog",
    "PacketRecord",
    "Path",
    "Probe",
    "ProbeConfig",
    "Refusal",
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
