"""A program as closures, a step each, that return the next step's index.

What a step can't be is said when it's reached, so that a program runs as far as it's right; a broken structure is
said at once. GOTO may lead anywhere in the program, into structures too: a FOR whose head was jumped over is an
error at its END, and a CASE whose head was jumped over ends where the next VALUE comes.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

from interfaces.val2.context import SPECIAL, Code, Context, Invoke, Leave, StepFunction, Warned
from interfaces.val2.errors import ValError
from interfaces.val2.expressions import Expressions
from interfaces.val2.forms import UNAVAILABLE
from interfaces.val2.instructions import instruction
from interfaces.val2.memory import MOST_DIMENSIONS, Slots, VariableSlot, index, mismatch, undefined
from interfaces.val2.signals import reaction_to
from interfaces.val2.structure import structure
from interfaces.val2.syntax import Expression, Ignored, Instruction, Number, Program, Step, Variable
from interfaces.val2.values import Location, Transformation, to_oat


def compiled(program: Program, context: Context) -> Code:
    """Compile a program.

    Raises:
        ValError: If its structures don't match, or a label is missing.
    """
    return _Compiler(program, context).code()


def refusal(step: Step, context: Context) -> ValError | None:
    """Why a step that stands alone can never be done, by its text; None where its text is right."""
    try:
        compiler = _Compiler(Program("", (), (step,)), context)
    except ValError:
        return None  # Labels and structures are those of its program.
    try:
        compiler.statement(0, step)
    except ValError as error:
        return error
    return None


class _Compiler:
    def __init__(self, program: Program, context: Context) -> None:
        self.program, self.context = program, context
        self.structure = structure(program)
        scope: dict[str, int | VariableSlot] = {p.name: i for i, p in enumerate(program.parameters)}
        names = len(program.parameters)
        for i in (step.statement for step in program.steps):
            if not isinstance(i, Instruction) or i.keyword not in ("AUTO", "LOCAL"):
                continue
            for name in (v.name for v in i.operands if v.name not in scope):
                if i.keyword == "AUTO":
                    scope[name] = names
                    names += 1
                else:
                    scope[name] = context.memory.own(program.name, name)
        self.names = names
        self.x = Expressions(context, scope)
        self.kept: dict[int, int] = {}

    def code(self) -> Code:
        steps = [self._step(i, step) for i, step in enumerate(self.program.steps)]
        steps.append(self._leave())
        return Code(self.program, steps, self.names, len(self.kept))

    def _step(self, i: int, step: Step) -> StepFunction:
        try:
            return self.statement(i, step)
        except ValError as error:
            failure = error

            def fail(_: Slots) -> int:
                raise failure

            return fail

    def _keep(self, i: int) -> int:
        """Number of the slot in which the FOR at a step keeps its limits."""
        return self.kept.setdefault(i, self.names + len(self.kept))

    def statement(self, i: int, step: Step) -> StepFunction:
        x, following, jumps = self.x, i + 1, self.structure.jumps
        match step.statement:
            case Ignored(keyword, _, at) if keyword in UNAVAILABLE:
                raise ValError("Not available", f"{keyword}: {UNAVAILABLE[keyword]}", place=at)
            case Ignored(keyword):
                return self._ignored(
                    f"{keyword} has no meaning here: program {self.program.name}, step {i + 1}", following
                )
            case Instruction("" | "DO" | "AUTO" | "LOCAL" | "GLOBAL"):
                return lambda _: following
            case Instruction("VALUE" | "ELSE" | "ANY"):
                target = self.structure.blocks[i].end + 1
                return lambda _: target
            case Instruction("END"):
                return self._end(i)
            case Instruction("RETURN"):
                return self._leave()
            case Instruction("=" | "SET" | "DECOMPOSE" as keyword, (name, value)):
                make = {"=": self._assign, "SET": self._set, "DECOMPOSE": self._decompose}[keyword]
                return make(name, value, following)
            case Instruction("IF", (condition, _)):
                test, target = x.condition(condition), jumps[i]
                return lambda s: target if test(s) else following
            case Instruction("IF" | "WHILE" | "UNTIL", (condition,)):
                test, otherwise = x.condition(condition), jumps[i]
                return lambda s: following if test(s) else otherwise
            case Instruction("GOTO" | "EXIT" | "NEXT"):
                target = jumps[i]
                return lambda _: target
            case Instruction("FOR", (variable, *limits)):
                return self._for(i, variable, limits)
            case Instruction("CASE", (value,)):
                return self._case(i, value)
            case Instruction("CALL" | "GOSUB") as call:
                return self._call(call, following)
            case Instruction("REACT" | "REACTI") as react:
                return self._react(react, following)
            case plain:
                return instruction(x, plain, i, jumps.get(i))

    def _ignored(self, text: str, following: int) -> StepFunction:
        context, warning = self.context, Warned(text)

        def ignored(_: Slots) -> int:
            context.warn(warning)
            return following

        return ignored

    def _leave(self) -> StepFunction:
        context, action = self.context, Leave()

        def leave(_: Slots) -> int:
            context.pending = action
            return SPECIAL

        return leave

    # Structures.

    def _end(self, i: int) -> StepFunction:
        block = self.structure.blocks[i]
        head, target = self.program.steps[block.start].statement, block.start if block.kind == "WHILE" else i + 1
        if block.kind != "FOR":
            return lambda _: target
        k, body, following = self._keep(block.start), block.start + 1, i + 1
        variable: Variable = head.operands[0]  # type: ignore[union-attr]

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

    def _for(self, i: int, variable: Variable, limits: list[Expression]) -> StepFunction:
        if variable.prefix:
            raise mismatch(variable)
        x, memory = self.x, self.context.memory
        start, stop, step = (x.real(e) for e in (*limits, Number(1.0))[:3])
        slot, k, body, past = x.reference(variable), self._keep(i), i + 1, self.structure.blocks[i].end + 1

        def begin(s: Slots) -> int:
            value, limit, by = start(s), stop(s), step(s)
            if by == 0.0:
                raise ValError("Illegal value", "STEP 0")
            counter = slot(s)
            memory.store(counter, value, variable)
            s[k] = counter, limit, by
            return body if (value <= limit if by > 0.0 else value >= limit) else past

        return begin

    def _case(self, i: int, value: Expression) -> StepFunction:
        x, block = self.x, self.structure.blocks[i]
        text = x.kind(value) == "string"
        read: Callable[[Expression], Callable[[Slots], Any]] = x.string if text else x.real
        given, arms, otherwise = read(value), [], block.end + 1
        for arm in block.arms:
            statement = self.program.steps[arm].statement
            if statement.keyword == "VALUE":
                arms.append(([read(v) for v in statement.operands], arm + 1))  # type: ignore[union-attr]
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

    # Names.

    def _set(self, name: Variable, e: Expression, following: int) -> StepFunction:
        x, context = self.x, self.context
        if name.prefix == "$":
            raise mismatch(name)
        slot = x.reference(name)
        read: Callable[[Slots], Location] = x.point(e) if name.prefix else x.transformation(e)

        def set_(s: Slots) -> int:
            value = read(s)
            context.memory.store(slot(s), value, name)
            return context.go_on(following)

        return set_

    def _assign(self, name: Variable, e: Expression, following: int) -> StepFunction:
        if name.prefix == "#":
            raise mismatch(name)
        x, memory, slot = self.x, self.context.memory, self.x.reference(name)
        read: Callable[[Slots], float | str] = x.string(e) if name.prefix else x.real(e)
        type_ = None if name.prefix else float
        place = None if name.indices else x.slot(name.name)
        if isinstance(place, VariableSlot):

            def assign(s: Slots) -> int:
                value = read(s)
                if place.value.__class__ is type_:
                    place.value = value
                else:
                    memory.store(place, value, name)
                return following

            return assign

        def assign_any(s: Slots) -> int:
            value = read(s)
            target = slot(s)
            if target.value.__class__ is type_:
                target.value = value
            else:
                memory.store(target, value, name)
            return following

        return assign_any

    def _decompose(self, target: Variable, e: Expression, following: int) -> StepFunction:
        """Six numbers, from the element that is named on; from 0 where none is."""
        x, context, memory = self.x, self.context, self.context.memory
        if target.prefix:
            raise mismatch(target)
        if len(target.indices) > MOST_DIMENSIONS:
            raise ValError("Invalid array index", f"{MOST_DIMENSIONS} dimensions at most", place=target.at)
        read, place = x.location(e), x.slot(target.name)
        first = [x.real(i) for i in target.indices] or [lambda _: 0.0]

        def decompose(s: Slots) -> int:
            location = read(s)
            values = to_oat(location) if isinstance(location, Transformation) else location.joints
            *before, start = [index(f(s), target.at) for f in first]
            array = s[place] if isinstance(place, int) else place
            for n, value in enumerate(values, start):
                last = index(float(n), target.at)
                memory.store(memory.element(array, (*before, last) if before else last), value, target)
            return context.go_on(following)

        return decompose

    # Calls.

    def _call(self, call: Instruction, following: int) -> StepFunction:
        context, x, at = self.context, self.x, call.at
        parts = [self._argument(a) for a in call.operands]
        prefixes = [None if a is None else _PREFIX.get(x.kind(a), "") for a in call.operands]

        def invoke(s: Slots) -> int:
            code = context.code(call.program, at)
            parameters = code.program.parameters
            for prefix, parameter in zip(prefixes, parameters, strict=False):
                if prefix is not None and prefix != parameter.prefix:
                    raise ValError("Variable type mismatch", f"argument {parameter.name}", place=at)
            context.pending = Invoke(code, code.slots([p(s) for p in parts]), following)
            return SPECIAL

        return invoke

    def _argument(self, e: Expression | None) -> Callable[[Slots], VariableSlot]:
        """By reference where it's a name, by value where it's anything else."""
        if e is None:
            return lambda _: VariableSlot()
        if isinstance(e, Variable):
            return self.x.reference(e)
        value = self.x.value(e)
        return lambda s: VariableSlot(value(s))

    def _react(self, react: Instruction, following: int) -> StepFunction:
        context, signal, at = self.context, self.x.real(react.operands[0]), react.at

        def watch(s: Slots) -> int:
            if react.program:
                context.code(react.program, at)
            immediate, always = react.keyword == "REACTI", "ALWAYS" in react.words
            context.reactions.add(reaction_to(signal(s), react.program, immediate=immediate, always=always))
            return following

        return watch


_PREFIX: Final = {"string": "$", "point": "#"}
