"""What a robot carries on board, whatever robot it is."""

from robots.onboard.avoidance import AvoidanceConfig, ObstacleAvoidance, Outline, SonarMount
from robots.onboard.command_filter import (
    CommandFilter,
    CommandFilterConfig,
)
from robots.onboard.curve import Curve, CurveKind, CurvePoint, load_curve, read_curve
from robots.onboard.curve_trackers import (
    Backwards,
    PurePursuit,
    PurePursuitConfig,
    QuadraticCurveTracker,
    QuadraticTrackerConfig,
    parabola_drive,
    wheel_rates,
)
from robots.onboard.driving import Drive, Posture
from robots.onboard.following import FollowingAbort, SensorFault, SensorMonitor, too_far
from robots.onboard.global_localization import Candidate, SearchConfig, Surroundings, locate
from robots.onboard.gsp_map import GspMap, Lines, load_map, read_map, save_map
from robots.onboard.journey import Goal, Journey, JourneyConfig, JourneyState
from robots.onboard.laser import (
    FrameReader,
    LaserModel,
    LaserScan,
    OdometryTrack,
    decode_scan,
    deskewed,
    encode_scan,
)
from robots.onboard.lease import Ended, Grant, Lease, LeaseConfig, LeaseEnd, LeaseRefusal, LeaseState, Pending
from robots.onboard.line_extraction import ExtractionConfig, extract
from robots.onboard.line_filter import LineFilter, MatchingConfig, MotionConfig
from robots.onboard.localization import LocalizationConfig, Observability, PaperLocalizer, Tracker
from robots.onboard.localizer import Event, Localizer, LocalizerConfig, Status
from robots.onboard.map_building import BuildingConfig, MapBuilder, Surveyor
from robots.onboard.movers import Mover, MoversConfig, MoverTracker, Yielding, YieldingConfig
from robots.onboard.navigator import Navigator
from robots.onboard.obstacle_map import ObstacleMap, ObstacleMapConfig
from robots.onboard.path import Arc, MovingPath, PathGenerator, Pivot, Projection
from robots.onboard.path_following import FieldLaw, PathFollowingConfig, PathFollowingController
from robots.onboard.routes import NoRoute, Route, RouteConfig, RouteMap, RouteProblem
from robots.onboard.servo import FeedForward, Servo, ServoGains, StopMotion, from_commanded, from_measured
from robots.onboard.supervisor import CellChange, EnvironmentSupervisor, SupervisorConfig
from robots.onboard.trajectory_tracking import KnownTrajectory, Reference, TrackingConfig, TrajectoryTracker
from robots.onboard.watchdog import (
    AcceptedFuture,
    BeginStop,
    GoOn,
    Kind,
    LossPolicy,
    Manner,
    Stamp,
    StopReason,
    Verdict,
    Watchdog,
    WatchdogConfig,
    WatchdogState,
)

__all__ = [
    "AcceptedFuture",
    "Arc",
    "AvoidanceConfig",
    "Backwards",
    "BeginStop",
    "BuildingConfig",
    "Candidate",
    "CellChange",
    "CommandFilter",
    "CommandFilterConfig",
    "Curve",
    "CurveKind",
    "CurvePoint",
    "Drive",
    "Ended",
    "EnvironmentSupervisor",
    "Event",
    "ExtractionConfig",
    "FeedForward",
    "FieldLaw",
    "FollowingAbort",
    "FrameReader",
    "GoOn",
    "Goal",
    "Grant",
    "GspMap",
    "Journey",
    "JourneyConfig",
    "JourneyState",
    "Kind",
    "KnownTrajectory",
    "LaserModel",
    "LaserScan",
    "Lease",
    "LeaseConfig",
    "LeaseEnd",
    "LeaseRefusal",
    "LeaseState",
    "LineFilter",
    "Lines",
    "LocalizationConfig",
    "Localizer",
    "LocalizerConfig",
    "LossPolicy",
    "Manner",
    "MapBuilder",
    "MatchingConfig",
    "MotionConfig",
    "Mover",
    "MoverTracker",
    "MoversConfig",
    "MovingPath",
    "Navigator",
    "NoRoute",
    "Observability",
    "ObstacleAvoidance",
    "ObstacleMap",
    "ObstacleMapConfig",
    "OdometryTrack",
    "Outline",
    "PaperLocalizer",
    "PathFollowingConfig",
    "PathFollowingController",
    "PathGenerator",
    "Pending",
    "Pivot",
    "Posture",
    "Projection",
    "PurePursuit",
    "PurePursuitConfig",
    "QuadraticCurveTracker",
    "QuadraticTrackerConfig",
    "Reference",
    "Route",
    "RouteConfig",
    "RouteMap",
    "RouteProblem",
    "SearchConfig",
    "SensorFault",
    "SensorMonitor",
    "Servo",
    "ServoGains",
    "SonarMount",
    "Stamp",
    "Status",
    "StopMotion",
    "StopReason",
    "SupervisorConfig",
    "Surroundings",
    "Surveyor",
    "Tracker",
    "TrackingConfig",
    "TrajectoryTracker",
    "Verdict",
    "Watchdog",
    "WatchdogConfig",
    "WatchdogState",
    "Yielding",
    "YieldingConfig",
    "decode_scan",
    "deskewed",
    "encode_scan",
    "extract",
    "from_commanded",
    "from_measured",
    "load_curve",
    "load_map",
    "locate",
    "parabola_drive",
    "read_curve",
    "read_map",
    "save_map",
    "too_far",
    "wheel_rates",
]
