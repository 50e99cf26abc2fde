"""The monitor's commands: names, forms, help, what each needs, and HELP itself."""

from __future__ import annotations

import difflib
import enum
import re
import textwrap
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import Final, TypeAlias

from interfaces.val2 import forms
from interfaces.val2.errors import ValError
from interfaces.val2.monitor import layout, locations, running, settings, storage
from interfaces.val2.monitor.editor import edit
from interfaces.val2.monitor.state import Dialogue, TerminalState, nothing, split_word, unique

Handler: TypeAlias = Callable[[TerminalState, str], Dialogue | None]
"""Carries a command out, with what follows its name; gives what takes the next line, or None for commands."""


class Need(enum.Enum):
    """What a command needs."""

    LOOK = "look"
    """Nothing: it only looks."""
    ARGUMENT = "argument"
    """Control if it's given anything; without, it shows what is."""
    CHANGE = "change"
    """Control: it moves the arm, or changes what others see."""


@dataclass(frozen=True, slots=True)
class MonitorCommand:
    """A command."""

    name: str
    """Upper case."""
    act: Handler | None
    """Carries it out; None for what the monitor does itself."""
    forms: str
    """What follows the name; forms are separated by `|`."""
    help: str
    """One line."""
    need: Need = Need.CHANGE
    idle: bool = False
    """Only while no program runs."""
    ours: bool = False
    """An extension, not VAL's."""
    whole: bool = False
    """Its name can't be abbreviated."""
    bare: bool = False
    """Nothing may follow its name."""

    @property
    def usage(self) -> tuple[str, ...]:
        """Each form with the name."""
        return tuple(f"{self.name} {form.strip()}".rstrip() for form in self.forms.split("|"))

    def carry_out(self, state: TerminalState, rest: str) -> Dialogue | None:
        """Do it; gives what takes the next line, or None for commands.

        Raises:
            ValError: If it can't be done.
        """
        assert self.act is not None
        if self.bare:
            nothing(rest, self.name)
        return self.act(state, rest)

    def only_shows(self, rest: str) -> bool:
        """Whether it changes nothing, with what follows its name."""
        if self.need is not Need.ARGUMENT:
            return self.need is Need.LOOK
        return rest in {"", "?"} or (self.name == "PARAMETER" and "=" not in rest)


_LOOK, _ARGUMENT = Need.LOOK, Need.ARGUMENT


_ASSIGNMENT: Final = re.compile(r"[#$]?[A-Za-z][A-Za-z0-9._]*(\[[^\]]*\])?\s*=(?!=).*", re.DOTALL)


def command(line: str) -> MonitorCommand:
    """The command that a line begins with.

    Raises:
        ValError: If it's none; it says so where the line is an instruction.
    """
    word, rest = split_word(line)
    if _ASSIGNMENT.fullmatch(line):
        raise ValError("Invalid command", f"{_short(line)}: an assignment is an instruction, DO {_short(line)}")
    try:
        if word.upper() in forms.INSTRUCTIONS and word.upper() not in COMMANDS:
            raise ValError("Invalid command", word.upper())
        return command_named(word)
    except ValError as error:
        if error.what == "Ambiguous command":
            raise
        raise ValError("Invalid command", _hint(word.upper(), rest, line)) from None


def _hint(word: str, rest: str, line: str) -> str:
    if not word:
        return _short(line)
    if word in forms.INSTRUCTIONS:
        return f"{word} is an instruction: DO {_short(f'{word} {rest}'.strip())}"
    if word in forms.SWITCHES:
        return f"{word} is a switch: ENABLE {word}, DISABLE {word}"
    close = difflib.get_close_matches(word, COMMANDS, n=1, cutoff=0.7)
    return f"{_short(word)}; did you mean {close[0]}?" if close else f"{_short(word)}; HELP lists the commands"


def _short(text: str) -> str:
    return text if len(text) <= 40 else f"{text[:37]}.."


def explained(word: str) -> Iterator[tuple[str, str, str]]:
    """What a word is, how it's written, and what it does; a word may be several things."""
    upper = word.upper()
    if upper in COMMANDS:
        one = COMMANDS[upper]
        mark = ", ours" if one.ours else ""
        yield f"command{mark}", " | ".join(one.usage), one.help
    if upper in forms.INSTRUCTIONS:
        form = forms.INSTRUCTIONS[upper]
        yield f"instruction, {form.origin}", form.usage, form.help
    for name in (upper, f"${upper}", f"#{upper}"):
        if name in forms.FUNCTIONS:
            function = forms.FUNCTIONS[name]
            yield f"function, {function.origin}", function.usage, function.help
    if upper in forms.SWITCHES:
        one_switch = forms.SWITCHES[upper]
        yield f"switch, {one_switch.origin}", f"ENABLE {upper} | DISABLE {upper}", one_switch.help
    if upper in forms.PARAMETERS:
        row = forms.PARAMETERS[upper]
        said = f"{row.help} {layout.number(row.low)} to {layout.number(row.high)} {row.unit}."
        yield f"parameter, {row.origin}", f"PARAMETER {upper} = value", said
    for table, kind in ((forms.OPERATORS, "operator"), (forms.WORDS, "word")):
        if upper in table:
            yield kind, upper, table[upper]
    if upper in forms.IGNORED and upper not in COMMANDS:
        why = forms.UNAVAILABLE.get(upper)
        passed = "It's recognised in programs, and passed over: it has no meaning here."
        yield "instruction, V+", upper, passed if why is None else f"It isn't available: {why}."


def help_(state: TerminalState, rest: str) -> None:
    """HELP; HELP word."""
    if not rest:
        state.say("Commands; they may be abbreviated. HELP and a word says more of it.")
        state.say(*layout.in_columns(COMMANDS))
        state.say("Instructions, after DO or in programs:")
        state.say(*layout.in_columns(forms.INSTRUCTIONS))
        state.say("Functions:")
        state.say(*layout.in_columns(forms.FUNCTIONS))
        return
    found = list(explained(rest)) or list(explained(_whole(rest)))
    if not found:
        raise ValError("Unknown word", f"{_short(rest)}{_near(rest)}")
    for kind, usage, said in found:
        state.say(
            f"{usage}  ({kind})",
            *textwrap.wrap(said, layout.WIDTH, initial_indent="    ", subsequent_indent="    "),
        )


def _whole(word: str) -> str:
    """The command, instruction, switch or parameter that a word is the beginning of; itself if there's none."""
    upper = word.upper()
    for names in (COMMANDS, forms.INSTRUCTIONS, forms.FUNCTIONS, forms.SWITCHES, forms.PARAMETERS):
        try:
            return unique(upper, names, "word")
        except ValError:
            continue
    return upper


def _near(word: str) -> str:
    known = [*COMMANDS, *forms.INSTRUCTIONS, *forms.FUNCTIONS, *forms.SWITCHES, *forms.PARAMETERS]
    close = difflib.get_close_matches(word.upper(), known, n=1, cutoff=0.7)
    return f"; did you mean {close[0]}?" if close else ""


_TABLE: Final = (
    MonitorCommand("ABORT", running.abort, "",
                   "Stop the program and the arm, within its limits; Ctrl-C does the same.", bare=True),
    MonitorCommand("AT", running.at, "t | +t [motion]",
                   "The next motion begins at a time, or so long from now [s].", idle=True, ours=True),
    MonitorCommand("BASE", partial(locations.frame, word="BASE"), "| dx,dy,dz,turn",
                   "Show the base, or set it: mm, and deg about Z.", need=_ARGUMENT, idle=True),
    MonitorCommand("CALIBRATE", settings.calibrate, "", "Make joint values valid; asks first.", idle=True,
                   bare=True),
    MonitorCommand("COPY", partial(storage.put, keep=True), "new=old", "Copy a program."),
    MonitorCommand("DELETE", storage.delete_programs, "program,..", "Delete programs; asks first.", idle=True),
    MonitorCommand("DELETEL", partial(storage.delete_values, kind="locations"), "location,..",
                   "Delete locations; asks first.", idle=True),
    MonitorCommand("DELETEP", storage.delete_programs, "program,..", "Delete programs; asks first.", idle=True),
    MonitorCommand("DELETER", partial(storage.delete_values, kind="reals"), "real,..", "Delete reals; asks first.",
                   idle=True),
    MonitorCommand("DELETES", partial(storage.delete_values, kind="strings"), "$string,..",
                   "Delete strings; asks first.", idle=True),
    MonitorCommand("DIRECTORY", storage.directory, "", "List the programs in memory.", need=_LOOK),
    MonitorCommand("DISABLE", partial(settings.turn, on=False), "switch,..", "Turn switches off."),
    MonitorCommand("DO", running.do, "instruction |", "Carry out one instruction; without one, the last again.",
                   idle=True),
    MonitorCommand("EDIT", edit, "program[,step]", "Edit a program line by line; ? there says how.", idle=True),
    MonitorCommand("ENABLE", partial(settings.turn, on=True), "switch,..",
                   "Turn switches on; ENABLE POWER after PANIC."),
    MonitorCommand("EXECUTE", running.execute, "program[(arguments)][,cycles[,step]] |",
                   "Run a program, or the last; cycles -1 for ever.", idle=True),
    MonitorCommand("EXIT", None, "", "Leave the monitor.", need=_LOOK, ours=True, whole=True),
    MonitorCommand("FLIST", storage.flist, "", "List the files.", need=_LOOK),
    MonitorCommand("FREE", storage.free, "", "Show what is in memory.", need=_LOOK, bare=True),
    MonitorCommand("HELP", help_, "| word", "List the commands, or explain a word of the language.", need=_LOOK),
    MonitorCommand("HERE", locations.here, "location | #location | a:b",
                   "Record where the arm is; then CR, or changes: ,,10"),
    MonitorCommand("ID", lambda s, _: s.say(s.version), "", "Show what this is, and its version.", need=_LOOK,
                   bare=True),
    MonitorCommand("IO", settings.io, "", "Show inputs, outputs and internal signals.", need=_LOOK, bare=True),
    MonitorCommand("LISTF", storage.flist, "", "List the files.", need=_LOOK),
    MonitorCommand("LISTL", storage.listl, "| location,..", "List locations; * stands for any characters.",
                   need=_LOOK),
    MonitorCommand("LISTP", storage.listp, "| program,..", "List programs.", need=_LOOK),
    MonitorCommand("LISTR", storage.listr, "| real,.. | expression",
                   "List reals, or show what an expression comes to.", need=_LOOK),
    MonitorCommand("LISTS", storage.lists, "| $string,.. | expression",
                   "List strings, or show what an expression comes to.", need=_LOOK),
    MonitorCommand("LOAD", storage.load, "file", "Read programs and values from a file."),
    MonitorCommand("NEXT", running.next_, "| n", "Carry out the next step of a program that stands, or the next n.",
                   idle=True),
    MonitorCommand("PANIC", running.panic, "", "Stop at once and turn the power off."),
    MonitorCommand("PARAMETER", settings.parameter, "| name | name=value", "Show or set parameters.",
                   need=_ARGUMENT),
    MonitorCommand("POINT", locations.point, "location[=expression]",
                   "Define or change a location; then CR, or changes: ,,10"),
    MonitorCommand("PROCEED", lambda s, _: s.controller.proceed(now=s.now), "",
                   "Go on with a program that stands, at its next step.", idle=True, bare=True),
    MonitorCommand("QUIT", None, "", "Leave the monitor.", need=_LOOK, ours=True, whole=True),
    MonitorCommand("RENAME", partial(storage.put, keep=False), "new=old", "Rename a program.", idle=True),
    MonitorCommand("RESET", lambda s, _: s.controller.signals.reset(), "", "Turn all outputs off.", bare=True),
    MonitorCommand("RETRY", lambda s, _: s.controller.retry(now=s.now), "",
                   "Go on with a program that stands, at the step that was interrupted.", idle=True, bare=True),
    MonitorCommand("REWIND", locations.rewind, "t | -t", "Show what WHERE showed at a time, or so long ago [s].",
                   need=_LOOK, ours=True),
    MonitorCommand("SIGNAL", settings.signal, "| n,-m,..", "Turn signals on, or off with a minus; show them.",
                   need=_ARGUMENT),
    MonitorCommand("SPEED", settings.speed, "| percent", "Show or set the monitor speed; it counts at once.",
                   need=_ARGUMENT),
    MonitorCommand("STATUS", running.status, "", "Show the program, its step and cycles, speeds, power.",
                   need=_LOOK, bare=True),
    MonitorCommand("STORE", partial(storage.store, parts=""), "file[=program,..]",
                   "Write programs, with all that they use, to a file."),
    MonitorCommand("STOREL", partial(storage.store, parts="locations"), "file[=location,..]",
                   "Write locations to a file."),
    MonitorCommand("STOREP", partial(storage.store, parts="programs"), "file[=program,..]",
                   "Write programs to a file."),
    MonitorCommand("STORER", partial(storage.store, parts="reals"), "file[=real,..]", "Write reals to a file."),
    MonitorCommand("STORES", partial(storage.store, parts="strings"), "file[=$string,..]",
                   "Write strings to a file."),
    MonitorCommand("SWITCH", settings.switch, "| switch,..", "Show switches.", need=_LOOK),
    MonitorCommand("TEACH", locations.teach, "location", "Record one location after the other, each by CR; E ends.",
                   idle=True),
    MonitorCommand("TIMELINE", running.timeline, "", "Show what is scheduled.", need=_LOOK, ours=True, bare=True),
    MonitorCommand("TOOL", partial(locations.frame, word="TOOL"), "| transformation", "Show the tool, or set it.",
                   need=_ARGUMENT, idle=True),
    MonitorCommand("UNDO", lambda s, _: s.say(s.controller.arm.undo(now=s.now)), "",
                   "Take back the newest motion, as far as it's still to come.", ours=True, bare=True),
    MonitorCommand("WHERE", locations.where, "| 1 | REAL",
                   "Show where the arm is; 1 repeats until CR, REAL: the other twin.", need=_LOOK),
    MonitorCommand("XSTEP", running.xstep, "| program[,cycles[,step]]",
                   "Begin a program step by step, or do its next step.", idle=True),
    MonitorCommand("ZERO", storage.zero, "", "Delete all programs and values; asks first.", idle=True, bare=True),
)  # fmt: skip

COMMANDS: Final = {command.name: command for command in _TABLE}
"""By name."""
SHORT: Final = {
    "A": "ABORT",
    "D": "DO",
    "E": "EXECUTE",
    "EX": "EXECUTE",
    "P": "PROCEED",
    "S": "STATUS",
    "W": "WHERE",
}
"""What stands for a command though others begin with it too."""


def command_named(word: str) -> MonitorCommand:
    """The command that a word names, whole or by its beginning.

    Raises:
        ValError: If none or several begin with it.
    """
    wanted = word.upper()
    if wanted in COMMANDS:
        return COMMANDS[wanted]
    found = SHORT.get(wanted) or unique(
        wanted, (name for name, one in COMMANDS.items() if not one.whole), "command"
    )
    return COMMANDS[found]
