"""Section 5 once: A to B before the door, "Hello!", a message, a book is put on top, the key, and back to A.

The home, its doors, who walks in it and who brings the book go by the clock; the robot, its laser, its localization
and the list of jobs are those that run live. The book is a body of its own in PyBullet.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import TYPE_CHECKING, Final

import numpy as np

from interfaces.jobs import (
    Done,
    EndJob,
    JobFailed,
    JobList,
    JobRunner,
    JobStage,
    ListCommand,
    Load,
    MessageJob,
    MoveJob,
    MoveTo,
    Request,
    RunArm,
    Show,
    SilentSpeaker,
    Speak,
    VoiceJob,
    WaitJob,
)
from interfaces.lab.goals.trial import FIRST_LOOK, TrialPilot
from robots.bullet.rooms import Person, Room
from robots.ipr.body import Cargo
from robots.ipr.chassis import IPR, Senses
from robots.ipr.robot import Collision, place
from robots.onboard.journey import GOING, Goal, JourneyState
from robots.onboard.laser import LaserModel
from vrs.mobile import wrapped
from vrs.model import Array

if TYPE_CHECKING:
    from robots.ipr.body import MobileBody

HELLO: Final = "Hello!"
"""What is said at B."""
PLEASE: Final = "Please put the book on my top side!"
"""And shown there."""
JOBS: Final = (MoveJob("B"), VoiceJob(HELLO), MessageJob(PLEASE), WaitJob(), MoveJob("A"))
"""The paper's list."""
OPENS, BROUGHT, KEY = 18.0, 36.0, 40.0
"""When the front door opens, the book is put on top, and the key is pressed [s]."""
LONGEST = 150.0
"""A run that isn't over by then has failed [s]."""
_MEETS = 10.5
"""So long after the key the robot comes by where somebody crosses its way [s], but for how he's drawn."""


@dataclass(frozen=True, slots=True)
class Scenario:
    """What is run."""

    seed: int = 0
    """Of the robot's noise and slip, and of when and how fast somebody walks by."""
    book: Cargo = field(default_factory=Cargo)
    """What is put on top."""


@dataclass(frozen=True, slots=True)
class ScenarioStop:
    """The robot at B, or at A again."""

    off: float
    """From the place to where it really is [m]."""
    turned: float
    """And its heading [rad]."""
    lost: float
    """From where it took itself to be to where it was [m]."""


@dataclass(frozen=True, slots=True, eq=False)
class ScenarioResult:
    """What happened."""

    stage: JobStage
    """Of the list at the end."""
    reason: str
    asked: tuple[str, ...]
    """What the list asked for, in its order."""
    shown: str
    """What was on the screen when the key was pressed."""
    stops: tuple[ScenarioStop, ...]
    """At B and at A."""
    book: tuple[float, float, float] | None
    """Where the book's middle lies at the end, in the robot's frame [m]; None if it was never put on."""
    slid: float
    """How far it slid on the robot [m]."""
    on_top: bool
    """Whether it's still there."""
    touched: tuple[Collision, ...]
    passed: float
    """Least distance of the robot's outline from somebody on the way back [m]."""
    lost: float
    """Largest error of the position [m]."""
    time: float
    track: Array
    """True postures, (k, 3)."""


def home(rng: np.random.Generator) -> Room:
    """The home as it is that day: who brings the book opens the front door; somebody goes through the study.

    Args:
        rng: What draws when and how fast he goes.
    """
    room = place("home")
    front = replace(room.doors[0], times=(0.0, OPENS, OPENS + 2.0), shares=(0.0, 0.0, 1.0))
    inside = tuple(replace(door, times=(0.0,), shares=(1.0,), repeat=False) for door in room.doors[1:])
    guest = Person("guest", 0.2, 1.7, (0.0, BROUGHT - 12, BROUGHT - 8, KEY, KEY + 4), (
        (4.8, 7.95), (4.8, 7.95), (4.8, 7.3), (4.8, 7.3), (4.8, 7.95)))  # fmt: skip
    speed, late = float(rng.uniform(0.4, 0.7)), float(rng.uniform(-1.5, 1.5))
    places = ((1.5, 2.6), (1.55, 4.2), (2.35, 4.7), (3.1, 4.05))
    times = [0.0]
    for a, b in pairwise(places):
        times.append(times[-1] + math.dist(a, b) / speed)
    begins = KEY + _MEETS + late - times[2]
    walker = Person("passer-by", 0.22, 1.7, tuple(t + begins for t in times), places)
    return replace(room, doors=(front, *inside), people=(guest, walker))


def play(scenario: Scenario) -> ScenarioResult:
    """Run the scenario in PyBullet, in virtual time."""
    from robots.ipr.body import MobileBody

    rng = np.random.default_rng([scenario.seed, 1])
    room = home(rng)
    senses = Senses(camera=None, laser=LaserModel())
    with MobileBody("ipr", room=room, rng=np.random.default_rng([scenario.seed, 2]), senses=senses) as body:
        return _ScenarioRun(scenario, room, body).whole()


class _ScenarioRun:
    """A run while it goes on."""

    def __init__(self, scenario: Scenario, room: Room, body: MobileBody) -> None:
        self._scenario, self._room, self._body = scenario, room, body
        self._pilot = TrialPilot(body)
        self._places = {one.name: Goal(one.x, one.y, one.heading) for one in room.places}
        self._runner = JobRunner()
        self._runner.receive(Load(JobList.of(*JOBS, places=self._places)), now=0.0)
        self._speaker = SilentSpeaker()
        self._moving = self._speaking = 0
        """Numbers of the attempts that are carried out; 0 for none."""
        self._asked: list[str] = []
        self._shown = self._shown_at_key = ""
        self._stops: list[ScenarioStop] = []
        self._put: tuple[float, float, float] | None = None
        self._passed = math.inf

    def whole(self) -> ScenarioResult:
        body, pilot, runner = self._body, self._pilot, self._runner
        begun = brought = pressed = False
        while body.time < LONGEST:
            now = body.time
            if not begun and now >= FIRST_LOOK - 1e-9:
                begun = not runner.receive(ListCommand.RUN, now=now)
            if not brought and now >= BROUGHT and runner.waits_for_key:
                body.load(self._scenario.book)
                brought = True
            if not pressed and brought and now >= KEY:
                self._put, self._shown_at_key = body.cargo[0], self._shown
                pressed = not runner.receive(ListCommand.KEY, now=now)
            self._answer(now)
            for request in runner.advance(now=now):
                self._carry_out(request, now)
            if begun and not runner.running:
                break
            pilot.step()
            if pressed:
                self._passed = min(self._passed, self._gap())
        return self._made()

    def _answer(self, now: float) -> None:
        """Tell the list what has been carried out."""
        journey = self._pilot.journey
        if self._moving and journey.state not in GOING:
            attempt, self._moving = self._moving, 0
            arrived = journey.state is JourneyState.ARRIVED
            self._stops.append(self._stop(journey.goal))
            self._runner.receive(Done(attempt) if arrived else JobFailed(attempt, journey.reason), now=now)
        if self._speaking and not self._speaker.is_speaking(now=now):
            attempt, self._speaking = self._speaking, 0
            self._runner.receive(Done(attempt), now=now)

    def _carry_out(self, request: Request, now: float) -> None:
        match request:
            case MoveTo(attempt, goal):
                name = next(name for name, one in self._places.items() if one == goal)
                self._asked.append(f"MOVE {name}")
                self._moving = attempt
                self._pilot.go(goal)
            case Speak(attempt, text):
                self._asked.append(f"VOICE {text}")
                self._speaking = attempt
                self._speaker.speak(text, now=now)
            case Show(text):
                self._asked.append(f"MESSAGE {text}")
                self._shown = text
            case EndJob():
                self._pilot.journey.end()
                self._moving = self._speaking = 0
            case RunArm(attempt):
                self._runner.receive(JobFailed(attempt, "there's no arm"), now=now)

    def _stop(self, goal: Goal | None) -> ScenarioStop:
        assert goal is not None
        assert goal.heading is not None
        x, y, theta = self._body.truth
        told = self._pilot.posture
        return ScenarioStop(
            math.hypot(goal.x - x, goal.y - y), abs(wrapped(goal.heading - theta)),
            math.hypot(told.x - x, told.y - y),
        )  # fmt: skip

    def _gap(self) -> float:
        """From the robot's outline to who walks by, now [m]."""
        x, y, theta = self._body.truth
        walker = self._room.people[1]
        dx, dy = (a - b for a, b in zip(walker.at(self._body.time), (x, y), strict=True))
        c, s = math.cos(theta), math.sin(theta)
        along, across = abs(c * dx + s * dy - IPR.centre_x), abs(c * dy - s * dx)
        return math.hypot(max(along - IPR.length / 2, 0.0), max(across - IPR.width / 2, 0.0)) - walker.radius

    def _made(self) -> ScenarioResult:
        progress, book = self._runner.progress, self._body.cargo[0] if self._body.cargo else None
        on_top = book is not None and book[2] > IPR.height and max(abs(book[0] - IPR.centre_x), abs(book[1])) < 0.2
        slid = math.inf if book is None or self._put is None else math.dist(book[:2], self._put[:2])
        return ScenarioResult(
            stage=progress.stage, reason=progress.reason, asked=tuple(self._asked), shown=self._shown_at_key,
            stops=tuple(self._stops), book=book, slid=slid, on_top=on_top, touched=self._body.collisions,
            passed=self._passed, lost=self._pilot.lost, time=self._body.time, track=np.array(self._pilot.track),
        )  # fmt: skip
