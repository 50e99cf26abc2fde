"""What a robot carries on board, whatever robot it is."""

from robots.onboard.avoidance import AvoidanceConfig, ObstacleAvoidance, SonarMount
from robots.onboard.command_filter import (
    CommandFilter,
    CommandFilterConfig,
    FilterEvent,
    FilterEventKind,
    FilterOutput,
)
from robots.onboard.driving import Drive, Posture
from robots.onboard.following import FollowingAbort, FollowingMonitor, Tolerance
from robots.onboard.free_ways import Outline
from robots.onboard.known_trajectory import KnownTrajectory
from robots.onboard.lease import Ended, Grant, Lease, LeaseConfig, LeaseEnd, LeaseRefusal, LeaseState, Pending
from robots.onboard.movers import Mover, MoversConfig, MoverTracker
from robots.onboard.path import Arc, MovingPath, Pivot, Projection
from robots.onboard.path_following import FieldLaw, PathFollowingConfig, PathFollowingController
from robots.onboard.path_generator import PathGenerator, PathGeneratorConfig
from robots.onboard.servo import FeedForward, Servo, ServoGains
from robots.onboard.stamps import Kind, Stamp, Verdict
from robots.onboard.stops import StopMotion, at_rest, from_commanded, from_measured
from robots.onboard.supervision import Supervision
from robots.onboard.supervisor import CellChange, EnvironmentSupervisor, SupervisorConfig
from robots.onboard.trajectory_tracking import Reference, TrackingConfig, TrajectoryTracker
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
from robots.onboard.yielding import Yielding, YieldingConfig

__all__ = [
    "AcceptedFuture",
    "Arc",
    "AvoidanceConfig",
    "BeginStop",
    "CellChange",
    "CommandFilter",
    "CommandFilterConfig",
    "Drive",
    "Ended",
    "EnvironmentSupervisor",
    "FeedForward",
    "FieldLaw",
    "FilterEvent",
    "FilterEventKind",
    "FilterOutput",
    "FollowingAbort",
    "FollowingMonitor",
    "GoOn",
    "Grant",
    "Kind",
    "KnownTrajectory",
    "Lease",
    "LeaseConfig",
    "LeaseEnd",
    "LeaseRefusal",
    "LeaseState",
    "LossPolicy",
    "Manner",
    "Mover",
    "MoverTracker",
    "MoversConfig",
    "MovingPath",
    "ObstacleAvoidance",
    "Outline",
    "PathFollowingConfig",
    "PathFollowingController",
    "PathGenerator",
    "PathGeneratorConfig",
    "Pending",
    "Pivot",
    "Posture",
    "Projection",
    "Reference",
    "Refusal",
    "RefusalCode",
    "Servo",
    "ServoGains",
    "SonarMount",
    "Stamp",
    "StopMotion",
    "StopReason",
    "Supervision",
    "SupervisorConfig",
    "Tolerance",
    "TrackingConfig",
    "TrajectoryTracker",
    "ValueGuard",
    "Verdict",
    "Watchdog",
    "WatchdogConfig",
    "WatchdogState",
    "Yielding",
    "YieldingConfig",
    "at_rest",
    "from_commanded",
    "from_measured",
]
