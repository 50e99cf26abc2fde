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
from collections.abc import Callable, Generator, Iterator
from dataclasses import replace
from functools import partial
from typing import Any, Final, TypeAlias, TypeVar

from interfaces.val2 import formats
from interfaces.val2.context import (
    SLICE,
    SPECIAL,
    Action,
    Asked,
    Code,
    Context,
    Ending,
    Invoke,
    StepFunction,
    Typed,
    Waiting,
    Warned,
    until,
)
from interfaces.val2.errors import ValError
from interfaces.val2.expressions import PACKED, Expressions, kind_of, packed
from interfaces.val2.functions import OPERATORS, whole
from interfaces.val2.memory import MOST_DIMENSIONS, Slots, VariableSlot, index, mismatch, undefined
from interfaces.val2.motion.places import ALTER_PERIOD
from interfaces.val2.motion.speeds import require
from interfaces.val2.rows import Form, OperandSlot, Origin, numbered
from interfaces.val2.signals import USUAL, Reaction, Reactions, legal
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
from interfaces.val2.units import NOT_READY, NOT_VALID, OURS, TERMINAL
from interfaces.val2.values import NULL, Location, Transformation, about_z

Do: TypeAlias = Callable[..., Any]
"""Does what an instruction wants, of the context, the instruction, and the values of its operands."""
Ask: TypeAlias = Callable[[], Any]
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
        super().__init__(context, scope, program.dialect)

    def keep(self, n: int) -> int:
        """Number of the slot in which the FOR at a step keeps its limits."""
        return self.kept.setdefault(n, self.names + len(self.kept))

    def prepared(
        self, i: Instruction, do: Do, check: Do | None = None, *, arm: bool = False
    ) -> Callable[[Slots], Ask]:
        """What evaluates an instruction's operands, and checks them, and gives what then does it.

        Args:
            i: The instruction.
            do: Does it.
            check: Raises where the operands can't be.
            arm: Whether the task has to have the arm.
        """
        slots, c = STATEMENTS[i.keyword].slots, self.context
        if i.keyword == "BASE" and stands_for_frame(i):
            slots = (OperandSlot("transformation", "frame"),)
        values = self.operands(slots, i.operands)

        def prepare(s: Slots) -> Ask:
            given = [value(s) for value in values]
            if arm:
                c.require_arm(i.keyword)
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


def reactions_of(c: Context) -> Reactions:
    """Those of the task whose step is done."""
    return c.reactions if c.task is None else c.task.reactions


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
    numbered("joint", joint)
    c.capped("DRIVE at", percent)


def _speed(c: Context, i: Instruction, speed: float, turn: float | None) -> None:
    c.capped("SPEED of turning", turn or 0.0)
    if "MONITOR" in i.words:
        c.capped("Monitor SPEED", speed)
        c.arm.set_monitor_speed(speed, now=c.now)
        return
    c.require_arm(i.keyword)
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
    c.timers[numbered("timer", number)] = c.now - seconds


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


def _channel(c: Context, i: Instruction, number: float, value: float) -> None:
    """DAC, IOPUT."""
    c.channels[i.keyword][numbered("channel", number)] = value


def _path(c: Context, i: Instruction) -> None:
    """CPON, CPOFF: of the end of the next motion; ALWAYS: of each, as the switch CP."""
    on = i.keyword == "CPON"
    if _always(i):
        c.switch("CP", on)
    c.path = c.path[0], None if _always(i) else on


def _base(c: Context, _: Instruction, first: float | Transformation, *others: float) -> None:
    if not isinstance(first, Transformation):
        *way, turn = others
        X = about_z(turn).X.copy()
        X[:3, 3] = first, *way
        first = Transformation(X)
    c.arm.set_base(first)


def _lock(c: Context, _: Instruction, priority: float) -> None:
    require(priority >= 0.0, priority, "a priority is 0 or above")
    reactions_of(c).priority = priority


def _take_arm(c: Context, following: int) -> Pause[int]:
    """ATTACH of the arm: wait until no other task has it."""
    task = c.task
    assert task is not None
    task.attaching = True
    try:
        while c.arm_holder() not in (None, task):
            yield c.now + SLICE
    finally:
        task.attaching = False
    task.robot = True
    return following


def _attach(x: ProgramCompiler, i: Instruction, n: int) -> StepFunction:
    """ATTACH a logical unit; without a device and a number it's the arm."""
    c, target = x.context, i.operands[0] if i.operands else None
    unit, mode, device = x.operands(STATEMENTS[i.keyword].slots, i.operands)
    slot = x.reference(target) if isinstance(target, Variable) else None

    def attach(s: Slots) -> Action:
        given, kind = None if whole(mode(s)) & OURS else whole(unit(s)), device(s) or ""
        if given == 0 and not kind:
            return Waiting(_take_arm(c, n + 1))
        number = c.units.attach(given, kind)
        if given is None:
            if slot is None:
                raise ValError("Invalid argument", f"ATTACH with mode {OURS} gives a variable the unit's number")
            assert isinstance(target, Variable)
            c.memory.store(slot(s), float(number), target)
        return n + 1

    return x.special(attach)


def _detach(c: Context, _: Instruction, unit: float) -> Pause[None]:
    """DETACH; the arm when it stands."""
    if number := whole(unit):
        c.units.detach(number)
        return
    yield from _standing(c, lambda: None, None)
    if c.task is not None:
        c.task.robot = False


def _read(x: ProgramCompiler, i: Instruction, n: int) -> StepFunction:
    """READ a line of a file, or of the terminal."""
    c, names = x.context, i.operands[3:]
    unit, *_ = x.operands(STATEMENTS[i.keyword].slots[:3], i.operands[:3])
    asking = _asking(x, names)
    slots = [x.reference(v) for v in names]

    def read(s: Slots) -> Action:
        number, targets = whole(unit(s)), [slot(s) for slot in slots]
        if number == TERMINAL:
            return Waiting(asking("", targets, n + 1))
        line = c.units.read(number)
        values = None if line is None else _answers(line, names)
        if line is not None and values is None:
            c.units.refuse(number, NOT_VALID)
        for slot, value, name in zip(targets, values or (), names, strict=False):
            c.memory.store(slot, value, name)
        return n + 1

    return x.special(read)


def _write(x: ProgramCompiler, i: Instruction, n: int) -> StepFunction:
    c, items = x.context, _items(x, i.operands[3:])
    unit, *_ = x.operands(STATEMENTS[i.keyword].slots[:3], i.operands[:3])

    def write(s: Slots) -> int:
        text, number = items(s), whole(unit(s))
        if number == TERMINAL:
            c.events.append(Typed(text))
        else:
            c.units.write(number, text)
        return c.go_on(n + 1)

    return write


# How it's waited for.


T = TypeVar("T")
Pause: TypeAlias = Generator[float, None, T]
_CHANGING: Final = {
    "ADC", "DEST", "#DEST", "HAND", "HERE", "#HERE", "IOGET", "IOSTAT", "RANDOM", "SPEED", "STATE", "TIME", "TIMER",
}  # fmt: skip
"""Functions whose values change with time alone."""


def _moving(context: Context, ask: Ask, following: int) -> Generator[float, None, int]:
    """Ask for a motion, and wait until it has begun; what a REACTI dropped before it began is asked for again."""
    goes_round, ends = context.path
    while True:
        yield from until(context, context.arm.settled if context.stop_first else context.arm.ready)
        context.powered()
        if goes_round is None:
            ask()
        else:
            context.arm.set_continuous_path(goes_round)
            try:
                ask()
            finally:
                context.arm.set_continuous_path(context.switches["CP"])
        context.path = ends, None
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


def _process(process: Callable[..., Pause[None]], *, interruptible: bool = False) -> Act:
    """What takes a while, by the values of its operands."""

    def act(x: ProgramCompiler, i: Instruction, n: int) -> StepFunction:
        prepare = x.prepared(i, process)
        return x.special(lambda s: Waiting(_followed(prepare(s)(), n + 1), interruptible))

    return act


def _followed(process: Pause[None], following: int) -> Pause[int]:
    yield from process
    return following


def _nothing(_c: Context, _i: Instruction) -> None:
    """Wait alone."""


def _asked(
    wait: Callable[[Context, Ask, Any], Generator[float, None, Any]], do: Do, check: Do | None = None
) -> Act:
    """What is asked for, and waited for."""

    def act(x: ProgramCompiler, i: Instruction, n: int) -> StepFunction:
        c, prepare = x.context, x.prepared(i, do, check, arm=i.keyword != "BRAKE")
        asks = prepare if i.begins is None else _timed(c, x.of_kind("real", i.begins), prepare)
        return x.special(lambda s: Waiting(wait(c, asks(s), n + 1)))

    return act


_motion: Final = partial(_asked, _moving)
_at_rest: Final = partial(_asked, _standing)


def _now(do: Do, *, arm: bool = False) -> Act:
    """What is done at once, and takes no time."""

    def act(x: ProgramCompiler, i: Instruction, n: int) -> StepFunction:
        prepare = x.prepared(i, do, arm=arm)

        def done(s: Slots) -> int:
            prepare(s)()
            return n + 1

        return x.special(done)

    return act


_setting: Final = partial(_now, arm=True)
"""What changes how the arm moves."""


def _alteration(do: Do) -> Act:
    """What is asked for at once; then a program waits: ALTOUT for its period, NOALTER until the arm stands."""

    def act(x: ProgramCompiler, i: Instruction, n: int) -> StepFunction:
        prepare, ends = x.prepared(i, do, arm=True), i.keyword != "ALTOUT" and len(i.operands) <= 2

        def alter(s: Slots) -> Waiting:
            ask = prepare(s)
            ask()
            return Waiting(_altering(x.context, ask, n + 1, ends=ends))

        return x.special(alter)

    return act


def _end_run(x: ProgramCompiler, i: Instruction, n: int) -> StepFunction:
    """PAUSE, STOP, HALT, when the arm stands, if it's the task's."""
    c, ending = x.context, Ending(i.keyword, n + 1)

    def end(_: Slots) -> Action:
        return ending if c.task is not None and not c.task.robot else Waiting(_standing(c, lambda: None, ending))

    return x.special(end)


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
    named = (
        p.function if isinstance(p, Apply) else p.name.upper() for p in parts(e) if isinstance(p, Apply | Variable)
    )
    return any(name in _CHANGING for name in named)


def _wait(x: ProgramCompiler, i: Instruction, n: int) -> StepFunction:
    """WAIT's condition; a bare number is a signal's, as in VAL. WAIT alone: a slice."""
    if not i.operands:
        return _sleeping(x, i, n)
    (e,), c = i.operands, x.context
    test = x.condition(e if literal(e) is None else Apply("SIG", (e,), e.at))
    polled = _changes(e)

    def waiting(s: Slots) -> Generator[float, None, int]:
        while not test(s):
            yield c.now + SLICE if polled else math.inf
        return n + 1

    return x.special(lambda s: Waiting(waiting(s), interruptible=True))


def _sleep(c: Context, i: Instruction, *given: float | None) -> Pause[None]:
    """WAIT.EVENT: a time, or for ever, as there are no other programs to send events; WAIT alone: a slice."""
    otherwise = SLICE if i.keyword == "WAIT" else math.inf
    over = c.now + (otherwise if given[-1] is None else given[-1])
    while c.now < over:
        yield over


_sleeping: Final = _process(_sleep, interruptible=True)


def _grasp(x: ProgramCompiler, i: Instruction, n: int) -> StepFunction:
    c, least, label = x.context, x.of_kind("real", i.operands[0]), x.jumps.get(n)

    def grasping(opening: float) -> Generator[float, None, int]:
        yield from _standing(c, lambda: c.arm.actuate(False, now=c.now), None)
        while not c.arm.felt(now=c.now):
            yield c.now + SLICE
        if c.arm.here(now=c.now).hand >= opening:
            return n + 1
        if label is None:
            raise ValError("Nothing in the hand", f"it's open by less than {opening:.9g} mm")
        return label

    def grasp(s: Slots) -> Waiting:
        c.require_arm(i.keyword)
        return Waiting(grasping(least(s)))

    return x.special(grasp)


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


def _leave(x: ProgramCompiler, i: Instruction, _n: int) -> StepFunction:
    """RETURN; RETURN n of VAL passes over so many steps of the one that called."""
    if not i.operands:
        action = Ending("RETURN")
        return x.special(lambda _: action)
    skipped = x.of_kind("real", i.operands[0])
    return x.special(lambda s: Ending("RETURN", max(whole(skipped(s)), 0)))


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


def arguments_of(i: Instruction) -> tuple[Any, ...]:
    """What an instruction that calls a program, or runs it beside, gives it."""
    return i.operands[3:] if STATEMENTS[i.keyword].rule == "tasks" else i.operands


def _called(x: ProgramCompiler, i: Instruction) -> Callable[[Slots], tuple[Code, list[VariableSlot]]]:
    """The program that an instruction calls, and its arguments.

    They're by reference where they're names, by value where they're anything else.
    """
    context, at, operands = x.context, i.at, arguments_of(i)

    def argument(e: Expression | None) -> Callable[[Slots], VariableSlot]:
        if e is None:
            return lambda _: VariableSlot()
        if isinstance(e, Variable):
            return x.reference(e)
        value = x.value(e)
        return lambda s: VariableSlot(value(s))

    given = [argument(a) for a in operands]
    prefixes = [None if a is None else {"string": "$", "point": "#"}.get(kind_of(a), "") for a in operands]

    def called(s: Slots) -> tuple[Code, list[VariableSlot]]:
        code = context.code(i.program, at)
        for prefix, parameter in zip(prefixes, code.program.parameters, strict=False):
            if prefix is not None and prefix != parameter.prefix:
                raise ValError("Variable type mismatch", f"argument {parameter.name}", place=at)
        return code, [slot(s) for slot in given]

    return called


def _call(x: ProgramCompiler, i: Instruction, n: int) -> StepFunction:
    called = _called(x, i)

    def invoke(s: Slots) -> Invoke:
        code, arguments = called(s)
        return Invoke(code, code.slots(arguments), n + 1)

    return x.special(invoke)


def _execute(x: ProgramCompiler, i: Instruction, n: int) -> StepFunction:
    """EXECUTE, PCEXECUTE; PRIME, which stands before the first step."""
    c, called = x.context, _called(x, i)
    numbers = x.operands(STATEMENTS[i.keyword].slots[:3], i.operands[:3])

    def execute(s: Slots) -> int:
        task, cycles, step = (number(s) for number in numbers)
        code, arguments = called(s)
        begun = c.begin(
            numbered("task", task), code, arguments, cycles=whole(cycles), step=whole(step), single=False
        )
        if i.keyword == "PRIME":
            begun.pause("PRIME")
        return n + 1

    return x.special(execute)


def _react(x: ProgramCompiler, i: Instruction, n: int) -> StepFunction:
    context, signal, immediate = x.context, x.of_kind("signal", i.operands[0]), i.keyword == "REACTI"
    given = i.operands[-1] if len(i.operands) > 1 else None
    priority = x.of_kind("priority", given or Number(USUAL + immediate))

    def watch(s: Slots) -> int:
        if i.program:
            context.code(i.program, i.at)
        number = signal(s)
        legal(number)
        reaction = Reaction(int(number), i.program, immediate, _always(i), priority(s))
        reactions_of(context).add(reaction)
        return n + 1

    return watch


def _react_to_errors(x: ProgramCompiler, i: Instruction, n: int) -> StepFunction:
    def trap(_: Slots) -> int:
        if i.program:
            x.context.code(i.program, i.at)
        reactions_of(x.context).on_error = i.program
        return n + 1

    return trap


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


def _assign_integer(x: ProgramCompiler, i: Instruction, n: int) -> StepFunction:
    """SETI of VAL, whose numbers are integers."""
    name, e = i.operands
    return _assign(x, replace(i, operands=(name, Apply("INT", (e,), e.at))), n)


def _pack(x: ProgramCompiler, i: Instruction, n: int) -> StepFunction:
    """PACK a string into the text that an array's elements hold one after the other."""
    target, *others = i.operands
    first, count, new = x.operands(STATEMENTS["PACK"].slots[1:], others)
    part = packed(x, target, first, count)

    def pack(s: Slots) -> int:
        (slots, text, begin, length), piece = part(s), new(s)
        text = text[:begin] + piece[:length].ljust(length, "\0") + text[begin + length :]
        for k, slot in enumerate(slots):
            x.context.memory.store(slot, text[k * PACKED : (k + 1) * PACKED].rstrip("\0"), target)
        return x.context.go_on(n + 1)

    return pack


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
        values = x.dialect.numbers(read(s))
        *before, start = [index(f(s), target.at) for f in first]
        array = s[place] if isinstance(place, int) else place
        for k, value in enumerate(values, start):
            last = index(float(k), target.at)
            memory.store(memory.element(array, (*before, last) if before else last), value, target)
        return context.go_on(n + 1)

    return decompose


# Dialogue.


def _items(x: ProgramCompiler, operands: tuple[Any, ...]) -> Callable[[Slots], str]:
    """The text of items, with a line end if it has one."""
    items = [o if isinstance(o, Format) else x.value(o) for o in operands]

    def text(s: Slots) -> str:
        shown, ends = formats.spelled([o if isinstance(o, Format) else o(s) for o in items], x.dialect)
        return shown + "\n" if ends else shown

    return text


def _type(x: ProgramCompiler, i: Instruction, n: int) -> StepFunction:
    context, items = x.context, _items(x, i.operands)

    def type_(s: Slots) -> int:
        text = items(s)
        if context.switches["MESSAGES"]:
            context.events.append(Typed(text))
        return context.go_on(n + 1)

    return type_


def _type_integer(x: ProgramCompiler, i: Instruction, n: int) -> StepFunction:
    x.of_kind("real", i.operands[0])
    return _type(x, replace(i, operands=(Format("I"), *i.operands)), n)


def _asking(
    x: ProgramCompiler, names: tuple[Variable, ...]
) -> Callable[[str, list[VariableSlot], int], Pause[int]]:
    """Ask for values, when no other task asks, and ask again until the answer is what is wanted."""
    context = x.context
    if any(v.prefix == "#" for v in names):
        raise mismatch(next(v for v in names if v.prefix == "#"))

    def asking(question: str, targets: list[VariableSlot], following: int) -> Pause[int]:
        while context.asking:
            yield context.now + SLICE
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

    return asking


def _prompt(x: ProgramCompiler, i: Instruction, n: int) -> StepFunction:
    text, names = x.of_kind("string", i.operands[0]), i.operands[1:]
    slots, asking = [x.reference(v) for v in names], _asking(x, names)
    return x.special(lambda s: Waiting(asking(text(s), [slot(s) for slot in slots], n + 1)))


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


def _of_tasks(name: str, pc: str, explanation: str, do: Callable[[Context, int], None]) -> Iterator[Form]:
    """The rows of V+ and of VAL-II's process control of what is done to another task."""
    act = _now(lambda c, _, number: do(c, numbered("task", number)))
    yield Form(name, "task:task?=0", explanation, "V+", act, tags="beside")
    if pc:
        said = explanation.replace("a task", "a process control program", 1)
        yield Form(pc, "task:task?=1", said, "VAL-II", act, tags="beside reading")


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
         _setting(lambda c, _, t: c.arm.at(t)), usage="AT time [motion]", rule="timed"),
    # Settings.
    Form("SPEED", "speed:speed, turning:percent?",
         "Speed of the next motion, [%] of the nominal or of the tool; ALWAYS: of all.", "VAL", _now(_speed),
         words="MMPS|IPS|MONITOR ALWAYS", rule="speed", tags="beside"),
    Form("ACCEL", "up:percent, down:percent?", "Accelerations: [%] of the nominal.", "V+", _setting(_accelerate),
         rule="channel"),
    Form("DURATION", "seconds:seconds", "Shortest time of the next motion; ALWAYS: each.", "V+",
         _setting(lambda c, i, t: c.arm.set_duration(t, always=_always(i))), words="ALWAYS"),
    Form("COARSE", "percent?", "The next motion may end roughly; ALWAYS: each.", "VAL", _setting(_tolerance),
         words="ALWAYS"),
    Form("FINE", "percent?", "The next motion ends exactly; ALWAYS: each.", "VAL-II", _setting(_tolerance),
         words="ALWAYS"),
    Form("NULL", "", "The next motion ends when the real arm is there; ALWAYS: each.", "VAL",
         _setting(lambda c, i: c.arm.set_nulling(True, always=_always(i))), words="ALWAYS"),
    Form("NONULL", "", "The next motion ends without waiting for the real arm; ALWAYS: each.", "VAL",
         _setting(lambda c, i: c.arm.set_nulling(False, always=_always(i))), words="ALWAYS"),
    *(Form(name, "", f"{what} from the next MOVE on.", "VAL", _setting(_configure))
      for name, what in (("RIGHTY", "The arm is to be right-handed"), ("LEFTY", "The arm is to be left-handed"),
                         ("ABOVE", "The elbow is to be above"), ("BELOW", "The elbow is to be below"),
                         ("FLIP", "The wrist is to be flipped"), ("NOFLIP", "The wrist is not to be flipped"))),
    *(Form(name, "", f"{what} the end of the next motion; ALWAYS: of each.", "VAL-II", _setting(_path),
           words="ALWAYS", tags="reading")
      for name, what in (("CPON", "The arm goes round"), ("CPOFF", "The arm stops at"))),
    *(Form(name, "", f"Joint 6 {what} in the next MOVE to a transformation; ALWAYS: each.", "VAL-II",
           _setting(lambda c, i: c.arm.set_turns(i.keyword == "SINGLE", always=_always(i))), words="ALWAYS",
           tags="reading")
      for name, what in (("SINGLE", "turns to within half a turn"), ("MULTIPLE", "turns as far as it's nearest"))),
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
    Form("OPEN", "opening:opening?", "Open the hand, or to an opening [mm], with the next motion.", "VAL",
         _setting(_hand_with_motion)),
    Form("CLOSE", "opening:opening?", "Close the hand, or to an opening [mm], with the next motion.", "VAL",
         _setting(_hand_with_motion)),
    Form("RELAX", "", "Let the hand go slack with the next motion.", "VAL",
         _setting(lambda c, _: c.arm.set_hand(None))),
    Form("OPENI", "opening:opening?", "Open the hand, or to an opening [mm], now, where the arm stands.", "VAL",
         _at_rest(_hand_now, _check_hand)),
    Form("CLOSEI", "opening:opening?", "Close the hand, or to an opening [mm], now, where the arm stands.", "VAL",
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
    Form("SETI", "variable:variable, value", "Assign the integer part of a number.", "VAL", _assign_integer,
         usage="SETI variable = value", tags="beside whole", rule="set"),
    Form("INVERSE", "variable:variable, location:frame", "Assign the transformation back of a location.", "VAL",
         _passed, usage="INVERSE variable = location", tags="beside whole", rule="set"),
    Form("PACK", "$array:variable, first, count, text:string",
         "Put a string into the text that an array's elements hold one after the other.", "VAL-II", _pack,
         usage="PACK $array[index], first, count = text", tags="beside reading", rule="group"),
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
    Form("PULSE", "signal:output, seconds:seconds?=0.2", "Turn an output on for a time, without waiting.", "VAL-II",
         _now(lambda c, _, signal, seconds: c.signals.pulse(signal, seconds, now=c.now)), tags="beside reading"),
    Form("DAC", "channel:channel, value", "Set an analogue output.", "VAL-II", _now(_channel),
         usage="DAC channel = value", tags="beside reading", rule="timing"),
    Form("IOPUT", "port:channel, value", "Set a port.", "VAL-II", _now(_channel), usage="IOPUT port = value",
         tags="beside reading", rule="timing"),
    Form("RESET", "", "Turn all outputs off.", "V+", _now(lambda c, _: c.signals.reset()), tags="beside"),
    Form("WAIT", "condition?", "Wait until a condition holds.", "VAL", _wait),
    Form("WAIT.EVENT", "mask?, seconds:seconds?", "Wait for a time.", "V+", _sleeping),
    Form("TIMER", "number:timer, seconds", "Set a timer.", "VAL-II", _now(_set_timer),
         usage="TIMER number = seconds", tags="beside", rule="timing"),
    Form("REACT", "signal:signal, program:program?, priority:priority?",
         "Call a program after the present step when a signal turns on.", "VAL", _react, words="ALWAYS"),
    Form("REACTI", "signal:signal, program:program?, priority:priority?",
         "REACT, stopping the present motion at once.", "VAL", _react, words="ALWAYS"),
    Form("REACTE", "program:program?", "Call a program instead of stopping when an error comes; without one, stop.",
         "V+", _react_to_errors, rule="worded"),
    Form("IGNORE", "signal:signal", "Don't react to a signal any more.", "VAL",
         _now(lambda c, _, signal: reactions_of(c).ignore(signal))),
    Form("LOCK", "priority", "Let reactions of no higher priority wait, until another LOCK or the reaction's end.",
         "V+", _now(_lock)),
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
    Form("RETURN", "skipped?", "Go back to the program that called, over so many of its steps.", "VAL", _leave,
         tags="program"),
    Form("RETURNE", "", "Go back from what REACTE called, to the step after the one with the error.", "V+", _leave,
         tags="program reading"),
    Form("PAUSE", "", "Pause until PROCEED.", "VAL", _end_run),
    Form("STOP", "", "End this cycle of the program.", "VAL", _end_run),
    Form("HALT", "", "End the program, whatever cycles are left.", "VAL", _end_run),
    # Files.
    Form("ATTACH", "unit?=0, mode?=0, device:string?", "Take a logical unit; without one the arm, when it's free.",
         "V+", _attach, usage="ATTACH (unit, mode) [device]", rule="device"),
    Form("DETACH", "unit?=0", "Give a logical unit back; without one the arm, when it stands.", "V+",
         _process(_detach),
         usage="DETACH (unit)", rule="device"),
    *(Form(name, "unit, record?, mode?, file:string", f"Open a file {what}.", "V+",
           _now(lambda c, i, unit, _r, _m, file: c.units.open(i.keyword, whole(unit), file)),
           usage=f"{name} (unit, record, mode) file", rule="device")
      for name, what in (("FOPENR", "to read"), ("FOPENW", "that isn't there, to write"),
                         ("FOPENA", "to write at its end"),
                         ("FOPEND", "that lists the directory: READ gives name, length and blanks"),
                         ("FOPEN", "of a window or a network: IOSTAT says that it isn't here"))),
    Form("FCLOSE", "unit", "Close a file; what was written is there then.", "V+",
         _now(lambda c, _, unit: c.units.close(whole(unit))), usage="FCLOSE (unit)", rule="device"),
    Form("FEMPTY", "unit", "Write out what is still to be written: at FCLOSE, here.", "V+", _now(lambda *_: None),
         usage="FEMPTY (unit)", rule="device"),
    Form("FDELETE", "unit, file:string", "Delete a file.", "V+",
         _now(lambda c, _, unit, file: c.units.delete(whole(unit), file)), usage="FDELETE (unit) file",
         rule="device"),
    Form("FSEEK", "unit, line", "Let the next READ of a file begin at a line, from 1.", "V+",
         _now(lambda c, _, unit, line: c.units.seek(whole(unit), whole(line))), usage="FSEEK (unit, line)",
         rule="device", tags="reading"),
    Form("FCMND", "unit, command, text:string?", "Refused, and IOSTAT says so: of disk commands, FDELETE is here.",
         "V+", _now(lambda c, _, unit, *_others: c.units.refuse(whole(unit), NOT_READY)),
         usage="FCMND (unit, command) text", rule="device"),
    Form("READ", "unit, record?, mode?, variable:variable*", "Read values of the next line of a file, or terminal.",
         "V+", _read, usage="READ (unit, record, mode) variable, ..", rule="device"),
    Form("WRITE", "unit, record?, mode?, item:any?*", "Write a line to a file, or terminal, as TYPE does.", "V+",
         _write, usage="WRITE (unit, record, mode) [item], ..", rule="device"),
    # Tasks.
    Form("EXECUTE", "task:task?=0, cycles?=1, step?=1, argument:any?*",
         "Run a program as a task beside this one, so many cycles; -1: for ever.", "V+", _execute,
         usage="EXECUTE [task] program(argument, ..)[, cycles[, step]]", rule="tasks", tags="beside"),
    Form("PCEXECUTE", "task:task?=1, cycles?=1, step?=1, argument:any?*",
         "Run a process control program beside this one, so many cycles; -1: for ever.", "VAL-II", _execute,
         usage="PCEXECUTE [task] program(argument, ..)[, cycles[, step]]", rule="tasks", tags="beside reading"),
    Form("PRIME", "task:task?=0, cycles?=1, step?=1, argument:any?*",
         "Let a program stand before a step as a task; PROCEED runs it.", "V+", _execute,
         usage="PRIME [task] program(argument, ..)[, cycles[, step]]", rule="tasks", tags="beside"),
    *_of_tasks("ABORT", "PCABORT", "Stop a task at once; it can go on.", Context.abort_task),
    *_of_tasks("PROCEED", "PCPROCEED", "Let a task that stands go on, with its next step.",
               Context.proceed),
    *_of_tasks("RETRY", "PCRETRY", "Let a task that stands go on, with the step that it was at.",
               partial(Context.proceed, again=True)),
    *_of_tasks("KILL", "", "Let a task that stands be at its end.", Context.kill),
    *_of_tasks("CYCLE.END", "PCEND", "Let the present cycle of a task be its last.", Context.finish),
    # Dialogue and names.
    Form("TYPE", "item:any?*", "Print texts and values; /F8.2 and such say how.", "VAL", _type, tags="beside",
         rule="items"),
    Form("TYPEI", "value", "Print a number as an integer.", "VAL", _type_integer, tags="beside whole"),
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
