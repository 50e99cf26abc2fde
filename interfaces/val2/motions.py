"""Instructions that are motions."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from interfaces.val2.context import Context
from interfaces.val2.errors import ValError
from interfaces.val2.operands import Ask, Operands, Preparation, numbers
from interfaces.val2.operations import Slots


def _hand(value: float) -> float | bool:
    """Of MOVET: an opening [mm] over 0; TRUE opens, 0 closes."""
    return value if value > 0.0 else value != 0.0


def _move(o: Operands, c: Context, *, straight: bool) -> Callable[[Slots], Ask]:
    target = o.x.location(o.expression(0))
    hand = o.real(1) if o.instruction.keyword in {"MOVET", "MOVEST"} else None

    def prepare(s: Slots) -> Ask:
        location = target(s)
        opening = None if hand is None else _hand(hand(s))
        return lambda: c.arm.move(location, straight=straight, hand=opening, now=c.now)

    return prepare


def _approach(o: Operands, c: Context, *, straight: bool) -> Callable[[Slots], Ask]:
    target, distance = o.x.location(o.expression(0)), o.real(1)

    def prepare(s: Slots) -> Ask:
        location, height = target(s), distance(s)
        return lambda: c.arm.approach(location, height, straight=straight, now=c.now)

    return prepare


def _drive(o: Operands, c: Context) -> Callable[[Slots], Ask]:
    joint, change, speed = o.real(0), o.real(1), o.real(2, 100.0)

    def prepare(s: Slots) -> Ask:
        number, angle, percent = joint(s), change(s), speed(s)
        if number not in range(1, 7):
            raise ValError("Illegal joint number", f"{number:.9g}: 1 to 6")
        c.capped("DRIVE at", percent)
        return lambda: c.arm.drive(int(number), angle, percent, now=c.now)

    return prepare


MOTIONS: Final[dict[str, Preparation]] = {
    "MOVE": lambda o, c: _move(o, c, straight=False),
    "MOVES": lambda o, c: _move(o, c, straight=True),
    "MOVET": lambda o, c: _move(o, c, straight=False),
    "MOVEST": lambda o, c: _move(o, c, straight=True),
    "APPRO": lambda o, c: _approach(o, c, straight=False),
    "APPROS": lambda o, c: _approach(o, c, straight=True),
    "DEPART": lambda o, c: numbers(o, 1, lambda d: c.arm.depart(d, straight=False, now=c.now)),
    "DEPARTS": lambda o, c: numbers(o, 1, lambda d: c.arm.depart(d, straight=True, now=c.now)),
    "DRIVE": _drive,
    "DRAW": lambda o, c: numbers(o, 3, lambda *d: c.arm.draw(*d, now=c.now), all_given=False),
    "READY": lambda _, c: lambda _: lambda: c.arm.go_ready(now=c.now),
    "NEST": lambda _, c: lambda _: lambda: c.arm.nest(now=c.now),
    "ALIGN": lambda _, c: lambda _: lambda: c.arm.align(now=c.now),
    "DELAY": lambda o, c: numbers(o, 1, lambda t: c.arm.delay(t, now=c.now)),
}
"""What is asked for as a motion."""
