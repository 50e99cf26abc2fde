"""The monitor's commands, a row each: names, forms, help, completion, what each needs, and what carries it out.

Abbreviations, HELP, completion and the line of help below a prompt read these rows, and those of the language.
"""

from __future__ import annotations

import enum
import re
import textwrap
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Final, NamedTuple, TypeAlias

from interfaces.val2 import forms
from interfaces.val2.context import PROCESS_CONTROL
from interfaces.val2.controller import Controller
from interfaces.val2.errors import ValError
from interfaces.val2.memory import KINDS
from interfaces.val2.monitor import layout, locations, running, storage
from interfaces.val2.monitor.editor import edit
from interfaces.val2.monitor.state import Dialogue, TerminalState, begun, nothing, split_word
from interfaces.val2.printer import number
from interfaces.val2.rows import Form, Setting
from vrs.checks import did_you_mean

Handler: TypeAlias = Callable[[TerminalState, str], Dialogue | None]
"""Carries a command out, with what follows its name; what asks, or None."""


class Need(enum.Enum):
    """What a command needs."""

    LOOK = "look"
    """Nothing: it only looks."""
    ARGUMENT = "argument"
    """Control if it's given anything; without, it shows what is."""
    CHANGE = "change"
    """Control: it moves the arm, or changes what others see."""


class Word(NamedTuple):
    """A word, as one of the things that it may be."""

    word: str
    help: str = ""
    """What it does, in one line; empty for none."""
    kind: str = ""
    """What it is; empty for a name."""
    usage: str = ""
    """How it's written."""
    origin: str = ""
    """Whose it is; empty where that isn't said."""


Completer: TypeAlias = Callable[[TerminalState, str], Iterable[Word]]
"""Gives what may come behind a command's name, and what was typed between."""


def _none(_state: TerminalState, _before: str) -> Iterable[Word]:
    return ()


@dataclass(frozen=True, slots=True)
class MonitorCommand:
    """A command."""

    name: str
    """Upper case."""
    act: Handler | None
    """Carries it out; None for leaving, the name of which can't be abbreviated."""
    forms: str
    """What follows the name; forms are separated by `|`."""
    help: str
    """One line."""
    need: Need = Need.CHANGE
    completes: Completer = _none
    """What may come behind its name and what else was typed."""
    idle: bool = False
    """Only while no program runs."""
    ours: bool = False
    """An extension, not VAL's."""
    short: str = ""
    """What stands for it though others begin with it too, between blanks."""
    more: bool = False
    """Something may follow its name though no form says what."""

    @property
    def usage(self) -> tuple[str, ...]:
        """Each form with the name."""
        return tuple(f"{self.name} {form.strip()}".rstrip() for form in self.forms.split("|"))

    def carry_out(self, state: TerminalState, rest: str) -> Dialogue | None:
        """Do it, but for leaving; what asks, or None.

        Raises:
            ValError: If it can't be done.
        """
        if not (self.forms or self.more):
            nothing(rest, self.name)
        return None if self.act is None else self.act(state, rest)

    def waits(self, rest: str) -> bool:
        """Whether it can't be done while the main program runs; what is about another task can."""
        return self.idle and not ("task" in self.forms and re.match(r"0*[1-9]", rest))

    def only_shows(self, rest: str) -> bool:
        """Whether it changes nothing, with what follows its name."""
        if self.need is not Need.ARGUMENT:
            return self.need is Need.LOOK
        return rest in {"", "?"} or ("=" in self.forms and "=" not in rest)


_ASSIGNMENT: Final = re.compile(r"[#$]?[A-Za-z][A-Za-z0-9._]*(\[[^\]]*\])?\s*=(?!=).*", re.DOTALL)


def command(line: str) -> MonitorCommand:
    """The command that a line begins with.

    Raises:
        ValError: If it's none; it says so where the line is an instruction.
    """
    word, rest = split_word(line)
    upper = word.upper()
    if _ASSIGNMENT.fullmatch(line) and not (upper in COMMANDS and COMMANDS[upper].forms == "new=old"):
        raise ValError("Invalid command", f"{_short(line)}: an assignment is an instruction, DO {_short(line)}")
    is_instruction = upper in forms.INSTRUCTIONS
    found = [] if is_instruction and upper not in COMMANDS else _candidates(word)
    if len(found) == 1:
        return COMMANDS[found[0]]
    if found:
        raise ValError("Ambiguous command", f"{upper}: {', '.join(sorted(found))}")
    if is_instruction:
        said = f"{upper} is an instruction: DO {_short(f'{upper} {rest}'.strip())}"
    elif upper in forms.SWITCHES:
        said = f"{upper} is a switch: ENABLE {upper}, DISABLE {upper}"
    elif upper:
        said = _short(upper) + (did_you_mean(upper, COMMANDS) or "; HELP lists the commands")
    else:
        said = _short(line)
    raise ValError("Invalid command", said)


def command_named(word: str) -> MonitorCommand | None:
    """The command that a word names, whole or by its beginning; None where that's none or several."""
    found = _candidates(word)
    return COMMANDS[found[0]] if len(found) == 1 else None


def _candidates(word: str) -> list[str]:
    wanted = word.upper()
    if wanted in _EXACT:
        return [_EXACT[wanted]]
    return begun(wanted, (name for name, one in COMMANDS.items() if one.act is not None))


def _short(text: str) -> str:
    return text if len(text) <= 40 else f"{text[:37]}.."


def explained(word: str) -> Iterator[Word]:
    """What a word is; it may be several things."""
    upper = word.upper()
    if upper in COMMANDS:
        one = COMMANDS[upper]
        yield Word(upper, one.help, "command", " | ".join(one.usage), "ours" if one.ours else "")
    if upper in forms.INSTRUCTIONS:
        form = forms.INSTRUCTIONS[upper]
        yield Word(upper, form.help, "instruction", form.usage, form.origin)
    for name in (upper, f"${upper}", f"#{upper}"):
        if name in forms.FUNCTIONS:
            form = forms.FUNCTIONS[name]
            yield Word(name, form.help, "function", form.usage, form.origin)
    if upper in forms.SWITCHES:
        switch = forms.SWITCHES[upper]
        yield Word(upper, switch.help, "switch", f"ENABLE {upper} | DISABLE {upper}", switch.origin)
    if upper in forms.PARAMETERS:
        row = forms.PARAMETERS[upper]
        said = f"{row.help} {number(row.low)} to {number(row.high)} {row.unit}."
        yield Word(upper, said, "parameter", f"PARAMETER {upper} = value", row.origin)
    for kind, words in (("operator", forms.OPERATORS), ("word", forms.WORDS)):
        if upper in words:
            yield Word(upper, words[upper], kind, upper)
    if upper in forms.IGNORED and upper not in COMMANDS:
        passed = upper in forms.PASSED
        said = "It's recognised in programs, and passed over" if passed else "It isn't available"
        why = forms.PASSED[upper] if passed else forms.UNAVAILABLE[upper]
        yield Word(upper, f"{said}: {why}.", "instruction", upper, "V+")


def help_(state: TerminalState, rest: str) -> None:
    """HELP; HELP word."""
    if not rest:
        title = "Commands; they may be abbreviated. HELP and a word says more of it."
        state.say(*textwrap.wrap(title, state.width), *layout.in_columns(COMMANDS, state.width))
        state.say("Instructions, after DO or in programs:", *layout.in_columns(forms.INSTRUCTIONS, state.width))
        state.say("Functions:", *layout.in_columns(forms.FUNCTIONS, state.width))
        return
    tables = (COMMANDS, forms.INSTRUCTIONS, forms.FUNCTIONS, forms.SWITCHES, forms.PARAMETERS)
    whole = next((some[0] for names in tables if len(some := begun(rest.upper(), names)) == 1), rest)
    found = list(explained(rest)) or list(explained(whole))
    if not found:
        near = did_you_mean(rest, [word for names in tables for word in names])
        raise ValError("Unknown word", _short(rest) + (near or "; HELP alone lists those that are allowed"))
    for one in found:
        kind = f"{one.kind}, {one.origin}" if one.origin else one.kind
        said = textwrap.wrap(one.help, state.width, initial_indent="    ", subsequent_indent="    ")
        state.say(f"{one.usage}  ({kind})", *said)


MOST: Final = 200
"""Longest list of suggestions."""
_FRAGMENT: Final = re.compile(r"[#$]?[A-Za-z0-9._]*$")
_DO: Final = re.compile(r"\sDO\s(.*)$", re.IGNORECASE | re.DOTALL)
_LABEL: Final = re.compile(r"\s*\d+\s+")
_OF_SETTING: Final = re.compile(r"\b(SWITCH|PARAMETER)\s*\(\s*$", re.IGNORECASE)
_SETTINGS: Final = {"SWITCH": forms.SWITCHES, "PARAMETER": forms.PARAMETERS}
"""What functions of names take."""


def suggestions(text: str, state: TerminalState, *, program: bool = False) -> tuple[str, list[Word]]:
    """What may complete a line.

    Args:
        text: As far as the cursor.
        state: Whose memory and files are known.
        program: Whether it's a line of a program, not a command.

    Returns:
        What is typed of the last word, and the words that begin with it; keywords in its case.
    """
    found = _FRAGMENT.search(text)
    fragment = found[0] if found else ""
    before = text[: len(text) - len(fragment)]
    word, _ = split_word(before)
    if before.count('"') % 2 or ";" in before:
        return fragment, []
    if program:
        known = _instruction(state, before)
    elif not word:
        known = iter(_rows(COMMANDS)(state, before))
    else:
        named = command_named(word)
        known = iter(named.completes(state, before.lstrip()[len(word) :]) if named else ())
    wanted = fragment.upper()
    fitting = {one.word: one for one in known if one.word.upper().startswith(wanted) and one.word.upper() != wanted}
    lower = bool(fragment) and not any(letter.isupper() for letter in fragment)
    some = sorted(fitting.values(), key=lambda one: one.word.upper())[:MOST]
    return fragment, [one._replace(word=one.word.lower()) if lower else one for one in some]


def _instruction(state: TerminalState, before: str, *, alone: bool = False) -> Iterator[Word]:
    """What may come in a line of a program, or in one that stands alone."""
    word, _ = split_word(_LABEL.sub("", before))
    keyword = word.upper()
    if not word:
        allowed = {name: row for name, row in forms.INSTRUCTIONS.items() if not (alone and "program" in row.tags)}
        yield from _rows(allowed)(state, before)
        yield from _names("reals", "strings")(state, before)
    elif keyword in {"ENABLE", "DISABLE"}:
        yield from _rows(forms.SWITCHES)(state, before)
    elif keyword == "PARAMETER" and "=" not in before:
        yield from _rows(forms.PARAMETERS)(state, before)
    else:
        if keyword in forms.INSTRUCTIONS:
            row = forms.INSTRUCTIONS[keyword]
            if row.rule in ("call", "tasks") or "program" in (slot.kind for slot in row.slots):
                yield from _programs(state, before)
            yield from (Word(one, forms.WORDS.get(one, "")) for one in row.allowed_words)
        yield from _operands(state, before)


def _statement(state: TerminalState, before: str) -> Iterable[Word]:
    return _instruction(state, before, alone=True)


def _motion(state: TerminalState, before: str) -> Iterable[Word]:
    found = _DO.search(before)
    return _statement(state, found[1]) if found else [Word("DO")]


def _operands(state: TerminalState, before: str) -> Iterator[Word]:
    if named := _OF_SETTING.search(before):
        yield from _rows(_SETTINGS[named[1].upper()])(state, before)
        return
    yield from (Word(one.name, f"{one.usage}: {one.help}") for one in forms.FUNCTIONS.values())
    yield from (Word(name, said) for name, said in forms.OPERATORS.items())
    yield from _names(*KINDS)(state, before)


def _programs(state: TerminalState, _before: str) -> Iterable[Word]:
    return [Word(one) for one in state.controller.memory.programs]


def _files(state: TerminalState, _before: str) -> Iterable[Word]:
    return [Word(one) for one in state.files.listed()]


def _rows(table: Mapping[str, Form | Setting | MonitorCommand]) -> Completer:
    """The names of a table's rows, with their help."""
    return lambda _state, _before: [Word(one.name, one.help) for one in table.values()]


def _names(*kinds: str) -> Completer:
    """Names in memory, an array's once."""

    def completes(state: TerminalState, _before: str) -> Iterable[Word]:
        known = list(state.controller.memory.variables())
        listed = [v.name for kind in kinds for v, value in known if isinstance(value, KINDS[kind])]
        return map(Word, dict.fromkeys(listed))

    return completes


def _until(letters: str, first: Completer, then: Completer = _none) -> Completer:
    """Completes by one, and behind certain letters by another."""
    return lambda state, before: (then if set(letters) & set(before) else first)(state, before)


def _all_words(_state: TerminalState, _before: str) -> Iterable[Word]:
    for name in {*COMMANDS, *forms.INSTRUCTIONS, *forms.FUNCTIONS, *forms.SWITCHES, *forms.PARAMETERS}:
        yield next(explained(name))


def hint(text: str, *, program: bool = False) -> str:
    """One line on the word that's being typed, or the last one that means something; empty for none.

    Args:
        text: As far as the cursor.
        program: Whether it's a line of a program, not a command.
    """
    parts = re.findall(r"[#$]?[A-Za-z][A-Za-z0-9._]*", text)
    if not program and parts:
        named = command_named(parts[0])
        if named is None:
            return ""
        parts[0] = named.name
    for index in reversed(range(len(parts))):
        found = list(explained(parts[index]))
        wanted = "command" if index == 0 and not program else "instruction"
        if found:
            one = next((one for one in found if one.kind == wanted), found[0])
            return f"{one.usage}: {one.help}"
    return ""


_LOOK, _ARGUMENT = Need.LOOK, Need.ARGUMENT
_LOCATIONS, _REALS, _STRINGS = map(_names, KINDS)
_SWITCHES, _STORED = _rows(forms.SWITCHES), _until("=", _files, _programs)
_KINDS: Final = (
    ("P", "programs", "program", _programs), ("L", "locations", "location", _until("=:", _LOCATIONS)),
    ("R", "reals", "real", _REALS), ("S", "strings", "$string", _STRINGS),
)  # fmt: skip
"""Of which there are some commands each: last letter, what they are about, a form, and what completes it."""
_TABLE: Final = (
    MonitorCommand("ABORT", running.abort, "| task",
                   "Stop the program and the arm, within its limits; Ctrl-C does the same.", short="A"),
    *(MonitorCommand(word, partial(running.channel, word=word), f"| {name} | {name}=value",
                     f"Show {what}, or set one.", _ARGUMENT, _until("=", _none, _operands))
      for word, name, what in (("ADC", "channel", "analogue inputs"), ("DAC", "channel", "analogue outputs"),
                               ("IOGET", "port", "ports that are read"), ("IOPUT", "port", "ports that are set"))),
    MonitorCommand("AT", running.at, "t | +t [motion]",
                   "The next motion begins at a time, or so long from now [s].", completes=_motion, idle=True,
                   ours=True),
    MonitorCommand("BASE", partial(locations.frame, word="BASE"), "| dx,dy,dz,turn",
                   "Show the base, or set it: mm, and deg about Z.", _ARGUMENT, _operands, idle=True),
    MonitorCommand("CALIBRATE", running.calibrate, "", "Make joint values valid; asks first.", idle=True),
    MonitorCommand("COPY", partial(storage.put, keep=True), "new=old", "Copy a program.", completes=_programs),
    MonitorCommand("DELETE", partial(storage.delete, kind="programs"), "program,..",
                   "Delete programs; asks first.", completes=_programs, idle=True),
    MonitorCommand("DIRECTORY", storage.directory, "", "List the programs in memory.", _LOOK, _programs, more=True),
    MonitorCommand("DISABLE", partial(running.turn, on=False), "switch,..", "Turn switches off.",
                   completes=_SWITCHES),
    MonitorCommand("DO", running.do, "instruction |", "Carry out one instruction; without one, the last again.",
                   completes=_statement, idle=True, short="D"),
    MonitorCommand("DONE", partial(running.of_task, do=Controller.finish), "| task",
                   "End the program, or a task, with its present cycle."),
    MonitorCommand("EDIT", edit, "program[,step]", "Edit a program line by line; ? there says how.",
                   completes=_programs, idle=True),
    MonitorCommand("ENABLE", partial(running.turn, on=True), "switch,..",
                   "Turn switches on; ENABLE POWER after PANIC.", completes=_SWITCHES),
    MonitorCommand("EXECUTE", running.execute, "[task] program[(arguments)][,cycles[,step]] |",
                   "Run a program, or the last; cycles -1 for ever.", completes=_programs, idle=True,
                   short="E EX"),
    MonitorCommand("EXIT", None, "", "Leave the monitor.", _LOOK, more=True, ours=True),
    MonitorCommand("FDELETE", storage.file_delete, "file", "Delete a file; asks first.", completes=_files),
    MonitorCommand("FLIST", storage.flist, "", "List the files.", _LOOK),
    MonitorCommand("FREE", storage.free, "", "Show what is in memory.", _LOOK, short="FR FRE"),
    MonitorCommand("FRENAME", storage.file_rename, "new=old", "Rename a file; asks before it replaces another.",
                   completes=_files),
    MonitorCommand("HELP", help_, "| word", "List the commands, or explain a word of the language.", _LOOK,
                   _all_words),
    MonitorCommand("HERE", locations.here, "location | #location | a:b",
                   "Record where the arm is; then CR, or changes: ,,10",
                   completes=_until("=:", _LOCATIONS, _operands)),
    MonitorCommand("ID", lambda s, _: s.say(s.version), "", "Show what this is, and its version.", _LOOK),
    MonitorCommand("IO", running.io, "", "Show inputs, outputs and internal signals.", _LOOK),
    MonitorCommand("KILL", partial(running.of_task, do=Controller.kill), "| task",
                   "Give up a program that stands: it can't go on any more.", idle=True),
    MonitorCommand("LISTF", storage.flist, "", "List the files.", _LOOK, more=True),
    MonitorCommand("LISTL", partial(storage.list_values, kind="locations"), "| location,..",
                   "List locations; * stands for any characters.", _LOOK, _until("=:", _LOCATIONS)),
    MonitorCommand("LISTP", storage.list_programs, "| program,..", "List programs.", _LOOK, _programs),
    MonitorCommand("LISTR", partial(storage.list_values, kind="reals"), "| real,.. | expression",
                   "List reals, or show what an expression comes to.", _LOOK, _REALS),
    MonitorCommand("LISTS", partial(storage.list_values, kind="strings"), "| $string,.. | expression",
                   "List strings, or show what an expression comes to.", _LOOK, _STRINGS),
    MonitorCommand("LOAD", storage.load, "file", "Read programs and values from a file.", completes=_STORED),
    MonitorCommand("NEXT", running.next_, "| n", "Carry out the next step of a program that stands, or the next n.",
                   idle=True),
    MonitorCommand("PANIC", running.panic, "", "Stop at once and turn the power off.", more=True),
    MonitorCommand("PARAMETER", running.parameter, "| name | name=value", "Show or set parameters.", _ARGUMENT,
                   _until("=", _rows(forms.PARAMETERS))),
    MonitorCommand("POINT", locations.point, "location[=expression]",
                   "Define or change a location; then CR, or changes: ,,10",
                   completes=_until("=:", _LOCATIONS, _operands)),
    *(MonitorCommand(f"PC{name}", partial(running.of_task, do=do, usual=PROCESS_CONTROL), "| task", said)
      for name, do, said in (
          ("ABORT", Controller.abort, "Stop a process control program."),
          ("END", Controller.finish, "End a process control program with its present cycle."),
          ("PROCEED", Controller.proceed, "Go on with a process control program that stands, at its next step."),
          ("RETRY", Controller.retry, "Go on with a process control program at the step that was interrupted."))),
    MonitorCommand("PCEXECUTE", partial(running.execute, usual=PROCESS_CONTROL),
                   "[task] program[(arguments)][,cycles[,step]]",
                   "Run a process control program beside the main one; cycles -1 for ever.", completes=_programs),
    MonitorCommand("PROCEED", partial(running.of_task, do=Controller.proceed), "| task",
                   "Go on with a program that stands, at its next step.", idle=True, short="P"),
    MonitorCommand("QUIT", None, "", "Leave the monitor.", _LOOK, more=True, ours=True),
    MonitorCommand("RENAME", partial(storage.put, keep=False), "new=old", "Rename a program.", completes=_programs,
                   idle=True),
    MonitorCommand("RESET", lambda s, _: s.controller.signals.reset(), "", "Turn all outputs off."),
    MonitorCommand("RETRY", partial(running.of_task, do=Controller.retry), "| task",
                   "Go on with a program that stands, at the step that was interrupted.", idle=True),
    MonitorCommand("REWIND", locations.rewind, "t | -t", "Show what WHERE showed at a time, or so long ago [s].",
                   _LOOK, _operands, ours=True),
    MonitorCommand("SIGNAL", running.signal, "| n,-m,..", "Turn signals on, or off with a minus; show them.",
                   _ARGUMENT, _operands),
    MonitorCommand("SPEED", running.speed, "| percent", "Show or set the monitor speed; it counts at once.",
                   _ARGUMENT, _operands),
    MonitorCommand("STATUS", running.status, "", "Show the program, its step and cycles, speeds, power.", _LOOK,
                   short="S"),
    MonitorCommand("STORE", partial(storage.store, parts=""), "file[=program,..]",
                   "Write programs, with all that they use, to a file.", completes=_STORED),
    MonitorCommand("SWITCH", running.switch, "| switch,..", "Show switches.", _LOOK, _SWITCHES),
    MonitorCommand("TEACH", locations.teach, "location", "Record one location after the other, each by CR; E ends.",
                   completes=_until("=:", _LOCATIONS), idle=True),
    MonitorCommand("TIMELINE", running.timeline, "", "Show what is scheduled.", _LOOK, ours=True),
    MonitorCommand("TOOL", partial(locations.frame, word="TOOL"), "| transformation", "Show the tool, or set it.",
                   _ARGUMENT, _operands, idle=True),
    MonitorCommand("UNDO", lambda s, _: s.say(s.controller.arm.undo(now=s.now)), "",
                   "Take back the newest motion, as far as it's still to come.", ours=True),
    MonitorCommand("WHERE", locations.where, "| 1 | REAL",
                   "Show where the arm is; 1 repeats until CR, REAL: the other twin.", _LOOK,
                   lambda _state, _before: [Word("REAL", "The other twin.")], short="W"),
    MonitorCommand("XSTEP", running.xstep, "| program[,cycles[,step]]",
                   "Begin a program step by step, or do its next step.", completes=_programs, idle=True),
    MonitorCommand("ZERO", storage.zero, "", "Delete all programs and values; asks first.", idle=True),
    *(MonitorCommand(f"DELETE{letter}", partial(storage.delete, kind=kind), f"{form},..",
                     f"Delete {kind}; asks first.", completes=completes, idle=True)
      for letter, kind, form, completes in _KINDS),
    *(MonitorCommand(f"STORE{letter}", partial(storage.store, parts=kind), f"file[={form},..]",
                     f"Write {kind} to a file.", completes=_STORED)
      for letter, kind, form, _ in _KINDS),
)  # fmt: skip

COMMANDS: Final = {row.name: row for row in sorted(_TABLE, key=lambda row: row.name)}
"""By name."""
_EXACT: Final = {word: row.name for row in _TABLE for word in (row.name, *row.short.split())}
