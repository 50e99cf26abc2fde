"""EDIT: a program, a line at a time. Answers to `n.?` are instructions, or one-letter commands."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from typing import Final

from typing_extensions import override

from interfaces.val2.errors import ValError
from interfaces.val2.monitor import layout
from interfaces.val2.monitor.locations import following
from interfaces.val2.monitor.state import Dialogue, Style, TerminalState, integer, named, pieces
from interfaces.val2.parser import parse_line, parse_program
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
_COMMAND: Final = re.compile(r"\s*([DEILPQSTUF?])(?:\s+(.*?))?\s*", re.IGNORECASE | re.DOTALL)
_COUNT: Final = re.compile(r"\d{1,6}")


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

    def line(self, text: str, *, column: int = 0) -> list[str]:
        """Take a line.

        Args:
            text: What was typed.
            column: Of its first character, for errors.

        Returns:
            What is shown.

        Raises:
            ValError: If it's neither an instruction nor a command; nothing has changed then.
        """
        if not text.strip():
            if self._inserting:
                self._inserting = False
            else:
                self._at = min(self._at + 1, len(self.program.steps) + 1)
            return self._shown()
        found = _COMMAND.fullmatch(text)
        rest = (found[2] or "") if found else ""
        if found and self._is_command(found[1].upper(), rest):
            return self._command(found[1].upper(), rest)
        self._put(parse_line(" " * column + text))
        return [] if self._inserting else self._shown()

    @staticmethod
    def _is_command(letter: str, rest: str) -> bool:
        """Whether it isn't an instruction, such as an assignment to a variable of one letter."""
        if letter in "TF":
            return not rest.startswith("=")
        return not rest or bool(_COUNT.fullmatch(rest))

    def _command(self, letter: str, rest: str) -> list[str]:
        steps, count = self.program.steps, min(int(rest), MOST_STEPS) if _COUNT.fullmatch(rest) else None
        match letter:
            case "?":
                return list(HELP)
            case "I":
                self._inserting = True
                return []
            case "D":
                if self._at > len(steps):
                    raise ValError("No such step", f"the program has {len(steps)}")
                end = self._at - 1 + (1 if count is None else count)
                self._change((*steps[: self._at - 1], *steps[end:]), self._at)
            case "S":
                self._at = min(max(count or 1, 1), len(steps) + 1)
            case "L":
                self._at = max(self._at - (1 if count is None else count), 1)
            case "P":
                end = len(steps) if count is None else self._at - 1 + count
                return layout.numbered(self._printed()[self._at - 1 : end], self._at)
            case "T":
                self._teach(rest)
            case "F":
                self._find(rest)
            case "U":
                if not self._history:
                    raise ValError("Nothing to undo")
                self.program, self._at = self._history.pop()
            case _:
                return self._leave(keep=letter == "E")
        self._inserting = False
        return self._shown()

    def _leave(self, *, keep: bool) -> list[str]:
        self.done = True
        if not keep:
            self.program = self._first
            return []
        try:
            structure(self.program)
        except ValError as error:
            return [str(error)]
        return []

    def _teach(self, name: str) -> None:
        variable = self._record(name)
        step = Step(Instruction("MOVE", (variable,)))
        self._insert(step)

    def _find(self, text: str) -> None:
        wanted = text.upper()
        lines = self._printed()
        if not wanted:
            raise ValError("Missing argument", "which text?")
        order = [*range(self._at, len(lines)), *range(min(self._at, len(lines)))]
        found = next((index for index in order if wanted in lines[index].upper()), None)
        if found is None:
            raise ValError("Not found", text)
        self._at = found + 1

    def _put(self, step: Step) -> None:
        """An instruction: inserted, or in the place of this step."""
        steps = self.program.steps
        if self._inserting or self._at > len(steps):
            self._insert(step)
        else:
            self._change((*steps[: self._at - 1], step, *steps[self._at :]), self._at + 1)

    def _insert(self, step: Step) -> None:
        steps = self.program.steps
        if len(steps) >= MOST_STEPS:
            raise ValError("Program too long", f"{MOST_STEPS} steps at most")
        self._change((*steps[: self._at - 1], step, *steps[self._at - 1 :]), self._at + 1)

    def _change(self, steps: tuple[Step, ...], at: int) -> None:
        self._history = [*self._history[1 - _HISTORY :], (self.program, self._at)]
        self.program, self._at = replace(self.program, steps=steps), at

    def _printed(self) -> list[str]:
        return [print_step(step) for step in self.program.steps]

    def _shown(self) -> list[str]:
        """The step at which it is, if there's one."""
        if self._at > len(self.program.steps) or self.done:
            return []
        step = self.program.steps[self._at - 1]
        text = "" if step == Step(BLANK) else print_step(step)
        return layout.numbered([text], self._at)


class Editing(Dialogue):
    """Takes lines for the editor."""

    def __init__(self, state: TerminalState, program: Program, step: int) -> None:
        """Show the program's head and the step."""
        self._state = state
        self._taught: Variable | None = None
        self._editor = Editor(program, step, self._record)
        state.say(*self._editor.begin())

    @property
    @override
    def prompt(self) -> str:
        return self._editor.prompt

    @override
    def line(self, text: str) -> Dialogue | None:
        shown = self._editor.line(text)
        if not self._editor.done:
            self._state.say(*shown)
            return self
        self._state.say(*shown, style=Style.ERROR)
        self._keep()
        return None

    def _keep(self) -> None:
        program = self._editor.program
        if program.steps or program.name in self._state.controller.memory.programs:
            self._state.controller.memory.programs[program.name] = program

    @override
    def leave(self, *, kept: bool) -> None:
        if kept:
            self._keep()

    def _record(self, name: str) -> Variable:
        """Record where the arm is under a name, or the one after the last."""
        if name:
            variable = self._state.variable(name)
        elif self._taught is None:
            raise ValError("Missing argument", "T location")
        else:
            variable = following(self._taught)
        place = self._state.controller.arm.here(now=self._state.now)
        self._state.controller.memory.set(variable, place.joints if variable.prefix == "#" else place.tool)
        self._taught = variable if variable.indices or variable.name[-1].isdigit() else None
        return variable


def edit(state: TerminalState, rest: str) -> Dialogue:
    """EDIT program, step; EDIT program(arguments) for a new one; EDIT alone goes on with the last."""
    given, *step = pieces(rest or state.last_edit) or [""]
    if len(step) > 1:
        raise ValError("Invalid argument", f"{rest}: a program and a step")
    head = parse_program(f".PROGRAM {given}\n.END") if "(" in given else Program(named(given, "program"))
    name = head.name
    if name in state.in_use():
        raise ValError("Program in use", name)
    known = state.controller.memory.programs.get(name)
    program = head if known is None else replace(known, parameters=head.parameters or known.parameters)
    state.last_edit = name
    return Editing(state, program, integer("".join(step), 1, "a step"))
