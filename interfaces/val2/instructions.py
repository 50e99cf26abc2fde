"""The instructions of VAL: how they're written, and the closures that carry them out, a step each.

One concept: each row of the table at the end says what one keyword is and does.

A closure returns the index of the next step. Operands are evaluated before anything is asked. A motion waits until
the one before it has begun, is asked for, and the program goes on when it has begun: it's then on its way while the
next one is asked for, which may go round its destination. RIGHTY and its like let the next motion begin at rest.

GOTO may lead anywhere in a program, into structures too: a FOR whose head was jumped over is an error at its END,
and a CASE whose head was jumped over ends where the next VALUE comes.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Generator
from functools import partial
from typing import Any, Final, Protocol, TypeAlias

from interfaces.val2 import formats
from interfaces.val2.context import (
    ARM,
    SLICE,
    SPECIAL,
    Action,
    Asked,
    Context,
    Ending,
    Invoke,
    StepFunction,
    Typed,
    Waiting,
    Warned,
)
from interfaces.val2.errors import ValError
from interfaces.val2.expressions import Expressions, kind_of
from interfaces.val2.functions import OPERATORS, whole
from interfaces.val2.memory import MOST_DIMENSIONS, Slots, VariableSlot, index, mismatch, undefined
from interfaces.val2.motion.places import ALTER_PERIOD
from interfaces.val2.motion.speeds import require
from interfaces.val2.rows import Form, OperandSlot, Origin
from interfaces.val2.signals import reaction_to
from interfaces.val2.structure import Structure, structure
from interfaces.val2.syntax import (
    Apply,
    Compound,
    Expression,
    Format,
    Instruction,
    Number,
    Program,
    Variable,
    literal,
    parts,
)
from interfaces.val2.values import NULL, Location, Transformation, about_z, to_oat

Do: TypeAlias = Callable[..., object]
"""Does what an instruction wants, of the context, the instruction, and the values of its operands."""
Ask: TypeAlias = Callable[[], object]
"""Does it with operands that have been evaluated."""


class ProgramCompiler(Expressions):
    """Makes closures of the steps of a program."""

    def __init__(self, program: Program, context: Context, found: Structure | None = None) -> None:
        """Find out what belongs together, unless that's given, and where the program's own names are.

        Raises:
            ValError: If its structures don't match, or a label is missing.
        """
        found = structure(program) if found is None else found
        self.program, self.jumps, self.blocks = program, found.jumps, found.blocks
        scope: dict[str, int | VariableSlot] = {p.name: i for i, p in enumerate(program.parameters)}
        self.names = len(program.parameters)
        self.kept: dict[int, int] = {}
        for i in (step.statement for step in program.steps):
            own = i.operands if i.keyword in ("AUTO", "LOCAL") else ()
            for name in (v.name for v in own if v.name not in scope):
                if i.keyword == "AUTO":
                    scope[name] = self.names
                    self.names += 1
                else:
                    scope[name] = context.memory.own(program.name, name)
        super().__init__(context, scope)

    def keep(self, n: int) -> int:
        """Number of the slot in which the FOR at a step keeps its limits."""
        return self.kept.setdefault(n, self.names + len(self.kept))

    def prepared(self, i: Instruction, do: Do, check: Do | None = None) -> Callable[[Slots], Ask]:
        """What evaluates an instruction's operands, and checks them, and gives what then does it."""
        slots, c = STATEMENTS[i.keyword].slots, self.context
        if i.keyword == "BASE" and stands_for_frame(i):
            slots = (OperandSlot("transformation", "frame"),)
        values = self.operands(slots, i.operands, i.keyword, i.at)

        def prepare(s: Slots) -> Ask:
            given = [value(s) for value in values]
            if check is not None:
                check(c, i, *given)
            return lambda: do(c, i, *given)

        return prepare

    def special(self, action: Callable[[Slots], Action]) -> StepFunction:
        """A step that wants something done."""
        context = self.context

        def step(s: Slots) -> int:
            context.pending = action(s)
            return SPECIAL

        return step


Act: TypeAlias = Callable[[ProgramCompiler, Instruction, int], StepFunction]
"""Makes the closure of an instruction that is a step, counted from 0."""


def stands_for_frame(i: Instruction) -> bool:
    """Whether the only operand of BASE is a transformation."""
    match i.operands:
        case (Number(),):
            return False
        case (Apply(name),):
            return name not in OPERATORS
    return len(i.operands) == 1


# What is done, of values.


def _move(c: Context, i: Instruction, location: Location, hand: float | None = None) -> None:
    """MOVET's opening [mm] is over 0; TRUE opens, 0 closes."""
    opening = hand if hand is None or hand > 0.0 else hand != 0.0
    c.arm.move(location, straight=i.keyword in ("MOVES", "MOVEST"), hand=opening, now=c.now)


def _approach(c: Context, i: Instruction, location: Location, height: float) -> None:
    c.arm.approach(location, height, straight=i.keyword == "APPROS", now=c.now)


def _depart(c: Context, i: Instruction, distance: float) -> None:
    c.arm.depart(distance, straight=i.keyword == "DEPARTS", now=c.now)


def _drive(c: Context, _: Instruction, joint: float, angle: float, percent: float) -> None:
    c.arm.drive(int(joint), angle, percent, now=c.now)


def _check_drive(c: Context, _: Instruction, joint: float, _angle: float, percent: float) -> None:
    if joint not in range(1, 7):
        raise ValError("Illegal joint number", f"{joint:.9g}: 1 to 6")
    c.capped("DRIVE at", percent)


def _speed(c: Context, i: Instruction, speed: float, turn: float | None) -> None:
    c.capped("SPEED of turning", turn or 0.0)
    if "MONITOR" in i.words:
        c.capped("Monitor SPEED", speed)
        c.arm.set_monitor_speed(speed, now=c.now)
        return
    unit = next((u for u in ("MMPS", "IPS") if u in i.words), "%")
    c.capped("SPEED", speed, c.arm.fastest(unit), unit)
    c.arm.set_speed(speed, turn=turn, unit=unit, always=_always(i))


def _always(i: Instruction) -> bool:
    return "ALWAYS" in i.words


def _accelerate(c: Context, _: Instruction, up: float, down: float | None) -> None:
    values = up, up if down is None else down
    c.capped("ACCEL", max(values))
    c.arm.set_acceleration(*values)


def _tolerance(c: Context, i: Instruction, percent: float | None) -> None:
    c.arm.set_tolerance(percent, fine=i.keyword == "FINE", always=_always(i))


def _configure(c: Context, i: Instruction) -> None:
    c.arm.set_configuration(i.keyword)
    c.stop_first = True


def _hand(i: Instruction, opening: float | None) -> float | bool:
    """What OPEN, CLOSE, OPENI and CLOSEI want of the hand: an opening [mm], or open or closed.

    Raises:
        ValError: If the opening is negative.
    """
    require(opening is None or opening >= 0.0, opening, "an opening is 0 mm or above")
    return i.keyword.startswith("OPEN") if opening is None else opening


def _hand_with_motion(c: Context, i: Instruction, opening: float | None) -> None:
    c.arm.set_hand(_hand(i, opening))


def _hand_now(c: Context, i: Instruction, opening: float | None) -> None:
    c.arm.actuate(_hand(i, opening), now=c.now)


def _check_hand(_: Context, i: Instruction, opening: float | None) -> None:
    _hand(i, opening)


def _set_timer(c: Context, _: Instruction, number: float, seconds: float) -> None:
    c.timers[c.timer(number)] = c.now - seconds


def _switch(c: Context, i: Instruction) -> None:
    for name in i.words:
        c.switch(name, i.keyword == "ENABLE")


def _alter(c: Context, i: Instruction, channel: float, mode: float, *correction: float) -> None:
    """ALTER; what is given behind the mode is the first correction."""
    c.arm.set_alter(whole(mode), whole(channel), now=c.now)
    if any(operand is not None for operand in i.operands[2:]):
        _correct(c, i, *correction)


def _correct(c: Context, _: Instruction, *values: float) -> None:
    c.powered()
    late = c.arm.alter(values, now=c.now)
    if late:
        c.warn(Warned(f"ALTOUT: {late}"))


def _base(c: Context, _: Instruction, first: float | Transformation, *others: float) -> None:
    if not isinstance(first, Transformation):
        *way, turn = others
        X = about_z(turn).X.copy()
        X[:3, 3] = first, *way
        first = Transformation(X)
    c.arm.set_base(first)


def _lock(c: Context, _: Instruction, priority: float) -> None:
    """Reactions have the lowest priority above 0, so that any priority above 0 defers all of them."""
    require(priority >= 0.0, priority, "a priority is 0 or above")
    c.reactions.locked = priority > 0.0


# How it's waited for.


Pause: TypeAlias = Generator[float, None, None]
_CHANGING: Final = {"TIMER", "HERE", "#HERE", "DEST", "#DEST", "RANDOM", "SPEED", "STATE"}
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


def _moving(context: Context, ask: Ask, following: int) -> Generator[float, None, int]:
    """Ask for a motion, and wait until it has begun; what a REACTI dropped before it began is asked for again."""
    while True:
        yield from until(context, context.arm.settled if context.stop_first else context.arm.ready)
        context.powered()
        ask()
        context.stop_first = context.braked = False
        context.moved = True
        dropped = context.dropped
        yield from until(context, context.arm.ready)
        if context.dropped == dropped:
            return following


def _standing(context: Context, ask: Ask, following: Any) -> Generator[float, None, Any]:
    """Wait for the arm to stand, ask, and wait again."""
    yield from until(context, context.arm.settled)
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


def _nothing(_c: Context, _i: Instruction) -> None:
    """Wait alone."""


def _asked(
    wait: Callable[[Context, Ask, Any], Generator[float, None, Any]], do: Do, check: Do | None = None
) -> Act:
    """What is asked for, and waited for."""

    def act(x: ProgramCompiler, i: Instruction, n: int) -> StepFunction:
        c, prepare = x.context, x.prepared(i, do, check)
        asks = prepare if i.begins is None else _timed(c, x.of_kind("real", i.begins), prepare)
        return x.special(lambda s: Waiting(wait(c, asks(s), n + 1)))

    return act


_motion: Final = partial(_asked, _moving)
_at_rest: Final = partial(_asked, _standing)


def _now(do: Do) -> Act:
    """What is done at once, and takes no time."""

    def act(x: ProgramCompiler, i: Instruction, n: int) -> StepFunction:
        prepare = x.prepared(i, do)

        def done(s: Slots) -> int:
            prepare(s)()
            return n + 1

        return x.special(done)

    return act


def _alteration(do: Do) -> Act:
    """What is asked for at once; then a program waits: ALTOUT for its period, NOALTER until the arm stands."""

    def act(x: ProgramCompiler, i: Instruction, n: int) -> StepFunction:
        prepare, ends = x.prepared(i, do), i.keyword != "ALTOUT" and len(i.operands) <= 2

        def alter(s: Slots) -> Waiting:
            ask = prepare(s)
            ask()
            return Waiting(_altering(x.context, ask, n + 1, ends=ends))

        return x.special(alter)

    return act


def _end_run(x: ProgramCompiler, i: Instruction, n: int) -> StepFunction:
    """PAUSE, STOP, HALT, when the arm stands."""
    return x.special(lambda _: Waiting(_standing(x.context, lambda: None, Ending(i.keyword, n + 1))))


def _here(x: ProgramCompiler, i: Instruction, n: int) -> StepFunction:
    c, frames, target = x.context, [], i.operands[0]
    if isinstance(target, Compound):
        frames, target = [x.of_kind("frame", p) for p in target.parts[:-1]], target.parts[-1]
    if not isinstance(target, Variable) or target.prefix == "$" or (frames and target.prefix):
        raise ValError("Invalid location", "HERE takes a name, or a compound that ends in one", place=i.at)
    name, slot = target, x.reference(target)

    def record(s: Slots) -> int:
        before = NULL
        for frame in frames:
            before = before @ frame(s)
        stands = c.arm.here(now=c.now)
        value = stands.joints if name.prefix else before.inverse() @ stands.tool if frames else stands.tool
        c.memory.store(slot(s), value, name)
        return n + 1

    return x.special(record)


def _changes(e: Expression) -> bool:
    """Whether the value of an expression changes with time alone."""
    return any(isinstance(part, Apply) and part.function in _CHANGING for part in parts(e))


def _wait(x: ProgramCompiler, i: Instruction, n: int) -> StepFunction:
    """WAIT's condition; a bare number is a signal's, as in VAL. WAIT alone: a slice."""
    if not i.operands:
        return _sleep(x, i, n)
    (e,), c = i.operands, x.context
    test = x.condition(e if literal(e) is None else Apply("SIG", (e,), e.at))
    polled = _changes(e)

    def waiting(s: Slots) -> Generator[float, None, int]:
        while not test(s):
            yield c.now + SLICE if polled else math.inf
        return n + 1

    return x.special(lambda s: Waiting(waiting(s), interruptible=True))


def _sleep(x: ProgramCompiler, i: Instruction, n: int) -> StepFunction:
    """WAIT.EVENT: a time, or for ever, as there are no other programs to send events."""
    c, *_, seconds = x.context, *x.operands(STATEMENTS[i.keyword].slots, i.operands, i.keyword, i.at)
    otherwise = SLICE if i.keyword == "WAIT" else math.inf

    def waiting(until: float) -> Generator[float, None, int]:
        while c.now < until:
            yield until
        return n + 1

    def sleep(s: Slots) -> Waiting:
        given = seconds(s)
        return Waiting(waiting(c.now + (otherwise if given is None else given)), interruptible=True)

    return x.special(sleep)


def _grasp(x: ProgramCompiler, i: Instruction, n: int) -> StepFunction:
    c, least, label = x.context, x.of_kind("real", i.operands[0]), x.jumps.get(n)

    def grasping(opening: float) -> Generator[float, None, int]:
        yield from _standing(c, lambda: c.arm.actuate(False, now=c.now), None)
        if c.arm.here(now=c.now).hand >= opening:
            return n + 1
        if label is None:
            raise ValError("Nothing in the hand", f"it's open by less than {opening:.9g} mm")
        return label

    return x.special(lambda s: Waiting(grasping(least(s))))


# What a step does with the program.


def _passed(_x: ProgramCompiler, _i: Instruction, n: int) -> StepFunction:
    return lambda _: n + 1


def _jump(x: ProgramCompiler, _: Instruction, n: int) -> StepFunction:
    target = x.jumps[n]
    return lambda _: target


def _divide(x: ProgramCompiler, _: Instruction, n: int) -> StepFunction:
    """VALUE, ANY and ELSE: what comes from the step before goes on behind the block."""
    target = x.blocks[n].end + 1
    return lambda _: target


def _leave(x: ProgramCompiler, _i: Instruction, _n: int) -> StepFunction:
    action = Ending("RETURN")
    return x.special(lambda _: action)


def _if(x: ProgramCompiler, i: Instruction, n: int) -> StepFunction:
    """IF, WHILE, UNTIL; IF condition GOTO label."""
    test, jump, following = x.condition(i.operands[0]), x.jumps[n], n + 1
    if len(i.operands) > 1:
        jump, following = following, jump
    return lambda s: following if test(s) else jump


def _end(x: ProgramCompiler, _: Instruction, n: int) -> StepFunction:
    block = x.blocks[n]
    target = block.start if block.kind == "WHILE" else n + 1
    if block.kind != "FOR":
        return lambda _: target
    k, body, following = x.keep(block.start), block.start + 1, n + 1
    variable: Variable = x.program.steps[block.start].statement.operands[0]

    def again(s: Slots) -> int:
        kept = s[k]
        if kept is None:
            raise ValError("Control structure error", "GOTO led into a FOR")
        slot, limit, by = kept
        value = slot.value
        if value.__class__ is not float:
            raise undefined(variable) if value is None else mismatch(variable)
        slot.value = value = value + by
        return body if (value <= limit if by > 0.0 else value >= limit) else following

    return again


def _for(x: ProgramCompiler, i: Instruction, n: int) -> StepFunction:
    variable, *limits = i.operands
    if variable.prefix:
        raise mismatch(variable)
    memory = x.context.memory
    start, stop, step = (x.of_kind("real", e) for e in (*limits, Number(1.0))[:3])
    slot, k, body, past = x.reference(variable), x.keep(n), n + 1, x.blocks[n].end + 1

    def begin(s: Slots) -> int:
        value, limit, by = start(s), stop(s), step(s)
        if by == 0.0:
            raise ValError("Illegal value", "STEP 0")
        counter = slot(s)
        memory.store(counter, value, variable)
        s[k] = counter, limit, by
        return body if (value <= limit if by > 0.0 else value >= limit) else past

    return begin


def _case(x: ProgramCompiler, i: Instruction, n: int) -> StepFunction:
    (value,), block = i.operands, x.blocks[n]
    kind = "string" if kind_of(value) == "string" else "real"
    given, arms, otherwise = x.of_kind(kind, value), [], block.end + 1
    for arm in block.arms:
        statement = x.program.steps[arm].statement
        if statement.keyword == "VALUE":
            arms.append(([x.of_kind(kind, v) for v in statement.operands], arm + 1))
        else:
            otherwise = arm + 1

    def choose(s: Slots) -> int:
        it = given(s)
        for values, target in arms:
            for one in values:
                if one(s) == it:
                    return target
        return otherwise

    return choose


def _call(x: ProgramCompiler, i: Instruction, n: int) -> StepFunction:
    """Arguments are by reference where they're names, by value where they're anything else."""
    context, at = x.context, i.at

    def argument(e: Expression | None) -> Callable[[Slots], VariableSlot]:
        if e is None:
            return lambda _: VariableSlot()
        if isinstance(e, Variable):
            return x.reference(e)
        value = x.value(e)
        return lambda s: VariableSlot(value(s))

    given = [argument(a) for a in i.operands]
    prefixes = [None if a is None else {"string": "$", "point": "#"}.get(kind_of(a), "") for a in i.operands]

    def invoke(s: Slots) -> Invoke:
        code = context.code(i.program, at)
        for prefix, parameter in zip(prefixes, code.program.parameters, strict=False):
            if prefix is not None and prefix != parameter.prefix:
                raise ValError("Variable type mismatch", f"argument {parameter.name}", place=at)
        return Invoke(code, code.slots([slot(s) for slot in given]), n + 1)

    return x.special(invoke)


def _react(x: ProgramCompiler, i: Instruction, n: int) -> StepFunction:
    context, signal = x.context, x.of_kind("signal", i.operands[0])

    def watch(s: Slots) -> int:
        if i.program:
            context.code(i.program, i.at)
        immediate = i.keyword == "REACTI"
        context.reactions.add(reaction_to(signal(s), i.program, immediate=immediate, always=_always(i)))
        return n + 1

    return watch


# Names.


def _set(x: ProgramCompiler, i: Instruction, n: int) -> StepFunction:
    (name, e), context = i.operands, x.context
    if name.prefix == "$":
        raise mismatch(name)
    slot, read = x.reference(name), x.of_kind("point" if name.prefix else "frame", e)

    def set_(s: Slots) -> int:
        value = read(s)
        context.memory.store(slot(s), value, name)
        return context.go_on(n + 1)

    return set_


def _assign(x: ProgramCompiler, i: Instruction, n: int) -> StepFunction:
    (name, e), memory, following = i.operands, x.context.memory, n + 1
    if name.prefix == "#":
        raise mismatch(name)
    slot, read = x.reference(name), x.of_kind("string" if name.prefix else "real", e)
    type_ = None if name.prefix else float

    def assign(s: Slots) -> int:
        value = read(s)
        target = slot(s)
        if target.value.__class__ is type_:
            target.value = value
        else:
            memory.store(target, value, name)
        return following

    return assign


def _decompose(x: ProgramCompiler, i: Instruction, n: int) -> StepFunction:
    """Six numbers, from the element that is named on; from 0 where none is."""
    (target, e), context, memory = i.operands, x.context, x.context.memory
    if target.prefix:
        raise mismatch(target)
    if len(target.indices) > MOST_DIMENSIONS:
        raise ValError("Invalid array index", f"{MOST_DIMENSIONS} dimensions at most", place=target.at)
    read, place = x.of_kind("location", e), x.slot(target.name)
    first = [x.of_kind("real", k) for k in target.indices] or [lambda _: 0.0]

    def decompose(s: Slots) -> int:
        location = read(s)
        values = to_oat(location) if isinstance(location, Transformation) else location.joints
        *before, start = [index(f(s), target.at) for f in first]
        array = s[place] if isinstance(place, int) else place
        for k, value in enumerate(values, start):
            last = index(float(k), target.at)
            memory.store(memory.element(array, (*before, last) if before else last), value, target)
        return context.go_on(n + 1)

    return decompose


# Dialogue.


def _type(x: ProgramCompiler, i: Instruction, n: int) -> StepFunction:
    context = x.context
    items = [o if isinstance(o, Format) else x.value(o) for o in i.operands]

    def type_(s: Slots) -> int:
        text, ends = formats.spelled([o if isinstance(o, Format) else o(s) for o in items])
        if context.switches["MESSAGES"]:
            context.events.append(Typed(text + "\n" if ends else text))
        return context.go_on(n + 1)

    return type_


def _prompt(x: ProgramCompiler, i: Instruction, n: int) -> StepFunction:
    """Ask, and ask again until the answer is what is wanted."""
    context, text, names = x.context, x.of_kind("string", i.operands[0]), i.operands[1:]
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
        return n + 1

    return x.special(lambda s: Waiting(asking(text(s), [slot(s) for slot in slots])))


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


# The table.


def _movement(
    name: str, spelled: str, explanation: str, do: Do, check: Do | None = None, *, origin: Origin = "VAL"
) -> Form:
    """The row of a motion, before which AT may stand."""
    return Form(name, spelled, explanation, origin, _motion(do, check), rule="motion")


_ROWS: Final = (
    # Motions.
    _movement("MOVE", "location:location", "Move to a location, the joints together.", _move),
    _movement("MOVES", "location:location", "Move the tool to a location on a straight line.", _move),
    _movement("MOVET", "location:location, opening", "MOVE, the hand to an opening [mm], TRUE, FALSE.", _move),
    _movement("MOVEST", "location:location, opening", "MOVET on a straight line.", _move),
    _movement("APPRO", "location:location, distance",
              "Move to a distance [mm] behind a location, along its tool axis.", _approach),
    _movement("APPROS", "location:location, distance", "APPRO on a straight line.", _approach),
    _movement("DEPART", "distance", "Move back by a distance [mm] along the tool axis, from the destination.",
              _depart),
    _movement("DEPARTS", "distance", "DEPART on a straight line.", _depart),
    _movement("DRIVE", "joint:joint, change, speed:percent", "Turn one joint by a change [deg] at a speed [%].",
              _drive, _check_drive),
    _movement("DRAW", "dx?=0, dy?=0, dz?=0", "Move straight by a way in world axes [mm].",
              lambda c, _, *way: c.arm.draw(*way, now=c.now)),
    _movement("READY", "", "Move to the ready position: the arm straight up.",
              lambda c, _: c.arm.go_ready(now=c.now)),
    _movement("NEST", "", "Move to the position in which the arm is parked.", lambda c, _: c.arm.nest(now=c.now),
              origin="VAL-II"),
    _movement("ALIGN", "", "Turn the tool's axis to the nearest axis of the world.",
              lambda c, _: c.arm.align(now=c.now)),
    Form("DELAY", "seconds:seconds", "Stand still for a time, as a motion.", "VAL",
         _motion(lambda c, _, seconds: c.arm.delay(seconds, now=c.now))),
    Form("BREAK", "", "Wait until the arm stands at its destination.", "VAL-II", _at_rest(_nothing)),
    Form("BRAKE", "", "Stop the present motion at once.", "V+", _at_rest(_nothing, lambda c, _: c.brake())),
    Form("AT", "time:time", "The next motion begins at a time of the session [s].", "ours",
         _now(lambda c, _, t: c.arm.at(t)), usage="AT time [motion]", rule="timed"),
    # Settings.
    Form("SPEED", "speed:speed, turning:percent?",
         "Speed of the next motion, [%] of the nominal or of the tool; ALWAYS: of all.", "VAL", _now(_speed),
         words="MMPS|IPS|MONITOR ALWAYS", rule="speed", tags="beside"),
    Form("ACCEL", "up:percent, down:percent?", "Accelerations: [%] of the nominal.", "V+", _now(_accelerate),
         rule="channel"),
    Form("DURATION", "seconds:seconds", "Shortest time of the next motion; ALWAYS: each.", "V+",
         _now(lambda c, i, t: c.arm.set_duration(t, always=_always(i))), words="ALWAYS"),
    Form("COARSE", "percent?", "The next motion may end roughly; ALWAYS: each.", "VAL", _now(_tolerance),
         words="ALWAYS"),
    Form("FINE", "percent?", "The next motion ends exactly; ALWAYS: each.", "VAL-II", _now(_tolerance),
         words="ALWAYS"),
    Form("NULL", "", "The next motion ends when the real arm is there; ALWAYS: each.", "VAL",
         _now(lambda c, i: c.arm.set_nulling(True, always=_always(i))), words="ALWAYS"),
    Form("NONULL", "", "The next motion ends without waiting for the real arm; ALWAYS: each.", "VAL",
         _now(lambda c, i: c.arm.set_nulling(False, always=_always(i))), words="ALWAYS"),
    Form("RIGHTY", "", "The arm is to be right-handed from the next MOVE on.", "VAL", _now(_configure)),
    Form("LEFTY", "", "The arm is to be left-handed from the next MOVE on.", "VAL", _now(_configure)),
    Form("ABOVE", "", "The elbow is to be above from the next MOVE on.", "VAL", _now(_configure)),
    Form("BELOW", "", "The elbow is to be below from the next MOVE on.", "VAL", _now(_configure)),
    Form("FLIP", "", "The wrist is to be flipped from the next MOVE on.", "VAL", _now(_configure)),
    Form("NOFLIP", "", "The wrist is not to be flipped from the next MOVE on.", "VAL", _now(_configure)),
    Form("TOOL", "transformation:frame?", "The tool's tip relative to the flange; NULL without one.", "VAL",
         _at_rest(lambda c, _, tool: c.arm.set_tool(NULL if tool is None else tool))),
    Form("BASE", "dx?=0, dy?=0, dz?=0, turn?=0",
         "Where the robot stands in the world: shifted [mm], turned about z [deg].", "VAL", _at_rest(_base)),
    Form("ENABLE", "", "Turn switches on.", "VAL", _now(_switch), usage="ENABLE switch, ..", tags="beside",
         rule="switches"),
    Form("DISABLE", "", "Turn switches off.", "VAL", _now(_switch), usage="DISABLE switch, ..", tags="beside",
         rule="switches"),
    Form("PARAMETER", "value", "Set a parameter.", "VAL-II",
         _now(lambda c, i, value: c.parameter(i.words[0], value)), usage="PARAMETER name = value", tags="beside",
         rule="parameter"),
    Form("ALTER", "channel?=0, mode:mode?=0, dx?=0, dy?=0, dz?=0, rx?=0, ry?=0, rz?=0",
         "Corrections of the path begin: mode 1 cumulative, 2 world axes.", "VAL-II", _alteration(_alter),
         usage="ALTER (channel) mode", tags="beside", rule="channel"),
    Form("ALTOUT", "dx?=0, dy?=0, dz?=0, rx?=0, ry?=0, rz?=0",
         "Correct the path, or the tool's place, by a way [mm] and a turn [deg]; 28 ms each.", "VAL-II",
         _alteration(_correct), tags="beside"),
    Form("NOALTER", "", "Corrections of the path end.", "VAL-II",
         _alteration(lambda c, _: c.arm.set_alter(None, now=c.now)), tags="beside"),
    Form("ALTON", "channel?=0, mode:mode?=0", "Corrections of the path begin, as by ALTER.", "V+",
         _alteration(_alter), usage="ALTON (channel) mode", rule="channel"),
    Form("ALTOFF", "", "Corrections of the path end, as by NOALTER.", "V+",
         _alteration(lambda c, _: c.arm.set_alter(None, now=c.now))),
    # Hand.
    Form("OPEN", "opening?", "Open the hand, or to an opening [mm], with the next motion.", "VAL",
         _now(_hand_with_motion)),
    Form("CLOSE", "opening?", "Close the hand, or to an opening [mm], with the next motion.", "VAL",
         _now(_hand_with_motion)),
    Form("RELAX", "", "Let the hand go slack with the next motion.", "VAL",
         _now(lambda c, _: c.arm.set_hand(None))),
    Form("OPENI", "opening?", "Open the hand, or to an opening [mm], now, where the arm stands.", "VAL",
         _at_rest(_hand_now, _check_hand)),
    Form("CLOSEI", "opening?", "Close the hand, or to an opening [mm], now, where the arm stands.", "VAL",
         _at_rest(_hand_now, _check_hand)),
    Form("RELAXI", "", "Let the hand go slack now, where the arm stands.", "VAL",
         _at_rest(lambda c, _: c.arm.actuate(None, now=c.now))),
    Form("GRASP", "opening, label:label?", "Close the hand; go to a label if it's less open than that [mm].", "VAL",
         _grasp),
    # Locations.
    Form("SET", "variable:variable, location:location", "Assign a location.", "VAL", _set,
         usage="SET variable = location", tags="beside", rule="set"),
    Form("HERE", "variable:variable", "Record where the tool is; of a compound, its last part.", "VAL", _here,
         tags="beside"),
    Form("DECOMPOSE", "array:variable, location:location", "Six numbers of a location into an array's elements.",
         "V+", _decompose, usage="DECOMPOSE array[first] = location", tags="beside", rule="set"),
    Form("SHIFT", "variable:variable, dx?, dy?, dz?", "Shift a location in world axes [mm].", "VAL", _passed,
         usage="SHIFT variable BY dx, dy, dz", rule="shift"),
    # Signals and time.
    Form("SIGNAL", "number:output*", "Turn outputs on, or off where negative.", "VAL",
         _now(lambda c, _, *numbers: c.signals.set(numbers)), tags="beside"),
    Form("BITS", "first:output, count?=1, value", "Turn a group of signals on or off, by the bits of a value.",
         "V+", _now(lambda c, _, *group: c.signals.set_group(*group)), usage="BITS first[, count] = value",
         tags="beside", rule="group"),
    Form("RESET", "", "Turn all outputs off.", "V+", _now(lambda c, _: c.signals.reset()), tags="beside"),
    Form("WAIT", "condition?", "Wait until a condition holds.", "VAL", _wait),
    Form("WAIT.EVENT", "mask?, seconds:seconds?", "Wait for a time.", "V+", _sleep),
    Form("TIMER", "number:timer, seconds", "Set a timer.", "VAL-II", _now(_set_timer),
         usage="TIMER number = seconds", tags="beside", rule="timing"),
    Form("REACT", "signal:signal, program:program?",
         "Call a program after the present step when a signal turns on.", "VAL", _react, words="ALWAYS"),
    Form("REACTI", "signal:signal, program:program?", "REACT, stopping the present motion at once.", "VAL", _react,
         words="ALWAYS"),
    Form("IGNORE", "signal:signal", "Don't react to a signal any more.", "VAL",
         _now(lambda c, _, signal: c.reactions.ignore(signal))),
    Form("LOCK", "priority", "Let reactions wait, until LOCK 0 or the end of the one that says it.", "V+",
         _now(_lock)),
    # Control.
    Form("IF", "condition:condition, label:label?", "Do steps if a condition holds.", "VAL", _if,
         usage="IF condition THEN .. ELSE .. END, IF condition GOTO label", tags="opens program", rule="branch"),
    Form("ELSE", "", "Do steps if the condition of IF doesn't hold.", "VAL-II", _divide,
         tags="opens closes program"),
    Form("END", "", "The end of IF, WHILE, FOR or CASE.", "VAL-II", _end, tags="closes program", rule="end"),
    Form("WHILE", "condition:condition", "Repeat steps as long as a condition holds.", "VAL-II", _if,
         usage="WHILE condition DO .. END", tags="opens program", rule="while"),
    Form("DO", "", "Repeat steps until a condition holds.", "VAL-II", _passed, usage="DO .. UNTIL condition",
         tags="opens program"),
    Form("UNTIL", "condition:condition", "The end of DO.", "VAL-II", _if, tags="closes program"),
    Form("FOR", "variable:variable, start, stop, step?", "Repeat steps, counting.", "VAL-II", _for,
         usage="FOR variable = start TO stop [STEP step] .. END", tags="opens program", rule="loop"),
    Form("CASE", "value:any", "Do the steps of one of several values.", "VAL-II", _case,
         usage="CASE value OF .. END", tags="opens program", rule="case"),
    Form("VALUE", "value:any*", "What of a CASE is done for these values.", "VAL-II", _divide,
         usage="VALUE value, ..:", tags="opens closes program", rule="values"),
    Form("ANY", "", "What of a CASE is done for any other value.", "VAL-II", _divide, tags="opens closes program",
         rule="values"),
    Form("EXIT", "count:count?", "Leave the innermost loop, or as many.", "VAL-II", _jump, tags="program"),
    Form("NEXT", "count:count?", "Go on with the next turn of the innermost loop.", "VAL-II", _jump,
         tags="program"),
    Form("GOTO", "label:label", "Go on at a label.", "VAL", _jump, tags="program"),
    Form("CALL", "argument:any?*", "Call a program; arguments by reference.", "VAL-II", _call,
         usage="CALL program(argument, ..)", rule="call"),
    Form("GOSUB", "argument:any?*", "Call a program.", "VAL", _call, usage="GOSUB program", rule="call"),
    Form("RETURN", "", "Go back to the program that called.", "VAL", _leave, tags="program"),
    Form("PAUSE", "", "Pause until PROCEED.", "VAL", _end_run),
    Form("STOP", "", "End this cycle of the program.", "VAL", _end_run),
    Form("HALT", "", "End the program, whatever cycles are left.", "VAL", _end_run),
    # Dialogue and names.
    Form("TYPE", "item:any?*", "Print texts and values; /F8.2 and such say how.", "VAL", _type, tags="beside",
         rule="items"),
    Form("PROMPT", "text:string?, variable:variable?*", "Print a text, read values.", "VAL-II", _prompt),
    Form("REMARK", "text:text?", "A comment.", "VAL", _passed, usage="REMARK text", rule="remark"),
    Form("AUTO", "name:variable*", "Names of this call of the program alone.", "V+", _passed,
         usage="AUTO [REAL|LOC] name, ..", tags="program", rule="names"),
    Form("LOCAL", "name:variable*", "Names of this program alone.", "V+", _passed,
         usage="LOCAL [REAL|LOC] name, ..", tags="program", rule="names"),
    Form("GLOBAL", "name:variable*", "Names of all programs, as they are without a word.", "V+", _passed,
         usage="GLOBAL [REAL|LOC] name, ..", tags="program", rule="names"),
)  # fmt: skip

INSTRUCTIONS: Final[dict[str, Form]] = {row.name: row for row in _ROWS}
"""Keywords of a program's lines."""
STATEMENTS: Final = {
    **INSTRUCTIONS,
    "": Form("", "", "Nothing, or a comment alone.", "VAL", _passed),
    "=": Form("=", "variable:variable, value:alike", "Assign a number or a string.", "VAL", _assign,
              rule="assignment", tags="beside"),
}  # fmt: skip
"""Lines that begin with no keyword among them."""
