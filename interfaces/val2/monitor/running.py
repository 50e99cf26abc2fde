"""DO, EXECUTE, ABORT, PANIC, PROCEED, RETRY, NEXT, XSTEP, STATUS; AT, UNDO and TIMELINE, ours."""

from __future__ import annotations

import contextlib
import re
from typing import Final

from interfaces.val2.controller import ControllerStatus
from interfaces.val2.errors import ValError
from interfaces.val2.monitor import layout
from interfaces.val2.monitor.state import Style, TerminalState, integer, named, pieces
from interfaces.val2.statements import timed
from interfaces.val2.syntax import BLANK, Expression, Instruction

FOREVER: Final = -1
"""Cycles that never end."""
POWER: Final = "POWER"
"""The switch without which the arm doesn't move."""
_AT: Final = re.compile(r"(.*?)\s+DO\s+(.*)", re.DOTALL | re.IGNORECASE)


def do(state: TerminalState, rest: str) -> None:
    """DO instruction; DO alone does the last again."""
    step = state.step(rest) if rest else state.last_do
    if step is None or step.statement == BLANK:
        raise ValError("Missing argument", "DO what? An instruction follows, such as DO READY")
    state.last_do = step
    state.controller.do(step, now=state.now)


def at(state: TerminalState, rest: str) -> None:
    """AT t, AT +t, before the next motion; AT t motion, AT t DO motion in one line."""
    together, places = _AT.fullmatch(rest), timed(rest)
    when, motion = rest, ""
    if together is not None:
        when, motion = together[1], together[2]
    elif places is not None:
        when, motion = rest[: places[0]], rest[places[1] :]
    t = state.number(when.removeprefix("+"))
    state.controller.arm.at(state.now + t if when.startswith("+") else t)
    state.scheduling = True
    if motion:
        do(state, motion)


def execute(state: TerminalState, rest: str) -> None:
    """EXECUTE program(arguments), cycles, step."""
    name, arguments, cycles, step = _program(state, rest)
    state.controller.execute(name, arguments, cycles=cycles, step=step, now=state.now)


def xstep(state: TerminalState, rest: str) -> None:
    """XSTEP; XSTEP program(arguments), cycles, step begins one."""
    if not rest:
        state.controller.xstep(now=state.now)
        return
    name, arguments, cycles, step = _program(state, rest)
    if arguments:
        raise ValError("Invalid argument", f"{rest}: XSTEP gives a program no arguments")
    state.controller.xstep(name, cycles=cycles, step=step, now=state.now)


def next_(state: TerminalState, rest: str) -> None:
    """NEXT; NEXT n: so many steps of a program that stands."""
    steps = integer(rest, 1, "the number of steps")
    if not 1 <= steps <= 10_000:
        raise ValError("Invalid argument", f"{rest}: 1 to 10000 steps")
    state.controller.xstep(now=state.now)
    state.steps = steps - 1


def _program(state: TerminalState, rest: str) -> tuple[str, tuple[Expression, ...], int, int]:
    """Program, arguments, cycles and step of a line; of an empty one those of the last."""
    text = rest or state.last_run
    if not text:
        raise ValError("Missing argument", "which program?")
    called, *numbers = pieces(text)
    if len(numbers) > 2:
        raise ValError("Invalid argument", f"{rest}: program, cycles and step")
    arguments: tuple[Expression, ...] = ()
    if "(" in called:
        statement = state.instruction("CALL", called).statement
        assert isinstance(statement, Instruction)
        called = statement.program
        arguments = tuple(argument for argument in statement.operands if argument is not None)
        if len(arguments) < len(statement.operands):
            raise ValError("Missing argument", f"{text}: none may be left out")
    name = named(called, "program")
    cycles, step = integer("".join(numbers[:1]), 1, "cycles"), integer("".join(numbers[1:]), 1, "step")
    if name not in state.controller.memory.programs:
        raise ValError("Undefined program name", name)
    if cycles < FOREVER or cycles == 0:
        raise ValError("Invalid argument", f"{cycles}: cycles are 1 or more, or -1 for ever")
    state.last_run = text
    return name, arguments, cycles, step


def abort(state: TerminalState, _rest: str) -> None:
    """ABORT."""
    controller = state.controller
    if not (controller.running or controller.doing) and _stands(state):
        raise ValError("No program running")
    controller.abort(now=state.now)


def _stands(state: TerminalState) -> bool:
    """Whether the arm has nothing to do; refusals are reported elsewhere."""
    try:
        return state.controller.arm.settled(now=state.now)
    except ValError:
        return False


def panic(state: TerminalState, _rest: str) -> None:
    """PANIC: stop, power off."""
    controller = state.controller
    controller.switch(POWER, False)
    with contextlib.suppress(ValError):
        controller.abort(now=state.now)
    state.say("*Arm power off* ENABLE POWER turns it on again", style=Style.ERROR)


def timeline(state: TerminalState, _rest: str) -> None:
    """TIMELINE."""
    state.say(f"Now {layout.fixed(state.now, 3)} s")
    scheduled = state.controller.arm.timeline(now=state.now)
    if scheduled:
        joints = " ".join(f"{f'JT {joint}':>8}" for joint in range(1, 7))
        state.say(f"{'no':>6} {'begins':>10} {'ends':>10}  {joints}")
    state.say_all(scheduled, "Nothing is scheduled")


def status(state: TerminalState, _rest: str) -> None:
    """STATUS."""
    controller = state.controller
    current = controller.status()
    here, there = controller.arm.here(now=state.now), controller.arm.destination(now=state.now)
    moves = not all(abs(a - b) < 1e-6 for a, b in zip(here.joints.joints, there.joints.joints, strict=True))
    state.say(
        *layout.table([
            ("Program", _program_line(current)),
            ("Monitor speed", f"{layout.number(controller.arm.monitor_speed())} %"),
            ("Power", "on" if controller.switches[POWER] else "off"),
            ("Arm", "moves" if moves else "stands"),
            ("Session time", f"{layout.fixed(state.now, 3)} s"),
        ])
    )  # fmt: skip
    for depth, (name, step) in enumerate(reversed(current.stack[:-1]), 1):
        state.say(f"{'':{2 * depth}}called from {name}, step {step}")


def _program_line(current: ControllerStatus) -> str:
    word = current.state.name.lower()
    if not current.program:
        return word
    left = "for ever" if current.cycles_left < 0 else f"{current.cycles_left}"
    why = f" ({current.word})" if current.word else ""
    return f"{current.program}, step {current.step}: {word}{why}, cycles left: {left}"
