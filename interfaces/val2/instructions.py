"""Instructions, a keyword with operands each, as closures: what moves the arm, and what sets or asks something.

One concept: each row says what one keyword does.

Operands are evaluated before anything is asked. A motion waits until the one before it has begun, is asked for, and
the program goes on when it has begun: it's then on its way while the next one is asked for, which may go round its
destination. RIGHTY and its like let the next motion begin at rest.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Generator
from typing import Any, Final, Protocol, TypeAlias

from interfaces.val2 import formats, forms, kinds
from interfaces.val2.context import (
    ARM,
    SLICE,
    SPECIAL,
    Action,
    Asked,
    Context,
    Finished,
    StepFunction,
    Suspend,
    Typed,
    Waiting,
)
from interfaces.val2.errors import ValError
from interfaces.val2.expressions import Expressions
from interfaces.val2.forms import OperandSlot
from interfaces.val2.functions import whole
from interfaces.val2.memory import Slots, VariableSlot, mismatch
from interfaces.val2.motion.places import ALTER_PERIOD
from interfaces.val2.syntax import (
    Apply,
    Binary,
    Compound,
    Expression,
    Format,
    Instruction,
    Number,
    Unary,
    Variable,
)
from interfaces.val2.values import NULL, Location, Transformation, about_z

Ask: TypeAlias = Callable[[], object]
"""Asks for what an instruction wants; its operands have been evaluated."""
Preparation: TypeAlias = Callable[..., Ask]
"""Of the context, the instruction, and the values of its operands: what asks."""


def _move(c: Context, i: Instruction, location: Location, hand: float | None = None) -> Ask:
    """MOVET's opening [mm] is over 0; TRUE opens, 0 closes."""
    opening = hand if hand is None or hand > 0.0 else hand != 0.0
    straight = i.keyword in ("MOVES", "MOVEST")
    return lambda: c.arm.move(location, straight=straight, hand=opening, now=c.now)


def _approach(c: Context, i: Instruction, location: Location, height: float) -> Ask:
    return lambda: c.arm.approach(location, height, straight=i.keyword == "APPROS", now=c.now)


def _depart(c: Context, i: Instruction, distance: float) -> Ask:
    return lambda: c.arm.depart(distance, straight=i.keyword == "DEPARTS", now=c.now)


def _drive(c: Context, _: Instruction, joint: float, angle: float, percent: float) -> Ask:
    if joint not in range(1, 7):
        raise ValError("Illegal joint number", f"{joint:.9g}: 1 to 6")
    c.capped("DRIVE at", percent)
    return lambda: c.arm.drive(int(joint), angle, percent, now=c.now)


MOTIONS: Final[dict[str, Preparation]] = {
    **dict.fromkeys(("MOVE", "MOVES", "MOVET", "MOVEST"), _move),
    **dict.fromkeys(("APPRO", "APPROS"), _approach),
    **dict.fromkeys(("DEPART", "DEPARTS"), _depart),
    "DRIVE": _drive,
    "DRAW": lambda c, _, *way: lambda: c.arm.draw(*way, now=c.now),
    "READY": lambda c, _: lambda: c.arm.go_ready(now=c.now),
    "NEST": lambda c, _: lambda: c.arm.nest(now=c.now),
    "ALIGN": lambda c, _: lambda: c.arm.align(now=c.now),
    "DELAY": lambda c, _, seconds: lambda: c.arm.delay(seconds, now=c.now),
}
"""What is asked for as a motion."""


def _speed(c: Context, i: Instruction, speed: float, turn: float | None) -> Ask:
    c.capped("SPEED of turning", turn or 0.0)
    if "MONITOR" in i.words:
        c.capped("Monitor SPEED", speed)
        return lambda: c.arm.set_monitor_speed(speed, now=c.now)
    unit = next((u for u in ("MMPS", "IPS") if u in i.words), "%")
    c.capped("SPEED", speed, c.arm.fastest(unit), unit)
    return lambda: c.arm.set_speed(speed, turn=turn, unit=unit, always=_always(i))


def _always(i: Instruction) -> bool:
    return "ALWAYS" in i.words


def _accelerate(c: Context, _: Instruction, up: float, down: float | None) -> Ask:
    values = up, up if down is None else down
    c.capped("ACCEL", max(values))
    return lambda: c.arm.set_acceleration(*values)


def _tolerance(c: Context, i: Instruction, percent: float | None) -> Ask:
    return lambda: c.arm.set_tolerance(percent, fine=i.keyword == "FINE", always=_always(i))


def _configure(c: Context, i: Instruction) -> Ask:
    def ask() -> None:
        c.arm.set_configuration(i.keyword)
        c.stop_first = True

    return ask


def _set_timer(c: Context, _: Instruction, number: float, seconds: float) -> Ask:
    index = c.timer(number)

    def ask() -> None:
        c.timers[index] = c.now - seconds

    return ask


def _switch(c: Context, i: Instruction) -> Ask:
    def ask() -> None:
        for name in i.words:
            c.switch(name, i.keyword == "ENABLE")

    return ask


AT_ONCE: Final[dict[str, Preparation]] = {
    **dict.fromkeys(("RIGHTY", "LEFTY", "ABOVE", "BELOW", "FLIP", "NOFLIP"), _configure),
    "ACCEL": _accelerate,
    "AT": lambda c, _, t: lambda: c.arm.at(t),
    "CLOSE": lambda c, _: lambda: c.arm.set_hand(False),
    "COARSE": _tolerance,
    "DISABLE": _switch,
    "DURATION": lambda c, i, t: lambda: c.arm.set_duration(t, always=_always(i)),
    "ENABLE": _switch,
    "FINE": _tolerance,
    "IGNORE": lambda c, _, signal: lambda: c.reactions.ignore(signal),
    "NONULL": lambda c, i: lambda: c.arm.set_nulling(False, always=_always(i)),
    "NULL": lambda c, i: lambda: c.arm.set_nulling(True, always=_always(i)),
    "OPEN": lambda c, _: lambda: c.arm.set_hand(True),
    "PARAMETER": lambda c, i, value: lambda: c.parameter(i.words[0], value),
    "RELAX": lambda c, _: lambda: c.arm.set_hand(None),
    "RESET": lambda c, _: c.signals.reset,
    "SIGNAL": lambda c, _, *numbers: lambda: c.signals.set(numbers),
    "SPEED": _speed,
    "TIMER": _set_timer,
}
"""What is done at once, and takes no time."""


def _alter(c: Context, i: Instruction, _channel: float, mode: float, *correction: float) -> Ask:
    """ALTER; what is given behind the mode is the first correction."""
    bits, corrects = whole(mode), any(operand is not None for operand in i.operands[2:])

    def ask() -> None:
        c.arm.set_alter(bits, now=c.now)
        if corrects:
            _correct(c, i, *correction)()

    return ask


def _correct(c: Context, _: Instruction, *values: float) -> Ask:
    def ask() -> None:
        c.powered()
        c.arm.alter(values, now=c.now)

    return ask


ALTERING: Final[dict[str, Preparation]] = {
    **dict.fromkeys(("ALTER", "ALTON"), _alter),
    **dict.fromkeys(("ALTOFF", "NOALTER"), lambda c, _: lambda: c.arm.set_alter(None, now=c.now)),
    "ALTOUT": _correct,
}
"""What is asked for at once; then a program waits: ALTOUT for its period, NOALTER until the arm stands."""


def _base(c: Context, _: Instruction, first: float | Transformation, *others: float) -> Ask:
    if isinstance(first, Transformation):
        return lambda: c.arm.set_base(first)
    *way, turn = others
    X = about_z(turn).X.copy()
    X[:3, 3] = first, *way
    return lambda: c.arm.set_base(Transformation(X))


AT_REST: Final[dict[str, Preparation]] = {
    "BASE": _base,
    "CLOSEI": lambda c, _: lambda: c.arm.actuate(False, now=c.now),
    "OPENI": lambda c, _: lambda: c.arm.actuate(True, now=c.now),
    "RELAXI": lambda c, _: lambda: c.arm.actuate(None, now=c.now),
    "TOOL": lambda c, _, tool: lambda: c.arm.set_tool(NULL if tool is None else tool),
}
"""What is done when the arm stands."""


def _prepared(x: Expressions, i: Instruction, make: Preparation) -> Callable[[Slots], Ask]:
    """What evaluates an instruction's operands, and gives what then asks."""
    slots, c = forms.INSTRUCTIONS[i.keyword].slots, x.context
    if i.keyword == "BASE" and len(i.operands) == 1 and not isinstance(i.operands[0], Number | Unary | Binary):
        slots = (OperandSlot("transformation", "frame"),)
    parts = x.operands(slots, i.operands, i.keyword, i.at)
    return lambda s: make(c, i, *[p(s) for p in parts])


def _here(x: Expressions, i: Instruction) -> Callable[[Slots], Ask]:
    c, frames, target = x.context, [], i.operands[0]
    if isinstance(target, Compound):
        frames, target = [x.transformation(p) for p in target.parts[:-1]], target.parts[-1]
    if not isinstance(target, Variable) or target.prefix == "$" or (frames and target.prefix):
        raise ValError("Invalid location", "HERE takes a name, or a compound that ends in one", place=i.at)
    name, slot = target, x.reference(target)

    def prepare(s: Slots) -> Ask:
        before = NULL
        for frame in frames:
            before = before @ frame(s)
        stands = c.arm.here(now=c.now)
        value = stands.joints if name.prefix else before.inverse() @ stands.tool if frames else stands.tool
        return lambda: c.memory.store(slot(s), value, name)

    return prepare


Pause: TypeAlias = Generator[float, None, None]
_CHANGING: Final = {"TIMER", "HERE", "#HERE", "DEST", "#DEST", "RANDOM", "SPEED"}
"""Functions whose values change with time alone."""


class _Look(Protocol):
    """A look at the arm: `ready`, the last motion has begun, or `settled`, it stands."""

    def __call__(self, *, now: float) -> bool: ...


def until(context: Context, look: _Look) -> Pause:
    """Wait until what was asked is answered, and the arm is as it's to be.

    Args:
        context: Of the arm.
        look: `ready` or `settled` of the arm.

    Raises:
        ValError: If what was asked was refused.
    """
    while not context.arm.answered(now=context.now) or not look(now=context.now):
        yield ARM


def _special(context: Context, action: Action) -> int:
    context.pending = action
    return SPECIAL


def _moving(context: Context, ask: Ask, following: int) -> Generator[float, None, int]:
    """Ask for a motion, and wait until it has begun; what a REACTI dropped before it began is asked for again."""
    while True:
        yield from until(context, context.arm.settled if context.stop_first else context.arm.ready)
        context.powered()
        ask()
        context.stop_first = False
        dropped = context.dropped
        yield from until(context, context.arm.ready)
        if context.dropped == dropped:
            return following


def _standing(context: Context, ask: Ask | None, following: Any) -> Generator[float, None, Any]:
    """Wait for the arm to stand, ask, and wait again."""
    yield from until(context, context.arm.settled)
    if ask is not None:
        ask()
        yield from until(context, context.arm.settled)
    return following


def _altering(context: Context, ask: Ask, following: int, *, ends: bool) -> Generator[float, None, int]:
    """Go on a period after a correction has begun, or when the arm stands.

    What a REACTI dropped before it began is asked for again.
    """
    dropped = context.dropped
    yield from until(context, context.arm.ready)
    while context.dropped != dropped:
        dropped = context.dropped
        yield from until(context, context.arm.settled)
        ask()
        yield from until(context, context.arm.ready)
    if ends:
        yield from until(context, context.arm.settled)
    over = context.now + (0.0 if ends else ALTER_PERIOD)
    while context.now < over:
        yield over
    return following


def _changes(e: Expression) -> bool:
    """Whether the value of an expression changes with time alone."""
    return any(isinstance(part, Apply) and part.function in _CHANGING for part in kinds.parts(e))


def _wait(x: Expressions, i: Instruction, following: int) -> StepFunction:
    """WAIT's condition; a bare number is a signal's, as in VAL. WAIT alone: a slice."""
    if not i.operands:
        return _sleep(x, i, following)
    (e,), c = i.operands, x.context
    number = e.operand if isinstance(e, Unary) and e.operator == "-" else e
    test = x.condition(Apply("SIG", (e,), e.at) if isinstance(number, Number) else e)
    polled = _changes(e)

    def waiting(s: Slots) -> Generator[float, None, int]:
        while not test(s):
            yield c.now + SLICE if polled else math.inf
        return following

    return lambda s: _special(c, Waiting(waiting(s), interruptible=True))


def _sleep(x: Expressions, i: Instruction, following: int) -> StepFunction:
    """WAIT.EVENT: a time, or for ever, as there are no other programs to send events."""
    c, *_, seconds = x.context, *x.operands(forms.INSTRUCTIONS[i.keyword].slots, i.operands, i.keyword, i.at)
    otherwise = SLICE if i.keyword == "WAIT" else math.inf

    def waiting(until: float) -> Generator[float, None, int]:
        while c.now < until:
            yield until
        return following

    def sleep(s: Slots) -> int:
        given = seconds(s)
        return _special(c, Waiting(waiting(c.now + (otherwise if given is None else given)), interruptible=True))

    return sleep


def _grasp(x: Expressions, i: Instruction, following: int, label: int | None) -> StepFunction:
    c, least = x.context, x.real(i.operands[0])

    def grasping(opening: float) -> Generator[float, None, int]:
        yield from _standing(c, lambda: c.arm.actuate(False, now=c.now), None)
        if c.arm.here(now=c.now).hand >= opening:
            return following
        if label is None:
            raise ValError("Nothing in the hand", f"it's open by less than {opening:.9g} mm")
        return label

    return lambda s: _special(c, Waiting(grasping(least(s))))


def _timed(c: Context, time: Callable[[Slots], float], prepare: Callable[[Slots], Ask]) -> Callable[[Slots], Ask]:
    """Ask for a motion at a time; where it can't be, the time isn't for the next one."""

    def timed(s: Slots) -> Ask:
        begins, ask = time(s), prepare(s)

        def both() -> None:
            c.arm.at(begins)
            try:
                ask()
            except ValError:
                c.arm.at(None)
                raise

        return both

    return timed


def instruction(x: Expressions, i: Instruction, index: int, jump: int | None) -> StepFunction:
    """The closure of an instruction.

    Args:
        x: Of the program.
        i: The instruction.
        index: Of its step.
        jump: Index of the step to which its label leads, if it has one.

    Raises:
        ValError: If there's none of this keyword, or an operand is missing or of a wrong type.
    """
    c, following = x.context, index + 1
    if i.keyword in MOTIONS:
        motion = _prepared(x, i, MOTIONS[i.keyword])
        timed = motion if i.begins is None else _timed(c, x.real(i.begins), motion)
        return lambda s: _special(c, Waiting(_moving(c, timed(s), following)))
    if i.keyword in AT_ONCE or i.keyword == "HERE":
        prepare = _here(x, i) if i.keyword == "HERE" else _prepared(x, i, AT_ONCE[i.keyword])

        def now(s: Slots) -> int:
            prepare(s)()
            return _special(c, following)

        return now
    if i.keyword in ALTERING:
        altering = _prepared(x, i, ALTERING[i.keyword])
        corrects = i.keyword == "ALTOUT" or len(i.operands) > 2

        def alter(s: Slots) -> int:
            ask = altering(s)
            ask()
            return _special(c, Waiting(_altering(c, ask, following, ends=not corrects)))

        return alter
    if i.keyword in AT_REST:
        at_rest = _prepared(x, i, AT_REST[i.keyword])
        return lambda s: _special(c, Waiting(_standing(c, at_rest(s), following)))
    match i.keyword:
        case "BREAK" | "BRAKE":

            def stop(_: Slots) -> int:
                if i.keyword == "BRAKE":
                    c.arm.brake(now=c.now)
                return _special(c, Waiting(_standing(c, None, following)))

            return stop
        case "TYPE":
            return _type(x, i, following)
        case "PROMPT":
            return _prompt(x, i, following)
        case "WAIT":
            return _wait(x, i, following)
        case "WAIT.EVENT":
            return _sleep(x, i, following)
        case "GRASP":
            return _grasp(x, i, following, jump)
        case "PAUSE":
            return lambda _: _special(c, Waiting(_standing(c, None, Suspend(following))))
        case "STOP" | "HALT":
            return lambda _: _special(c, Waiting(_standing(c, None, Finished(i.keyword))))
        case _:
            raise ValError("Unknown instruction", i.keyword, place=i.at)


# Dialogue.


def _type(x: Expressions, i: Instruction, following: int) -> StepFunction:
    context = x.context
    parts = [o if isinstance(o, Format) else x.value(o) for o in i.operands]

    def type_(s: Slots) -> int:
        text, ends = formats.spelled([p if isinstance(p, Format) else p(s) for p in parts])
        if context.switches["MESSAGES"]:
            context.events.append(Typed(text + "\n" if ends else text))
        return context.go_on(following)

    return type_


def _prompt(x: Expressions, i: Instruction, following: int) -> StepFunction:
    """Ask, and ask again until the answer is what is wanted."""
    context, text, names = x.context, x.string(i.operands[0]), i.operands[1:]
    slots = [x.reference(v) for v in names]
    if any(v.prefix == "#" for v in names):
        raise mismatch(next(v for v in names if v.prefix == "#"))

    def asking(question: str, targets: list[VariableSlot]) -> Generator[float, None, int]:
        context.answers.clear()
        context.asking = True
        try:
            while True:
                context.events.append(Asked(question))
                while not context.answers:
                    yield math.inf
                values = _answers(context.answers.pop(), names)
                if values is not None:
                    break
                context.events.append(Typed(f"*Illegal value* {_wanted(names)}\n"))
        finally:
            context.asking = False
        for slot, value, name in zip(targets, values, names, strict=True):
            context.memory.store(slot, value, name)
        return following

    def ask(s: Slots) -> int:
        context.pending = Waiting(asking(text(s), [slot(s) for slot in slots]))
        return SPECIAL

    return ask


def _answers(line: str, names: tuple[Variable, ...]) -> list[float | str] | None:
    """The values in an answer: parted by commas or blanks; a string at the end takes what is left.

    Returns:
        None if it isn't what is wanted.
    """
    rest = line.strip("\r\n")
    values: list[float | str] = []
    for n, name in enumerate(names, 1):
        if n == len(names) and name.prefix:
            return [*values, rest if n == 1 else rest.strip()]
        rest = rest.strip()
        end = next((k for k, c in enumerate(rest) if c == "," or (c.isspace() and not name.prefix)), len(rest))
        field, rest = rest[:end].strip(), rest[end:].lstrip().removeprefix(",")
        value = field if name.prefix else formats.whole_number(field)
        if value is None:
            return None
        values.append(value)
    return None if rest.strip() and names else values


def _wanted(names: tuple[Variable, ...]) -> str:
    return ", ".join(f"{v.name}: {'a string' if v.prefix else 'a number'}" for v in names)
