"""Instructions, a keyword with operands each, as closures: what moves the arm, and what sets or asks something.

Operands are evaluated before anything is asked. A motion waits until the one before it has begun, is asked for, and
the program goes on when it has begun: it's then on its way while the next one is asked for, which may go round its
destination. RIGHTY and its like let the next motion begin at rest.
"""

from __future__ import annotations

from collections.abc import Callable, Generator
from typing import Any, Final, Protocol, TypeAlias

from interfaces.val2.code import StepFunction
from interfaces.val2.context import ARM, SLICE, SPECIAL, Action, Context, Finish, Suspend, Waiting
from interfaces.val2.errors import ValError
from interfaces.val2.expressions import Expressions
from interfaces.val2.memory import where
from interfaces.val2.motions import MOTIONS
from interfaces.val2.operands import Ask, Operands
from interfaces.val2.operations import Real, Slots
from interfaces.val2.ports import ALTER_PERIOD
from interfaces.val2.settings import ALTERING, AT_ONCE, AT_REST
from interfaces.val2.syntax import Apply, Binary, Compound, Expression, Instruction, Number, Unary, Variable

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
            return lambda _: _special(c, Finish(i.keyword))
        case _:
            raise ValError("Unknown instruction", i.keyword, place=where(i.at))
