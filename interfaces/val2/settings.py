"""Instructions that are done at once, or when the arm stands."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from interfaces.val2.arithmetic import whole
from interfaces.val2.context import Context
from interfaces.val2.errors import ValError
from interfaces.val2.geometry import about_z
from interfaces.val2.memory import where
from interfaces.val2.operands import Ask, Operands, Preparation, numbers
from interfaces.val2.operations import Slots
from interfaces.val2.syntax import Binary, Compound, Number, Unary, Variable
from interfaces.val2.values import NULL, Transformation

_CONFIGURATIONS: Final = ("RIGHTY", "LEFTY", "ABOVE", "BELOW", "FLIP", "NOFLIP")


def _speed(o: Operands, c: Context) -> Callable[[Slots], Ask]:
    value, turn = o.real(0), o.real(1) if o.present(1) else None
    unit = next((u for u in ("MMPS", "IPS") if o.says(u)), "%")
    always = o.says("ALWAYS")

    def prepare(s: Slots) -> Ask:
        speed, turning = value(s), None if turn is None else turn(s)
        c.capped("SPEED of turning", turning or 0.0)
        if o.says("MONITOR"):
            c.capped("Monitor SPEED", speed)
            return lambda: c.arm.set_monitor_speed(speed, now=c.now)
        c.capped("SPEED", speed, c.arm.fastest(unit), unit)
        return lambda: c.arm.set_speed(speed, turn=turning, unit=unit, always=always)

    return prepare


def _accelerate(o: Operands, c: Context) -> Callable[[Slots], Ask]:
    up = o.real(0)
    down = o.real(1) if o.present(1) else up

    def prepare(s: Slots) -> Ask:
        values = up(s), down(s)
        c.capped("ACCEL", max(values))
        return lambda: c.arm.set_acceleration(*values)

    return prepare


def _tolerance(o: Operands, c: Context, *, fine: bool) -> Callable[[Slots], Ask]:
    percent, always = o.real(0) if o.present(0) else None, o.says("ALWAYS")

    def prepare(s: Slots) -> Ask:
        value = None if percent is None else percent(s)
        return lambda: c.arm.set_tolerance(value, fine=fine, always=always)

    return prepare


def _configure(o: Operands, c: Context) -> Callable[[Slots], Ask]:
    def ask() -> None:
        c.arm.set_configuration(o.instruction.keyword)
        c.stop_first = True

    return lambda _: ask


def _signal(o: Operands, c: Context) -> Callable[[Slots], Ask]:
    parts = [o.real(i) for i in range(max(1, len(o.given)))]

    def prepare(s: Slots) -> Ask:
        numbers = [p(s) for p in parts]
        return lambda: c.signals.set(numbers)

    return prepare


def _set_timer(o: Operands, c: Context) -> Callable[[Slots], Ask]:
    number, value = o.real(0), o.real(1)

    def prepare(s: Slots) -> Ask:
        i, seconds = c.timer(number(s)), value(s)

        def ask() -> None:
            c.timers[i] = c.now - seconds

        return ask

    return prepare


def _set_parameter(o: Operands, c: Context) -> Callable[[Slots], Ask]:
    value, name = o.real(0), next(iter(o.instruction.words), "")

    def prepare(s: Slots) -> Ask:
        number = value(s)

        return lambda: c.parameter(name, number)

    return prepare


def _switch(o: Operands, c: Context, *, on: bool) -> Callable[[Slots], Ask]:
    def ask() -> None:
        for name in o.instruction.words:
            c.switch(name, on)

    return lambda _: ask


def _alter(o: Operands, c: Context) -> Callable[[Slots], Ask]:
    """ALTER; what is given behind the mode is the first correction."""
    _, mode, *parts = o.reals(8)
    corrects = any(o.present(i) for i in range(2, 8))

    def prepare(s: Slots) -> Ask:
        bits, values = whole(mode(s)), tuple(p(s) for p in parts)

        def ask() -> None:
            c.arm.set_alter(bits, now=c.now)
            if corrects:
                c.powered()
                c.arm.alter(values, now=c.now)

        return ask

    return prepare


def _correct(o: Operands, c: Context) -> Callable[[Slots], Ask]:
    def ask(*values: float) -> None:
        c.powered()
        c.arm.alter(values, now=c.now)

    return numbers(o, 6, ask, all_given=False)


def _here(o: Operands, c: Context) -> Callable[[Slots], Ask]:
    x, target = o.x, o.expression(0)
    frames = []
    if isinstance(target, Compound):
        frames, target = [x.transformation(p) for p in target.parts[:-1]], target.parts[-1]
    if not isinstance(target, Variable) or target.prefix == "$" or (frames and target.prefix):
        raise ValError("Invalid location", "HERE takes a name, or a compound that ends in one",
                       place=where(o.instruction.at))  # fmt: skip
    name, slot = target, x.reference(target)

    def prepare(s: Slots) -> Ask:
        before = NULL
        for frame in frames:
            before = before @ frame(s)
        stands = c.arm.here(now=c.now)
        value = stands.joints if name.prefix else before.inverse() @ stands.tool if frames else stands.tool
        return lambda: c.memory.store(slot(s), value, name)

    return prepare


AT_ONCE: Final[dict[str, Preparation]] = {
    **dict.fromkeys(_CONFIGURATIONS, _configure),
    "ACCEL": _accelerate,
    "AT": lambda o, c: numbers(o, 1, c.arm.at),
    "CLOSE": lambda _, c: lambda _: lambda: c.arm.set_hand(False),
    "COARSE": lambda o, c: _tolerance(o, c, fine=False),
    "DISABLE": lambda o, c: _switch(o, c, on=False),
    "DURATION": lambda o, c: numbers(o, 1, lambda t: c.arm.set_duration(t, always=o.says("ALWAYS"))),
    "ENABLE": lambda o, c: _switch(o, c, on=True),
    "FINE": lambda o, c: _tolerance(o, c, fine=True),
    "HERE": _here,
    "IGNORE": lambda o, c: numbers(o, 1, c.reactions.ignore),
    "NONULL": lambda o, c: lambda _: lambda: c.arm.set_nulling(False, always=o.says("ALWAYS")),
    "NULL": lambda o, c: lambda _: lambda: c.arm.set_nulling(True, always=o.says("ALWAYS")),
    "OPEN": lambda _, c: lambda _: lambda: c.arm.set_hand(True),
    "PARAMETER": _set_parameter,
    "RELAX": lambda _, c: lambda _: lambda: c.arm.set_hand(None),
    "RESET": lambda _, c: lambda _: c.signals.reset,
    "SIGNAL": _signal,
    "SPEED": _speed,
    "TIMER": _set_timer,
}
"""What is done at once, and takes no time."""

ALTERING: Final[dict[str, Preparation]] = {
    "ALTER": _alter,
    "ALTOFF": lambda _, c: lambda _: lambda: c.arm.set_alter(None, now=c.now),
    "ALTON": _alter,
    "ALTOUT": _correct,
    "NOALTER": lambda _, c: lambda _: lambda: c.arm.set_alter(None, now=c.now),
}
"""What is asked for at once; then a program waits: ALTOUT for its period, NOALTER until the arm stands."""


def _tool(o: Operands, c: Context) -> Callable[[Slots], Ask]:
    tool = o.x.transformation(o.expression(0)) if o.present(0) else (lambda _: NULL)

    def prepare(s: Slots) -> Ask:
        value = tool(s)
        return lambda: c.arm.set_tool(value)

    return prepare


def _base(o: Operands, c: Context) -> Callable[[Slots], Ask]:
    if len(o.given) == 1 and o.present(0) and not isinstance(o.given[0], Number | Unary | Binary):
        frame = o.x.transformation(o.expression(0))

        def whole_frame(s: Slots) -> Ask:
            base = frame(s)
            return lambda: c.arm.set_base(base)

        return whole_frame
    parts = o.reals(4)

    def prepare(s: Slots) -> Ask:
        *translation, turn = (p(s) for p in parts)
        X = about_z(turn).X.copy()
        X[:3, 3] = translation
        value = Transformation(X)
        return lambda: c.arm.set_base(value)

    return prepare


AT_REST: Final[dict[str, Preparation]] = {
    "BASE": _base,
    "CLOSEI": lambda _, c: lambda _: lambda: c.arm.actuate(False, now=c.now),
    "OPENI": lambda _, c: lambda _: lambda: c.arm.actuate(True, now=c.now),
    "RELAXI": lambda _, c: lambda _: lambda: c.arm.actuate(None, now=c.now),
    "TOOL": _tool,
}
"""What is done when the arm stands."""
