"""What runs and moves, and its settings: DO to STATUS, AT and TIMELINE; switches, parameters, speed, signals."""

from __future__ import annotations

import contextlib
import re
from collections.abc import Callable, Collection
from dataclasses import replace
from functools import partial
from typing import Final

from interfaces.val2.context import MOST_PERCENT
from interfaces.val2.errors import ValError
from interfaces.val2.monitor import layout
from interfaces.val2.monitor.state import Dialogue, Style, TerminalState, halves, integer, named, pieces, unique
from interfaces.val2.printer import number as spelled
from interfaces.val2.rows import numbered
from interfaces.val2.signals import INPUTS, INTERNAL, OUTPUTS, legal
from interfaces.val2.syntax import BLANK, Expression, Instruction, Step

FOREVER: Final = -1
"""Cycles that never end."""
POWER: Final = "POWER"
"""The switch without which the arm doesn't move."""
_IN_A_LINE: Final = 32
"""Signals of a line of IO."""
_TASK: Final = re.compile(r"(\d{1,3})\s*:?\s+(?=[A-Za-z])")
"""The number before a program's name."""
_AT: Final = re.compile(r"(.*?)\s+DO\s+(.*)", re.DOTALL | re.IGNORECASE)


def do(state: TerminalState, rest: str) -> None:
    """DO instruction; DO alone does the last again."""
    _carry_out(state, state.step(rest) if rest else state.last_do)


def _carry_out(state: TerminalState, step: Step | None) -> None:
    if step is None or step.statement == BLANK:
        raise ValError("Missing argument", "DO what? An instruction follows, such as DO READY")
    state.last_do = step
    state.controller.do(step, now=state.now)


def at(state: TerminalState, rest: str) -> None:
    """AT t, AT +t, before the next motion; AT t motion, AT t DO motion in one line."""
    step, together = None, _AT.fullmatch(rest)
    if together is not None:
        time, step = state.expression(together[1]), state.step(together[2])
    elif (timed := state.instruction("AT", rest)).statement.begins is not None:
        time, step = timed.statement.begins, replace(timed, statement=replace(timed.statement, begins=None))
    else:
        (time,) = timed.statement.operands
    t = state.number_of(time)
    state.controller.arm.at(state.now + t if rest.startswith("+") else t)
    state.scheduling = True
    if step is not None:
        _carry_out(state, step)


def execute(state: TerminalState, rest: str, *, usual: int = 0) -> None:
    """EXECUTE task program(arguments), cycles, step; PCEXECUTE."""
    given = _TASK.match(rest)
    number = usual if given is None else numbered("task", int(given[1]))
    name, arguments, cycles, step = _program(state, rest if given is None else rest[given.end() :])
    state.controller.execute(name, arguments, cycles=cycles, step=step, number=number, now=state.now)


def of_task(state: TerminalState, rest: str, *, do: Callable[..., None], usual: int = 0) -> None:
    """PROCEED, RETRY, KILL, DONE, and their like of process control: of the task that's given, or the usual one."""
    do(state.controller, numbered("task", integer(rest, usual, "a task")), now=state.now)


def xstep(state: TerminalState, rest: str) -> None:
    """XSTEP; XSTEP program, cycles, step begins one."""
    if not rest:
        state.controller.proceed(single=True, now=state.now)
        return
    name, arguments, cycles, step = _program(state, rest)
    if arguments:
        raise ValError("Invalid argument", f"{rest}: XSTEP gives a program no arguments")
    state.controller.execute(name, cycles=cycles, step=step, single=True, now=state.now)


def next_(state: TerminalState, rest: str) -> None:
    """NEXT; NEXT n: so many steps of a program that stands."""
    steps = integer(rest, 1, "the number of steps")
    if not 1 <= steps <= 10_000:
        raise ValError("Invalid argument", f"{rest}: 1 to 10000 steps")
    state.controller.proceed(single=True, now=state.now)
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


def abort(state: TerminalState, rest: str) -> None:
    """ABORT; ABORT task."""
    if rest:
        of_task(state, rest, do=type(state.controller).abort)
        return
    controller, stands = state.controller, False
    # Refusals are reported elsewhere.
    with contextlib.suppress(ValError):
        stands = not (controller.running or controller.doing) and controller.arm.settled(now=state.now)
    if stands:
        raise ValError("No program running")
    controller.abort(now=state.now)


def panic(state: TerminalState, _rest: str) -> None:
    """PANIC: stop, power off."""
    _turn(state, POWER, False)
    state.say("*Arm power off* ENABLE POWER turns it on again", style=Style.ERROR)


def _turn(state: TerminalState, name: str, on: bool) -> None:
    state.controller.switch(name, on)
    if name == POWER and not on:
        with contextlib.suppress(ValError):
            state.controller.abort(now=state.now)


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
    controller, arm = state.controller, state.controller.arm
    current, doing = controller.status(), controller.status().state.name.lower()
    if current.program:
        left = "for ever" if current.cycles_left < 0 else f"{current.cycles_left}"
        why = f" ({current.word})" if current.word else ""
        doing = f"{current.program}, step {current.step}: {doing}{why}, cycles left: {left}"
    here, there = arm.here(now=state.now).joints.joints, arm.destination(now=state.now).joints.joints
    state.say(
        *layout.table([
            ("Program", doing),
            ("Monitor speed", f"{spelled(arm.monitor_speed())} %"),
            ("Power", "on" if controller.switches[POWER] else "off"),
            ("Arm", "stands" if all(abs(a - b) < 1e-6 for a, b in zip(here, there, strict=True)) else "moves"),
            ("Session time", f"{layout.fixed(state.now, 3)} s"),
            *((f"Jt {n}", name) for n, name in enumerate(arm.joint_names, 1)),
        ])
    )  # fmt: skip
    for depth, (name, step) in enumerate(reversed(current.stack[:-1]), 1):
        state.say(f"{'':{2 * depth}}called from {name}, step {step}")
    for number in sorted(n for n in controller.tasks if n):
        task = controller.status(number)
        why = f" ({task.word})" if task.word else ""
        state.say(f"Task {number}: {task.program}, step {task.step}: {task.state.name.lower()}{why}")


def turn(state: TerminalState, rest: str, *, on: bool) -> None:
    """ENABLE switch, ..; DISABLE switch, .."""
    if not rest:
        raise ValError("Missing argument", f"one of {', '.join(sorted(state.controller.switches))}")
    for name in _matched(rest, state.controller.switches, "switch"):
        _turn(state, name, on)
    if on:
        state.control.resume(now=state.now)


def _matched(rest: str, known: Collection[str], kind: str) -> list[str]:
    """The names that beginnings between commas stand for."""
    return [unique(piece.upper(), known, kind) for piece in pieces(rest)]


def switch(state: TerminalState, rest: str) -> None:
    """SWITCH: which are on."""
    switches = state.controller.switches
    names = _matched(rest, switches, "switch") or sorted(switches)
    state.say(*layout.table([(name, "ON" if switches[name] else "OFF") for name in names]))


def parameter(state: TerminalState, rest: str) -> None:
    """PARAMETER; PARAMETER name; PARAMETER name = value."""
    parameters = state.controller.parameters
    given, value = halves(rest)
    names = _matched(given, parameters, "parameter") or sorted(parameters)
    if value is None:
        state.say(*layout.table([(name, f"= {spelled(parameters[name])}") for name in names]))
        return
    if not given or len(names) != 1:
        raise ValError("Invalid argument", "PARAMETER name = value")
    state.controller.parameter(names[0], state.number(value))


def speed(state: TerminalState, rest: str) -> None:
    """SPEED; SPEED percent: the monitor speed."""
    arm = state.controller.arm
    if rest in {"", "?"}:
        state.say(f"Monitor speed {spelled(arm.monitor_speed())} %")
        return
    wanted = state.number(rest)
    arm.set_monitor_speed(wanted, now=state.now)
    if wanted > MOST_PERCENT:
        state.say(f"*Warning* SPEED {spelled(wanted)} % counts as {MOST_PERCENT:g} %", style=Style.NOTE)


def signal(state: TerminalState, rest: str) -> None:
    """SIGNAL n, -m: on, off; inputs too, in the place of what would set them."""
    if not rest:
        io(state, rest)
    numbers = [state.number(piece) for piece in pieces(rest)]
    for number in [number for number in numbers if legal(number)]:
        state.controller.signals.force(number)


def io(state: TerminalState, _rest: str) -> None:
    """IO: a table of signals, 1 for on; of those behind the first 32, lines in which one is on."""
    signals = state.controller.signals
    for title, numbers in (("Outputs", OUTPUTS), ("Inputs", INPUTS), ("Internal", INTERNAL)):
        for row in (numbers[k : k + _IN_A_LINE] for k in range(0, len(numbers), _IN_A_LINE)):
            states = ["1" if signals.on(number) else "0" for number in row]
            if row[0] == numbers[0] or "1" in states:
                eights = " ".join("".join(states[k : k + 8]) for k in range(0, len(states), 8))
                state.say(f"{title:8}  {row[0]:4} {eights} {row[-1]}")


def channel(state: TerminalState, rest: str, *, word: str) -> None:
    """ADC, DAC, IOGET, IOPUT: simulated channels; what programs read, and what they have set."""
    known, (given, value) = state.controller.channels[word], halves(rest)
    if value is not None:
        known[numbered("channel", state.number(given))] = state.number(value)
        return
    shown = [numbered("channel", state.number(given))] if given else [n for n in known if known[n]] or [*known][:1]
    state.say(*layout.table([(f"{word} {n}", f"= {spelled(known[n])}") for n in shown]))


def calibrate(state: TerminalState, _rest: str) -> Dialogue:
    """CALIBRATE: the virtual arm knows where it is, so nothing moves."""
    if not state.controller.switches[POWER]:
        raise ValError("Arm power off", "ENABLE POWER first")
    said = partial(state.say, "Calibrated: nothing had to move", style=Style.NOTE)
    yield from state.confirm("Are you sure", said)


def show_setting(state: TerminalState, word: str) -> bool:
    """What `word ?` asks for: `COARSE ?`, `FINE ?`, a switch, a parameter; whether there's such a state."""
    controller = state.controller
    if word in {"COARSE", "FINE"}:
        fine, percent = controller.arm.tolerance()
        state.say(f"{'FINE' if fine else 'COARSE'} {spelled(percent)} %")
    elif word in controller.switches:
        state.say(f"{word} is {'ON' if controller.switches[word] else 'OFF'}")
    elif word in controller.parameters:
        state.say(f"{word} = {spelled(controller.parameters[word])}")
    else:
        return False
    return True
