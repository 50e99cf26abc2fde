"""Instructions, a keyword with operands each, as closures: what moves the arm, and what sets or asks something.

One concept: each row says what one keyword does.

Operands are evaluated before anything is asked. A motion waits until the one before it has begun, is asked for, and
the program goes on when it has begun: it's then on its way while the next one is asked for, which may go round its
destination. RIGHTY and its like let the next motion begin at rest.
"""

from __future__ import annotations

from collections.abc import Callable, Generator
from typing import Any, Final, Protocol, TypeAlias

from interfaces.val2.arithmetic import Real, Slots, whole
from interfaces.val2.context import ARM, SLICE, SPECIAL, Action, Context, Finished, StepFunction, Suspend, Waiting
from interfaces.val2.errors import ValError
from interfaces.val2.expressions import Expressions
from interfaces.val2.memory import where
from interfaces.val2.ports import ALTER_PERIOD
from interfaces.val2.syntax import Apply, Binary, Compound, Expression, Instruction, Number, Unary, Variable
from interfaces.val2.values import NULL, Transformation, about_z

Ask: TypeAlias = Callable[[], None]
"""Asks for what an instruction wants; its operands have been evaluated."""


class Operands:
    """The operands of one instruction, as closures."""

    def __init__(self, x: Expressions, instruction: Instruction) -> None:
        self.x, self.given, self.instruction = x, instruction.operands, instruction

    def present(self, i: int) -> bool:
        """Whether it's there."""
        return i < len(self.given) and self.given[i] is not None

    def expression(self, i: int) -> Expression:
        """An operand.

        Raises:
            ValError: If it's missing.
        """
        if self.present(i):
            return self.given[i]  # type: ignore[return-value]
        raise ValError("Missing argument", self.instruction.keyword, place=where(self.instruction.at))

    def real(self, i: int, otherwise: float | None = None) -> Real:
        """A real; without `otherwise` it must be there."""
        if otherwise is not None and not self.present(i):
            return lambda _: otherwise
        return self.x.real(self.expression(i))

    def reals(self, count: int, otherwise: float = 0.0) -> list[Real]:
        """The first few, those that were left out filled up."""
        return [self.real(i, otherwise) for i in range(count)]

    def says(self, word: str) -> bool:
        """Whether a word follows."""
        return word in self.instruction.words


Preparation: TypeAlias = Callable[[Operands, Context], Callable[[Slots], Ask]]
"""Makes a closure that evaluates an instruction's operands, and gives what then asks."""


def numbers(o: Operands, count: int, ask: Callable[..., None], *, all_given: bool = True) -> Callable[[Slots], Ask]:
    """Prepare a call with the first few operands, reals all; `all_given` if none of them may be left out."""
    parts = [o.real(i) for i in range(count)] if all_given else o.reals(count)

    def prepare(s: Slots) -> Ask:
        values = [p(s) for p in parts]
        return lambda: ask(*values)

    return prepare


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


def _changes(e: Expression | object) -> bool:
    """Whether the value of an expression changes with time alone."""
    match e:
        case Apply(function, arguments):
            return function in _CHANGING or any(_changes(a) for a in arguments)
        case Unary(_, operand):
            return _changes(operand)
        case Binary(_, left, right):
            return _changes(left) or _changes(right)
        case Compound(parts) | Variable(_, parts):
            return any(_changes(p) for p in parts)
        case _:
            return False


def _condition(o: Operands) -> Callable[[Slots], bool]:
    """WAIT's; a bare number is a signal's, as in VAL."""
    e = o.expression(0)
    number = e.operand if isinstance(e, Unary) and e.operator == "-" else e
    return o.x.condition(Apply("SIG", (e,), e.at) if isinstance(number, Number) else e)


def _wait(o: Operands, c: Context, following: int) -> StepFunction:
    if not o.present(0):
        return _sleep(o, c, following)
    test = _condition(o)
    polled = _changes(o.given[0])

    def waiting(s: Slots) -> Generator[float, None, int]:
        while not test(s):
            yield c.now + SLICE if polled else float("inf")
        return following

    return lambda s: _special(c, Waiting(waiting(s), interruptible=True))


def _sleep(o: Operands, c: Context, following: int) -> StepFunction:
    """WAIT alone: a slice; WAIT.EVENT: a time, or for ever, as there are no other programs to send events."""
    seconds = o.real(1, float("inf")) if o.instruction.keyword == "WAIT.EVENT" else o.real(0, SLICE)

    def waiting(until: float) -> Generator[float, None, int]:
        while c.now < until:
            yield until
        return following

    return lambda s: _special(c, Waiting(waiting(c.now + seconds(s)), interruptible=True))


def _grasp(o: Operands, c: Context, following: int, label: int | None) -> StepFunction:
    least = o.real(0)

    def grasping(opening: float) -> Generator[float, None, int]:
        yield from _standing(c, lambda: c.arm.actuate(False, now=c.now), None)
        if c.arm.here(now=c.now).hand >= opening:
            return following
        if label is None:
            raise ValError("Nothing in the hand", f"it's open by less than {opening:.9g} mm")
        return label

    return lambda s: _special(c, Waiting(grasping(least(s))))


def _timed(c: Context, time: Real, prepare: Callable[[Slots], Ask]) -> Callable[[Slots], Ask]:
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
    c, o, following = x.context, Operands(x, i), index + 1
    if (motion := MOTIONS.get(i.keyword)) is not None:
        prepare = motion(o, c) if i.begins is None else _timed(c, x.real(i.begins), motion(o, c))
        return lambda s: _special(c, Waiting(_moving(c, prepare(s), following)))
    if (at_once := AT_ONCE.get(i.keyword)) is not None:
        prepare = at_once(o, c)

        def now(s: Slots) -> int:
            prepare(s)()
            return _special(c, following)

        return now
    if (altering := ALTERING.get(i.keyword)) is not None:
        ask_for = altering(o, c)
        corrects = i.keyword == "ALTOUT" or len(i.operands) > 2

        def alter(s: Slots) -> int:
            ask = ask_for(s)
            ask()
            return _special(c, Waiting(_altering(c, ask, following, ends=not corrects)))

        return alter
    if (at_rest := AT_REST.get(i.keyword)) is not None:
        prepare = at_rest(o, c)
        return lambda s: _special(c, Waiting(_standing(c, prepare(s), following)))
    match i.keyword:
        case "BREAK":
            return lambda _: _special(c, Waiting(_standing(c, None, following)))
        case "BRAKE":

            def brake(_: Slots) -> int:
                c.arm.brake(now=c.now)
                return _special(c, Waiting(_standing(c, None, following)))

            return brake
        case "WAIT":
            return _wait(o, c, following)
        case "WAIT.EVENT":
            return _sleep(o, c, following)
        case "GRASP":
            return _grasp(o, c, following, jump)
        case "PAUSE":
            return lambda _: _special(c, Waiting(_standing(c, None, Suspend(following))))
        case "STOP" | "HALT":
            return lambda _: _special(c, Waiting(_standing(c, None, Finished(i.keyword))))
        case _:
            raise ValError("Unknown instruction", i.keyword, place=where(i.at))
