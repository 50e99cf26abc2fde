"""A program of a file, from its first step to its end, for whoever lets time pass; and its rehearsal.

A rehearsal is on a virtual arm alone, in virtual time, for what only planning shows.
"""

from __future__ import annotations

import math
import random
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from interfaces.val2.context import (
    Asked,
    Event,
    ProgramEnded,
    ProgramFailed,
    ProgramPaused,
    ProgramState,
    Traced,
    Typed,
    Warned,
)
from interfaces.val2.controller import STATEMENT, TURN, Controller
from interfaces.val2.corrections import Corrections, Corrector
from interfaces.val2.errors import CheckFinding, TextPosition, ValError
from interfaces.val2.motion import Arm, ArmConventions, EngineRobot
from interfaces.val2.printer import print_step
from interfaces.val2.source import SourceFile
from interfaces.val2.units import Units
from vrs.clock import ManualClock
from vrs.engine import Engine
from vrs.model import Array, RobotModel, home
from vrs.timeline import Timeline


def unheard(_text: str) -> None:
    """Nobody listens, or answers."""


@dataclass(frozen=True, slots=True)
class Listeners:
    """Who hears what a program says."""

    typed: Callable[[str], None] = unheard
    """What it TYPEs, with line ends."""
    warned: Callable[[str], None] = unheard
    """Warnings, a line each."""
    asked: Callable[[str], str | None] = unheard
    """Answers PROMPT; None where nobody does."""


class Player:
    """A controller that carries out the first program of a file, once."""

    def __init__(
        self,
        source: SourceFile,
        arm: Arm,
        listeners: Listeners,
        rng: random.Random,
        *,
        units: Units | None = None,
        skips: bool = False,
        corrections: Corrections | None = None,
    ) -> None:
        """Load the file.

        Args:
            source: The file.
            arm: What moves.
            listeners: Who hears what the program says.
            rng: Of RANDOM.
            units: Its files; none unless given.
            skips: Whether it goes on after what it can't reach, and after PAUSE.
            corrections: What comes from elsewhere for ALTER; nothing unless given.

        Raises:
            ValError: If there's no program.
        """
        if not source.programs:
            raise ValError("Undefined program name", "the file holds no program")
        self.source, self._listeners, self._skips = source, listeners, skips
        self.errors: list[ValError] = []
        """What stopped it, or what it went on after."""
        self.given_up: ValError | None = None
        """Why it was ended, for a reason of its surroundings."""
        self.done = self._ended = False
        self._controller = controller = Controller(arm, parameters=arm.parameters, rng=rng, units=units)
        for program in source.programs:
            controller.memory.programs[program.name] = program
        for entry in source.values:
            controller.memory.set(entry.variable, entry.value)
        controller.cell = source.signals
        self._corrector = None if corrections is None else Corrector(corrections, arm)

    def begin(self, now: float) -> None:
        """Execute the program.

        Raises:
            ValError: If it can't be.
        """
        self._controller.execute(self.source.programs[0].name, now=now)

    def advance(self, now: float) -> None:
        """Do what is due by now [s]."""
        for event in self._controller.advance(now=now):
            self._take(event, now)
        if self._corrector is not None:
            self._corrector.advance(now)
        self.done |= self._ended and not self._goes_on()
        if self.done and self._corrector is not None:
            for line in self._corrector.report():
                self._listeners.warned(line)
            self._corrector = None

    def next_deadline(self) -> float:
        """When something is due [s]; infinity where nothing will ever be."""
        if self.done:
            return math.inf
        corrected = math.inf if self._corrector is None else self._corrector.next_deadline()
        return min(corrected, self._controller.next_deadline())

    def expire(self, now: float, limit: float) -> None:
        """Give a program up that nothing wakes, or that hasn't ended by a time [s]."""
        if not self.done and self.next_deadline() == math.inf:
            self._give_up(ValError("Waits for ever", "no signal that it waits for will come"), now)
        if not self.done and now >= limit:
            self._give_up(ValError("Program given up", f"it hadn't ended after {limit:g} s"), now)

    def _give_up(self, error: ValError, now: float) -> None:
        status = self._controller.status()
        self.given_up = error.at(program=status.program, step=status.step)
        self.errors.append(self.given_up)
        self._controller.abort(now=now)
        self.done = True

    def _take(self, event: Event, now: float) -> None:
        match event:
            case Typed(text):
                self._listeners.typed(text)
            case Warned(text):
                self._listeners.warned(text)
            case Asked(question):
                line = self._listeners.asked(question)
                if line is None:
                    self._give_up(ValError("No answer", f"nobody answers {question!r}"), now)
                else:
                    self._controller.answer(line, now=now)
            case ProgramFailed(error, task):
                self.errors.append(error)
                self._go_on(task, now, error.what in _OUT_OF_REACH)
            case ProgramPaused(program, step, word, task):
                if word in ("ABORT", "PRIME"):
                    self._ended |= task == 0
                elif not self.done and not self._go_on(task, now, True):
                    self._listeners.warned(f"{word} in program {program} before step {step}: nobody proceeds")
            case Traced(program, number, done):
                self._listeners.warned(f"{program} {number}: {print_step(done)}")
            case ProgramEnded(task=0):
                self._ended = True

    def _go_on(self, task: int, now: float, may: bool) -> bool:
        if self._skips and may:
            self._controller.proceed(task, now=now)
            return True
        self.done |= task == 0
        return False

    def _goes_on(self) -> bool:
        """Whether the main program runs, or another that has the arm, or waits for nothing else."""
        running = [task for task in self._controller.tasks.values() if task.state is ProgramState.RUNNING]
        return any(not task.number or task.robot or task.attaching or not task.waiting for task in running)

    def place(self, error: ValError) -> TextPosition | None:
        """Where in the file an error happened; None where that's unknown."""
        for program in self.source.programs:
            if program.name == error.program and error.step is not None and error.step <= len(program.steps):
                at = program.steps[error.step - 1].at
                return TextPosition(at.line, at.column if error.place is None else error.place.column)
        return error.place if error.step is None else None


_OUT_OF_REACH: Final = ("Location out of range", "Straight line not possible")
"""Errors about where the arm can't go."""
LONGEST: Final = 600.0
"""How long a program may take [s]."""
COMPUTING: Final = 10.0
"""How much of that it may compute without a pause [s]; 5,000,000 steps."""
MOST: Final = 20
"""Places out of reach that are looked for."""


@dataclass(frozen=True, slots=True, eq=False)
class Rehearsal:
    """What a rehearsal came to."""

    findings: tuple[CheckFinding, ...]
    """Errors, and as warnings what the rehearsal couldn't see past."""
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
    files: Path | None = None,
    conventions: ArmConventions | None = None,
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
        files: Where the program's files are; what it writes doesn't get there.
        conventions: See `Arm`.
    """
    now, computed, clock = 0.0, 0.0, ManualClock(0.0)
    engine = Engine(model, q=home(model) if start is None else start, clock=clock)
    rng = random.Random(0)  # noqa: S311 - RANDOM is no secret
    units = Units(files, keeps=False)
    arm = Arm(EngineRobot(engine), conventions=conventions)
    player = Player(source, arm, listeners or Listeners(), rng, units=units, skips=True)
    player.begin(0.0)
    while True:
        player.advance(now)
        if len(player.errors) < MOST:
            player.expire(now, now if now >= limit or computed >= COMPUTING else math.inf)
        if player.done or len(player.errors) >= MOST:
            break
        # The steps of one call take little more than this; longer pauses are waits.
        deadline = player.next_deadline()
        computed += deadline - now if deadline - now <= 4 * TURN * STATEMENT else 0.0
        now = max(now, deadline)
        clock.set(now)
    findings = tuple(
        CheckFinding("warning" if error is player.given_up else "error", error, player.place(error))
        for error in player.errors
    )
    return Rehearsal(findings, engine.timeline, now)
