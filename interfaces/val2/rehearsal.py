"""A rehearsal: a program on a virtual arm alone, in virtual time, for what only planning shows."""

from __future__ import annotations

import math
import random
from dataclasses import dataclass
from typing import Final

from interfaces.val2.controller import STATEMENT, TURN
from interfaces.val2.errors import TextPosition, ValError
from interfaces.val2.motion import Arm, EngineRobot
from interfaces.val2.playing import Listeners, Player, endless, stuck
from interfaces.val2.source import SourceFile
from vrs.clock import ManualClock
from vrs.engine import Engine
from vrs.model import Array, RobotModel
from vrs.timeline import Timeline

LONGEST: Final = 600.0
"""How long a program may take [s]."""
COMPUTING: Final = 10.0
"""How much of that it may compute without a pause [s]; 5,000,000 steps."""
MOST: Final = 20
"""Places out of reach that are looked for."""


@dataclass(frozen=True, slots=True)
class RehearsalFinding:
    """Something that a rehearsal came upon."""

    error: ValError
    place: TextPosition | None
    """Where in the file."""
    grave: bool
    """Whether the program is wrong; else the rehearsal could see no farther."""


@dataclass(frozen=True, slots=True, eq=False)
class Rehearsal:
    """What a rehearsal came to."""

    findings: tuple[RehearsalFinding, ...]
    timeline: Timeline
    """What the arm did."""
    end: float
    """When the program ended, or was given up [s]."""


def rehearse(
    source: SourceFile,
    model: RobotModel,
    *,
    limit: float = LONGEST,
    listeners: Listeners | None = None,
    start: Array | None = None,
) -> Rehearsal:
    """Carry out the first program of a file, once.

    Places that the arm can't reach are passed over, so that all of them are found. What PROMPT asks isn't known,
    nor signals that `.SIGNALS` doesn't say: where the program waits for those, the rehearsal ends.

    Args:
        source: The file.
        model: The robot.
        limit: When the program is given up [s].
        listeners: Who hears what it says; nobody by default.
        start: Where the arm stands [rad], (n,); in its `nominal` pose unless given.
    """
    now, computed, clock = 0.0, 0.0, ManualClock(0.0)
    engine = Engine(model, q=model.poses["nominal"] if start is None else start, clock=clock)
    given_up: ValError | None = None
    rng = random.Random(0)  # noqa: S311 - RANDOM is no secret
    player = Player(source, Arm(EngineRobot(engine)), listeners or Listeners(), rng, skips=True)
    player.begin(0.0)
    while not player.done:
        player.advance(now)
        deadline = player.next_deadline()
        if player.done:
            break
        if len(player.errors) >= MOST:
            break
        if deadline == math.inf or now >= limit or computed >= COMPUTING:
            given_up = player.give_up(stuck() if deadline == math.inf else endless(now), now)
            break
        # The steps of one call take little more than this; longer pauses are waits.
        computed += deadline - now if deadline - now <= 4 * TURN * STATEMENT else 0.0
        now = max(now, deadline)
        clock.set(now)
    findings = tuple(
        RehearsalFinding(error, player.place(error), _grave(error, given_up)) for error in player.errors
    )
    return Rehearsal(findings, engine.timeline, now)


def _grave(error: ValError, given_up: ValError | None) -> bool:
    return error is not given_up and error.what != "No answer"
