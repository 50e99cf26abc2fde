"""ENABLE, DISABLE, SWITCH, PARAMETER, SPEED, SIGNAL, RESET, IO, CALIBRATE, and what `name ?` asks for."""

from __future__ import annotations

import contextlib

from interfaces.val2 import forms
from interfaces.val2.context import MOST_PERCENT
from interfaces.val2.errors import ValError
from interfaces.val2.monitor import layout
from interfaces.val2.monitor.running import POWER
from interfaces.val2.monitor.state import Confirm, Dialogue, Style, TerminalState, halves, pieces, unique
from interfaces.val2.signals import INPUTS, INTERNAL, OUTPUTS, legal


def turn(state: TerminalState, rest: str, *, on: bool) -> None:
    """ENABLE switch, ..; DISABLE switch, .."""
    switches = state.controller.switches
    if not rest:
        raise ValError("Missing argument", f"one of {', '.join(sorted(switches))}")
    names = [unique(piece.upper(), switches, "switch") for piece in pieces(rest)]
    for name in names:
        state.controller.switch(name, on)
    if POWER in names and not on:
        with contextlib.suppress(ValError):
            state.controller.abort(now=state.now)


def switch(state: TerminalState, rest: str) -> None:
    """SWITCH: which are on."""
    switches = state.controller.switches
    names = [unique(piece.upper(), switches, "switch") for piece in pieces(rest)] or sorted(switches)
    state.say(*layout.table([(name, "ON" if switches[name] else "OFF") for name in names]))


def parameter(state: TerminalState, rest: str) -> None:
    """PARAMETER; PARAMETER name; PARAMETER name = value."""
    parameters = state.controller.parameters
    given, value = halves(rest)
    names = [unique(piece.upper(), parameters, "parameter") for piece in pieces(given)] or sorted(parameters)
    if value is None:
        state.say(*layout.table([(name, f"= {layout.number(parameters[name])}") for name in names]))
        return
    if not given or len(names) != 1:
        raise ValError("Invalid argument", "PARAMETER name = value")
    wanted, row = state.number(value), forms.PARAMETERS.get(names[0])
    if row is not None and not row.low <= wanted <= row.high:
        allowed = f"{layout.number(row.low)} to {layout.number(row.high)} {row.unit}"
        raise ValError("Invalid argument", f"{names[0]} is {allowed}")
    parameters[names[0]] = wanted


def speed(state: TerminalState, rest: str) -> None:
    """SPEED; SPEED percent: the monitor speed."""
    arm = state.controller.arm
    if rest in {"", "?"}:
        state.say(f"Monitor speed {layout.number(arm.monitor_speed())} %")
        return
    wanted = state.number(rest)
    arm.set_monitor_speed(wanted, now=state.now)
    if wanted > MOST_PERCENT:
        state.say(f"*Warning* SPEED {layout.number(wanted)} % counts as {MOST_PERCENT:g} %", style=Style.NOTE)


def signal(state: TerminalState, rest: str) -> None:
    """SIGNAL n, -m: on, off; inputs too, in the place of what would set them."""
    if not rest:
        io(state, rest)
        return
    numbers = [state.number(piece) for piece in pieces(rest)]
    signals = state.controller.signals
    for number in [number for number in numbers if legal(number)]:
        signals.force(number)


def io(state: TerminalState, _rest: str) -> None:
    """IO: a table of all signals, 1 for on."""
    signals = state.controller.signals
    for title, numbers in (("Outputs", OUTPUTS), ("Inputs", INPUTS), ("Internal", INTERNAL)):
        states = ["1" if on else "0" for on in signals.states(numbers)]
        eights = " ".join("".join(states[k : k + 8]) for k in range(0, len(states), 8))
        state.say(f"{title:8}  {numbers[0]:4} {eights} {numbers[-1]}")


def calibrate(state: TerminalState, _rest: str) -> Dialogue:
    """CALIBRATE: the virtual arm knows where it is, so nothing moves."""
    if not state.controller.switches[POWER]:
        raise ValError("Arm power off", "ENABLE POWER first")

    def act() -> None:
        state.say("Calibrated: nothing had to move", style=Style.NOTE)

    return Confirm("Are you sure", act)


def show_setting(state: TerminalState, word: str) -> bool:
    """What `word ?` asks for: `COARSE ?`, `FINE ?`, a switch; whether there's such a state."""
    arm = state.controller.arm
    if word in {"COARSE", "FINE"}:
        fine, percent = arm.tolerance()
        state.say(f"{'FINE' if fine else 'COARSE'} {layout.number(percent)} %")
        return True
    if word in state.controller.switches:
        state.say(f"{word} is {'ON' if state.controller.switches[word] else 'OFF'}")
        return True
    if word in state.controller.parameters:
        state.say(f"{word} = {layout.number(state.controller.parameters[word])}")
        return True
    return False
