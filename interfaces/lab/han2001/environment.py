"""Section 3.2: the virtual environment under I to III, and in a room that changes (Fig. 13).

The figure isn't in the paper's text, so the room is drawn after its words: what stands at the centre isn't on the
map, comes after 5 s and goes after 90 s. An operator drives through there time and again.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import Any, Final, NamedTuple

import numpy as np

from interfaces.lab.claims import OWN_BAR, Findings, Study, Table, above, at_least, none_of
from interfaces.lab.driving.run import run
from interfaces.lab.han2001.architectures import TAU
from interfaces.lab.statistics import Estimate, bootstrap
from interfaces.runs.drive_run import KNOWN, DriveCase
from interfaces.teleop.architectures import Transport
from robots.ipr.model import IPR_AXLE_OFFSET, IPR_LENGTH, IPR_WIDTH
from robots.mobile.floor_plan import FloorPlan
from robots.mobile.robot import place
from robots.rooms import Room

PROFILE: Final = f"mon@{TAU}"
NEAR: Final = 0.15
"""A cell whose middle is so near to a thing shows it [m]."""
CHANGING: Final = place("fig13")
EMPTIED: Final = CHANGING.known()
"""The same room without what isn't on the map."""
MAPPED: Final = replace(
    CHANGING,
    blocks=tuple(replace(thing, known=True, start=-math.inf, end=math.inf) for thing in CHANGING.blocks),
    columns=tuple(replace(thing, known=True, start=-math.inf, end=math.inf) for thing in CHANGING.columns),
)
"""The same room with all of it on the map, from the beginning on."""
THINGS: Final = (
    *(replace(CHANGING, blocks=(thing,), columns=()) for thing in CHANGING.blocks if not thing.known),
    *(replace(CHANGING, blocks=(), columns=(thing,)) for thing in CHANGING.columns if not thing.known),
)
"""What comes and goes, each alone in the room."""
COME, GONE = CHANGING.columns[0].start, CHANGING.columns[0].end
"""When all of it does [s]."""
BLIND: Final = "the supervisor off"
EMPTY: Final = "in the room without them"
BARE: Final = "without it"
_of = partial(DriveCase, transport=Transport.STREAM, delay=PROFILE, robot="bare", operator="wander")
CASES: Final[dict[str, DriveCase]] = {
    "extended": _of("extended", room=CHANGING),
    f"extended, {BLIND}": _of("extended", room=CHANGING, environment=KNOWN),
    f"extended, {EMPTY}": _of("extended", room=EMPTIED),
    f"extended, {BLIND}, {EMPTY}": _of("extended", room=EMPTIED, environment=KNOWN),
    "III": _of("III", room=CHANGING, environment=KNOWN),
    **{f"{who}, mapped": _of(who, room=MAPPED, environment=KNOWN) for who in ("I", "II", "III")},
    f"III, mapped, {BARE}": _of("III", room=MAPPED),
}
"""What is run, by name: in the room that changes, but where `mapped` says that all of it is on the map."""


class Surrounded(NamedTuple):
    """Figures of a run."""

    learnt: float
    """Share of the things that come and go of which the virtual environment had a cell while they stood."""
    there: int
    """Cells that it held beside the map just before they went."""
    left: int
    """Cells that it held in the end."""
    collisions: int
    """Of the real robot."""
    through: float
    """Share of its time that the virtual robot stood in something."""
    error: float
    """Path error, mean [cm]."""


def work(study: Study, case: str) -> tuple[Surrounded, ...]:
    """A run a seed."""
    seeds = range(study.seed, study.seed + study.runs)
    return tuple(surrounded(replace(CASES[case], seed=seed, length=study.length)) for seed in seeds)


def surrounded(case: DriveCase) -> Surrounded:
    """Run a case, and sum it up."""
    drive = run(case)
    before = [held for t, held in drive.learned if t < GONE]
    learnt = [any(shows(thing, held) for held in before) for thing in THINGS]
    assert isinstance(case.room, Room)
    plan, driving = FloorPlan(case.room), drive.t <= case.length
    through = [
        bool(plan.touched(
            x - IPR_AXLE_OFFSET * math.cos(a), y - IPR_AXLE_OFFSET * math.sin(a), a,
            (IPR_LENGTH / 2, IPR_WIDTH / 2), t,
        ))
        for t, (x, y, a) in zip(drive.t[driving][::4].tolist(), drive.virtual[driving][::4].tolist(), strict=True)
    ]  # fmt: skip
    return Surrounded(
        float(np.mean(learnt)),
        len(before[-1]) if before else 0,
        len(drive.learned[-1][1]) if drive.learned else 0,
        drive.collisions,
        float(np.mean(through)),
        100 * (drive.compare().path_error_mean or 0.0),
    )


def shows(thing: Room, cells: Sequence[tuple[int, int]]) -> bool:
    """Whether one of some cells of 0.1 m shows a thing, alone in its room."""
    plan = FloorPlan(thing)
    return any(plan.clearance(0.1 * i + 0.05, 0.1 * j + 0.05, COME) < NEAR for i, j in cells)


def conclude(study: Study, results: tuple[Any, ...]) -> Findings:
    """The paper's claims, and the table of all that was run."""
    found: dict[str, tuple[Surrounded, ...]] = dict(zip(CASES, results, strict=True))

    def mean(who: str, figure: str) -> Estimate:
        return bootstrap([getattr(one, figure) for one in found[who]], study.seed)

    def total(who: str, figure: str) -> int:
        return sum(getattr(one, figure) for one in found[who])

    def saved(room: str) -> Estimate:
        pairs = zip(found[f"extended, {BLIND}{room}"], found[f"extended{room}"], strict=True)
        return bootstrap([off.error - on.error for off, on in pairs], study.seed)

    fig = "Section 4.1, Fig. 13"
    inside = [f"{who}, mapped" for who in ("I", "II", "III")]
    claims = (
        none_of(
            "I, II, III: the virtual environment keeps the virtual robot out of what is on the map: runs in which "
            "it stood in something",
            "Section 3.1, Fig. 5", sum(one.through > 0 for who in inside for one in found[who]),
            (BARE, sum(one.through > 0 for one in found[f"III, mapped, {BARE}"])),
        ),
        none_of(
            "III: the real robot then runs into nothing: collisions",
            "Section 4.1", total(inside[-1], "collisions"), ("I", total(inside[0], "collisions")),
        ),
        at_least(
            f"extended: the virtual environment comes to hold what stands at the centre: share of {len(THINGS)} "
            "things",
            f"{fig}(a); {OWN_BAR}", 0.9, mean("extended", "learnt"), (EMPTY, mean(f"extended, {EMPTY}", "learnt")),
        ),
        none_of(
            "extended: and forgets it when it has gone: cells left in the end",
            "Section 3.2, eq. (16)–(17)", total("extended", "left"),
            ("just before it goes", total("extended", "there")),
        ),
        none_of(
            "extended: the real robot runs into nothing that isn't on the map: collisions",
            fig, total("extended", "collisions"),
            ("III with the map alone", total("III", "collisions")),
        ),
        above(
            f"extended: the real robot is nearer to the virtual one's path by the supervisor: path error, mean, "
            f"{BLIND} − on [cm]",
            fig, 0.0, saved(""), (EMPTY, saved(f", {EMPTY}")),
        ),
    )  # fmt: skip
    rows = [
        (
            ("architecture", who),
            ("things learnt", mean(who, "learnt").value),
            ("cells before they go", mean(who, "there").value),
            ("cells in the end", mean(who, "left").value),
            ("collisions of the real robot", total(who, "collisions")),
            ("virtual robot in something, share of the time", mean(who, "through").value),
            ("path error, mean [cm]", mean(who, "error").value),
        )
        for who in found
    ]
    return Findings(claims, (Table.of("environment", f"The virtual environment, {PROFILE}", rows),))
