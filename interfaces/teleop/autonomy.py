"""What a mobile robot does by itself: drive to a goal, or do a list of jobs, and what it sees.

It's on board, and outlives links.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from typing_extensions import override

from interfaces.jobs.file import digest
from interfaces.jobs.runner import (
    ArmControl,
    CarryOut,
    EndJob,
    JobRunner,
    Request,
    RunnerConfig,
    Show,
    SilentSpeaker,
    Speaker,
)
from interfaces.messages.drive_sites import Doing, RobotTask, SensedPoints, TaskReport
from interfaces.messages.fields import MOST_POINTS
from interfaces.messages.jobs import ArmJob, ListCommand, MoveJob, OperatorLoss, VoiceJob
from robots.mobile.navigation import BodyNavigator
from robots.mobile.position import LaserPosition
from robots.mobile.robot import MobileRobot
from robots.onboard.driving import STAND, Drive, Posture, is_still
from robots.onboard.following import PositionSource
from robots.onboard.journey import GOING, Goal, Journey, JourneyState
from robots.onboard.laser import LaserScan, beam_angles
from robots.onboard.routes import Point


class Pilot(Protocol):
    """Whatever takes a robot to a goal by itself."""

    @property
    def state(self) -> JourneyState:
        """How far it is."""

    @property
    def reason(self) -> str:
        """Why it waits or has failed."""

    @property
    def goal(self) -> Goal | None:
        """Where to; None before the first."""

    @property
    def route(self) -> tuple[Point, ...]:
        """The way that's being driven [m]."""

    @property
    def left(self) -> float:
        """Of that way [m]."""

    def go(self, goal: Goal, posture: Posture) -> None:
        """Set out for a goal, from where the robot stands."""

    def end(self) -> None:
        """Leave off."""

    def drive(self, posture: Posture, before: Drive) -> Drive:
        """What to drive in the next period, after what was driven before."""


class JourneyPilot(Pilot):
    """A journey by the map alone."""

    def __init__(self, journey: Journey, clock: Callable[[], float]) -> None:
        """Stand.

        Args:
            journey: What finds the way.
            clock: Tells the robot's own time [s].
        """
        self._journey, self._clock = journey, clock

    @property
    @override
    def state(self) -> JourneyState:
        return self._journey.state

    @property
    @override
    def reason(self) -> str:
        return self._journey.reason

    @property
    @override
    def goal(self) -> Goal | None:
        return self._journey.goal

    @property
    @override
    def route(self) -> tuple[Point, ...]:
        route = self._journey.route
        return () if route is None else route.points

    @property
    @override
    def left(self) -> float:
        return self._journey.way_left

    @override
    def go(self, goal: Goal, posture: Posture) -> None:
        self._journey.go(goal, posture, now=self._clock())

    @override
    def end(self) -> None:
        self._journey.end()

    @override
    def drive(self, posture: Posture, before: Drive) -> Drive:
        drive = self._journey.control(posture, now=self._clock(), v_before=before.v)
        return drive if self.state in GOING else STAND


class NavigatorPilot(JourneyPilot):
    """Drives by a robot's own navigator: its laser, its sonars, and who walks there."""

    def __init__(self, body: MobileRobot, period: float) -> None:
        """Take a robot.

        Args:
            body: With a laser scanner and sonars.
            period: Between two drives [s].
        """
        self._ahead = BodyNavigator(body, period)
        super().__init__(self._ahead.navigator.journey, lambda: body.time)

    @override
    def go(self, goal: Goal, posture: Posture) -> None:
        self._ahead.navigator.go(goal, posture, now=self._clock())

    @override
    def drive(self, posture: Posture, before: Drive) -> Drive:
        drive = self._ahead.drive(posture, v_before=before.v)
        return drive if self.state in GOING else STAND


DIRECT = "it's to drive to a goal"
"""Why a list is paused when somebody gives another goal."""
NO_ARM = "there's no arm here that could carry out a program"
"""Why a program can't be begun."""


@dataclass(frozen=True, slots=True)
class Hands:
    """Who carries out what isn't driving."""

    speaker: Speaker = field(default_factory=SilentSpeaker)
    screen: Callable[[str], object] = lambda _: None
    """Shows a text in place of any other; an empty one clears it."""
    arm: ArmControl | None = None


class Autonomy:
    """Takes tasks, and drives; times are the operator's [s], journeys go by the robot's own."""

    def __init__(self, pilot: Pilot, hands: Hands | None = None, config: RunnerConfig | None = None) -> None:
        """Do nothing.

        Args:
            pilot: Takes the robot to a goal.
            hands: Who speaks, shows and lets an arm work; nobody aloud unless given.
            config: Of the list of jobs.
        """
        self._pilot = pilot
        self._hands = Hands() if hands is None else hands
        self.runner = JobRunner(config=config)
        self._digest = digest(self.runner.jobs)
        self._next: Goal | None = None
        """Where to set out for once the robot rests."""
        self._aside: tuple[JourneyState, str] | None = None
        """What became of a journey that never began."""
        self._move = self._voice = self._work = 0
        """Attempts that are being carried out; 0 for none."""
        self._says = self._shows = ""

    @property
    def doing(self) -> Doing:
        """What it does."""
        if self.runner.running:
            return Doing.JOBS
        return Doing.GOAL if self._next is not None or self._pilot.state in GOING else Doing.NOTHING

    @property
    def loss(self) -> OperatorLoss:
        """What follows when the operator is lost."""
        return self.runner.config.loss

    @property
    def left(self) -> float:
        """Way to the goal [m]."""
        return self._pilot.left

    def receive(self, task: RobotTask, *, now: float) -> None:
        """Take a task; one that can't be done now changes nothing."""
        if task.go is not None:
            self.runner.interrupt(DIRECT, now=now)
            self._turn(now)
            self._set_out(task.go)
        elif task.halt is not None:
            self.stop(task.halt, now=now)
        elif task.jobs is not None:
            self.runner.load(task.jobs, task.progress, now=now)
            self._digest = digest(self.runner.jobs)
        elif task.do is not None:
            if task.do in (ListCommand.RUN, ListCommand.RESUME) and not self.runner.running:
                self._leave()
            self.runner.receive(task.do, now=now)
        self._turn(now)

    def stop(self, reason: str, *, now: float) -> None:
        """Leave off; a list is paused."""
        self.runner.interrupt(reason, now=now)
        self._turn(now)
        self._leave(reason)

    def lost(self, reason: str, *, now: float) -> None:
        """The operator is lost: stop or go on, as the policy says."""
        self.runner.lose_operator(reason, now=now)
        self._turn(now)
        if self.loss is OperatorLoss.STOP:
            self._leave(reason)

    def drive(self, posture: Posture, before: Drive, *, now: float) -> Drive | None:
        """What to drive in the next period.

        Args:
            posture: Where the robot takes itself to be.
            before: What it was told to drive last.
            now: [s].

        Returns:
            A drive, whose limits are for the caller to keep; None to come to rest, and stay there.
        """
        self._turn(now)
        if self._next is not None:
            if not is_still(before):
                return None
            goal, self._next = self._next, None
            self._pilot.go(goal, posture)
        if self._pilot.state not in GOING:
            return None
        return self._pilot.drive(posture, before)

    def report(self) -> TaskReport:
        """How far it is."""
        pilot, state, reason = self._pilot, self._pilot.state, self._pilot.reason
        goal, route = pilot.goal, pilot.route
        if self._next is not None:
            state, reason, goal, route = JourneyState.DRIVING, "", self._next, ()
        elif self._aside is not None:
            state, reason = self._aside
        progress, loss = self.runner.progress, self.loss
        return TaskReport(
            state, reason, goal, route[:MOST_POINTS], self._digest, progress, loss, self._shows, self._says
        )

    def _set_out(self, goal: Goal) -> None:
        """Drive to a goal, from where the robot comes to rest."""
        self._pilot.end()
        self._next, self._aside = goal, None

    def _leave(self, reason: str = "") -> None:
        """End a journey, also one that was to begin."""
        if self._next is not None:
            self._next, self._aside = None, (JourneyState.ENDED, reason)
        self._pilot.end()

    def _turn(self, now: float) -> None:
        """Tell the runner what has come to its end, and begin what it asks for, until there's nothing new."""
        requests = self._answered(now)
        while requests:
            for request in requests:
                self._begin(request, now)
            requests = self._answered(now)

    def _answered(self, now: float) -> tuple[Request, ...]:
        pilot, hands, runner = self._pilot, self._hands, self.runner
        if self._move and self._next is None and pilot.state not in GOING:
            attempt, self._move = self._move, 0
            arrived = pilot.state is JourneyState.ARRIVED
            runner.answer(attempt, None if arrived else pilot.reason or "it was ended", now=now)
        if self._voice and not hands.speaker.is_speaking(now=now):
            attempt, self._voice, self._says = self._voice, 0, ""
            runner.answer(attempt, now=now)
        outcome = hands.arm.outcome(now=now) if hands.arm is not None and self._work else None
        if outcome is not None:
            attempt, self._work = self._work, 0
            runner.answer(attempt, outcome or None, now=now)
        return runner.advance(now=now)

    def _begin(self, request: Request, now: float) -> None:
        hands = self._hands
        match request:
            case CarryOut(attempt, MoveJob(to=Goal() as goal)):
                self._move = attempt
                self._set_out(goal)
            case CarryOut(attempt, VoiceJob(text=text)):
                self._voice, self._says = attempt, text
                hands.speaker.speak(text, now=now)
            case Show(text):
                self._shows = text
                hands.screen(text)
            case CarryOut(attempt, ArmJob(program=program, source=source)):
                refusal = NO_ARM if hands.arm is None else hands.arm.run(program, source, now=now)
                if refusal:
                    self.runner.answer(attempt, refusal, now=now)
                else:
                    self._work = attempt
            case EndJob(attempt):
                self._end(attempt, now)

    def _end(self, attempt: int, now: float) -> None:
        """Leave off what an attempt began."""
        if attempt == self._move:
            self._move = 0
            self._leave()
        elif attempt == self._voice:
            self._voice, self._says = 0, ""
            self._hands.speaker.hush()
        elif self._hands.arm is not None and attempt == self._work:
            self._work = 0
            self._hands.arm.end(now=now)


_EVERY = 4
"""Each so many of a scan's beams is told of."""
_SIGHTS = 0.39
"""At most so often [s]."""


class LaserSight:
    """Where the beams of a robot's newest scan ended, and how sure it is of its place."""

    def __init__(self, body: MobileRobot, position: PositionSource) -> None:
        """Take a robot, and what tells it where it is."""
        self._body, self._position = body, position
        self._scan: LaserScan | None = None
        self._sight: SensedPoints | None = None
        self._told = -math.inf

    def look(self) -> None:
        """Note where the robot is while its newest scan is new; to be called each control period."""
        scan = self._body.laser
        if scan is None or scan is self._scan or scan.time < self._told + _SIGHTS:
            return
        self._scan, self._told = scan, scan.time
        reckoned, position = self._body.reckoned, self._position
        doubt, place = None, reckoned
        if isinstance(position, LaserPosition):
            localizer = position.localizer
            place = reckoned if localizer.posture is None else localizer.posture
            (xx, xy, _), (_, yy, _), _ = localizer.covariance.tolist()
            doubt = xx, xy, yy
        self._sight = SensedPoints(scan.time, seen_from(scan, place)[:MOST_POINTS], doubt)

    def newest(self) -> SensedPoints | None:
        """What was seen since the last call; None if that's nothing."""
        sight, self._sight = self._sight, None
        return sight


def seen_from(scan: LaserScan, place: tuple[float, float, float]) -> tuple[tuple[float, float], ...]:
    """Where some of a scan's beams ended, for a map.

    Args:
        scan: The scan; how the robot moved during it doesn't matter for a picture.
        place: Where the robot is, (x, y, θ) [m, m, rad].

    Returns:
        Places on the map [m], to the centimetre.
    """
    x, y, theta = place
    angles = beam_angles(len(scan.ranges))[::_EVERY] + theta
    ranges = scan.ranges[::_EVERY]
    hit = np.isfinite(ranges)
    ahead = np.array([x + scan.forward * math.cos(theta), y + scan.forward * math.sin(theta)])
    ends = ahead + ranges[hit, None] * np.column_stack([np.cos(angles[hit]), np.sin(angles[hit])])
    return tuple((round(a, 2), round(b, 2)) for a, b in ends.tolist())
