"""Section 5: A to B before the door, "Hello!", a message, a book put on top, the key, back to A; and its claims.

The home, its doors, who walks in it and who brings the book go by the clock; the robot, its laser, its localization
and the list of jobs are those that run live. The book is a body of its own in PyBullet.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from itertools import pairwise
from typing import TYPE_CHECKING, Final

import numpy as np

from interfaces.jobs import CarryOut, EndJob, JobRunner, Show, SilentSpeaker
from interfaces.lab.claims import OWN_BAR, Cell, Claim, Figure, Findings, Results, Study, Table
from interfaces.lab.goals.study import draw_room
from interfaces.lab.goals.trial import FIRST_LOOK, TrialPilot
from interfaces.lab.output import BAD, INK, MUTED, REAL, draw
from interfaces.lab.statistics import bootstrap
from interfaces.messages.jobs import JobList, JobStage, ListCommand, MessageJob, MoveJob, VoiceJob, WaitJob
from robots.bullet.rooms import Person, Room
from robots.ipr.parameters import IPR
from robots.mobile.chassis import Senses
from robots.mobile.robot import place
from robots.onboard.journey import GOING, Goal, JourneyState
from robots.onboard.laser import LaserModel
from robots.vehicle import Cargo
from vrs.mobile import wrapped

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Canvas

    from robots.mobile.body import MobileBody

HELLO: Final = "Hello!"
"""What is said at B."""
PLEASE: Final = "Please put the book on my top side!"
"""And shown there."""
JOBS: Final = (MoveJob(1, "B"), VoiceJob(2, HELLO), MessageJob(3, PLEASE), WaitJob(4), MoveJob(5, "A"))
"""The paper's list."""
OPENS, BROUGHT, KEY = 18.0, 36.0, 40.0
"""When the front door opens, the book is put on top, and the key is pressed [s]."""
LONGEST = 150.0
"""A run that isn't over by then has failed [s]."""
_MEETS = 10.5
"""So long after the key the robot comes by where somebody crosses its way [s], but for how he's drawn."""


def home(rng: np.random.Generator) -> Room:
    """The home as it is that day: who brings the book opens the front door; somebody goes through the study.

    Args:
        rng: What draws when and how fast he goes.
    """
    room = place("home")
    front = replace(room.doors[0], times=(0.0, OPENS, OPENS + 2.0), shares=(0.0, 0.0, 1.0))
    inside = tuple(replace(door, times=(0.0,), shares=(1.0,), repeat=False) for door in room.doors[1:])
    times = 0.0, BROUGHT - 12, BROUGHT - 8, KEY, KEY + 4
    guest = Person("guest", 0.2, 1.7, times, (4.8,) * 5, (7.95, 7.95, 7.3, 7.3, 7.95))
    speed, late = float(rng.uniform(0.4, 0.7)), float(rng.uniform(-1.5, 1.5))
    x, y = (1.5, 1.55, 2.35, 3.1), (2.6, 4.2, 4.7, 4.05)
    reached = [0.0]
    for a, b in pairwise(zip(x, y, strict=True)):
        reached.append(reached[-1] + math.dist(a, b) / speed)
    begins = KEY + _MEETS + late - reached[2]
    walker = Person("passer-by", 0.22, 1.7, tuple(t + begins for t in reached), x, y)
    return replace(room, doors=(front, *inside), people=(guest, walker))


def play(seed: int) -> Results:
    """Run the scenario in PyBullet, in virtual time.

    Args:
        seed: Of the robot's noise and slip, and of when and how fast somebody walks by.
    """
    from robots.mobile.body import MobileBody

    room = home(np.random.default_rng([seed, 1]))
    senses = Senses(camera=None, laser=LaserModel())
    with MobileBody(IPR, room=room, rng=np.random.default_rng([seed, 2]), senses=senses) as body:
        return _played(room, body)


def _played(room: Room, body: MobileBody) -> Results:
    """Drive until the list is done, or has taken too long."""
    pilot, runner, speaker = TrialPilot(body), JobRunner(), SilentSpeaker()
    places = {one.name: Goal(one.x, one.y, one.heading) for one in room.places}
    runner.load(JobList(JOBS, places), now=0.0)
    # Attempts that are carried out; 0 for none.
    moving = speaking = 0
    begun = brought = pressed = False
    asked: list[str] = []
    stops: list[Results] = []
    shown = shown_at_key = ""
    put: tuple[float, float, float] | None = None
    passed = math.inf
    while (now := body.time) < LONGEST:
        if not begun and now >= FIRST_LOOK - 1e-9:
            begun = not runner.receive(ListCommand.RUN, now=now)
        if not brought and now >= BROUGHT and runner.waits_for_key:
            body.load(Cargo())
            brought = True
        if not pressed and brought and now >= KEY:
            put, shown_at_key = body.cargo[0], shown
            pressed = not runner.receive(ListCommand.KEY, now=now)
        journey = pilot.journey
        if moving and journey.state not in GOING:
            attempt, moving = moving, 0
            stops.append(_stop(journey.goal, body.truth, pilot.posture))
            arrived = journey.state is JourneyState.ARRIVED
            runner.answer(attempt, None if arrived else journey.reason, now=now)
        if speaking and not speaker.is_speaking(now=now):
            attempt, speaking = speaking, 0
            runner.answer(attempt, now=now)
        for request in runner.advance(now=now):
            match request:
                case CarryOut(attempt, MoveJob(to=Goal() as goal)):
                    moving = attempt
                    asked.append(f"MOVE {next(name for name, one in places.items() if one == goal)}")
                    pilot.go(goal)
                case CarryOut(attempt, VoiceJob(text=text)):
                    speaking = attempt
                    asked.append(f"VOICE {text}")
                    speaker.speak(text, now=now)
                case Show(shown):
                    asked.append(f"MESSAGE {shown}")
                case EndJob():
                    journey.end()
                    moving = speaking = 0
                case CarryOut(attempt):
                    runner.answer(attempt, "there's no arm", now=now)
        if begun and not runner.running:
            break
        pilot.step()
        if pressed:
            passed = min(passed, gap(body, room.people[1]))
    lies = body.cargo[0] if body.cargo else None
    on_top = lies is not None and lies[2] > IPR.height and max(abs(lies[0] - IPR.centre_x), abs(lies[1])) < 0.2
    slid = math.inf if lies is None or put is None else math.dist(lies[:2], put[:2])
    return Results(
        stage=runner.progress.stage,  # of the list at the end
        reason=runner.progress.reason,
        asked=tuple(asked),  # what the list asked for, in its order
        shown=shown_at_key,  # what was on the screen when the key was pressed
        stops=tuple(stops),  # at B and at A
        slid=slid,  # how far the book slid on the robot [m]
        on_top=on_top,  # whether it's still there
        touched=body.collisions,
        passed=passed,  # least distance of the robot's outline from somebody on the way back [m]
        lost=pilot.lost,  # largest error of the position [m]
        time=body.time,
        track=np.array(pilot.track),  # true postures, (k, 3)
    )


def _stop(goal: Goal | None, truth: tuple[float, float, float], told: tuple[float, float, float]) -> Results:
    """How far the robot came from a goal, and how wrong it was about that."""
    assert goal is not None
    assert goal.heading is not None
    x, y, theta = truth
    return Results(
        off=math.hypot(goal.x - x, goal.y - y),  # from the place to where it really is [m]
        turned=abs(wrapped(goal.heading - theta)),  # and its heading [rad]
        lost=math.hypot(told[0] - x, told[1] - y),  # from where it took itself to be to where it was [m]
    )


def gap(body: MobileBody, walker: Person) -> float:
    """From the robot's outline to somebody, now [m]."""
    x, y, theta = body.truth
    dx, dy = (a - b for a, b in zip(walker.at(body.time), (x, y), strict=True))
    c, s = math.cos(theta), math.sin(theta)
    along, across = abs(c * dx + s * dy - IPR.centre_x), abs(c * dy - s * dx)
    return math.hypot(max(along - IPR.length / 2, 0.0), max(across - IPR.width / 2, 0.0)) - walker.radius


SECTION: Final = "section 5"
NEAR, NEAR_TURN = 0.05, 2.0
"""What counts as at B and at A [m, deg]: our own; the paper says that the robot came there."""
KNOWN = 0.01
"""Bar of the position's error there [m]; section 3 gives none: it is our own."""
ORDER: Final = ("MOVE B", f"VOICE {HELLO}", f"MESSAGE {PLEASE}", "MOVE A")
"""What the list has to ask for; WAIT asks for nothing."""
_BY = 1.5
"""Somebody who comes so near has passed near the robot [m]."""
TOGETHER: Final = 5
"""Runs are measured in so many cases."""


def measure(study: Study, case: str) -> tuple[Results, ...]:
    """Each `TOGETHER`-th run from the case's number on."""
    numbers = range(int(case), study.runs, TOGETHER)
    return tuple(play(int(np.random.SeedSequence([study.seed, k]).generate_state(1)[0])) for k in numbers)


def conclude(study: Study, measured: tuple[tuple[Results, ...], ...]) -> Findings:
    """What the paper says of its scenario."""
    found = [measured[k % TOGETHER][k // TOGETHER] for k in range(study.runs)]
    total = len(found)
    count, at_stops = partial(_count, total), partial(_at_stops, study, found)
    touches = sum(len(one.touched) for one in found)
    claims = (
        count("runs of {} in which the list was done to its end", [one.stage is JobStage.DONE for one in found]),
        count("runs of {} that asked for move, voice, message, move", [one.asked == ORDER for one in found]),
        count("runs of {} with the message on the screen until the key", [one.shown == PLEASE for one in found]),
        count("runs of {} in which the book arrived on top at A", [one.on_top and _at_a(one) for one in found]),
        count("runs of {} in which somebody passed near the robot", [one.passed < _BY for one in found]),
        Claim("touches: who passes is avoided", SECTION, "0", touches, touches == 0),
        *at_stops("position error at {} [cm]", 100 * NEAR, lambda stop: 100 * stop.off),
        *at_stops("heading error at {} [deg]", NEAR_TURN, lambda stop: math.degrees(stop.turned)),
        *at_stops("error of the localization at {} [cm]", 100 * KNOWN, lambda stop: 100 * stop.lost),
    )
    return Findings(claims, (_table(found),), (picture(found[0]),))


def _count(total: int, what: str, good: Sequence[bool]) -> Claim:
    return Claim(what.format(total), SECTION, f"{total}", sum(good), all(good))


def _at_a(one: Results) -> bool:
    return len(one.stops) == len([job for job in JOBS if isinstance(job, MoveJob)]) and one.stops[-1].off <= NEAR


def _at_stops(
    study: Study, found: Sequence[Results], what: str, bar: float, error: Callable[[Results], float]
) -> Iterator[Claim]:
    """An error at B and at A; infinite where the robot never came."""
    for k, name in enumerate("BA"):
        errors = [error(one.stops[k]) if len(one.stops) > k else math.inf for one in found]
        yield _bounded(f"{what.format(name)}: mean", bar, errors, study)


def _bounded(what: str, bar: float, values: Sequence[float], study: Study) -> Claim:
    """A mean with its interval; it holds if all values keep the bar."""
    holds = max(values) <= bar
    if not math.isfinite(max(values)):
        return Claim(what, OWN_BAR, f"≤ {bar:g} in each run", "a stop wasn't reached", met=False)
    mean = bootstrap(values, study.seed)
    return Claim(what, OWN_BAR, f"≤ {bar:g} in each run", mean.value, holds, mean.interval)


COLUMNS: Final = (
    "run", "list", "at B [cm]", "at A [cm]", "localization at B [cm]", "at A [cm], localization", "book slid [mm]",
    "passed at [m]", "touches", "largest localization error [cm]", "time [s]",
)  # fmt: skip
"""Of the table of runs."""


def _table(found: Sequence[Results]) -> Table:
    rows: list[tuple[Cell, ...]] = []
    for k, one in enumerate(found):
        offs = [100 * stop.off for stop in one.stops] + [None] * (2 - len(one.stops))
        known = [100 * stop.lost for stop in one.stops] + [None] * (2 - len(one.stops))
        slid = 1000 * one.slid if math.isfinite(one.slid) else None
        passed = one.passed if math.isfinite(one.passed) else None
        rows.append((
            k, f"{one.stage} {one.reason}".strip(), *offs, *known, slid, passed, len(one.touched), 100 * one.lost,
            one.time,
        ))  # fmt: skip
    return Table("scenario", "the scenario, run by run", COLUMNS, tuple(rows))


def picture(one: Results) -> Figure:
    """The room and the ways that were driven in it."""
    room = home(np.random.default_rng(0))

    def paint(canvas: Canvas) -> None:
        ax = canvas.subplots()
        draw_room(ax, room)
        ax.plot(one.track[:, 0], one.track[:, 1], color=REAL, label="robot")
        for spot in room.places:
            if spot.name in ("A", "B"):
                ax.plot(spot.x, spot.y, "x", color=BAD)
                ax.annotate(spot.name, (spot.x, spot.y), textcoords="offset points", xytext=(6, 6), color=INK)
        ax.plot([], [], ":", color=MUTED, label="people")
        canvas.legend(loc="outside upper center", ncols=2, fontsize=8.0, labelcolor=INK)

    return draw("kim2002_scenario", "Section 5: A to B at the door and back", paint, height=5.8)
