"""The parts of the reproduction: the scenario of section 5, and the localization of section 3 on a small case."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING, Final

import numpy as np

from interfaces.jobs import JobStage
from interfaces.lab.claims import OWN_BAR, Cell, Claim, Figure, Findings, Paper, PaperPart, Study, Table
from interfaces.lab.drawing import BAD, INK, MUTED, REAL, draw
from interfaces.lab.goals.pictures import draw_room
from interfaces.lab.kim2002.scenario import HELLO, JOBS, PLEASE, Scenario, ScenarioResult, home, play
from interfaces.lab.localization.accuracy import conclude_rooms, measure_room
from interfaces.lab.statistics import bootstrap

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Canvas

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
ROOMS: Final = ("0", "1")
"""Of the localization."""


def measure(study: Study, case: str) -> tuple[ScenarioResult, ...]:
    """Each `TOGETHER`-th run from the case's number on."""
    numbers = range(int(case), study.runs, TOGETHER)
    return tuple(play(Scenario(int(np.random.SeedSequence([study.seed, k]).generate_state(1)[0]))) for k in numbers)


def conclude(study: Study, measured: tuple[tuple[ScenarioResult, ...], ...]) -> Findings:
    """What the paper says of its scenario."""
    found = [measured[k % TOGETHER][k // TOGETHER] for k in range(study.runs)]
    total = len(found)
    count = partial(_count, total)
    touches = sum(len(one.touched) for one in found)
    claims = (
        count("runs of {} in which the list was done to its end", [one.stage is JobStage.DONE for one in found]),
        count("runs of {} that asked for move, voice, message, move", [one.asked == ORDER for one in found]),
        count("runs of {} with the message on the screen until the key", [one.shown == PLEASE for one in found]),
        count("runs of {} in which the book arrived on top at A", [one.on_top and _at_a(one) for one in found]),
        count("runs of {} in which somebody passed near the robot", [one.passed < _BY for one in found]),
        Claim("touches: who passes is avoided", SECTION, "0", touches, touches == 0),
        *(_posture(study, name, k, found) for k, name in enumerate("BA")),
        *(_turn(study, name, k, found) for k, name in enumerate("BA")),
        *(_known(study, name, k, found) for k, name in enumerate("BA")),
    )
    return Findings(claims, (_table(found),), (_picture(found[0]),))


def _count(total: int, what: str, good: Sequence[bool]) -> Claim:
    return Claim(what.format(total), SECTION, f"{total}", sum(good), all(good))


def _at_a(one: ScenarioResult) -> bool:
    return len(one.stops) == len([job for job in JOBS if job.word == "MOVE"]) and one.stops[-1].off <= NEAR


def _posture(study: Study, name: str, k: int, found: Sequence[ScenarioResult]) -> Claim:
    errors = [100 * one.stops[k].off if len(one.stops) > k else math.inf for one in found]
    return _bounded(f"position error at {name} [cm]: mean", 100 * NEAR, errors, study)


def _turn(study: Study, name: str, k: int, found: Sequence[ScenarioResult]) -> Claim:
    errors = [math.degrees(one.stops[k].turned) if len(one.stops) > k else math.inf for one in found]
    return _bounded(f"heading error at {name} [deg]: mean", NEAR_TURN, errors, study)


def _known(study: Study, name: str, k: int, found: Sequence[ScenarioResult]) -> Claim:
    errors = [100 * one.stops[k].lost if len(one.stops) > k else math.inf for one in found]
    return _bounded(f"error of the localization at {name} [cm]: mean", 100 * KNOWN, errors, study)


def _bounded(what: str, bar: float, values: Sequence[float], study: Study) -> Claim:
    """A mean with its interval; it holds if all values keep the bar."""
    holds = max(values) <= bar
    if not math.isfinite(max(values)):
        return Claim(what, OWN_BAR, f"≤ {bar:g} in each run", "a stop wasn't reached", holds=False)
    mean = bootstrap(values, study.seed)
    return Claim(what, OWN_BAR, f"≤ {bar:g} in each run", mean.value, holds, mean.interval)


COLUMNS: Final = (
    "run", "list", "at B [cm]", "at A [cm]", "localization at B [cm]", "at A [cm], localization", "book slid [mm]",
    "passed at [m]", "touches", "largest localization error [cm]", "time [s]",
)  # fmt: skip
"""Of the table of runs."""


def _table(found: Sequence[ScenarioResult]) -> Table:
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


def _picture(one: ScenarioResult) -> Figure:
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


PAPER: Final = Paper(
    "kim2002",
    "Kim, Han, Kim, Kim: Internet-Based Personal Robot System using Map-Based Localization",
    (
        PaperPart("The scenario", measure, conclude, tuple(str(k) for k in range(TOGETHER))),
        PaperPart("Localization", measure_room, conclude_rooms, ROOMS),
    ),
    runs=5,
)
"""As `vrs reproduce kim2002` runs it."""
