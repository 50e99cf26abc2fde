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
from interfaces.val2.instructions import instruction, prompt_step, type_step
from interfaces.val2.memory import MOST_DIMENSIONS, Slots, VariableSlot, index, mismatch, undefined
from interfaces.val2.signals import reaction_to
from interfaces.val2.structure import StructureBlock, structure
from interfaces.val2.syntax import (
    Assign,
    Call,
    Case,
    Conditional,
    Expression,
    For,
    Goto,
    Ignored,
    Instruction,
    Local,
    LoopJump,
    PlainStatement,
    Program,
    Prompt,
    React,
    Step,
    Type,
    Value,
    Variable,
)  # fmt: skip
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
        for step in program.steps:
            if not isinstance(step.statement, Local) or step.statement.keyword == "GLOBAL":
                continue
            for name in (v.name for v in step.statement.names if v.name not in scope):
                if step.statement.keyword == "AUTO":
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
        context, x, following, jumps = self.context, self.x, i + 1, self.structure.jumps
        match step.statement:
            case PlainStatement.BLANK | PlainStatement.DO | Local():
                return lambda _: following
            case Value() | PlainStatement.ELSE | PlainStatement.ANY:
                target = self._past(i)
                return lambda _: target
            case PlainStatement.END:
                return self._end(i)
            case PlainStatement.RETURN:
                return self._leave()
            case Assign(name, value, "SET"):
                return self._set(name, value, following)
            case Assign(name, value, "DECOMPOSE"):
                return self._decompose(name, value, following)
            case Assign(name, value):
                return self._assign(name, value, following)
            case Conditional(_, condition):
                test, otherwise = x.condition(condition), jumps[i]
                return lambda s: following if test(s) else otherwise
            case Goto(_, condition) if condition is not None:
                test, target = x.condition(condition), jumps[i]
                return lambda s: target if test(s) else following
            case Goto() | LoopJump():
                target = jumps[i]
                return lambda _: target
            case For() as loop:
                return self._for(i, loop)
            case Case(value):
                return self._case(i, value)
            case Call() as call:
                return self._call(call, following)
            case Type(items):
                return type_step(x, items, following)
            case Prompt() as prompt:
                return prompt_step(x, prompt, following)
            case React() as react:
                return self._react(react, following)
            case Ignored(keyword, _, at) if keyword in UNAVAILABLE:
                raise ValError("Not available", f"{keyword}: {UNAVAILABLE[keyword]}", place=at)
            case Ignored(keyword):
                text = f"{keyword} has no meaning here: program {self.program.name}, step {i + 1}"

                def ignored(_: Slots) -> int:
                    context.warn(Warned(text))
                    return following

                return ignored
            case Instruction() as plain_instruction:
                return instruction(x, plain_instruction, i, jumps.get(i))

    def _leave(self) -> StepFunction:
        context, action = self.context, Leave()

        def leave(_: Slots) -> int:
            context.pending = action
            return SPECIAL

        return leave

    # Structures.

    def _block(self, i: int) -> StructureBlock:
        """The innermost block that a step belongs to as its head, its end, or an arm."""
        return self.structure.blocks[i]

    def _past(self, i: int) -> int:
        """Behind the END of the block whose arm is at a step."""
        return self._block(i).end + 1

    def _end(self, i: int) -> StepFunction:
        block = self._block(i)
        head = self.program.steps[block.start].statement
        if isinstance(head, Conditional) and head.keyword == "WHILE":
            start = block.start
            return lambda _: start
        following = i + 1
        if not isinstance(head, For):
            return lambda _: following
        k, body, variable = self._keep(block.start), block.start + 1, head.variable

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

    def _for(self, i: int, loop: For) -> StepFunction:
        if loop.variable.prefix:
            raise mismatch(loop.variable)
        x, memory, variable = self.x, self.context.memory, loop.variable
        start, stop = x.real(loop.start), x.real(loop.stop)
        step = x.real(loop.step) if loop.step is not None else (lambda _: 1.0)
        slot, k, body, past = x.reference(variable), self._keep(i), i + 1, self._block(i).end + 1

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
        x, block = self.x, self._block(i)
        text = x.kind(value) == "string"
        read: Callable[[Expression], Callable[[Slots], Any]] = x.string if text else x.real
        given, arms, otherwise = read(value), [], block.end + 1
        for arm in block.arms:
            statement = self.program.steps[arm].statement
            if isinstance(statement, Value):
                arms.append(([read(v) for v in statement.values], arm + 1))
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

    def _call(self, call: Call, following: int) -> StepFunction:
        context, x, at = self.context, self.x, call.at
        parts = [self._argument(a) for a in call.arguments]
        prefixes = [None if a is None else _PREFIX.get(x.kind(a), "") for a in call.arguments]

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

    def _react(self, react: React, following: int) -> StepFunction:
        context, signal, at = self.context, self.x.real(react.signal), react.at

        def watch(s: Slots) -> int:
            if react.program:
                context.code(react.program, at)
            context.reactions.add(
                reaction_to(signal(s), react.program, immediate=react.immediate, always=react.always)
            )
            return following

        return watch


_PREFIX: Final = {"string": "$", "point": "#"}
