"""What a robot carries on board, whatever robot it is."""

from robots.onboard.following import FollowingAbort, FollowingMonitor, Tolerance
from robots.onboard.lease import Ended, Grant, Lease, LeaseConfig, LeaseEnd, LeaseRefusal, LeaseState, Pending
from robots.onboard.servo import FeedForward, Servo, ServoGains
from robots.onboard.stamps import Kind, Stamp, Verdict
from robots.onboard.stops import StopMotion, at_rest, from_commanded, from_measured
from robots.onboard.supervision import Supervision
from robots.onboard.values import Refusal, RefusalCode, ValueGuard
from robots.onboard.watchdog import (
    AcceptedFuture,
    BeginStop,
    GoOn,
    LossPolicy,
    Manner,
    StopReason,
    Watchdog,
    WatchdogConfig,
    WatchdogState,
)

__all__ = [
    "AcceptedFuture",
    "BeginStop",
    "Ended",
    "FeedForward",
    "FollowingAbort",
    "FollowingMonitor",
    "GoOn",
    "Grant",
    "Kind",
    "Lease",
    "LeaseConfig",
    "LeaseEnd",
    "LeaseRefusal",
    "LeaseState",
    "LossPolicy",
    "Manner",
    "Pending",
    "Refusal",
    "RefusalCode",
    "Servo",
    "ServoGains",
    "Stamp",
    "StopMotion",
    "StopReason",
    "Supervision",
    "Tolerance",
    "ValueGuard",
    "Verdict",
    "Watchdog",
    "WatchdogConfig",
    "WatchdogState",
    "at_rest",
    "from_commanded",
    "from_measured",
]
