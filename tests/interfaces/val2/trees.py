"""Trees as the parser makes them, for Hypothesis."""

from __future__ import annotations

import string

from hypothesis import strategies as st

from interfaces.val2 import forms
from interfaces.val2.functions import OPERATORS, row_of
from interfaces.val2.parser import LONGEST_LINE
from interfaces.val2.printer import print_step
from interfaces.val2.syntax import (
    BLANK,
    Apply,
    Compound,
    Format,
    Instruction,
    Number,
    Program,
    Step,
    Text,
    Variable,
)

RESERVED = forms.CONSTANTS | forms.OPERATORS.keys() | {"ALWAYS", "MMPS", "IPS", "MONITOR"}
LETTERS = string.ascii_lowercase
bodies = st.builds(
    lambda first, rest: (first + rest)[:15], st.sampled_from(LETTERS), st.text(LETTERS + "0129_.", max_size=16)
)
words = st.sampled_from(["step", "to", "of", "then", "do", "by", "speed", "value", "end", "goto", "for", "at", "x"])
plain = (bodies | words).filter(lambda name: name.upper() not in RESERVED)
names = st.builds(str.__add__, st.sampled_from(["", "", "", "#", "$"]), plain)
labels = st.integers(0, 65535)
counts = st.integers(1, 100)
numbers = st.builds(Number, st.floats(0, 1e12) | st.integers(0, 9999).map(float))
unbroken = st.text(st.characters(blacklist_characters='"\r\n', blacklist_categories=["Cs"]), max_size=12)
texts = st.builds(Text, unbroken.filter(lambda text: text.upper() not in RESERVED))
formats = st.builds(
    Format,
    st.sampled_from(sorted(forms.FORMATS)),
    st.none() | st.integers(0, 999),
    st.none() | st.integers(0, 99),
)
BETWEEN_TWO = sorted(name for name, row in OPERATORS.items() if len(row.slots) == 2)


def variables(inner, named=names):
    """A name, an element, or a whole array."""
    some = st.lists(inner, min_size=1, max_size=3).map(tuple)
    return (
        st.builds(Variable, named)
        | st.builds(Variable, named, some)
        | st.builds(lambda name: Variable(name, array=True), named)
    )


def targets(inner, prefixes=("", "$", "#")):
    """What may be set."""
    return variables(inner).filter(lambda v: v.prefix in prefixes)


@st.composite
def applications(draw, inner):
    """A function with as many arguments as it takes."""
    row = forms.FUNCTIONS[draw(st.sampled_from(sorted(forms.FUNCTIONS)))]
    least = sum(slot.required for slot in row.slots)
    most = 6 if row.repeats else len(row.slots)
    arguments = []
    for i in range(draw(st.integers(least, most))):
        required = bool(row.slots) and row.slots[min(i, len(row.slots) - 1)].required
        choice = inner | formats if row.name == "$ENCODE" else inner
        arguments.append(draw(choice if required else choice | st.none()))
    return Apply(row.name, () if arguments == [None] else tuple(arguments))


def larger(inner):
    """Expressions of others."""
    loose = inner.filter(lambda e: not isinstance(e, Compound))
    return (
        st.builds(Apply, st.sampled_from(["-", "NOT", "COM"]), st.tuples(inner))
        | st.builds(Apply, st.sampled_from(BETWEEN_TWO), st.tuples(inner, inner))
        | st.builds(Compound, st.lists(loose, min_size=2, max_size=4).map(tuple))
        | variables(inner)
        | applications(inner)
    )


expressions = st.recursive(numbers | texts | st.builds(Variable, names), larger, max_leaves=6)
optional = st.none() | expressions


def _located(value):
    return (
        isinstance(value, Compound)
        or (isinstance(value, Apply) and row_of(value).gives in ("frame", "location"))
        or (isinstance(value, Variable) and value.prefix == "#")
    )


TIMED = (
    "MOVE", "MOVES", "MOVET", "MOVEST", "APPRO", "APPROS", "DEPART", "DEPARTS", "DRIVE", "DRAW", "READY", "NEST",
    "ALIGN",
)  # fmt: skip
"""What AT may stand before."""


OTHERS = (
    "SET", "DECOMPOSE", "SHIFT", "REACT", "REACTI", "IF", "ELSE", "END", "WHILE", "DO", "UNTIL", "FOR", "CASE",
    "VALUE", "ANY", "EXIT", "NEXT", "GOTO", "CALL", "GOSUB", "RETURN", "TYPE", "PROMPT", "REMARK", "AUTO", "LOCAL",
    "GLOBAL", "EXECUTE", "PCEXECUTE", "PRIME",
)  # fmt: skip
"""What is made by `statements` below."""


@st.composite
def instructions(draw):
    """An instruction whose operands stand between commas, and some others."""
    row = draw(st.sampled_from([row for row in forms.INSTRUCTIONS.values() if row.name not in OTHERS]))
    match row.name:
        case "TIMER":
            return Instruction("TIMER", (draw(expressions), draw(expressions)))
        case "BITS":
            return Instruction("BITS", (draw(expressions), draw(optional), draw(expressions)))
        case "PARAMETER":
            return Instruction(
                "PARAMETER", (draw(expressions),), (draw(st.sampled_from(sorted(forms.PARAMETERS))),)
            )
        case "ENABLE" | "DISABLE":
            switches = st.lists(st.sampled_from(sorted(forms.SWITCHES)), min_size=1, max_size=3)
            return Instruction(row.name, (), tuple(draw(switches)))
        case "GRASP":
            label = draw(labels.map(lambda n: (Number(float(n)),)) | st.just(()))
            return Instruction("GRASP", (draw(expressions), *label))
        case "WAIT":
            return Instruction(
                "WAIT",
                draw(st.just(()) | st.tuples(st.builds(Apply, st.just("<"), st.tuples(expressions, expressions)))),
            )
    operands = []
    count = len(row.slots) + (draw(st.integers(0, 3)) if row.repeats else 0)
    for i in range(count):
        required = row.slots[min(i, len(row.slots) - 1)].required
        operands.append(draw(expressions if required else optional))
    while operands and operands[-1] is None:
        operands.pop()
    chosen = [draw(st.sampled_from(["", *group])) for group in row.words]
    times = numbers | st.builds(Variable, plain)
    begins = draw(st.none() | times) if row.name in TIMED else None
    return Instruction(row.name, tuple(operands), tuple(filter(None, chosen)), begins=begins)


programs_called = plain
ignored = st.sampled_from(sorted(forms.IGNORED))
rests = st.text(LETTERS + "0123456789 ,+()", max_size=12).map(lambda s: f"unknown{s}".strip())
label_numbers = labels.map(lambda n: Number(float(n)))


def made(keywords, *operands, **others):
    """Instructions of some keywords, each with these operands."""
    return st.builds(Instruction, st.sampled_from(keywords), st.tuples(*operands), **others)


def many(keywords, operands, **others):
    """Instructions of some keywords, with a run of operands."""
    return st.builds(Instruction, st.sampled_from(keywords), operands.map(tuple), **others)


statements = st.one_of(
    made(["="], targets(expressions, ("", "$")), expressions.filter(lambda e: not _located(e))),
    made(["SET", "DECOMPOSE"], targets(expressions), expressions),
    instructions(),
    made(["IF", "WHILE", "UNTIL"], expressions),
    st.just(BLANK) | made(["ELSE", "END", "DO", "ANY", "RETURN"]),
    made(["FOR"], targets(expressions), expressions, expressions),
    made(["FOR"], targets(expressions), expressions, expressions, expressions),
    made(["CASE"], expressions),
    many(["VALUE"], st.lists(expressions, min_size=1, max_size=3)),
    many(["EXIT", "NEXT"], counts.map(lambda n: [Number(float(n))] if n > 1 else [])),
    made(["GOTO"], label_numbers) | made(["IF"], expressions, label_numbers),
    many(
        ["CALL", "GOSUB"],
        st.lists(optional, max_size=3).filter(lambda given: given != [None]),
        program=programs_called,
    ),
    made(
        ["REACT", "REACTI"],
        expressions,
        program=st.just("") | programs_called,
        words=st.sampled_from([(), ("ALWAYS",)]),
    ),
    st.builds(
        lambda keyword, before, given, called: Instruction(keyword, (*before, *given), program=called),
        st.sampled_from(["EXECUTE", "PCEXECUTE", "PRIME"]),
        st.tuples(st.none() | counts.map(lambda n: Number(float(n))), optional, optional),
        st.lists(optional, max_size=3).filter(lambda given: given != [None]),
        programs_called,
    ),
    many(["TYPE"], st.lists(expressions | formats, max_size=4)),
    st.builds(
        lambda text, names: Instruction("PROMPT", (text, *names)),
        expressions,
        st.lists(targets(expressions).filter(lambda v: not v.array), max_size=3),
    ),
    many(
        ["AUTO", "LOCAL", "GLOBAL"],
        st.lists(variables(numbers), min_size=1, max_size=3),
        words=st.sampled_from([(), ("REAL",), ("LOC",)]),
    ),
    st.builds(Instruction, ignored, passed=rests),
    st.just(Instruction("DISABLE", passed="color.speed, scale")),
    st.just(Instruction("PARAMETER", passed="vscale = 3")),
)
comments = st.none() | st.text(
    st.characters(blacklist_characters="\r\n", blacklist_categories=["Cs"]), max_size=20
).map(str.rstrip)
steps = st.builds(Step, statements, st.none() | labels, comments).filter(
    lambda step: len(print_step(step)) < LONGEST_LINE - 200
)
parameters = st.lists(
    st.builds(lambda name, array: Variable(name, array=array), names, st.booleans()),
    max_size=4,
    unique_by=lambda v: v.name,
).map(tuple)
programs = st.builds(Program, plain, parameters, st.lists(steps, max_size=12).map(tuple), comments)
