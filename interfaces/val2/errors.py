"""VAL's errors: what is wrong, and where."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal

from vrs.errors import VrsError

TAKEN: Final = "whoever has control has given another command"
"""Why a program is interrupted whose person commands the robot from elsewhere, too."""


@dataclass(frozen=True, slots=True)
class TextPosition:
    """Where something stands in a text."""

    line: int
    """Line, from 1."""
    column: int
    """Column, from 1."""


NOWHERE: Final = TextPosition(0, 0)
"""Of what was made, not read."""


class ValError(VrsError):
    """An error in VAL's dress: `*Undefined location* P3, step 12`."""

    def __init__(
        self,
        what: str,
        detail: str = "",
        *,
        program: str = "",
        step: int | None = None,
        place: TextPosition | None = None,
    ) -> None:
        """Say what is wrong.

        Args:
            what: The words between the stars, such as `Undefined location`.
            detail: Which one, or what is allowed.
            program: Name of the program.
            step: Step of the program, from 1.
            place: Where it stands: within the line of the step for a program, in the file for a file; `NOWHERE`
                is none.
        """
        self.what, self.detail = what, detail
        self.program, self.step = program, step
        self.place = place if place is not None and place.line else None
        super().__init__(self._spelled())

    def _spelled(self) -> str:
        where = []
        if self.program:
            where.append(f"program {self.program}")
        if self.step is not None:
            where.append(f"step {self.step}")
        if self.place is not None:
            line = f"line {self.place.line}, " if self.step is None else ""
            where.append(f"{line}column {self.place.column}")
        head = f"*{self.what}*" + (f" {self.detail}" if self.detail else "")
        return ", ".join([head, *where])

    def at(self, *, program: str = "", step: int | None = None, place: TextPosition | None = None) -> ValError:
        """The same error at a place, where it doesn't know its own."""
        return ValError(
            self.what,
            self.detail,
            program=self.program or program,
            step=self.step if self.step is not None else step,
            place=self.place if self.place is not None else place,
        )


def syntax_error(detail: str, line: int, column: int, what: str = "Syntax error") -> ValError:
    """The error of a text that can't be read.

    Args:
        detail: What is wrong with it, or what is allowed.
        line: Line, from 1.
        column: Column, from 1.
        what: The words between the stars.
    """
    return ValError(what, detail, place=TextPosition(line, column))


@dataclass(frozen=True, slots=True)
class CheckFinding:
    """Something that a check of a file, or its rehearsal, found."""

    severity: Literal["error", "warning"]
    error: ValError
    """What is wrong, and in which program and step."""
    place: TextPosition | None
    """Where in the file."""


def robot_halted(why: str, *, commanded: bool = True) -> ValError:
    """The error of a real robot that stopped by itself.

    Args:
        why: Why it did.
        commanded: Whether whoever is told may let it go on.
    """
    return ValError("Robot halted", f"{why}; ENABLE POWER lets it go on" if commanded else why)
