"""Programs as closures, a step each, that return the next step's index; which steps may stand alone.

What a step can't be is said when it's reached, so that a program runs as far as it's right; a broken structure is
said at once.
"""

from __future__ import annotations

from interfaces.val2.context import Code, Context, StepFunction, Warned
from interfaces.val2.errors import ValError
from interfaces.val2.forms import PASSED, UNAVAILABLE
from interfaces.val2.grammar import undefined
from interfaces.val2.instructions import STATEMENTS, ProgramCompiler
from interfaces.val2.memory import Slots
from interfaces.val2.syntax import Instruction, Program, Step


def compiled(program: Program, context: Context) -> Code:
    """Compile a program.

    Raises:
        ValError: If its structures don't match, or a label is missing.
    """
    x = ProgramCompiler(program, context)
    steps = [_whatever(x, n, step.statement) for n, step in enumerate(program.steps)]
    steps.append(compiled_step(x, len(steps), Instruction("RETURN")))
    return Code(program, steps, x.names, len(x.kept))


def _whatever(x: ProgramCompiler, n: int, i: Instruction) -> StepFunction:
    """A step; of one that can't be, what fails when it's reached."""
    try:
        return compiled_step(x, n, i)
    except ValError as error:
        failure = error

    def fail(_: Slots) -> int:
        raise failure

    return fail


def compiled_step(x: ProgramCompiler, n: int, i: Instruction) -> StepFunction:
    """A step of a program, counted from 0.

    Raises:
        ValError: If it can never be done, by its text.
    """
    if (error := undefined(i)) is not None:
        raise error
    act = STATEMENTS[i.keyword].act if i.passed is None else _passed_over
    assert act is not None
    made: StepFunction = act(x, i, n)
    return made


def _passed_over(x: ProgramCompiler, i: Instruction, n: int) -> StepFunction:
    if i.keyword in UNAVAILABLE:
        raise ValError("Not available", f"{i.keyword}: {UNAVAILABLE[i.keyword]}", place=i.at)
    why = f": {PASSED[i.keyword]}" if i.keyword in PASSED else ""
    warning = Warned(f"{i.keyword} is passed over{why}, program {x.program.name}, step {n + 1}")

    def warn(_: Slots) -> int:
        x.context.warn(warning)
        return n + 1

    return warn


def standalone_error(step: Step) -> ValError | None:
    """Why a step can't stand alone, as DO wants it; None if it can."""
    i = step.statement
    if i.passed is None and "program" in STATEMENTS[i.keyword].tags:
        return ValError("Control structure error", "it's for programs", place=step.at)
    return None


def runs_beside_program(step: Step) -> bool:
    """Whether a step takes no time and moves nothing."""
    i = step.statement
    if i.passed is not None or (i.keyword == "SPEED" and "MONITOR" not in i.words):
        return False
    return "beside" in STATEMENTS[i.keyword].tags
