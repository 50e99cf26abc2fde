"""A run of the mobile robot's laboratory: what is run, what happened, who notes it, and its row of figures."""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from typing import Annotated, Any, Protocol, TypeAlias

import numpy as np

from interfaces.link.link import Link
from interfaces.messages.recording import Direction
from interfaces.messages.sites import DriveOrders, DriveReport
from interfaces.teleop.architectures import ArchitectureOperatorSite, Constants, Transport
from interfaces.teleop.architectures.compositions import CONTROL, POSITIONS
from robots.mobile.chassis import MobileReality
from robots.mobile.robot import PLACES, Collision, MobileRobot
from robots.onboard.driving import Posture
from robots.robot import BARE, USUAL_BASE, Robot, load
from robots.rooms import Room
from vrs.checks import one_of, validated, within
from vrs.comparison import PathComparison, PathMatch, match_paths, summed_up
from vrs.model import Array

DriveLink: TypeAlias = Link[DriveOrders, DriveReport]
"""What is between both sites."""


KNOWN, SENSED = "known", "sensed"
"""What a virtual environment holds."""


@dataclass(frozen=True, slots=True)
@validated
class DriveCase:
    """What is run."""

    architecture: str = "timeline"
    transport: Transport = Transport.DATAGRAMS
    delay: str = "mon"
    """Profile of either direction, as the command line spells it."""
    robot: str = USUAL_BASE
    """A mobile robot, as `robots.load` finds it, and `@BODY` for another body than its usual one; or `bare`."""
    operator: str = "mixed"
    seed: int = 0
    length: Annotated[float, within(1.0, 3600.0, "s")] = 120.0
    """For how long the operator drives [s], in [1, 3600]."""
    constants: Constants = field(default_factory=Constants)
    reality: MobileReality | None = None
    """Of the real robot; all of it unless given."""
    room: str | Room = ""
    """Where it drives, a room or one that comes with the package; the operator's own unless given."""
    position: str = "fused"
    """What tells the real robot where it is: `fused` (odometry and camera), `laser` (odometry and laser on the map
    of its room), `odometry`, or the `truth`."""
    environment: str = ""
    """What the virtual robot avoids: `known`, its room's map; `sensed`, what the real one senses as well; unless
    given, `sensed` under architectures that sense, and else nothing."""
    known: Robot | None = field(default=None, repr=False, compare=False)
    """The robot, where somebody has it; else it's found by what `robot` says."""

    @property
    def group(self) -> tuple[str, str, str, str, str]:
        """Architecture, transport, delay, robot and operator: what it's one of several seeds of."""
        return self.architecture, self.transport.value, self.delay, self.robot, self.operator

    @property
    def real(self) -> tuple[Robot, str]:
        """The real robot, and the name of its body; empty for the usual one.

        Raises:
            InvalidValueError: If there's no such robot.
            FormatError: If its module can't be imported.
        """
        name, at, body = self.robot.rpartition("@")
        if self.robot == BARE:
            name, body = USUAL_BASE, BARE
        elif not at or not body.isidentifier():
            name, body = self.robot, ""
        robot = load(name) if self.known is None else self.known
        return robot, body and robot.body_name(body)

    def __post_init__(self) -> None:
        object.__setattr__(self, "transport", Transport(one_of("transport", self.transport, list(Transport))))
        self.real[0].base  # noqa: B018 - raises where it's none
        one_of("position", self.position, POSITIONS)
        one_of("environment", self.environment, ("", KNOWN, SENSED))
        if isinstance(self.room, str):
            one_of("room", self.room, ("", *PLACES))


@dataclass(frozen=True, slots=True, eq=False)
class DriveRun:
    """What happened in a run."""

    case: DriveCase
    t: Array
    """Times [s], (k,)."""
    virtual: Array
    """Postures of the virtual robot, without corrections, (k, 3)."""
    real: Array
    """True postures of the real robot, (k, 3)."""
    measured: Array
    """Postures that the real robot took itself to be at, (k, 3)."""
    estimated: Array
    """Postures that the operator's site thought the real robot would come to, as of the last command, (k, 3)."""
    drives: Array
    """What the real robot was told, v and ω, (k, 2)."""
    offset: Array
    """D [s], (k,); NaN where the architecture has none."""
    delays: Array
    """When each packet was sent and how long it took [s], (p, 2)."""
    touched: tuple[Collision, ...]
    """What the real robot ran into, or who into it."""
    sent_bytes: int
    reported_bytes: int
    """What the real robot sent back."""
    learned: tuple[tuple[float, tuple[tuple[int, int], ...]], ...]
    """Cells that the virtual environment had beside the known map, each half second; empty without one."""

    @property
    def collisions(self) -> int:
        """How many there were."""
        return len(self.touched)

    def limits_passed(self) -> int:
        """How many drives were beyond the robot's limits of speed and acceleration."""
        limits, slack = self.case.real[0].base.limits, 1 + 1e-9
        v, w = self.drives.T
        # So many control periods may have begun between two samples, which live don't come just when one does.
        periods = np.ceil(np.diff(self.t, prepend=self.t[0] - CONTROL) / CONTROL - 1e-6)
        change = np.abs(np.diff(v, prepend=0.0 if self.t[0] < CONTROL else v[0]))
        rise = change > limits.a_max * CONTROL * periods * slack + 1e-12
        return int(np.sum(rise | (np.abs(v) > limits.v_max * slack) | (np.abs(w) > limits.w_max * slack)))

    def match(self) -> PathMatch:
        """The real robot's path matched to the virtual one's."""
        return match_paths(self.t, self.virtual[:, :2], self.real[:, :2])

    def compare(self) -> PathComparison:
        """How far the twins were apart."""
        return summed_up(self.match())


class Witness(Protocol):
    """Who notes what happens in a run, and changes nothing of it."""

    def begun(
        self, case: DriveCase, start: Posture, body: MobileRobot, site: ArchitectureOperatorSite, link: DriveLink
    ) -> None:
        """The run begins; the site and the link tell those who listen."""

    def sent(self, direction: Direction, now: float, size: int) -> None:
        """A packet of so many bytes goes `forward` or `backward` now [s]."""


DIGITS = 6
"""Significant digits of what was measured."""
METRICS = tuple(item.name for item in fields(PathComparison))
"""Names of the metrics, as in files."""
KEYS = ("architecture", "transport", "delay", "robot", "operator")
COLUMNS = (*KEYS, "seed", *METRICS, "collisions", "limits_passed", "sent_bytes", "longest_delay")
"""Of runs.csv; lengths in metres, times in seconds, speeds in m/s. An empty cell is undefined."""


@dataclass(frozen=True, slots=True)
class Row:
    """A run, in figures."""

    group: tuple[str, ...]
    """What it's one of several seeds of: see `KEYS`."""
    seed: int
    metrics: PathComparison
    collisions: int
    limits_passed: int
    """Drives beyond a limit."""
    sent_bytes: int
    longest_delay: float
    """Of a packet that was sent while the operator drove [s]."""


def row_of(drive: DriveRun) -> Row:
    """The figures of a run."""
    case = drive.case
    return Row(
        case.group, case.seed, drive.compare(), drive.collisions, drive.limits_passed(), drive.sent_bytes,
        float(drive.delays[:, 1].max(initial=0.0)),
    )  # fmt: skip


def cell(value: float | int | str | None) -> str:
    """A value as it stands in a table: six significant digits, nothing where it's undefined."""
    if value is None:
        return ""
    return f"{value:.{DIGITS}g}" if isinstance(value, float) else str(value)


def values_of(row: Row) -> list[Any]:
    """What stands in the `COLUMNS`."""
    metrics = (getattr(row.metrics, name) for name in METRICS)
    rest = row.collisions, row.limits_passed, row.sent_bytes, row.longest_delay
    return [*row.group, row.seed, *metrics, *rest]


def facts_of(row: Row) -> dict[str, Any]:
    """A row of runs.csv as JSON takes it, by the names of its columns: the very digits that stand there."""
    shown = [float(cell(value)) if isinstance(value, float) else value for value in values_of(row)]
    return dict(zip(COLUMNS, shown, strict=True))
