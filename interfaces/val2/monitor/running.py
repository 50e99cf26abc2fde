"""DO, EXECUTE, ABORT, PANIC, PROCEED, RETRY, NEXT, XSTEP, STATUS; AT, UNDO and TIMELINE, ours."""

from __future__ import annotations

import contextlib
import re
from typing import Final

from interfaces.val2.controller import ControllerStatus
from interfaces.val2.errors import ValError
from interfaces.val2.monitor import layout
from interfaces.val2.monitor.state import Style, TerminalState, integer, named, nothing, pieces
from interfaces.val2.statements import timed
from interfaces.val2.syntax import Blank, Call, Expression

FOREVER: Final = -1
"""Cycles that never end."""
POWER: Final = "POWER"
"""The switch without which the arm doesn't move."""
_AT: Final = re.compile(r"(.*?)\s+DO\s+(.*)", re.DOTALL | re.IGNORECASE)


def do(desk: TerminalState, rest: str, *, now: float) -> None:
    """DO instruction; DO alone does the last again."""
    step = desk.step(rest) if rest else desk.last_do
    if step is None or isinstance(step.statement, Blank):
        raise ValError("Missing argument", "DO what? An instruction follows, such as DO READY")
    desk.last_do = step
    desk.controller.do(step, now=now)


def at(desk: TerminalState, rest: str, *, now: float) -> None:
    """AT t, AT +t, before the next motion; AT t motion, AT t DO motion in one line."""
    together, places = _AT.fullmatch(rest), timed(rest)
    when, motion = rest, ""
    if together is not None:
        when, motion = together[1], together[2]
    elif places is not None:
        when, motion = rest[: places[0]], rest[places[1] :]
    t = desk.number(when.removeprefix("+"), now=now)
    desk.controller.arm.at(now + t if when.startswith("+") else t)
    desk.scheduling = True
    if motion:
        do(desk, motion, now=now)


def execute(desk: TerminalState, rest: str, *, now: float) -> None:
    """EXECUTE program(arguments), cycles, step."""
    name, arguments, cycles, step = _program(desk, rest)
    desk.controller.execute(name, arguments, cycles=cycles, step=step, now=now)


def xstep(desk: TerminalState, rest: str, *, now: float) -> None:
    """XSTEP; XSTEP program(arguments), cycles, step begins one."""
    if not rest:
        desk.controller.xstep(now=now)
        return
    name, arguments, cycles, step = _program(desk, rest)
    if arguments:
        raise ValError("Invalid argument", f"{rest}: XSTEP gives a program no arguments")
    desk.controller.xstep(name, cycles=cycles, step=step, now=now)


def next_(desk: TerminalState, rest: str, *, now: float) -> None:
    """NEXT; NEXT n: so many steps of a program that stands."""
    steps = integer(rest, 1, "the number of steps")
    if not 1 <= steps <= 10_000:
        raise ValError("Invalid argument", f"{rest}: 1 to 10000 steps")
    desk.controller.xstep(now=now)
    desk.steps = steps - 1


def _program(desk: TerminalState, rest: str) -> tuple[str, tuple[Expression, ...], int, int]:
    """Program, arguments, cycles and step of a line; of an empty one those of the last."""
    text = rest or desk.last_run
    if not text:
        raise ValError("Missing argument", "which program?")
    called, *numbers = pieces(text)
    if len(numbers) > 2:
        raise ValError("Invalid argument", f"{rest}: program, cycles and step")
    arguments: tuple[Expression, ...] = ()
    if "(" in called:
        statement = desk.instruction("CALL", called).statement
        assert isinstance(statement, Call)
        called = statement.program
        arguments = tuple(argument for argument in statement.arguments if argument is not None)
        if len(arguments) < len(statement.arguments):
            raise ValError("Missing argument", f"{text}: none may be left out")
    name = named(called, "program")
    cycles, step = integer("".join(numbers[:1]), 1, "cycles"), integer("".join(numbers[1:]), 1, "step")
    if name not in desk.controller.memory.programs:
        raise ValError("Undefined program name", name)
    if cycles < FOREVER or cycles == 0:
        raise ValError("Invalid argument", f"{cycles}: cycles are 1 or more, or -1 for ever")
    desk.last_run = text
    return name, arguments, cycles, step


def abort(desk: TerminalState, rest: str, *, now: float) -> None:
    """ABORT."""
    nothing(rest, "ABORT")
    controller = desk.controller
    if not (controller.running or controller.doing) and _stands(desk, now):
        raise ValError("No program running")
    controller.abort(now=now)


def _stands(desk: TerminalState, now: float) -> bool:
    """Whether the arm has nothing to do; what became of it is said elsewhere."""
    try:
        return desk.controller.arm.settled(now=now)
    except ValError:
        return False


def panic(desk: TerminalState, rest: str, *, now: float) -> None:  # noqa: ARG001 - it works whatever follows
    """PANIC: stop, power off."""
    controller = desk.controller
    controller.switch(POWER, False)
    with contextlib.suppress(ValError):
        controller.abort(now=now)
    desk.say("*Arm power off* ENABLE POWER turns it on again", style=Style.ERROR)


def proceed(desk: TerminalState, rest: str, *, now: float) -> None:
    """PROCEED."""
    nothing(rest, "PROCEED")
    desk.controller.proceed(now=now)


def retry(desk: TerminalState, rest: str, *, now: float) -> None:
    """RETRY."""
    nothing(rest, "RETRY")
    desk.controller.retry(now=now)


def undo(desk: TerminalState, rest: str, *, now: float) -> None:
    """UNDO."""
    nothing(rest, "UNDO")
    desk.say(desk.controller.arm.undo(now=now))


def timeline(desk: TerminalState, rest: str, *, now: float) -> None:
    """TIMELINE."""
    nothing(rest, "TIMELINE")
    desk.say(f"Now {layout.fixed(now, 3)} s")
    scheduled = desk.controller.arm.timeline(now=now)
    if scheduled:
        joints = " ".join(f"{f'JT {joint}':>8}" for joint in range(1, 7))
        desk.say(f"{'no':>6} {'begins':>10} {'ends':>10}  {joints}")
    desk.say_all(scheduled, "Nothing is scheduled")


def status(desk: TerminalState, rest: str, *, now: float) -> None:
    """STATUS."""
    nothing(rest, "STATUS")
    controller = desk.controller
    state = controller.status()
    here, there = controller.arm.here(now=now), controller.arm.destination(now=now)
    moves = not all(abs(a - b) < 1e-6 for a, b in zip(here.joints.joints, there.joints.joints, strict=True))
    desk.say(
        *layout.table([
            ("Program", _program_line(state)),
            ("Monitor speed", f"{layout.number(controller.arm.monitor_speed())} %"),
            ("Power", "on" if controller.switches[POWER] else "off"),
            ("Arm", "moves" if moves else "stands"),
            ("Session time", f"{layout.fixed(now, 3)} s"),
        ])
    )  # fmt: skip
    for depth, (name, step) in enumerate(reversed(state.stack[:-1]), 1):
        desk.say(f"{'':{2 * depth}}called from {name}, step {step}")


def _program_line(state: ControllerStatus) -> str:
    word = state.state.name.lower()
    if not state.program:
        return word
    left = "for ever" if state.cycles_left < 0 else f"{state.cycles_left}"
    why = f" ({state.word})" if state.word else ""
    return f"{state.program}, step {state.step}: {word}{why}, cycles left: {left}"
