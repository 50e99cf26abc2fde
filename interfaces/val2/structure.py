"""Which steps of a program belong together, where each leads, and which may stand alone."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Final, Literal, TypeAlias, get_args

from interfaces.val2.errors import TextPosition, ValError
from interfaces.val2.syntax import Instruction, Number, Program, Step

BlockKind: TypeAlias = Literal["IF", "WHILE", "DO", "FOR", "CASE"]
_KINDS: Final = get_args(BlockKind)
_LOOPS: Final = ("WHILE", "DO", "FOR")
DEEPEST: Final = 100
"""Most levels of structure."""


@dataclass(frozen=True, slots=True)
class StructureBlock:
    """A structure from its first step to its last; steps are counted from 0."""

    kind: BlockKind
    start: int
    end: int
    """The step of `END` or `UNTIL`."""
    arms: tuple[int, ...] = ()
    """The steps of `ELSE`, or of `VALUE` and `ANY`."""


@dataclass(frozen=True, slots=True)
class Structure:
    """How a program's steps hang together; steps are counted from 0, as in `program.steps`."""

    labels: Mapping[int, int]
    """Step of each label."""
    jumps: Mapping[int, int]
    """Where a step goes when it doesn't go on to the next. It may be the number of steps: the program's end.

    `IF`, `WHILE`, `FOR`, `VALUE` and `UNTIL` go there when they don't hold; `CASE` always, to its first `VALUE`;
    `END` of a loop to the loop's first step; `ELSE` behind its `END`, as only the steps before it come to it;
    `GOTO`, `IF .. GOTO` and `GRASP` to a label; `EXIT` behind its loop, `NEXT` to the `END` or `UNTIL` of its loop.
    """
    blocks: Mapping[int, StructureBlock]
    """The structure of each step that begins, divides or ends one.

    What comes to a `VALUE` or an `ANY` from the step before it goes on behind the block's end.
    """


@dataclass(slots=True)
class _Open:
    """A structure whose end hasn't come yet."""

    kind: BlockKind
    start: int
    arms: list[int] = field(default_factory=list)
    closed: bool = False
    """Whether `ELSE` or `ANY` has come."""
    exits: list[int] = field(default_factory=list)
    nexts: list[int] = field(default_factory=list)


def structure(program: Program) -> Structure:
    """How the steps of a program belong together.

    Raises:
        ValError: `*Control structure error*` or `*Undefined label*`, the first there is.
    """
    found, errors = survey(program)
    if errors:
        raise errors[0]
    return found


def survey(program: Program) -> tuple[Structure, list[ValError]]:
    """How the steps of a program belong together, as far as they do, and every error, in the order of steps."""
    found = _Surveyor(program)
    found.run()
    errors = [error for _, error in sorted(found.errors, key=lambda pair: pair[0])]
    return Structure(*map(MappingProxyType, (found.labels, found.jumps, found.blocks))), errors  # type: ignore[arg-type]


class _Surveyor:
    def __init__(self, program: Program) -> None:
        self._program = program
        self._open: list[_Open] = []
        self.labels: dict[int, int] = {}
        self.jumps: dict[int, int] = {}
        self.blocks: dict[int, StructureBlock] = {}
        self.errors: list[tuple[int, ValError]] = []

    def run(self) -> None:
        for i, step in enumerate(self._program.steps):
            if step.label is not None and self.labels.setdefault(step.label, i) != i:
                first = self.labels[step.label] + 1
                self._fail(i, f"label {step.label} stands at step {first} already", "Duplicate label")
        for i, step in enumerate(self._program.steps):
            self._step(i, step)
        for left in self._open:
            closer = "UNTIL" if left.kind == "DO" else "END"
            self._fail(left.start, f"{left.kind} without {closer}")

    def _fail(
        self, i: int, detail: str, what: str = "Control structure error", at: TextPosition | None = None
    ) -> None:
        place = at or self._program.steps[i].at
        self.errors.append((i, ValError(what, detail, program=self._program.name, step=i + 1, place=place)))

    def _step(self, i: int, step: Step) -> None:
        match step.statement:
            case Instruction("IF" | "GRASP", (_, Number(label)), at=at) | Instruction(
                "GOTO", (Number(label),), at=at
            ):
                self._goto(i, int(label), at)
            case Instruction("ELSE" | "VALUE" | "ANY" as keyword):
                self._divide(i, keyword)
            case Instruction("END" | "UNTIL" as keyword):
                self._end(i, keyword)
            case Instruction("EXIT" | "NEXT" as keyword, count, at=at):
                self._loop(i, keyword, int(count[0].value) if count else 1, at)
            case Instruction(""):
                pass
            case statement:
                if self._open and self._open[-1].kind == "CASE" and not self._open[-1].arms:
                    self._fail(i, "VALUE is allowed behind CASE, and nothing before it")
                if statement.keyword in _KINDS:
                    if len(self._open) == DEEPEST:
                        self._fail(i, f"more than {DEEPEST} levels")
                    self._open.append(_Open(statement.keyword, i))  # type: ignore[arg-type]

    def _divide(self, i: int, word: str) -> None:
        kind = "IF" if word == "ELSE" else "CASE"
        if not self._open or self._open[-1].kind != kind:
            self._fail(i, f"{word} is allowed between {kind} and END{self._within()}")
        elif self._open[-1].closed:
            self._fail(i, "a second ELSE" if word == "ELSE" else f"{word} behind ANY")
        else:
            self._open[-1].closed = word != "VALUE"
            self._open[-1].arms.append(i)

    def _within(self) -> str:
        if not self._open:
            return ""
        inner = self._open[-1]
        return f"; {inner.kind} of step {inner.start + 1} is still open"

    def _end(self, i: int, word: str) -> None:
        if not self._open or (self._open[-1].kind == "DO") != (word == "UNTIL"):
            needed = "DO" if word == "UNTIL" else "IF, WHILE, FOR or CASE"
            self._fail(i, f"{word} without {needed}{self._within()}")
            return
        inner = self._open.pop()
        block = StructureBlock(inner.kind, inner.start, i, tuple(inner.arms))
        self.blocks.update(dict.fromkeys((block.start, *block.arms, i), block))
        match block.kind:
            case "IF":
                self.jumps[block.start] = (block.arms[0] if block.arms else i) + 1
                self.jumps.update(dict.fromkeys(block.arms, i + 1))
            case "WHILE" | "FOR":
                self.jumps |= {block.start: i + 1, i: block.start}
            case "DO":
                self.jumps[i] = block.start + 1
            case "CASE":
                for arm, following in zip((block.start, *block.arms), (*block.arms, i + 1), strict=True):
                    if self._program.steps[arm].statement.keyword != "ANY":
                        self.jumps[arm] = following
        self.jumps.update(dict.fromkeys(inner.exits, i + 1))
        self.jumps.update(dict.fromkeys(inner.nexts, i))

    def _loop(self, i: int, word: str, count: int, at: TextPosition) -> None:
        loops = [block for block in self._open if block.kind in _LOOPS]
        if count > len(loops):
            shown, within = (word, "a loop") if count == 1 else (f"{word} {count}", f"{count} loops")
            self._fail(i, f"{shown} is allowed within {within}; here are {len(loops)}", at=at)
        else:
            (loops[-count].exits if word == "EXIT" else loops[-count].nexts).append(i)

    def _goto(self, i: int, label: int, at: TextPosition) -> None:
        if label in self.labels:
            self.jumps[i] = self.labels[label]
        else:
            known = ", ".join(map(str, sorted(self.labels)[:8])) or "none"
            self._fail(i, f"{label}; the program's labels: {known}", "Undefined label", at)
