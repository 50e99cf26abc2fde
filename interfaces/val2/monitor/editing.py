"""EDIT at the monitor: the editor as what takes lines."""

from __future__ import annotations

from dataclasses import replace

from interfaces.val2.errors import ValError
from interfaces.val2.monitor.desk import Dialogue, Style, TerminalState
from interfaces.val2.monitor.editor import Editor
from interfaces.val2.monitor.locations import following
from interfaces.val2.monitor.text import integer, named, pieces
from interfaces.val2.parser import parse_program
from interfaces.val2.syntax import Program, Variable


class Editing:
    """Takes lines for the editor."""

    def __init__(self, desk: TerminalState, program: Program, step: int, *, now: float) -> None:
        """Show the program's head and the step."""
        self._desk, self._now = desk, now
        self._taught: Variable | None = None
        self._editor = Editor(program, step, self._record)
        desk.say(*self._editor.begin())

    @property
    def prompt(self) -> str:
        """`n.?`."""
        return self._editor.prompt

    def line(self, text: str, *, now: float) -> Dialogue | None:
        """Take a line.

        Raises:
            ValError: If it's neither an instruction nor a command.
        """
        self._now = now
        shown = self._editor.line(text)
        if not self._editor.done:
            self._desk.say(*shown)
            return self
        self._desk.say(*shown, style=Style.ERROR)
        self._keep()
        return None

    def _keep(self) -> None:
        program = self._editor.program
        if program.steps or program.name in self._desk.controller.memory.programs:
            self._desk.controller.memory.programs[program.name] = program

    def leave(self, *, now: float, kept: bool) -> None:  # noqa: ARG002 - it takes no time
        """At the end of input the program is kept."""
        if kept:
            self._keep()

    def _record(self, name: str) -> Variable:
        """Record where the arm is under a name, or the one after the last."""
        if name:
            variable = self._desk.variable(name, now=self._now)
        elif self._taught is None:
            raise ValError("Missing argument", "T location")
        else:
            variable = following(self._taught)
        place = self._desk.controller.arm.here(now=self._now)
        self._desk.controller.memory.set(variable, place.joints if variable.prefix == "#" else place.tool)
        self._taught = variable if variable.indices or variable.name[-1].isdigit() else None
        return variable


def edit(desk: TerminalState, rest: str, *, now: float) -> Dialogue:
    """EDIT program, step; EDIT program(arguments) for a new one; EDIT alone goes on with the last."""
    given, *step = pieces(rest or desk.last_edit) or [""]
    if len(step) > 1:
        raise ValError("Invalid argument", f"{rest}: a program and a step")
    head = parse_program(f".PROGRAM {given}\n.END") if "(" in given else Program(named(given, "program"))
    name = head.name
    if name in desk.in_use():
        raise ValError("Program in use", name)
    known = desk.controller.memory.programs.get(name)
    program = head if known is None else replace(known, parameters=head.parameters or known.parameters)
    desk.last_edit = name
    return Editing(desk, program, integer("".join(step), 1, "a step"), now=now)
