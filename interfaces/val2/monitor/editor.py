"""EDIT: a program, a line at a time. Answers to `n.?` are instructions, or one-letter commands."""

from __future__ import annotations

import contextlib
import re
from collections.abc import Callable
from dataclasses import replace
from typing import Final

from interfaces.val2.errors import ValError
from interfaces.val2.monitor import layout
from interfaces.val2.monitor.locations import following
from interfaces.val2.monitor.state import Dialogue, Expects, Question, Style, TerminalState, integer, named, pieces
from interfaces.val2.parser import parse_header, parse_line
from interfaces.val2.printer import print_program, print_step
from interfaces.val2.structure import structure
from interfaces.val2.syntax import BLANK, Instruction, Program, Step, Variable

HELP: Final = (
    "an instruction   takes the place of this step, or comes after the last one",
    "CR               on to the next step",
    "I                insert before this step, line after line, until an empty one",
    "D [n]            delete this step, or n",
    "S n              go to step n",
    "L [n]            go back to the last step, or n back",
    "P [n]            print the next n steps, or all",
    "T location       record where the arm is, and insert MOVE location; T alone: the next name",
    "F text           find the next step with that text",
    "U                undo the last change",
    "E                end; the program is kept",
    "Q                quit; the program stays as it was",
)
"""What may be answered."""
MOST_STEPS: Final = 20_000
"""Longest program."""
_HISTORY: Final = 100
_COMMAND: Final = re.compile(
    r"\s*(?:([TF])(?:\s+(?![\s=])(.*?))?|([DEILPQSU?])(?:\s+(\d{1,6}))?)\s*", re.IGNORECASE | re.DOTALL
)
"""What isn't an instruction, such as an assignment to a variable of one letter."""


class Editor:
    """A program being edited: lines in, what is shown out."""

    def __init__(self, program: Program, step: int, record: Callable[[str], Variable]) -> None:
        """Begin.

        Args:
            program: As it is.
            step: To begin at, from 1; after the last if it's higher.
            record: Keeps where the arm is under the name that was given, or the next one; the name.
        """
        self.program = program
        self._first, self._record = program, record
        self._at = min(max(step, 1), len(program.steps) + 1)
        self._inserting = False
        self._history: list[tuple[Program, int]] = []
        self.done = False

    @property
    def prompt(self) -> str:
        """`n.?`."""
        return f"{self._at}.? "

    def begin(self) -> list[str]:
        """What is shown first."""
        head, *_ = print_program(self.program).splitlines()
        return [head, *self._shown()]

    def line(self, text: str) -> list[str]:
        """Take a line; what is shown.

        Raises:
            ValError: If it's neither an instruction nor a command; nothing has changed then.
        """
        found = _COMMAND.fullmatch(text)
        if found is not None:
            letter, rest = (found[1], found[2]) if found[1] else (found[3], found[4])
            return self._command(letter.upper(), rest or "")
        if text.strip():
            self._put(parse_line(text), insert=self._inserting or self._at > len(self.program.steps))
            return [] if self._inserting else self._shown()
        if not self._inserting:
            self._at = min(self._at + 1, len(self.program.steps) + 1)
        self._inserting = False
        return self._shown()

    def _command(self, letter: str, rest: str) -> list[str]:
        steps, count = self.program.steps, int(rest) if rest.isdecimal() else 1
        match letter:
            case "?":
                return list(HELP)
            case "I":
                self._inserting = True
                return []
            case "P":
                end = self._at - 1 + count if rest else len(steps)
                return layout.numbered(self._printed()[self._at - 1 : end], self._at)
            case "D":
                if self._at > len(steps):
                    raise ValError("No such step", f"the program has {len(steps)}")
                self._change(self._at - 1, count, ())
            case "S":
                self._at = min(max(count, 1), len(steps) + 1)
            case "L":
                self._at = max(self._at - count, 1)
            case "T":
                self._put(Step(Instruction("MOVE", (self._record(rest),))), insert=True)
            case "F":
                self._find(rest)
            case "U":
                if not self._history:
                    raise ValError("Nothing to undo")
                self.program, self._at = self._history.pop()
            case "Q":
                self.program, self.done = self._first, True
            case _:
                self.done = True
                try:
                    structure(self.program)
                except ValError as error:
                    return [str(error)]
        self._inserting = False
        return self._shown()

    def _find(self, text: str) -> None:
        lines, wanted = self._printed(), text.upper()
        if not wanted:
            raise ValError("Missing argument", "which text?")
        order = [*range(self._at, len(lines)), *range(min(self._at, len(lines)))]
        found = next((index for index in order if wanted in lines[index].upper()), None)
        if found is None:
            raise ValError("Not found", text)
        self._at = found + 1

    def _put(self, step: Step, *, insert: bool) -> None:
        """Put an instruction before this step, or in its place."""
        if insert and len(self.program.steps) >= MOST_STEPS:
            raise ValError("Program too long", f"{MOST_STEPS} steps at most")
        self._change(self._at - 1, 0 if insert else 1, (step,))

    def _change(self, first: int, count: int, new: tuple[Step, ...]) -> None:
        """Put steps in the place of some, and go behind them."""
        self._history = [*self._history[1 - _HISTORY :], (self.program, self._at)]
        steps = self.program.steps
        self.program = replace(self.program, steps=(*steps[:first], *new, *steps[first + count :]))
        self._at += len(new)

    def _printed(self) -> list[str]:
        return [print_step(step) for step in self.program.steps]

    def _shown(self) -> list[str]:
        """The step at which it is, if there's one."""
        if self._at > len(self.program.steps) or self.done:
            return []
        step = self.program.steps[self._at - 1]
        return layout.numbered(["" if step == Step(BLANK) else print_step(step)], self._at)


def edit(state: TerminalState, rest: str) -> Dialogue:
    """EDIT program, step; EDIT program(arguments) for a new one; EDIT alone goes on with the last."""
    given, *step = pieces(rest or state.last_edit) or [""]
    if len(step) > 1:
        raise ValError("Invalid argument", f"{rest}: a program and a step")
    head = parse_header(f".PROGRAM {given}") if "(" in given else Program(named(given, "program"))
    name, programs = head.name, state.controller.memory.programs
    state.refuse_in_use(name)
    known = programs.get(name)
    program = (
        replace(head, dialect=state.controller.dialect)
        if known is None
        else replace(known, parameters=head.parameters or known.parameters)
    )
    state.last_edit = name
    taught: Variable | None = None

    def record(name: str) -> Variable:
        """Record where the arm is under a name, or the one after the last."""
        nonlocal taught
        if not name and taught is None:
            raise ValError("Missing argument", "T location")
        variable = state.variable(name) if name or taught is None else following(taught)
        state.controller.memory.set(variable, state.here(variable))
        taught = variable if variable.indices or variable.name[-1].isdigit() else None
        return variable

    editor = Editor(program, integer("".join(step), 1, "a step"), record)
    state.say(*editor.begin())
    with contextlib.suppress(EOFError):
        while not editor.done:
            line = yield Question(editor.prompt, Expects.STEP)
            with state.guarded():
                shown = editor.line(line or "")
                state.say(*shown, style=Style.ERROR if editor.done else Style.ANSWER)
    if editor.program.steps or name in programs:
        programs[name] = editor.program
