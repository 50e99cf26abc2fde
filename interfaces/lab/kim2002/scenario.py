"""Section 5: A to B before the door, "Hello!", a message, a book put on top, the key, back to A; and its claims.

The home, its doors, who walks in it and who brings the book go by the clock; the robot, its laser, its localization
and the list of jobs are those that run live. The book is a body of its own, in the robot's world of physics. Who
walks by is timed so that a robot that ignores him meets him: that one and others that lack something are the
claims' counterfactuals.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cache, partial
from itertools import pairwise
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np
from typing_extensions import override

from interfaces.jobs import CarryOut, EndJob, JobRunner, Show, SilentSpeaker
from interfaces.lab.claims import (
    OWN_BAR,
    Cell,
    Claim,
    Figure,
    Findings,
    Results,
    Study,
    Table,
    at_least,
    at_most,
)
from interfaces.lab.goals.rivals import HEEDLESS, RECKONED
from interfaces.lab.goals.study import draw_room
from interfaces.lab.goals.trial import FIRST_LOOK, Aboard, TrialPilot
from interfaces.lab.output import BAD, INK, MUTED, REAL, draw
from interfaces.messages.jobs import (
    ArmJob,
    JobList,
    JobProgress,
    JobStage,
    ListCommand,
    MessageJob,
    MoveJob,
    VoiceJob,
    WaitJob,
)
from robots.ipr.parameters import IPR
from robots.mobile.chassis import Senses
from robots.mobile.robot import BareBody, place
from robots.onboard.journey import GOING, Goal, JourneyState
from robots.onboard.laser import LaserModel
from robots.robot import USUAL_BASE, load
from robots.rooms import Person, Room
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
_CROSSED = 2.4
"""Where somebody crosses the way back [m], by x in the study."""


class Meeting(NamedTuple):
    """Where and when a robot that ignores everybody passes where somebody crosses its way."""

    after: float
    """The key [s]."""
    x: float
    """[m]."""
    y: float
    """[m]."""


@cache
def meeting() -> Meeting:
    """Drive from B towards A without anybody, and without avoidance; no physics are needed for that."""
    room = _opened(place("home"))
    a, b = room.place("A"), room.place("B")
    senses = Senses(camera=None, laser=LaserModel())
    assert b.heading is not None
    start, rng = (b.x, b.y, b.heading), np.random.default_rng(0)
    with BareBody(IPR, start, room=replace(room, people=()), rng=rng, senses=senses) as body:
        pilot = TrialPilot(body, HEEDLESS)
        pilot.go(Goal(a.x, a.y, a.heading))
        while body.truth[0] > _CROSSED:
            pilot.step()
        return Meeting(body.time, *body.truth[:2])


def _opened(room: Room) -> Room:
    """All of its doors but the front door's stand open."""
    inside = tuple(replace(door, times=(0.0,), shares=(1.0,), repeat=False) for door in room.doors[1:])
    return replace(room, doors=(room.doors[0], *inside))


def home(rng: np.random.Generator) -> Room:
    """The home as it is that day: who brings the book opens the front door; somebody goes through the study.

    Args:
        rng: What draws when and how fast he goes.
    """
    room = _opened(place("home"))
    front = replace(room.doors[0], times=(0.0, OPENS, OPENS + 2.0), shares=(0.0, 0.0, 1.0))
    times = 0.0, BROUGHT - 12, BROUGHT - 8, KEY, KEY + 4
    guest = Person("guest", 0.2, 1.7, times, (4.8,) * 5, (7.95, 7.95, 7.3, 7.3, 7.95))
    speed, late = float(rng.uniform(0.4, 0.7)), float(rng.uniform(-0.4, 0.4))
    met = meeting()
    x, y = (1.5, 1.55, met.x, 3.2), (2.6, 4.2, met.y, 5.95)
    reached = [0.0]
    for a, b in pairwise(zip(x, y, strict=True)):
        reached.append(reached[-1] + math.dist(a, b) / speed)
    begins = KEY + met.after + late - reached[2]
    walker = Person("passer-by", 0.22, 1.7, tuple(t + begins for t in reached), x, y)
    return replace(room, doors=(front, *room.doors[1:]), people=(guest, walker))


class UnwaitingRunner(JobRunner):
    """Asks for each job as soon as for the one before: it waits for no answer and no key."""

    @override
    def _ask(self, job: MoveJob | VoiceJob | WaitJob | ArmJob, before: JobProgress, now: float) -> None:
        super()._ask(job, before, now)
        self._finish(now)


@dataclass(frozen=True, slots=True)
class Cast:
    """Who plays: the product's own, but for what a counterfactual has in its place."""

    aboard: Aboard = field(default_factory=Aboard)
    runner: type[JobRunner] = JobRunner
    book: Cargo = field(default_factory=Cargo)


OURS, HEEDLESS_ROBOT, RECKONING, SLIPPERY, UNWAITING = "ours", "heedless", "reckoning", "slippery", "unwaiting"
CASTS: Final = {
    OURS: Cast(),
    HEEDLESS_ROBOT: Cast(HEEDLESS),
    RECKONING: Cast(RECKONED),
    SLIPPERY: Cast(book=Cargo(friction=0.005)),
    UNWAITING: Cast(runner=UnwaitingRunner),
}
"""By name."""


def play(seed: int, who: str = OURS, body: str = "") -> Results:
    """Run the scenario with physics, in virtual time.

    Args:
        seed: Of the robot's noise and slip, and of when and how fast somebody walks by.
        who: Plays: one of `CASTS`.
        body: Of the robot, by its world; the usual one unless given.
    """
    room = home(np.random.default_rng([seed, 1]))
    senses = Senses(camera=None, laser=LaserModel())
    with load(USUAL_BASE).body(body)(room=room, rng=np.random.default_rng([seed, 2]), senses=senses) as robot:
        return _played(room, robot, CASTS[who])


def _played(room: Room, body: MobileBody, cast: Cast) -> Results:
    """Drive until the list is done, something was touched, the book has fallen, or it has taken too long."""
    pilot, runner, speaker = TrialPilot(body, cast.aboard), cast.runner(), SilentSpeaker()
    places = {one.name: Goal(one.x, one.y, one.heading) for one in room.places}
    runner.load(JobList(JOBS, places), now=0.0)
    # Attempts that are carried out; 0 for none.
    moving = speaking = 0
    begun = brought = pressed = False
    in_turn = True
    asked: list[str] = []
    stops: list[Results] = []
    shown = shown_at_key = ""
    put: tuple[float, float, float] | None = None
    passed = math.inf
    while (now := body.time) < LONGEST and not body.collisions and (not brought or _is_on_top(body)):
        if not begun and now >= FIRST_LOOK - 1e-9:
            begun = not runner.receive(ListCommand.RUN, now=now)
        if not brought and now >= BROUGHT and runner.waits_for_key:
            body.load(cast.book)
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
                    in_turn = in_turn and pressed == bool(asked)
                    asked.append(f"MOVE {next(name for name, one in places.items() if one == goal)}")
                    pilot.go(goal)
                case CarryOut(attempt, VoiceJob(text=text)):
                    speaking = attempt
                    in_turn = in_turn and len(stops) == 1
                    asked.append(f"VOICE {text}")
                    speaker.speak(text, now=now)
                case Show(shown):
                    in_turn = in_turn and len(stops) == 1 and not speaker.is_speaking(now=now)
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
    # Of a stop that wasn't reached it's told how far off the robot was in the end.
    left = [_stop(places[name], body.truth, pilot.posture) for name in ("B", "A")[len(stops) :]]
    slid = math.inf if lies is None or put is None else math.dist(lies[:2], put[:2])
    return Results(
        stage=runner.progress.stage,  # of the list at the end
        reason=runner.progress.reason,
        asked=tuple(asked),  # what the list asked for, in its order
        in_turn=in_turn,  # whether each was asked for when the one before was done
        shown=shown_at_key,  # what was on the screen when the key was pressed
        stops=(*stops, *left),  # at B and at A
        slid=slid,  # how far the book slid on the robot [m]
        on_top=_is_on_top(body),  # whether it's still there
        touched=body.collisions,
        passed=passed,  # least distance of the robot's outline from somebody on the way back [m]
        lost=pilot.lost,  # largest error of the position [m]
        time=body.time,
        track=np.array(pilot.track),  # true postures, (k, 3)
    )


def _is_on_top(body: MobileBody) -> bool:
    """Whether the book lies there."""
    return any(z > IPR.height and max(abs(x - IPR.centre_x), abs(y)) < 0.2 for x, y, z in body.cargo)


def _stop(goal: Goal | None, truth: tuple[float, float, float], told: tuple[float, float, float]) -> Results:
    """How far the robot is from a goal, and how wrong about that."""
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
TOGETHER: Final = 5
"""Runs are measured in so many cases."""
RIVALS: Final = (HEEDLESS_ROBOT, RECKONING, SLIPPERY, UNWAITING, UNWAITING)
"""What each case measures beside them, with the seed of its first run."""


class Measured(NamedTuple):
    """Of a case."""

    runs: tuple[Results, ...]
    rival: Results


def measure(study: Study, case: str) -> Measured:
    """Each `TOGETHER`-th run from the case's number on, and one of a robot that lacks something."""

    def seed(k: int) -> int:
        return int(np.random.SeedSequence([study.seed, k]).generate_state(1)[0])

    first = int(case)
    runs = tuple(play(seed(k), body=study.body) for k in range(first, study.runs, TOGETHER))
    return Measured(runs, play(seed(first), RIVALS[first], study.body))


def conclude(study: Study, measured: tuple[Measured, ...]) -> Findings:
    """What the paper says of its scenario, beside robots that lack what it takes."""
    found = [measured[k % TOGETHER].runs[k // TOGETHER] for k in range(study.runs)]
    rivals = {
        name: [one.rival for who, one in zip(RIVALS, measured, strict=True) if who == name] for name in RIVALS
    }
    count, at_stops = partial(_count, found, rivals), partial(_at_stops, found, rivals[RECKONING])
    claims = (
        count("in which the list was done to its end", HEEDLESS_ROBOT, lambda one: one.stage is JobStage.DONE),
        count("in which nobody and nothing was touched", HEEDLESS_ROBOT, lambda one: not one.touched),
        count(
            "that asked for move, voice, message, move, each when the one before was done", UNWAITING,
            lambda one: one.asked == ORDER and one.in_turn,
        ),
        count("with the message on the screen until the key", UNWAITING, lambda one: one.shown == PLEASE),
        count("in which the book arrived on top at A", SLIPPERY, lambda one: one.on_top and _at_a(one)),
        *at_stops("position error at {} [cm]", 100 * NEAR, lambda stop: 100 * stop.off),
        *at_stops("heading error at {} [deg]", NEAR_TURN, lambda stop: math.degrees(stop.turned)),
        *at_stops("error of the localization at {} [cm]", 100 * KNOWN, lambda stop: 100 * stop.lost),
    )  # fmt: skip
    rows = [("ours", one) for one in found] + [(WITHOUT[name], one) for name in WITHOUT for one in rivals[name]]
    return Findings(claims, (_table(rows),), (picture(found[0]),))


WITHOUT: Final = {
    HEEDLESS_ROBOT: "no avoidance",
    RECKONING: "odometry alone",
    SLIPPERY: "friction 0.005 under the book",
    UNWAITING: "jobs asked for without waiting",
}
"""What each of them lacks."""


def _count(
    found: Sequence[Results],
    rivals: dict[str, list[Results]],
    what: str,
    without: str,
    good: Callable[[Results], bool],
) -> Claim:
    """All runs are to be good, and those without something aren't."""
    share, other = (100 * sum(map(good, runs)) / len(runs) for runs in (found, rivals[without]))
    return at_least(f"of {len(found)} runs {what} [%]", SECTION, 100, share, (WITHOUT[without], other))


def _at_a(one: Results) -> bool:
    return bool(one.stops[-1].off <= NEAR)


def _at_stops(
    found: Sequence[Results], reckoned: Sequence[Results], what: str, bar: float, error: Callable[[Results], float]
) -> Iterator[Claim]:
    """The largest error at B and at A, and without localization."""
    for k, name in enumerate("BA"):
        ours, others = ([error(one.stops[k]) for one in runs] for runs in (found, reckoned))
        text = f"{what.format(name)}: largest of {len(found)} runs"
        yield at_most(text, f"{SECTION}; {OWN_BAR}", bar, max(ours), (WITHOUT[RECKONING], max(others)))


COLUMNS: Final = (
    "who", "list", "at B [cm]", "at A [cm]", "localization at B [cm]", "at A [cm], localization", "book slid [mm]",
    "passed at [m]", "touches", "largest localization error [cm]", "time [s]",
)  # fmt: skip
"""Of the table of runs."""


def _table(found: Sequence[tuple[str, Results]]) -> Table:
    rows: list[tuple[Cell, ...]] = []
    for who, one in found:
        offs = [100 * stop.off for stop in one.stops]
        known = [100 * stop.lost for stop in one.stops]
        slid = 1000 * one.slid if math.isfinite(one.slid) else None
        passed = one.passed if math.isfinite(one.passed) else None
        rows.append((
            who, f"{one.stage} {one.reason}".strip(), *offs, *known, slid, passed, len(one.touched), 100 * one.lost,
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
