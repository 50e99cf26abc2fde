"""The state of one terminal, and the pieces of a command's line."""

from __future__ import annotations

import contextlib
import enum
import math
import re
import textwrap
from collections.abc import Callable, Collection, Generator, Iterable, Iterator
from dataclasses import dataclass, field, replace
from typing import Final, TypeAlias

from interfaces.val2.controller import Controller
from interfaces.val2.errors import ValError
from interfaces.val2.monitor.control import Control
from interfaces.val2.monitor.files import Files
from interfaces.val2.monitor.layout import WIDTH
from interfaces.val2.parser import parse_expression, parse_line
from interfaces.val2.printer import print_expression
from interfaces.val2.syntax import Expression, Number, Step, Variable
from interfaces.val2.values import Location, PrecisionPoint, Transformation, Value
from vrs.errors import VrsError

NAME: Final = re.compile(r"[A-Za-z][A-Za-z0-9._]*")
"""A name without its prefix."""
_WORD: Final = re.compile(r"\s*([A-Za-z][A-Za-z0-9._]*)\s*(.*)", re.DOTALL)
_INTEGER: Final = re.compile(r"\s*[-+]?\d{1,9}\s*")


def split_word(text: str) -> tuple[str, str]:
    """The first word of a line, empty if it doesn't begin with one, and the rest."""
    found = _WORD.fullmatch(text)
    return (found[1], found[2].strip()) if found else ("", text.strip())


def pieces(text: str) -> list[str]:
    """What stands between commas, but for those within brackets or quotes; none of an empty text."""
    found, depth, quoted = [""], 0, False
    for letter in text:
        quoted ^= letter == '"'
        depth += 0 if quoted else (letter in "([") - (letter in ")]")
        if letter == "," and depth == 0 and not quoted:
            found.append("")
        else:
            found[-1] += letter
    return [piece.strip() for piece in found] if text.strip() else []


def halves(text: str) -> tuple[str, str | None]:
    """What stands before and after the first `=`; None after where there's none."""
    before, equals, after = text.partition("=")
    return before.strip(), after.strip() if equals else None


def named(text: str, kind: str) -> str:
    """A name without a prefix, lower case.

    Args:
        text: What was given.
        kind: What it names, for the error.

    Raises:
        ValError: If it's none.
    """
    if not text.strip():
        raise ValError("Missing argument", kind)
    if not NAME.fullmatch(text.strip()):
        raise ValError("Invalid argument", f"{text.strip()}: the name of a {kind} is wanted")
    return text.strip().lower()


def integer(text: str, default: int, what: str) -> int:
    """A whole number; the default where nothing is given.

    Raises:
        ValError: If it's none.
    """
    if not text.strip():
        return default
    if not _INTEGER.fullmatch(text):
        raise ValError("Invalid argument", f"{text.strip()}: {what} is a whole number")
    return int(text)


def begun(word: str, names: Iterable[str]) -> list[str]:
    """The names, upper case, that a word is the beginning of; of STORE, STOREL, STOREP it's STORE alone."""
    found = sorted((name for name in names if word and name.startswith(word)), key=lambda name: (len(name), name))
    return found[:1] if found and all(name.startswith(found[0]) for name in found) else found


def unique(word: str, names: Collection[str], kind: str) -> str:
    """The name that a word is the beginning of.

    Args:
        word: Upper case.
        names: Those that there are, upper case.
        kind: What they are, for the error.

    Raises:
        ValError: If none or several begin with it.
    """
    match begun(word, names):
        case [name]:
            return name
        case []:
            raise ValError(f"Invalid {kind}", f"{word}; allowed: {', '.join(sorted(names))}")
        case several:
            raise ValError(f"Ambiguous {kind}", f"{word}: {', '.join(sorted(several))}")


def nothing(rest: str, name: str) -> None:
    """Refuse what follows a command that takes nothing.

    Raises:
        ValError: If there's something.
    """
    if rest:
        raise ValError("Invalid argument", f"{rest}: nothing follows {name}")


SLICE: Final = 80
"""Work that is done at once for a command that takes long: about as many characters of a file are read, in 1 ms."""


class Style(enum.StrEnum):
    """What kind of output a text is, for its colour."""

    ANSWER = "answer"
    """What a command shows."""
    TYPED = "typed"
    """What a program types."""
    NOTE = "note"
    """What has become of a program."""
    ERROR = "error"


@dataclass(frozen=True, slots=True)
class OutputText:
    """A piece of output."""

    text: str
    """Lines end with a newline; what a program types may go on in the next piece."""
    style: Style


class Expects(enum.Enum):
    """What the next line of a terminal is."""

    COMMAND = "command"
    STEP = "step"
    """A line of a program."""
    ANSWER = "answer"
    """The answer to a question of a command or a program."""


@dataclass(frozen=True, slots=True)
class Question:
    """What a command asks."""

    prompt: str = ""
    expects: Expects = Expects.ANSWER
    answers: frozenset[str] = frozenset()
    """The lines that answer it, upper case, where a command is expected; all others are one."""
    due: float = math.inf
    """When it's over without a line [s]."""

    def passes(self, text: str) -> bool:
        """Whether a line is a command, not an answer."""
        return self.expects is Expects.COMMAND and text.strip().upper() not in self.answers


Dialogue: TypeAlias = Generator[Question, str | None, None]
"""A command that asks. It's sent the lines that answer, None when a question is due; at the end of the input it's
thrown `EOFError`, and Ctrl-C closes it."""


@dataclass(slots=True)
class TerminalState:
    """What one terminal has and shows."""

    controller: Controller
    control: Control
    files: Files
    version: str
    """Name and version of the program, and what it's connected to."""
    now: float = 0.0
    """Session time at which the terminal does what is due [s]."""
    width: int = WIDTH
    """Longest line that it shows [characters]."""
    line: str = ""
    """The line that is being carried out."""
    output: list[OutputText] = field(default_factory=list)
    last_do: Step | None = None
    last_run: str = ""
    """What followed the last EXECUTE."""
    last_edit: str = ""
    scheduling: bool = False
    """Whether the next motion is one for later, and isn't waited for."""
    work: Generator[int, None, None] | None = None
    """What a command does in slices: yields how many characters, or as much work, each took."""
    steps: int = 0
    """Steps that NEXT has still to do."""

    def say(self, *lines: str, style: Style = Style.ANSWER) -> None:
        """Say whole lines; notes and errors by lines that a narrow terminal shows."""
        for line in lines:
            folds = self.width < WIDTH and style is not Style.ANSWER
            shown = textwrap.fill(line, self.width, break_long_words=False) if folds else line
            self.output.append(OutputText(f"{shown}\n", style))

    def say_all(self, lines: Iterable[str], none: str = "") -> None:
        """Say whole lines, or a note where there are none."""
        listed = list(lines)
        self.say(*listed)
        if not listed and none:
            self.say(none, style=Style.NOTE)

    def fail(self, error: ValError) -> None:
        """Say what is wrong; the place in the line as it was typed."""
        text = str(error)
        if not error.program and error.step is None and error.place is not None:
            text = re.sub(r"line \d+, column", "column", text)
        self.say(text, style=Style.ERROR)

    @contextlib.contextmanager
    def guarded(self) -> Iterator[None]:
        """Say what goes wrong within."""
        try:
            yield
        except ValError as error:
            self.fail(error)
        except VrsError as error:
            self.fail(ValError("Not possible", str(error)))

    def confirm(self, question: str, act: Callable[[], None]) -> Dialogue:
        """Ask before something is destroyed: Y does it, all else doesn't; where it fails it's asked again.

        Args:
            question: What would happen; empty where nothing is asked.
            act: Does it.
        """
        if not question:
            act()
            return
        while ((yield Question(f"{question} (Y/N)? ")) or "").strip().upper() in {"Y", "YES"}:
            with self.guarded():
                act()
                return

    def work_on(self, *, allowed: bool) -> None:
        """Do a slice of what a command does; it's dropped where that isn't allowed any more."""
        done = 0
        if self.work is not None and not allowed:
            self.drop_work()
            self.fail(ValError("No control", "what was begun isn't done"))
        try:
            while self.work is not None and done < SLICE:
                done += next(self.work) + 1
        except StopIteration:
            self.work = None
        except ValError as error:
            self.work = None
            self.fail(error)

    def drop_work(self) -> None:
        """Leave what a command does; then nothing of it has happened."""
        if self.work is not None:
            self.work.close()
        self.work = None

    def refuse_in_use(self, *programs: str) -> None:
        """Refuse to change programs that run.

        Raises:
            ValError: If one does.
        """
        running = {name for stack in self.controller.stacks() for name, _ in stack}
        for name in programs:
            if name in running:
                raise ValError("Program in use", name)

    def here(self, variable: Variable) -> Location:
        """Where the arm is, as a variable keeps it."""
        place = self.controller.arm.here(now=self.now)
        return place.joints if variable.prefix == "#" else place.tool

    def padded(self, part: str) -> str:
        """A part of the line with blanks before it, so that columns are those of the line."""
        return " " * max(self.line.rfind(part), 0) + part

    def step(self, text: str) -> Step:
        """An instruction of the line.

        Raises:
            ValError: If it's none.
        """
        return parse_line(self.padded(text))

    def instruction(self, keyword: str, rest: str) -> Step:
        """An instruction that has the form of the line, but for its abbreviated keyword."""
        column = max(self.line.rfind(rest), 0)
        return parse_line(f"{keyword:<{column}}{rest}" if column > len(keyword) else f"{keyword} {rest}")

    def expression(self, text: str, what: str = "a value") -> Expression:
        """An expression of the line.

        Args:
            text: The part of the line.
            what: What is wanted, for the error.

        Raises:
            ValError: If it's none, or nothing.
        """
        if not text.strip():
            raise ValError("Missing argument", what)
        return parse_expression(self.padded(text))

    def value(self, text: str) -> Value:
        """What an expression of the line comes to."""
        return self.controller.evaluate(self.expression(text), now=self.now)

    def number(self, text: str) -> float:
        """A number of the line.

        Raises:
            ValError: If it's something else.
        """
        return self.number_of(self.expression(text))

    def number_of(self, expression: Expression) -> float:
        """What an expression comes to, which is to be a number.

        Raises:
            ValError: If it's something else.
        """
        value = self.controller.evaluate(expression, now=self.now)
        if not isinstance(value, float):
            raise ValError("Invalid argument", f"{print_expression(expression)}: a number is wanted")
        return value

    def variable(self, text: str) -> Variable:
        """A variable of the line, its indices worked out.

        Raises:
            ValError: If it's none.
        """
        found = self.expression(text, "a name")
        if not isinstance(found, Variable):
            raise ValError("Invalid argument", f"{text}: a name is wanted")
        return self.resolved(found)

    def resolved(self, variable: Variable) -> Variable:
        """A variable with its indices worked out.

        Raises:
            ValError: If one isn't a number.
        """
        indices = []
        for index in variable.indices:
            value = self.controller.evaluate(index, now=self.now)
            if not isinstance(value, float):
                raise ValError("Invalid array index", variable.name)
            indices.append(Number(float(math.floor(value))))
        return replace(variable, indices=tuple(indices))


def as_location(value: Value, text: str) -> Location:
    """A value that's a location.

    Raises:
        ValError: If it's something else.
    """
    if not isinstance(value, Transformation | PrecisionPoint):
        raise ValError("Invalid argument", f"{text}: a location is wanted")
    return value
