"""ENABLE, DISABLE, SWITCH, PARAMETER, SPEED, SIGNAL, RESET, IO, CALIBRATE, and what `name ?` asks for."""

from __future__ import annotations

import contextlib

from interfaces.val2 import forms
from interfaces.val2.context import MOST_PERCENT
from interfaces.val2.errors import ValError
from interfaces.val2.monitor import layout
from interfaces.val2.monitor.commands import unique
from interfaces.val2.monitor.locations import Confirm
from interfaces.val2.monitor.running import POWER
from interfaces.val2.monitor.state import Dialogue, Style, TerminalState, halves, nothing, pieces
from interfaces.val2.signals import INPUTS, INTERNAL, OUTPUTS, legal


def enable(desk: TerminalState, rest: str, *, now: float) -> None:
    """ENABLE switch, .."""
    _turn(desk, rest, on=True, now=now)


def disable(desk: TerminalState, rest: str, *, now: float) -> None:
    """DISABLE switch, .."""
    _turn(desk, rest, on=False, now=now)


def _turn(desk: TerminalState, rest: str, *, on: bool, now: float) -> None:
    switches = desk.controller.switches
    if not rest:
        raise ValError("Missing argument", f"one of {', '.join(sorted(switches))}")
    names = [unique(piece.upper(), switches, "switch") for piece in pieces(rest)]
    for name in names:
        desk.controller.switch(name, on)
    if POWER in names and not on:
        with contextlib.suppress(ValError):
            desk.controller.abort(now=now)


def switch(desk: TerminalState, rest: str, *, now: float) -> None:  # noqa: ARG001 - commands have one form
    """SWITCH: which are on."""
    switches = desk.controller.switches
    names = [unique(piece.upper(), switches, "switch") for piece in pieces(rest)] or sorted(switches)
    desk.say(*layout.table([(name, "ON" if switches[name] else "OFF") for name in names]))


def parameter(desk: TerminalState, rest: str, *, now: float) -> None:
    """PARAMETER; PARAMETER name; PARAMETER name = value."""
    parameters = desk.controller.parameters
    given, value = halves(rest)
    names = [unique(piece.upper(), parameters, "parameter") for piece in pieces(given)] or sorted(parameters)
    if value is None:
        desk.say(*layout.table([(name, f"= {layout.number(parameters[name])}") for name in names]))
        return
    if not given or len(names) != 1:
        raise ValError("Invalid argument", "PARAMETER name = value")
    wanted, row = desk.number(value, now=now), forms.PARAMETERS.get(names[0])
    if row is not None and not row.low <= wanted <= row.high:
        allowed = f"{layout.number(row.low)} to {layout.number(row.high)} {row.unit}"
        raise ValError("Invalid argument", f"{names[0]} is {allowed}")
    parameters[names[0]] = wanted


def speed(desk: TerminalState, rest: str, *, now: float) -> None:
    """SPEED; SPEED percent: the monitor speed."""
    arm = desk.controller.arm
    if rest in {"", "?"}:
        desk.say(f"Monitor speed {layout.number(arm.monitor_speed())} %")
        return
    wanted = desk.number(rest, now=now)
    arm.set_monitor_speed(wanted, now=now)
    if wanted > MOST_PERCENT:
        desk.say(f"*Warning* SPEED {layout.number(wanted)} % counts as {MOST_PERCENT:g} %", style=Style.NOTE)


def signal(desk: TerminalState, rest: str, *, now: float) -> None:
    """SIGNAL n, -m: on, off; inputs too, in the place of what would set them."""
    if not rest:
        io(desk, rest, now=now)
        return
    numbers = [desk.number(piece, now=now) for piece in pieces(rest)]
    signals = desk.controller.signals
    for number in [number for number in numbers if legal(number)]:
        signals.force(number)


def reset(desk: TerminalState, rest: str, *, now: float) -> None:  # noqa: ARG001 - commands have one form
    """RESET: all outputs off."""
    nothing(rest, "RESET")
    desk.controller.signals.reset()


def io(desk: TerminalState, rest: str, *, now: float) -> None:  # noqa: ARG001 - commands have one form
    """IO: a table of all signals, 1 for on."""
    nothing(rest, "IO")
    signals = desk.controller.signals
    for title, numbers in (("Outputs", OUTPUTS), ("Inputs", INPUTS), ("Internal", INTERNAL)):
        states = ["1" if on else "0" for on in signals.states(numbers)]
        eights = " ".join("".join(states[k : k + 8]) for k in range(0, len(states), 8))
        desk.say(f"{title:8}  {numbers[0]:4} {eights} {numbers[-1]}")


def calibrate(desk: TerminalState, rest: str, *, now: float) -> Dialogue:  # noqa: ARG001 - commands have one form
    """CALIBRATE: the virtual arm knows where it is, so nothing moves."""
    nothing(rest, "CALIBRATE")
    if not desk.controller.switches[POWER]:
        raise ValError("Arm power off", "ENABLE POWER first")

    def act(_: float) -> None:
        desk.say("Calibrated: nothing had to move", style=Style.NOTE)

    return Confirm("Are you sure", act)


def state(desk: TerminalState, word: str) -> bool:
    """What `word ?` asks for: `COARSE ?`, `FINE ?`, a switch; whether there's such a state."""
    arm = desk.controller.arm
    if word in {"COARSE", "FINE"}:
        fine, percent = arm.tolerance()
        desk.say(f"{'FINE' if fine else 'COARSE'} {layout.number(percent)} %")
        return True
    if word in desk.controller.switches:
        desk.say(f"{word} is {'ON' if desk.controller.switches[word] else 'OFF'}")
        return True
    if word in desk.controller.parameters:
        desk.say(f"{word} = {layout.number(desk.controller.parameters[word])}")
        return True
    return False
