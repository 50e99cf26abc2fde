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

from typing_extensions import override

from interfaces.val2.compiler import compiled, runs_beside_program, standalone_error
from interfaces.val2.context import Code, Context, Event, ProgramFailed, ProgramState, Task, Warned
from interfaces.val2.errors import ValError
from interfaces.val2.expressions import Expressions
from interfaces.val2.memory import LONGEST_STRING, VariableSlot
from interfaces.val2.motion.arm import Arm
from interfaces.val2.signals import SignalRule
from interfaces.val2.syntax import (
    Expression,
    Program,
    Step,
    Variable,
)  # fmt: skip
from interfaces.val2.units import Units
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
        units: Units | None = None,
        now: float = 0.0,
    ) -> None:
        """Join what a controller needs.

        Args:
            arm: What moves.
            parameters: Shared with the arm where it reads some; those that are missing are added.
            rng: Of RANDOM.
            units: Files of programs; none unless given.
            now: Session time [s]; timers begin here.
        """
        super().__init__(arm, compiled, now=now)
        if rng is not None:
            self.rng = rng
        if units is not None:
            self.units = units
        self.units.warn = lambda text: self.warn(Warned(text))
        if parameters is not None:
            for name, value in self.parameters.items():
                parameters.setdefault(name, value)
            self.parameters = parameters
        self.timers = [now] * len(self.timers)
        self.cell: tuple[SignalRule, ...] = ()
        """What sets the inputs; begins anew at every EXECUTE."""
        self.tasks: dict[int, Task] = {}
        self._do: Task | None = None
        self._busy = now

    @property
    def running(self) -> bool:
        """Whether the main program runs."""
        return 0 in self.tasks and self.tasks[0].state is ProgramState.RUNNING

    @property
    def doing(self) -> bool:
        """Whether a DO is under way."""
        return self._do is not None

    @property
    def busy(self) -> bool:
        """Whether any program runs."""
        return any(task.state is ProgramState.RUNNING for task in self.tasks.values())

    def status(self, number: int = 0) -> ControllerStatus:
        """What a task does, the main program unless another is asked for."""
        task = self.tasks.get(number)
        if task is None:
            return ControllerStatus(ProgramState.IDLE)
        stack = tuple((f.name, f.step) for f in task.frames)
        return ControllerStatus(task.state, *stack[-1], task.cycles, stack, task.word)

    def stacks(self) -> list[tuple[tuple[str, int], ...]]:
        """Programs and steps of each task that runs, outermost first."""
        return [self.status(n).stack for n, task in self.tasks.items() if task.state is ProgramState.RUNNING]

    # Commands.

    def execute(
        self,
        name: str,
        arguments: Sequence[Expression] = (),
        *,
        cycles: int = 1,
        step: int = 1,
        single: bool = False,
        number: int = 0,
        now: float,
    ) -> None:
        """EXECUTE, XSTEP, PCEXECUTE: run a program.

        Args:
            name: The program.
            arguments: Names by reference, other expressions by value.
            cycles: How often; negative for ever.
            step: First step, from 1.
            single: Whether it pauses after each step.
            number: As which task.
            now: Session time [s].

        Raises:
            ValError: If one runs there, or this one is missing or not right.
        """
        self.come(now)
        self._require_idle(number)
        code = self.code(name)
        x = Expressions(self)
        slots = [x.reference(a)([]) if isinstance(a, Variable) else VariableSlot(x.value(a)([])) for a in arguments]
        self.begin(number, code, slots, cycles=cycles, step=step, single=single)

    @override
    def begin(
        self, number: int, code: Code, arguments: list[VariableSlot], *, cycles: int, step: int, single: bool
    ) -> Task:
        self._require_idle(number)
        task = Task(self, code, arguments, cycles=cycles, step=step, single=single, number=number)
        self.require_free_arm(task)
        if number == 0:
            values = [self._condition(rule) for rule in self.cell]
            self.arm.begin_program()
            self.reactions.clear()
            self.warned.clear()
            self.stop_first, self.path = False, (None, None)
            self.signals.begin(self.cell, values, now=self.now)
        self.tasks[number] = task
        self.come(None)
        return task

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
        self.come(now)
        code = compiled(Program("", steps=(step,), dialect=self.dialect), self)
        if not self.running:
            self.warned.clear()
            self._do = Task(self, code, [], cycles=1)
            return
        try:
            code.steps[0](code.slots([]))
        except ValError as error:
            self.events.append(ProgramFailed(error))

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
            self.due = True

    def abort(self, number: int = 0, *, now: float) -> None:
        """ABORT: the arm brakes within its limits; a program stands, and can go on; a DO is over."""
        self.come(now)
        if number:
            self.abort_task(number)
        elif self._do is not None:
            self._do.end("ABORT")
            self._do = None
        elif self.running:
            self.tasks[0].pause("ABORT")
        if not number:
            self.arm.brake(now=self.now)

    def abort_all(self, *, now: float) -> None:
        """Stop what runs: all tasks, and the arm."""
        for task in self._active():
            if task.number:
                self.abort(task.number, now=now)
        self.abort(now=now)

    def interrupt(self, error: ValError, *, now: float) -> None:
        """Give up what moves the arm, for a reason that isn't its own: a program stands, and RETRY may go on.

        A DO is over. The arm isn't told to stop: somebody else does that, or has other plans.
        """
        self.come(now)
        task = self._do or next((t for t in self._active() if t.robot), None)
        if task is None:
            return
        task.fail(error)
        self._do = None
        self.arm.give_up(now=self.now)

    def retry(self, number: int = 0, *, now: float) -> None:
        """RETRY: go on, with the motion and the step that were given up.

        Raises:
            ValError: If there's nothing to go on with.
        """
        self.proceed(number, again=True, now=now)

    def answer(self, text: str, *, now: float) -> None:
        """A line for the PROMPT that asked.

        Raises:
            ValError: If none asks.
        """
        if not self.asking:
            raise ValError("No program asks")
        self.come(now)
        self.answers.append(text[:LONGEST_STRING])

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
        if self.busy or self._do is not None:
            raise ValError("Program already running")
        self.tasks.clear()
        self.memory.clear()
        self.compiled.clear()
        self.signals.reset()
        self.due = True

    def _require_idle(self, number: int) -> None:
        """See that nothing runs as a task.

        Raises:
            ValError: If something does.
        """
        task = self.tasks.get(number)
        if (task is not None and task.state is ProgramState.RUNNING) or (number == 0 and self._do is not None):
            raise ValError("Program already running", f"task {number}" if number else "")

    # Time.

    def _active(self) -> list[Task]:
        """What runs."""
        running = [task for _, task in sorted(self.tasks.items()) if task.state is ProgramState.RUNNING]
        return running if self._do is None else [self._do, *running]

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
        self.due |= self.notice()
        active = self._active()
        if not active:
            self.due = False
        elif self._busy <= now:
            self.due = False
            waits = all(task.waiting for task in active)
            start = now if waits else max(self._busy, now - (MOST_AT_ONCE - TURN) * STATEMENT)
            share = (TURN + round((now - start) / STATEMENT)) // len(active)
            done = sum(task.run(share) for task in active if task.state is ProgramState.RUNNING)
            self._busy = start + done * STATEMENT
            self.signals.advance(now=now)
            # What one has done, others may wait for.
            self.due |= self.notice() or (done > 0 and len(active) > 1)
            if self._do is not None and self._do.state is not ProgramState.RUNNING:
                self._do = None
        events = tuple(self.events)
        self.events.clear()
        return events

    def next_deadline(self) -> float:
        """When `advance` has something to do [s]: a time that is over for at once, infinity for never."""
        if self.events or self.signals.changed:
            return self.now
        active = self._active()
        if not active:
            wanted = self.now if self.due else math.inf
        elif self.due or not all(task.waiting for task in active):
            wanted = self._busy
        else:
            wanted = max(self._busy, min(task.next_deadline() for task in active))
        return min(wanted, self.signals.next_deadline(), self.arm.renewal())
