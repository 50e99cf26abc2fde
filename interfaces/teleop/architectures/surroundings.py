"""What the extended architecture adds to both sites: the virtual environment there, sonar and supervisor here.

Source: Han, Kim, Kim, Kim, 2001, section 3.2 and Fig. 10.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from robots.onboard.avoidance import ObstacleAvoidance
from robots.onboard.driving import Drive, Posture
from robots.onboard.movers import MoverTracker, Yielding
from robots.onboard.supervisor import CellChange, EnvironmentSupervisor
from vrs.mobile import Avoidance, VirtualEnvironment, wrapped

_AWAY, _BACK = 0.25, 0.05
"""A robot that avoided something further from its path than the first is back within the second [m]."""
_ASIDE, _TURN, _SPEED = 0.5, 0.6, 0.3
"""On its way back it turns on the spot to what is further aside [rad], so fast [rad/s], and drives so [m/s]."""
_STEERED = 1.0
"""A controller without a direction of its own is taken to want to get where its drive turns in this time [s]."""


class OperatorSurroundings:
    """The virtual environment at the operator's site, kept by what the robot reports, and avoided.

    Reports may be lost, repeated or overtaken: of each cell the observation made last counts, in whatever order
    they come. The robot's clock needn't be the operator's: a report that came as quickly as any is taken as of now.
    """

    def __init__(self, environment: VirtualEnvironment, avoidance: Avoidance, *, learns: bool = True) -> None:
        """Take the environment with the known map, and what keeps the virtual robot out of its cells.

        Args:
            environment: With the known map.
            avoidance: Keeps the virtual robot out of its cells.
            learns: Whether what the real robot senses is added to it.
        """
        self.environment, self._learns = environment, learns
        self._avoidance = avoidance
        self._offset = math.inf
        self._last: dict[tuple[int, int], CellChange] = {}
        """The last observation of each cell that has come."""

    def receive(self, cells: Sequence[CellChange], said_at: float, *, now: float) -> None:
        """Take in what a report says.

        Args:
            cells: What it says changed, each cell once.
            said_at: When the robot said it, by its own clock [s].
            now: By the operator's clock [s], not before an earlier call's.
        """
        if not self._learns:
            return
        environment = self.environment
        self._offset = min(self._offset, now - said_at)
        # What was seen before this can't live any more, whatever a late report says of it.
        oldest = now - self._offset - environment.longest
        self._last = {cell: last for cell, last in self._last.items() if last.seen > oldest}
        freed, formed = [], {}
        m, n = environment.grid.shape
        for change in cells:
            cell = change.cell
            if not (change.seen > oldest and 0 <= cell[0] < m and 0 <= cell[1] < n):
                continue
            last = self._last.get(cell, change)
            if change.seen > last.seen:
                last = change
            self._last[cell] = last
            if not last.occupied:
                freed.append(cell)
            elif change.occupied:
                # Also where a later observation came before: its neighbours may be in this report, and it may have
                # died without them.
                formed[cell] = min(last.seen + self._offset, now)
        environment.forget(freed, now)
        environment.add(formed, now, formed=formed)

    def command(self, asked: Drive, before: Drive, posture: Posture, *, now: float) -> Drive:
        """What the virtual robot drives in the next period, so that it enters no occupied cell.

        Args:
            asked: What the operator asks for.
            before: What it drives now.
            posture: Where it will be when the command begins.
            now: By the operator's clock [s].
        """
        environment = self.environment
        found = self._avoidance.command(asked, before, posture, environment.grid, environment.occupied(now))
        return Drive(*found)


class RobotSurroundings:
    """Sonar, the virtual environment supervisor, and obstacle avoidance between controller and drive."""

    def __init__(
        self,
        sonar: Callable[[], tuple[float, Sequence[float]] | None],
        supervisor: EnvironmentSupervisor,
        avoidance: ObstacleAvoidance,
        movers: MoverTracker,
        yielding: Yielding,
        aim: Callable[[], tuple[float, float, tuple[float, float] | None]] | None = None,
    ) -> None:
        """Take the parts.

        Args:
            sonar: Tells when the newest scan was taken [s] and its ranges [m], infinite without echo; None before
                the first.
            supervisor: Of the virtual environment.
            avoidance: Of what stands.
            movers: Follows who walks.
            yielding: Goes out of their way.
            aim: Tells where a controller that knows it wants to get: in which direction [rad], the way after which
                it's to stand [m], and the place on its path where it should be [m], None while it has no path.
        """
        self._movers, self._yielding = movers, yielding
        self.supervisor = supervisor
        self._sonar, self._avoidance, self._aim = sonar, avoidance, aim
        self._heard = -math.inf
        self._rejoins = False
        self._before: tuple[float, Posture] | None = None
        """When and where the robot was at the last call."""

    def drive(self, wanted: Drive, posture: Posture, *, now: float, v_before: float) -> Drive:
        """Listen, and say what to drive until the next call.

        Args:
            wanted: What the controller wants.
            posture: Where the robot takes itself to be.
            now: By the robot's clock [s].
            v_before: Linear speed that it was told to drive last [m/s].
        """
        scan = self._sonar()
        if scan is not None and scan[0] > self._heard:
            self._heard = scan[0]
            where = self._at(scan[0], posture, now)
            new = self.supervisor.hear(scan[1], where, now=scan[0])
            self._movers.hear(scan[1], new.tolist(), where, now=scan[0])
            self._avoidance.hear(scan[1], where, now=scan[0])
        self._before = now, posture
        wanted, towards, left = self._wanted(wanted, posture)
        found = self._avoidance.drive(wanted, posture, now=now, towards=towards, v_before=v_before, left=left)
        return self._yielding.drive(found, self._movers.movers(now=now), posture, now=now, v_before=v_before)

    def _wanted(self, wanted: Drive, posture: Posture) -> tuple[Drive, float, float]:
        """What is wanted, in which direction [rad], and the way left [m]; or straight back to the path.

        A field leads to a path along which there's way left. Beside its end, or a pivot, it doesn't.
        """
        if self._aim is None:
            return wanted, posture.theta + _STEERED * wanted.w, math.inf
        direction, left, nearest = self._aim()
        x, y = posture[:2] if nearest is None else nearest
        off = math.hypot(x - posture.x, y - posture.y)
        self._rejoins = left < off and off > (_BACK if self._rejoins else _AWAY)
        if not self._rejoins:
            return wanted, direction, left
        towards = math.atan2(y - posture.y, x - posture.x)
        error = wrapped(towards - posture.theta)
        if abs(error) > _ASIDE:
            return Drive(0.0, math.copysign(_TURN, error)), towards, off
        return Drive(min(_SPEED, off), 1.5 * error), towards, off

    def _at(self, t: float, posture: Posture, now: float) -> Posture:
        """Where the robot was when a scan was taken, between the last call and this one."""
        if self._before is None or t >= now:
            return posture
        then, before = self._before
        share = max(0.0, (t - then) / (now - then)) if now > then else 1.0
        turn = wrapped(posture.theta - before.theta)
        return Posture(
            before.x + share * (posture.x - before.x),
            before.y + share * (posture.y - before.y),
            before.theta + share * turn,
        )
