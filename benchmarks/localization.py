"""What a scan of 361 beams costs the robot that finds its place by it; drives are recorded, so no ray is cast."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from typing import TYPE_CHECKING

from interfaces.lab.localization.trial import PostureSource, body_of, furnished, setting, wander
from robots.mobile.floor_plan import plan_map
from robots.onboard.driving import Drive
from robots.onboard.global_localization import locate
from robots.onboard.laser import LaserScan
from robots.onboard.localization import PaperLocalizer
from robots.onboard.localizer import Localizer
from robots.onboard.map_building import MapBuilder, Surveyor

if TYPE_CHECKING:
    from benchmarks.results import Part

Step = tuple[float, tuple[float, float, float], LaserScan | None]
"""Time, odometry and a scan that is new then."""
LENGTH = 30.0
ROOM = 3
"""Of the study with seed 0: with three people."""


def recorded() -> tuple[list[Step], tuple[float, float, float]]:
    """Return what a drive gave, and where it began."""
    chosen = setting(furnished(0, ROOM), ROOM, 0.03, (0, ROOM, 1))
    steps: list[Step] = []
    with body_of(chosen) as body:
        start, driver, heard = body.truth, wander(chosen), -1.0
        while body.time < LENGTH:
            scan = body.laser
            new = scan if scan is not None and scan.time > heard else None
            heard = heard if new is None else new.time
            steps.append((body.time, body.reckoned, new))
            told = driver(body.time, body.truth)
            body.drive(told.v, told.w, 3)
    return steps, start


def costs(steps: list[Step], one: PostureSource) -> list[float]:
    """Return the processor time of each scan with the odometry since the one before [s]."""
    found, spent = [], 0.0
    for t, reading, scan in steps:
        begin = time.process_time()
        one.move(t, reading)
        if scan is not None:
            one.see(scan)
        spent += time.process_time() - begin
        if scan is not None:
            found.append(spent)
            spent = 0.0
    return found


def searching() -> list[float]:
    """Return the processor time of looking for the place after a turn on the spot, in five apartments [s]."""
    found = []
    for number in range(5):
        room = furnished(1, number)
        chosen, surveyor = setting(room, number, 0.03, (1, number)), Surveyor()
        with body_of(chosen) as body:
            turn = Drive(0.0, 0.65)
            while body.time < 10.0:
                surveyor.move(body.time, body.reckoned)
                if body.laser is not None:
                    surveyor.see(body.laser)
                body.drive(turn.v, turn.w, 3)
        around, known = surveyor.surroundings(), plan_map(room)
        begin = time.process_time()
        locate(known, around)
        found.append(time.process_time() - begin)
    return found


def part() -> Part:
    """Measure."""
    from benchmarks.results import Bar, Cost, Part, Result

    steps, start = recorded()
    plan = plan_map(furnished(0, ROOM))
    makers: dict[str, Callable[[], PostureSource]] = {
        "track on a floor-plan map": lambda: Localizer(plan, start),
        "build a map": lambda: MapBuilder(start),
        "the paper's update": lambda: PaperLocalizer(plan, start),
    }
    rows = []
    for name, make in makers.items():
        spent = [cost for _ in range(3) for cost in costs(steps, make())]
        median, asked = statistics.median(spent), name.startswith("track")
        note = f"{1 / (sum(spent) / len(spent)):.0f} scans a second, the slowest {1e3 * max(spent):.1f} ms"
        rows.append(Result(name, Cost(1e6 * median), bar=Bar(median=1e4 if asked else None), note=note))
    rows.append(Result("look for the place, after a turn", Cost(1e6 * statistics.median(searching()))))
    return Part(
        "Localization",
        f"A scan of 361 beams and the odometry of 0.2 s before it, in processor time on one core; {LENGTH:g} s "
        f"of a drive among three people, {len(plan.lines)} lines on the map. No ray is cast.",
        tuple(rows),
    )
