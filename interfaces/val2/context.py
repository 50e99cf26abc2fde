"""What running programs share: memory, arm, signals, switches, parameters, timers, events; and their tasks.

One concept in over 600 lines: a task runs a compiled program, a stack of calls, each at a step, which may wait; its
steps reach out to the context, and from there to other tasks.
"""

from __future__ import annotations

import math
import random
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Generator, Mapping, MutableMapping
from dataclasses import dataclass, field
from enum import Enum
from typing import Any, Final, Protocol, TypeAlias

from interfaces.val2.errors import NOWHERE, TextPosition, ValError
from interfaces.val2.memory import Memory, Slots, VariableSlot
from interfaces.val2.motion.arm import Arm
from interfaces.val2.rows import CHANNELS, PARAMETERS, SWITCHES, TIMERS
from interfaces.val2.signals import HIGHEST, Reaction, Reactions, Signals
from interfaces.val2.syntax import Program, Step
from interfaces.val2.units import Units
from interfaces.val2.values import VAL2, VPLUS, Dialect
from vrs.errors import VrsError


@dataclass(frozen=True, slots=True)
class Typed:
    """A program wrote something."""

    text: str
    """With its line ends."""


@dataclass(frozen=True, slots=True)
class Asked:
    """A program wants a line: `Controller.answer`."""

    text: str
    """What it asks; no line end."""


@dataclass(frozen=True, slots=True)
class ProgramPaused:
    """A program stands before a step, and can go on."""

    program: str
    step: int
    """The next step, from 1."""
    word: str
    """Why: `PAUSE`, `ABORT` or `XSTEP`."""
    task: int = 0


@dataclass(frozen=True, slots=True)
class ProgramEnded:
    """A program, or a `DO`, is done."""

    program: str
    """Empty for a `DO`."""
    word: str
    """How: `END`, `STOP`, `HALT`, `ABORT` or `DO`."""
    task: int = 0


@dataclass(frozen=True, slots=True)
class ProgramFailed:
    """A program, or a `DO`, was stopped by an error."""

    error: ValError
    task: int = 0


@dataclass(frozen=True, slots=True)
class Warned:
    """Something was passed over."""

    text: str


@dataclass(frozen=True, slots=True)
class SignalChanged:
    """A signal turned on or off."""

    number: int
    on: bool


@dataclass(frozen=True, slots=True)
class Traced:
    """A step is done, and TRACE is on."""

    program: str
    number: int
    """Of the step, from 1."""
    step: Step
    task: int = 0


Event: TypeAlias = Traced | Typed | Asked | ProgramPaused | ProgramEnded | ProgramFailed | Warned | SignalChanged


StepFunction: TypeAlias = Callable[[Slots], int]
"""Does a step and returns the next one's index, or SPECIAL."""


@dataclass(frozen=True, slots=True)
class Code:
    """A compiled program."""

    program: Program
    steps: list[StepFunction]
    """One more than the program has: the last is its end."""
    names: int
    """How many names are the call's own: arguments first."""
    kept: int
    """How many FOR and CASE there are."""

    def slots(self, arguments: list[VariableSlot]) -> list[Any]:
        """What a call has of its own.

        Raises:
            ValError: If there are too many arguments.
        """
        if len(arguments) > len(self.program.parameters):
            raise ValError("Too many arguments", f"{self.program.name} takes {len(self.program.parameters)}")
        return [*arguments, *[VariableSlot() for _ in range(self.names - len(arguments))], *[None] * self.kept]


SPECIAL: Final = -1
"""What a step returns instead of the next step's index when `Context.pending` holds what is to be done."""
EXTRA_STEP_COST: Final = 9
TRACE_COST: Final = 2_500
"""Steps for which one that's told by TRACE stands in addition: a person reads them."""
MOST_CALLS: Final = 1_000
"""How deep programs may call each other."""
MOST_PERCENT: Final = 100.0
"""Of speeds and accelerations: more counts as this."""
SLICE: Final = 0.016
"""How often a wait looks at what changes with time alone [s]: V+'s cycle."""


@dataclass(frozen=True, slots=True)
class Invoke:
    """Call a program."""

    code: Code
    slots: list[Any]
    following: int
    """The caller's step after it."""


@dataclass(frozen=True, slots=True)
class Ending:
    """A call, a program or its running has ended."""

    word: str
    """`RETURN` for the call, `STOP` and `END` for the cycle, `HALT` for the program, `PAUSE` for its running; the
    arm stands but for RETURN."""
    step: int = 0
    """Index of the step to go on with after PAUSE; of RETURN, how many of the caller's steps are passed over."""


@dataclass(frozen=True, slots=True)
class Waiting:
    """Wait; the generator yields when it wants to be asked again, and returns the next step's index."""

    process: Wait
    interruptible: bool = False
    """Whether a reaction may come in between, and the wait goes on after it."""


ARM: Final = -1.0
"""What a wait yields for the arm's own deadline."""
Wait: TypeAlias = Generator[float, None, "int | Ending"]
Action: TypeAlias = "Invoke | Ending | Waiting | int"
"""What a special step wants done; a number is the next step's index, after reactions have been looked at."""


class ProgramState(Enum):
    """What a program does."""

    IDLE = "idle"
    """It has ended."""
    RUNNING = "running"
    PAUSED = "paused"
    """It can go on: after PAUSE, ABORT, a single step or an error."""


PROCESS_CONTROL: Final = 1
"""The task of VAL-II's process control program."""


@dataclass(slots=True)
class Context(ABC):
    """What the closures of compiled programs reach out to."""

    arm: Arm
    compile: Callable[[Program, Context], Code]
    """Makes closures of a program; see `interfaces.val2.compiler.compiled`."""
    memory: Memory = field(default_factory=Memory)
    signals: Signals = field(default_factory=Signals)
    reactions: Reactions = field(default_factory=Reactions)
    """Of the main program, and of a DO."""
    tasks: Mapping[int, Task] = field(default_factory=dict)
    """Those that run or stand, or have ended; by number."""
    task: Task | None = None
    """The one whose steps are done now."""
    switches: dict[str, bool] = field(default_factory=lambda: {s.name: bool(s.default) for s in SWITCHES.values()})
    parameters: MutableMapping[str, float] = field(
        default_factory=lambda: {p.name: p.default for p in PARAMETERS.values()}
    )
    channels: dict[str, dict[int, float]] = field(
        default_factory=lambda: {word: dict.fromkeys(CHANNELS, 0.0) for word in ("ADC", "DAC", "IOGET", "IOPUT")}
    )
    """Simulated values of analogue inputs and outputs and of ports, by what reads or sets them in a program."""
    path: tuple[bool | None, bool | None] = (None, None)
    """Whether the arm goes round the ends of the last motion and the next, by CPON and CPOFF; None: as CP says."""
    units: Units = field(default_factory=Units)
    """Files of programs."""
    rng: random.Random = field(default_factory=lambda: random.Random(0))  # noqa: S311
    now: float = 0.0
    timers: list[float] = field(default_factory=lambda: [0.0] * len(TIMERS))
    """When each was 0."""
    events: deque[Event] = field(default_factory=deque)
    pending: Action = 0
    stop_first: bool = False
    """Whether the next motion begins at rest: a configuration was asked for."""
    due: bool = False
    """Whether something that waits is to be looked at again."""
    extra_steps: int = 0
    """Steps for which a dear one stands in addition."""
    dropped: int = 0
    """How often a REACTI braked before the motion that was asked for last had begun."""
    moved: bool = False
    """Whether a motion has been asked for."""
    braked: bool = False
    """Whether BRAKE or REACTI stopped the last motion."""
    asking: bool = False
    """Whether a PROMPT waits for a line."""
    answers: deque[str] = field(default_factory=lambda: deque(maxlen=1))
    """The line that answers a PROMPT."""

    compiled: dict[str, Code] = field(default_factory=dict)
    """Programs that were compiled, by name."""
    warned: set[Warned] = field(default_factory=set)

    @property
    def dialect(self) -> Dialect:
        """In which angles are at the prompt, and in files that don't say."""
        return VPLUS if self.parameters["VPLUS"] else VAL2

    def code(self, name: str, at: TextPosition = NOWHERE) -> Code:
        """A program, compiled anew where it was changed.

        Raises:
            ValError: If there's none, or its structures don't match.
        """
        program = self.memory.programs.get(name)
        if program is None:
            raise ValError("Undefined program name", name, place=at)
        code = self.compiled.get(name)
        if code is None or code.program is not program:
            code = self.compiled[name] = self.compile(program, self)
        return code

    def go_on(self, following: int) -> int:
        """Go on after a dear step: one of locations or text, which takes as long as ten others."""
        self.extra_steps += EXTRA_STEP_COST
        self.pending = following
        return SPECIAL

    def notice(self) -> bool:
        """Tell of the signals that have turned, and let the program react to them; whether there are any."""
        changes = self.signals.changes()
        for number, on in changes:
            self.events.append(SignalChanged(number, on))
            for reactions in (self.reactions, *(task.reactions for n, task in self.tasks.items() if n)):
                reactions.notice(number, on)
        return bool(changes)

    def warn(self, warning: Warned) -> None:
        """Warn, once an EXECUTE."""
        if warning not in self.warned:
            self.warned.add(warning)
            self.events.append(warning)

    def capped(self, word: str, value: float, most: float = MOST_PERCENT, unit: str = "%") -> None:
        """Say that a value counts as less where it's more than can be."""
        if value > most:
            self.warn(Warned(f"{word} {value:.9g} {unit} counts as {most:.9g} {unit}"))

    def switch(self, name: str, on: bool) -> None:
        """ENABLE or DISABLE.

        Raises:
            ValError: If there's no such switch.
        """
        if name not in self.switches:
            raise ValError("Unknown switch", f"{name}: one of {', '.join(sorted(self.switches))}")
        if name == "CP":
            self.arm.set_continuous_path(on)
        elif name == "DRY.RUN":
            self.arm.set_dry_run(on)
        self.switches[name] = on

    def parameter(self, name: str, value: float) -> None:
        """PARAMETER: set one.

        Raises:
            ValError: If there's no such parameter, or the value is out of its range.
        """
        if name not in self.parameters or name not in PARAMETERS:
            raise ValError("Unknown parameter", f"{name}: one of {', '.join(sorted(self.parameters))}")
        PARAMETERS[name].require(value)
        self.parameters[name] = value

    def brake(self) -> None:
        """BRAKE, REACTI: stop the present motion at once."""
        self.braked = not self.arm.settled(now=self.now)
        self.arm.brake(now=self.now)

    # Tasks.

    @abstractmethod
    def begin(
        self, number: int, code: Code, arguments: list[VariableSlot], *, cycles: int, step: int, single: bool
    ) -> Task:
        """Run a program as a task.

        Raises:
            ValError: If that task runs, or the main one wants the arm and another has it.
        """

    def abort_task(self, number: int) -> None:
        """ABORT: a task that runs stands; the arm brakes if it's that task's."""
        task = self.tasks.get(number)
        if task is not None and task.state is ProgramState.RUNNING:
            task.pause("ABORT")
            if task.robot:
                self.arm.brake(now=self.now)

    def come(self, now: float | None) -> None:
        """Let time come to now [s], if it's said, and look after what waits."""
        self.now, self.due = self.now if now is None else max(now, self.now), True

    def proceed(
        self, number: int = 0, *, again: bool = False, single: bool = False, now: float | None = None
    ) -> None:
        """PROCEED, RETRY, XSTEP: a task that stands goes on.

        Args:
            number: The task.
            again: Whether with the step that was given up, and the motion; else with the next one.
            single: Whether it pauses after that step.
            now: Session time [s].

        Raises:
            ValError: If it doesn't stand, or wants the arm, and another has it.
        """
        self.come(now)
        task = self._standing_task(number)
        self.require_free_arm(task)
        if again and task.robot:
            self.arm.retry(now=self.now)
        task.go_on(again=again, single=single)

    def kill(self, number: int = 0, *, now: float | None = None) -> None:
        """KILL: a task that stands can't go on any more.

        Raises:
            ValError: If it doesn't stand.
        """
        self.come(now)
        self._standing_task(number).end("KILL")

    def finish(self, number: int = 0, *, now: float | None = None) -> None:
        """DONE, CYCLE.END: the present cycle of a task is its last.

        Raises:
            ValError: If it doesn't run.
        """
        self.come(now)
        task = self.tasks.get(number)
        if task is None or task.state is not ProgramState.RUNNING:
            raise ValError("No program running", f"task {number}" if number else "")
        task.cycles = 1

    def _standing_task(self, number: int) -> Task:
        """A task that stands.

        Raises:
            ValError: If it doesn't.
        """
        task = self.tasks.get(number)
        if task is None or task.state is not ProgramState.PAUSED:
            raise ValError("No program to proceed", f"task {number}" if number else "")
        return task

    def task_state(self, number: int) -> float:
        """TASK: 0 where nothing has run, 1 at an end, 2 after an error, 3 while it stands, 4 while it runs."""
        task = self.tasks.get(number)
        if task is None or task.state is not ProgramState.PAUSED:
            return 0.0 if task is None else 1.0 if task.state is ProgramState.IDLE else 4.0
        return 2.0 if task.word == "ERROR" else 3.0

    def arm_holder(self) -> Task | None:
        """The task that has the arm."""
        running = (task for task in self.tasks.values() if task.state is ProgramState.RUNNING)
        return next((task for task in running if task.robot), None)

    def require_free_arm(self, task: Task) -> None:
        """See that a task may have the arm, if it wants it.

        Raises:
            ValError: If another has it.
        """
        holder = self.arm_holder()
        if task.robot and holder is not None and holder is not task:
            raise ValError("Robot attached", f"to task {holder.number}; allowed: DETACH there first")

    def require_arm(self, word: str) -> None:
        """Instructions that move the arm, or change how it moves, ask this first.

        Raises:
            ValError: If the task whose steps are done hasn't attached the arm.
        """
        task, holder = self.task, self.arm_holder()
        if task is None or holder is task or (task.robot and holder is None):
            return
        where = "the arm is detached" if holder is None else f"task {holder.number} has the arm"
        raise ValError("Robot not attached", f"{word} in task {task.number}; {where}; allowed: ATTACH first")

    def powered(self) -> None:
        """Motions ask this first.

        Raises:
            ValError: If POWER is off.
        """
        if not self.switches["POWER"]:
            raise ValError("Arm power off")


@dataclass(slots=True)
class CallFrame:
    """A call."""

    code: Code
    slots: list[Any]
    restores: float | None = None
    """Of a reaction, the priority that holds again after it."""
    pc: int = 0
    """Index of the step that runs, or waits, or is next."""
    waiting: Waiting | None = None

    @property
    def name(self) -> str:
        """The program's."""
        return self.code.program.name

    @property
    def step(self) -> int:
        """The step's number, from 1; no more than there are."""
        return min(self.pc, max(0, len(self.code.program.steps) - 1)) + 1

    def drop(self) -> None:
        """Wait no more."""
        if self.waiting is not None:
            self.waiting.process.close()
            self.waiting = None


class Task:
    """A program that runs: EXECUTE's, or the one step of a DO."""

    def __init__(
        self,
        context: Context,
        code: Code,
        arguments: list[VariableSlot],
        *,
        cycles: int,
        step: int = 1,
        single: bool = False,
        number: int = 0,
    ) -> None:
        """Stand before a step.

        Args:
            context: What it reaches out to.
            code: The program.
            arguments: By reference; the same ones in every cycle.
            cycles: How often it's run; negative for ever.
            step: The first step, from 1.
            single: Whether it pauses after each step.
            number: Of the task; the main program's and a DO's is 0.

        Raises:
            ValError: If there's no such step, or there are too many arguments.
        """
        if not 1 <= step <= max(1, len(code.program.steps)):
            raise ValError("Invalid step", f"{step}: 1 to {len(code.program.steps)}", program=code.program.name)
        self.context, self.code, self.arguments = context, code, arguments
        self.cycles, self.single = cycles, single
        self.number, self.robot, self.attaching = number, number == 0, False
        self.reactions = Reactions() if number else context.reactions
        self.state = ProgramState.RUNNING
        self.word = ""
        """Why it paused or ended."""
        self.error: ValError | None = None
        """The last one: what REACTE's program reacts to."""
        self.deadline = math.inf
        """When a wait wants to be looked at again."""
        self._done = 0
        self._interrupted = False
        self.frames = [CallFrame(code, code.slots(arguments), pc=step - 1)]

    @property
    def program(self) -> str:
        """What it was begun with; empty for a DO."""
        return self.code.program.name

    @property
    def waiting(self) -> bool:
        """Whether it waits for something else than its turn."""
        return self.frames[-1].waiting is not None

    def next_deadline(self) -> float:
        """When its wait may be over by itself [s]; infinity for never."""
        return self.context.arm.next_deadline() if self.deadline == ARM else self.deadline

    def run(self, most: int) -> int:
        """Do steps until it waits, pauses or ends.

        Args:
            most: Steps that it may do.

        Returns:
            Steps that it did.
        """
        self._done, self.context.task = 0, self
        while self._done < most and self.state is ProgramState.RUNNING:
            try:
                if not self._take_turn(most - self._done):
                    break
            except ValError as error:
                self._react_to(error)
            except VrsError as error:
                self._react_to(ValError("Motion error", str(error)))
        self.context.notice()
        self.context.task = None
        return self._done

    def _take_turn(self, most: int) -> bool:
        """Do some steps, or see whether a wait is over; whether there may be more to do."""
        self._react()
        frame = self.frames[-1]
        if frame.waiting is None:
            traced = self.context.switches["TRACE"] and self._trace(frame)
            self._compute(frame, 1 if self.single or traced else most)
            self._done += self.context.extra_steps
            self.context.extra_steps = 0
        elif not self._wait(frame):
            return False
        if self.single and self.state is ProgramState.RUNNING and not self.waiting:
            self.pause("XSTEP")
        return True

    def _trace(self, frame: CallFrame) -> bool:
        """Tell which step is done; whether there's one, a DO's not counted."""
        steps = frame.code.program.steps
        if frame.pc >= len(steps) or not frame.name:
            return False
        self.context.extra_steps += TRACE_COST
        self.context.events.append(Traced(frame.name, frame.step, steps[frame.pc], self.number))
        return True

    def _compute(self, frame: CallFrame, most: int) -> None:
        steps, slots, pc = frame.code.steps, frame.slots, frame.pc
        following, left = pc, most
        try:
            while left:
                left -= 1
                following = steps[pc](slots)
                if following < 0:
                    break
                pc = following
        finally:
            frame.pc = pc
            self._done += most - left
        if following < 0:
            self._act(self.context.pending, frame)

    def _wait(self, frame: CallFrame) -> bool:
        """Whether a wait is over."""
        assert frame.waiting is not None
        try:
            self.deadline = next(frame.waiting.process)
        except StopIteration as stop:
            frame.waiting = None
            self._act(stop.value, frame)
            return True
        return False

    def _act(self, action: Action, frame: CallFrame) -> None:
        match action:
            case int():
                frame.pc = action
            case Waiting():
                frame.waiting = action
            case Invoke(code, slots, following):
                self._push(CallFrame(code, slots))
                frame.pc = following
            case Ending("RETURN", skipped):
                self._leave(frame, skipped)
            case Ending("PAUSE", step):
                frame.pc = step
                self.pause("PAUSE")
            case Ending(word):
                self._finish(word)

    def _push(self, frame: CallFrame) -> None:
        if len(self.frames) >= MOST_CALLS:
            raise ValError("Too many calls", f"{MOST_CALLS} at most")
        self.frames.append(frame)

    def _leave(self, frame: CallFrame, skipped: int = 0) -> None:
        frame.drop()
        if len(self.frames) == 1:
            frame.waiting = Waiting(_resting(self.context, arm=self.robot))
            return
        self._release(self.frames.pop())
        self.frames[-1].pc = min(self.frames[-1].pc + skipped, len(self.frames[-1].code.program.steps))
        if frame.restores is not None:
            self.reactions.priority = frame.restores

    def _release(self, frame: CallFrame) -> None:
        for slot in frame.slots[len(frame.code.program.parameters) : frame.code.names]:
            self.context.memory.release(slot)

    def _finish(self, word: str) -> None:
        if word == "HALT" or self.cycles in (0, 1):
            self.cycles = 0
            self.end(word if self.program else "DO")
            return
        self._unwind()
        self.cycles = max(self.cycles - 1, -1)
        self.frames = [CallFrame(self.code, self.code.slots(self.arguments))]
        self.reactions.priority = 0.0
        if self.robot:
            self.context.arm.begin_program()

    def _unwind(self) -> None:
        for frame in self.frames:
            frame.drop()
            self._release(frame)

    # Reactions.

    def _react(self) -> None:
        """Call what is to be called: REACT's after the current step, or amid a WAIT; REACTI's at once."""
        self.context.notice()
        frame = self.frames[-1]
        amid = frame.waiting is not None and not frame.waiting.interruptible
        reaction = self.reactions.due(immediate=amid)
        if reaction is not None:
            self._call(reaction, frame)

    def _react_to(self, error: ValError) -> None:
        """Call what REACTE names, and go on with the next step after it; an error in it, or without it, stops."""
        self.error, self._done, trap = error, self._done + EXTRA_STEP_COST, self.reactions.on_error
        if not (trap and self.program) or self.reactions.priority >= HIGHEST:
            self.fail(error)
            return
        frame = self.frames[-1]
        try:
            self._call_program(trap, HIGHEST)
        except ValError as failure:
            self.fail(failure)
        else:
            frame.drop()
            frame.pc = min(frame.pc + 1, len(frame.code.program.steps))

    def _call_program(self, name: str, priority: float) -> None:
        code = self.context.code(name)
        self._push(CallFrame(code, code.slots([]), self.reactions.priority))
        self.reactions.priority = priority

    def _call(self, reaction: Reaction, frame: CallFrame) -> None:
        context = self.context
        if reaction.immediate:
            context.dropped += not context.arm.ready(now=context.now)
            context.brake()
        if reaction.program:
            self._call_program(reaction.program, reaction.priority)
        else:
            self._leave(frame)

    # Interruptions.

    def pause(self, word: str) -> None:
        """Stand; the present step is given up if it has begun."""
        frame = self.frames[-1]
        self._interrupted = frame.waiting is not None
        frame.drop()
        self.state, self.word = ProgramState.PAUSED, word
        self.context.events.append(ProgramPaused(frame.name, frame.step, word, self.number))

    def end(self, word: str) -> None:
        """End now."""
        self._unwind()
        self.state, self.word = ProgramState.IDLE, word
        if self.program:  # A DO leaves what a paused program watches alone.
            self.reactions.clear()
        self.context.events.append(ProgramEnded(self.program, word, self.number))

    def fail(self, error: ValError) -> None:
        """Stand at the present step, for an error."""
        frame = self.frames[-1]
        frame.drop()
        if frame.name:
            steps = frame.code.program.steps
            place = steps[frame.pc].at if frame.pc < len(steps) else None
            error = error.at(program=frame.name, step=frame.step, place=place)
        self.state, self.word, self._interrupted = ProgramState.PAUSED, "ERROR", True
        self.context.events.append(ProgramFailed(error, self.number))

    def go_on(self, *, again: bool, single: bool = False) -> None:
        """PROCEED, RETRY, XSTEP: run, from the next step or from the one that was given up."""
        frame = self.frames[-1]
        if self._interrupted and not again:
            frame.pc = min(frame.pc + 1, len(frame.code.program.steps))
        self._interrupted = False
        self.state, self.word, self.single = ProgramState.RUNNING, "", single


def _resting(context: Context, *, arm: bool) -> Generator[float, None, Ending]:
    """Wait for the arm to stand, if it's the task's, and end."""
    if arm:
        yield from until(context, context.arm.settled)
    return Ending("END")


class _Look(Protocol):
    """A look at the arm: `ready`, the last motion has begun, or `settled`, it stands."""

    def __call__(self, *, now: float) -> bool: ...


def until(context: Context, look: _Look) -> Generator[float, None, None]:
    """Wait until what was asked is answered, and the arm is as it's to be.

    Args:
        context: Of the arm.
        look: `ready` or `settled` of the arm.

    Raises:
        ValError: If what was asked was refused.
    """
    while not context.arm.answered(now=context.now) or not look(now=context.now):
        yield ARM
