"""Runs a compiled program: a stack of calls, each at a step, which may wait."""

from __future__ import annotations

import math
from collections.abc import Generator
from dataclasses import dataclass
from typing import Any, Final

from interfaces.val2.context import (
    ARM,
    EXTRA_STEP_COST,
    Action,
    Code,
    Context,
    Ending,
    Invoke,
    ProgramEnded,
    ProgramFailed,
    ProgramPaused,
    ProgramState,
    Traced,
    Waiting,
)
from interfaces.val2.errors import ValError
from interfaces.val2.instructions import until
from interfaces.val2.memory import VariableSlot
from interfaces.val2.printer import print_step
from interfaces.val2.signals import HIGHEST, Reaction, Reactions
from vrs.errors import VrsError

TRACE_COST: Final = 2_500
"""Steps for which one that's told by TRACE stands in addition: a person reads them."""
MOST_CALLS: Final = 1_000
"""How deep programs may call each other."""


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
        text = print_step(steps[frame.pc])
        self.context.extra_steps += TRACE_COST
        self.context.events.append(Traced(frame.name, frame.step, text, self.number))
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
