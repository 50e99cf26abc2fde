"""The controller: memory, signals and an arm, and the program that runs on them.

It's a state machine: whoever drives it calls `advance` with the time, now and at `next_deadline`. What programs and
commands bring about comes out of `advance` alone, so that several monitors may look at one controller.
"""

from __future__ import annotations

import math
import random
from collections.abc import Callable, MutableMapping, Sequence
from dataclasses import dataclass
from typing import Final

from interfaces.val2.compiler import compiled, runs_beside_program, standalone_error
from interfaces.val2.context import Context, Event, ProgramFailed
from interfaces.val2.errors import ValError
from interfaces.val2.expressions import Expressions
from interfaces.val2.interpreter import ProgramState, Task
from interfaces.val2.memory import LONGEST_STRING, VariableSlot
from interfaces.val2.motion.arm import Arm
from interfaces.val2.signals import SignalRule
from interfaces.val2.syntax import (
    Expression,
    Program,
    Step,
    Variable,
)  # fmt: skip
from interfaces.val2.values import Value

STATEMENT: Final = 2e-6
"""Session time that a step of computing takes [s]."""
TURN: Final = 500
"""Steps that are done at once; then time passes."""
MOST_AT_ONCE: Final = 2_500
"""Where the driver is late, some of what was missed is caught up with: never more steps than these."""


@dataclass(frozen=True, slots=True)
class ControllerStatus:
    """What STATUS shows."""

    state: ProgramState
    program: str = ""
    """Where it runs or stands: the innermost call."""
    step: int = 0
    """From 1; of a paused program the one that it stands at."""
    cycles_left: int = 0
    """With the present one; negative for ever."""
    stack: tuple[tuple[str, int], ...] = ()
    """Programs and steps, outermost first."""
    word: str = ""
    """Why it stands: PAUSE, ABORT, XSTEP or ERROR; or how it ended."""


class Controller(Context):
    """One controller."""

    def __init__(
        self,
        arm: Arm,
        *,
        parameters: MutableMapping[str, float] | None = None,
        rng: random.Random | None = None,
        now: float = 0.0,
    ) -> None:
        """Join what a controller needs.

        Args:
            arm: What moves.
            parameters: Shared with the arm where it reads some; those that are missing are added.
            rng: Of RANDOM.
            now: Session time [s]; timers begin here.
        """
        super().__init__(arm, compiled, now=now)
        if rng is not None:
            self.rng = rng
        if parameters is not None:
            for name, value in self.parameters.items():
                parameters.setdefault(name, value)
            self.parameters = parameters
        self.timers = [now] * len(self.timers)
        self.cell: tuple[SignalRule, ...] = ()
        """What sets the inputs; begins anew at every EXECUTE."""
        self._program: Task | None = None
        self._do: Task | None = None
        self._busy = now
        self._due = False

    @property
    def running(self) -> bool:
        """Whether a program runs."""
        return self._program is not None and self._program.state is ProgramState.RUNNING

    @property
    def doing(self) -> bool:
        """Whether a DO is under way."""
        return self._do is not None

    def status(self) -> ControllerStatus:
        """What the program does."""
        task = self._program
        if task is None:
            return ControllerStatus(ProgramState.IDLE)
        stack = tuple((f.name, f.step) for f in task.frames)
        return ControllerStatus(task.state, *stack[-1], task.cycles, stack, task.word)

    # Commands.

    def execute(
        self,
        name: str,
        arguments: Sequence[Expression] = (),
        *,
        cycles: int = 1,
        step: int = 1,
        single: bool = False,
        now: float,
    ) -> None:
        """EXECUTE, XSTEP: run a program.

        Args:
            name: The program.
            arguments: Names by reference, other expressions by value.
            cycles: How often; negative for ever.
            step: First step, from 1.
            single: Whether it pauses after each step.
            now: Session time [s].

        Raises:
            ValError: If one runs, or this one is missing or not right.
        """
        self._free()
        self.now = max(now, self.now)
        code = self.code(name)
        x = Expressions(self)
        slots = [x.reference(a)([]) if isinstance(a, Variable) else VariableSlot(x.value(a)([])) for a in arguments]
        task = Task(self, code, slots, cycles=cycles, step=step, single=single)
        values = [self._condition(rule) for rule in self.cell]
        self.arm.begin_program()
        self.reactions.clear()
        self.warned.clear()
        self.stop_first = False
        self._program, self._due = task, True
        self.signals.begin(self.cell, values, now=self.now)

    def _condition(self, rule: SignalRule) -> Callable[[], bool]:
        """What a rule follows; false where its expression has no value."""
        test = Expressions(self).condition(rule.value)

        def holds() -> bool:
            try:
                return test([])
            except ValError:
                return False

        rule.require_valid()
        return holds

    def do(self, step: Step, *, now: float) -> None:
        """DO: one step. While a program runs: those alone that take no time.

        Raises:
            ValError: If it can't stand alone, or must not now; what goes wrong while it's done is an event.
        """
        if (misplaced := standalone_error(step)) is not None:
            raise misplaced
        if self._do is not None or (self.running and not runs_beside_program(step)):
            raise ValError("Program already running")
        self.now = max(now, self.now)
        code = compiled(Program("", steps=(step,), dialect=self.dialect), self)
        if not self.running:
            self.warned.clear()
            self._do, self._due = Task(self, code, [], cycles=1), True
            return
        try:
            code.steps[0](code.slots([]))
        except ValError as error:
            self.events.append(ProgramFailed(error))
        self._due = True

    def release_scheduled(self, *, now: float) -> None:
        """End a DO whose motion is accepted but begins later, without waiting for it; else nothing."""
        self.now = max(now, self.now)
        if self._do is None or self.asking:
            return
        try:
            scheduled = self.arm.answered(now=self.now) and not self.arm.ready(now=self.now)
            word = "DO"
        except ValError as error:
            self.events.append(ProgramFailed(error))
            scheduled, word = True, "ERROR"
        if scheduled:
            self._do.end(word)
            self._do = None
            self._due = True

    def abort(self, *, now: float) -> None:
        """ABORT: the arm brakes within its limits; a program stands, and can go on; a DO is over."""
        self.now = max(now, self.now)
        if self._do is not None:
            self._do.end("ABORT")
            self._do = None
        elif self._program is not None and self.running:
            self._program.pause("ABORT")
        self._due = True
        self.arm.brake(now=self.now)

    def interrupt(self, error: ValError, *, now: float) -> None:
        """Give up what runs, for a reason that isn't its own: a program stands, and RETRY may go on; a DO is over.

        The arm isn't told to stop: somebody else does that, or has other plans.
        """
        self.now = max(now, self.now)
        task = self._active()
        if task is None:
            return
        task.fail(error)
        self._do = None
        self._due = True
        self.arm.give_up(now=self.now)

    def proceed(self, *, single: bool = False, now: float) -> None:
        """PROCEED, XSTEP: go on, with the next step where one was given up.

        Args:
            single: Whether it pauses after that step.
            now: Session time [s].

        Raises:
            ValError: If there's nothing to go on with.
        """
        self._paused(now).go_on(again=False, single=single)

    def retry(self, *, now: float) -> None:
        """RETRY: go on, with the motion and the step that were given up.

        Raises:
            ValError: If there's nothing to go on with.
        """
        task = self._paused(now)
        self.arm.retry(now=self.now)
        task.go_on(again=True)

    def kill(self, *, now: float) -> None:
        """KILL: what stands can't go on any more.

        Raises:
            ValError: If nothing does.
        """
        self._paused(now).end("KILL")

    def finish(self) -> None:
        """DONE: the present cycle of a program is its last.

        Raises:
            ValError: If none runs.
        """
        if self._program is None or not self.running:
            raise ValError("No program running")
        self._program.cycles = 1

    def answer(self, text: str, *, now: float) -> None:
        """A line for the PROMPT that asked.

        Raises:
            ValError: If none asks.
        """
        if not self.asking:
            raise ValError("No program asks")
        self.now = max(now, self.now)
        self.answers.append(text[:LONGEST_STRING])
        self._due = True

    def evaluate(self, expression: Expression, *, now: float) -> Value:
        """The value of an expression.

        Raises:
            ValError: If it has none.
        """
        self.now = max(now, self.now)
        value: Value = Expressions(self).value(expression)([])
        return value

    def forget(self) -> None:
        """ZERO: no program, no variables; outputs off.

        Raises:
            ValError: If a program runs.
        """
        self._free()
        self._program = None
        self.memory.clear()
        self.compiled.clear()
        self.signals.reset()
        self._due = True

    def _free(self) -> None:
        if self.running or self._do is not None:
            raise ValError("Program already running")

    def _paused(self, now: float) -> Task:
        self._free()
        if self._program is None or self._program.state is not ProgramState.PAUSED:
            raise ValError("No program to proceed")
        self.now = max(now, self.now)
        self._due = True
        return self._program

    # Time.

    def _active(self) -> Task | None:
        return self._do or (self._program if self.running else None)

    def advance(self, *, now: float) -> tuple[Event, ...]:
        """Let time come to now.

        Args:
            now: Session time [s]; it doesn't go back.

        Returns:
            What has happened, oldest first.
        """
        self.now = now = max(now, self.now)
        self.signals.advance(now=now)
        self.arm.renew(now=now)
        self._due |= self.notice()
        task = self._active()
        if task is None:
            self._due = False
        elif self._busy <= now:
            self._due = False
            start = now if task.waiting else max(self._busy, now - (MOST_AT_ONCE - TURN) * STATEMENT)
            done = task.run(TURN + round((now - start) / STATEMENT))
            self._busy = start + done * STATEMENT
            self.signals.advance(now=now)
            self._due |= self.notice()
            if task is self._do and task.state is not ProgramState.RUNNING:
                self._do = None
        events = tuple(self.events)
        self.events.clear()
        return events

    def next_deadline(self) -> float:
        """When `advance` has something to do [s]: a time that is over for at once, infinity for never."""
        if self.events or self.signals.changed:
            return self.now
        task = self._active()
        if task is None:
            wanted = self.now if self._due else math.inf
        else:
            wanted = max(self._busy, task.next_deadline() if task.waiting and not self._due else self._busy)
        return min(wanted, self.signals.next_deadline(), self.arm.renewal())
