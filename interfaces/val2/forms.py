"""Every word of the language: how it's written, what it does in a line, and whose it is.

The parser, the checker, the lexer, the monitor's help and its completion, and the reference in docs/val2.md
read these tables.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Final, Literal, TypeAlias

from interfaces.val2.errors import TextPosition, ValError

Kind: TypeAlias = Literal[
    "real", "string", "location", "any", "label", "program", "variable", "frame", "point", "array", "text"
]
"""What an operand is: a `location` is a `frame` or a precision `point`, a `variable` something to be set."""
Origin: TypeAlias = Literal["VAL", "VAL-II", "V+", "ours"]
"""Where a word is known from; VAL-II took over what VAL has, and V+ what VAL-II has."""

MISSING: Final = "Missing argument"
TOO_MANY: Final = "Too many arguments"


@dataclass(frozen=True, slots=True)
class OperandSlot:
    """A place for an operand."""

    name: str
    kind: Kind
    required: bool = True
    default: float | None = None
    """What stands for one that was left out; None where that's for the instruction or function to say."""

    @classmethod
    def read(cls, spelled: str) -> OperandSlot:
        """A slot as `Form` has it."""
        named, _, default = spelled.partition("=")
        name, _, kind = named.rstrip("?*").partition(":")
        return cls(name, kind or "real", "?" not in spelled, float(default) if default else None)  # type: ignore[arg-type]


class Form:
    """A row of the table: how an instruction or a function is written, and what it does."""

    def __init__(
        self,
        name: str,
        spelled: str,
        explanation: str,
        origin: Origin,
        *,
        words: str = "",
        usage: str = "",
        constant: bool = False,
        idle: bool = False,
    ) -> None:
        """Read a row.

        Args:
            name: Upper case; of a function with its prefix.
            spelled: Slots such as `target:location, hand:real?=0`, and what a function gives: `angle -> real`. Of
                a slot that ends in `?` the operand may be left out; the number behind `=` stands for it then. One
                that ends in `*` may come many times.
            explanation: What it does, a line.
            origin: Where it's known from.
            words: What may stand behind the operands, in their order, one of each group at most: `MMPS|IPS ALWAYS`.
            usage: How it's written, where that isn't told by the slots.
            constant: A function that may be written without parentheses; its name can't be a variable's.
            idle: A function that is recognised, but has no meaning here: 0, or an empty string.
        """
        operands, _, gives = spelled.partition("-> ")
        self.name, self.help, self.origin = name, explanation, origin
        self.constant, self.idle = constant, idle
        self.gives: Kind | str = gives
        """Of a function."""
        self.repeats = "*" in operands
        """Whether the last operand may come many times."""
        self.slots = tuple(OperandSlot.read(part) for part in operands.strip().split(", ") if part)
        self.words = tuple(tuple(group.split("|")) for group in words.split())
        self.allowed_words = tuple(word for group in self.words for word in group)
        self.usage = usage or self._usage()

    def _usage(self) -> str:
        shown = ""
        for i, slot in enumerate(self.slots):
            piece = f"{', ' if i else ''}{slot.name}"
            shown += piece if slot.required else f"[{piece}]"
        shown += ", .." if self.repeats else ""
        if self.gives:
            return self.name if self.constant else f"{self.name}({shown})"
        return f"{self.name} {shown}".rstrip() + "".join(f" [{'|'.join(group)}]" for group in self.words)

    def expect(self, arguments: Sequence[object | None], at: TextPosition) -> None:
        """Count a function's arguments.

        Raises:
            ValError: If there are too few or too many of them.
        """
        if len(arguments) > len(self.slots) and not self.repeats:
            raise ValError(TOO_MANY, f"{self.name}: {self.usage}", place=at)
        for i, slot in enumerate(self.slots):
            if slot.required and (i >= len(arguments) or arguments[i] is None):
                raise ValError(MISSING, f"{self.name}: {self.usage}", place=at)


@dataclass(frozen=True, slots=True)
class Switch:
    """Something that ENABLE and DISABLE turn on and off."""

    name: str
    default: bool
    help: str
    origin: Origin


@dataclass(frozen=True, slots=True)
class Parameter:
    """A number that PARAMETER sets."""

    name: str
    default: float
    low: float
    high: float
    unit: str
    help: str
    origin: Origin


def nearest(word: str, words: Iterable[str]) -> str:
    """`; did you mean MOVES?`, or nothing."""
    close = nearest_word(word, words)
    return f"; did you mean {close}?" if close else ""


def nearest_word(word: str, words: Iterable[str]) -> str:
    """The word that is most like another, upper case; empty where none is."""
    return next(iter(difflib.get_close_matches(word.upper(), list(words), n=1, cutoff=0.7)), "")


_MOTION: Final = (
    Form("MOVE", "location:location", "Move to a location, the joints together.", "VAL"),
    Form("MOVES", "location:location", "Move the tool to a location on a straight line.", "VAL"),
    Form("MOVET", "location:location, opening", "MOVE, the hand to an opening [mm], TRUE, FALSE.", "VAL"),
    Form("MOVEST", "location:location, opening", "MOVET on a straight line.", "VAL"),
    Form("APPRO", "location:location, distance", "Move to a distance [mm] behind a location, along its tool axis.",
         "VAL"),
    Form("APPROS", "location:location, distance", "APPRO on a straight line.", "VAL"),
    Form("DEPART", "distance", "Move back by a distance [mm] along the tool axis, from the destination.", "VAL"),
    Form("DEPARTS", "distance", "DEPART on a straight line.", "VAL"),
    Form("DRIVE", "joint, change, speed", "Turn one joint by a change [deg] at a speed [%].", "VAL"),
    Form("DRAW", "dx?=0, dy?=0, dz?=0", "Move straight by a way in world axes [mm].", "VAL"),
    Form("READY", "", "Move to the ready position: the arm straight up.", "VAL"),
    Form("NEST", "", "Move to the position in which the arm is parked.", "VAL-II"),
    Form("ALIGN", "", "Turn the tool's axis to the nearest axis of the world.", "VAL"),
    Form("DELAY", "seconds", "Stand still for a time, as a motion.", "VAL"),
    Form("BREAK", "", "Wait until the arm stands at its destination.", "VAL-II"),
    Form("BRAKE", "", "Stop the present motion at once.", "V+"),
    Form("AT", "time", "The next motion begins at a time of the session [s].", "ours", usage="AT time [motion]"),
)  # fmt: skip

_SETTINGS: Final = (
    Form("SPEED", "speed, turning?", "Speed of the next motion, [%] of the nominal or of the tool; ALWAYS: of all.",
         "VAL", words="MMPS|IPS|MONITOR ALWAYS"),
    Form("ACCEL", "up, down?", "Accelerations: [%] of the nominal.", "V+"),
    Form("DURATION", "seconds", "Shortest time of the next motion; ALWAYS: each.", "V+", words="ALWAYS"),
    Form("COARSE", "percent?", "The next motion may end roughly; ALWAYS: each.", "VAL", words="ALWAYS"),
    Form("FINE", "percent?", "The next motion ends exactly; ALWAYS: each.", "VAL-II", words="ALWAYS"),
    Form("NULL", "", "The next motion ends when the real arm is there; ALWAYS: each.", "VAL", words="ALWAYS"),
    Form("NONULL", "", "The next motion ends without waiting for the real arm; ALWAYS: each.", "VAL",
         words="ALWAYS"),
    Form("RIGHTY", "", "The arm is to be right-handed from the next MOVE on.", "VAL"),
    Form("LEFTY", "", "The arm is to be left-handed from the next MOVE on.", "VAL"),
    Form("ABOVE", "", "The elbow is to be above from the next MOVE on.", "VAL"),
    Form("BELOW", "", "The elbow is to be below from the next MOVE on.", "VAL"),
    Form("FLIP", "", "The wrist is to be flipped from the next MOVE on.", "VAL"),
    Form("NOFLIP", "", "The wrist is not to be flipped from the next MOVE on.", "VAL"),
    Form("TOOL", "transformation:frame?", "The tool's tip relative to the flange; NULL without one.", "VAL"),
    Form("BASE", "dx?=0, dy?=0, dz?=0, turn?=0",
         "Where the robot stands in the world: shifted [mm], turned about z [deg].", "VAL"),
    Form("ENABLE", "", "Turn switches on.", "VAL", usage="ENABLE switch, .."),
    Form("DISABLE", "", "Turn switches off.", "VAL", usage="DISABLE switch, .."),
    Form("PARAMETER", "value", "Set a parameter.", "VAL-II", usage="PARAMETER name = value"),
    Form("ALTER", "channel?=0, mode?=0, dx?=0, dy?=0, dz?=0, rx?=0, ry?=0, rz?=0",
         "Corrections of the path begin: mode 1 cumulative, 2 world axes.", "VAL-II", usage="ALTER (channel) mode"),
    Form("ALTOUT", "dx?=0, dy?=0, dz?=0, rx?=0, ry?=0, rz?=0",
         "Correct the tool's place by a way [mm] and a turn [deg], exactly; 28 ms each.", "VAL-II"),
    Form("NOALTER", "", "Corrections of the path end.", "VAL-II"),
    Form("ALTON", "channel?=0, mode?=0", "As ALTER.", "V+", usage="ALTON (channel) mode"),
    Form("ALTOFF", "", "As NOALTER.", "V+"),
)  # fmt: skip

_HAND: Final = (
    Form("OPEN", "", "Open the hand with the next motion.", "VAL"),
    Form("CLOSE", "", "Close the hand with the next motion.", "VAL"),
    Form("RELAX", "", "Let the hand go slack with the next motion.", "VAL"),
    Form("OPENI", "", "Open the hand now, where the arm stands.", "VAL"),
    Form("CLOSEI", "", "Close the hand now, where the arm stands.", "VAL"),
    Form("RELAXI", "", "Let the hand go slack now, where the arm stands.", "VAL"),
    Form("GRASP", "opening, label:label?", "Close the hand; go to a label if it's less open than that [mm].",
         "VAL"),
)  # fmt: skip

_LOCATIONS: Final = (
    Form("SET", "variable:variable, location:location", "Assign a location.", "VAL",
         usage="SET variable = location"),
    Form("HERE", "variable:variable", "Record where the tool is; of a compound, its last part.", "VAL"),
    Form("DECOMPOSE", "array:variable, location:location", "Six numbers of a location into an array's elements.",
         "V+", usage="DECOMPOSE array[first] = location"),
    Form("SHIFT", "variable:variable, dx?, dy?, dz?", "Shift a location in world axes [mm].", "VAL",
         usage="SHIFT variable BY dx, dy, dz"),
)  # fmt: skip

_SIGNALS: Final = (
    Form("SIGNAL", "number*", "Turn outputs on, or off where negative.", "VAL"),
    Form("RESET", "", "Turn all outputs off.", "V+"),
    Form("WAIT", "condition?", "Wait until a condition holds.", "VAL"),
    Form("WAIT.EVENT", "mask?, seconds?", "Wait for a time.", "V+"),
    Form("TIMER", "number, seconds", "Set a timer.", "VAL-II", usage="TIMER number = seconds"),
    Form("REACT", "signal, program:program?", "Call a program after the present step when a signal turns on.",
         "VAL", words="ALWAYS"),
    Form("REACTI", "signal, program:program?", "REACT, stopping the present motion at once.", "VAL",
         words="ALWAYS"),
    Form("IGNORE", "signal", "Don't react to a signal any more.", "VAL"),
)  # fmt: skip

_CONTROL: Final = (
    Form("IF", "condition, label:label?", "Do steps if a condition holds.", "VAL",
         usage="IF condition THEN .. ELSE .. END, IF condition GOTO label"),
    Form("ELSE", "", "Do steps if the condition of IF doesn't hold.", "VAL-II"),
    Form("END", "", "The end of IF, WHILE, FOR or CASE.", "VAL-II"),
    Form("WHILE", "condition", "Repeat steps as long as a condition holds.", "VAL-II",
         usage="WHILE condition DO .. END"),
    Form("DO", "", "Repeat steps until a condition holds.", "VAL-II", usage="DO .. UNTIL condition"),
    Form("UNTIL", "condition", "The end of DO.", "VAL-II"),
    Form("FOR", "variable:variable, start, stop, step?", "Repeat steps, counting.", "VAL-II",
         usage="FOR variable = start TO stop [STEP step] .. END"),
    Form("CASE", "value:any", "Do the steps of one of several values.", "VAL-II", usage="CASE value OF .. END"),
    Form("VALUE", "value:any*", "What of a CASE is done for these values.", "VAL-II", usage="VALUE value, ..:"),
    Form("ANY", "", "What of a CASE is done for any other value.", "VAL-II"),
    Form("EXIT", "count?", "Leave the innermost loop, or as many.", "VAL-II"),
    Form("NEXT", "count?", "Go on with the next turn of the innermost loop.", "VAL-II"),
    Form("GOTO", "label:label", "Go on at a label.", "VAL"),
    Form("CALL", "argument:any?*", "Call a program; arguments by reference.", "VAL-II",
         usage="CALL program(argument, ..)"),
    Form("GOSUB", "argument:any?*", "Call a program.", "VAL", usage="GOSUB program"),
    Form("RETURN", "", "Go back to the program that called.", "VAL"),
    Form("PAUSE", "", "Pause until PROCEED.", "VAL"),
    Form("STOP", "", "End this cycle of the program.", "VAL"),
    Form("HALT", "", "End the program, whatever cycles are left.", "VAL"),
)  # fmt: skip

_DIALOGUE: Final = (
    Form("TYPE", "item:any?*", "Print texts and values; /F8.2 and such say how.", "VAL"),
    Form("PROMPT", "text:string?, variable:variable?*", "Print a text, read values.", "VAL-II"),
    Form("REMARK", "text:text?", "A comment.", "VAL", usage="REMARK text"),
    Form("AUTO", "name:variable*", "Names of this call of the program alone.", "V+",
         usage="AUTO [REAL|LOC] name, .."),
    Form("LOCAL", "name:variable*", "Names of this program alone.", "V+", usage="LOCAL [REAL|LOC] name, .."),
    Form("GLOBAL", "name:variable*", "Names of all programs, as they are without a word.", "V+",
         usage="GLOBAL [REAL|LOC] name, .."),
)  # fmt: skip

INSTRUCTIONS: Final[dict[str, Form]] = {
    row.name: row for row in (*_MOTION, *_SETTINGS, *_HAND, *_LOCATIONS, *_SIGNALS, *_CONTROL, *_DIALOGUE)
}
"""Keywords of a program's lines."""

IGNORED: Final = frozenset((
    "ABORT", "ATTACH", "BITS", "CLEAR.EVENT", "CYCLE.END", "DETACH", "DISABLE.EVENT", "ENABLE.EVENT", "EXECUTE",
    "FCLOSE", "FCMND", "FDELETE", "FEMPTY", "FOPEN", "FOPENA", "FOPEND", "FOPENR", "FOPENW", "FSEEK", "FSET",
    "INTOFF", "INTON", "KILL", "LOCK", "MC", "MULTIPLE", "NOOVERLAP", "OVERLAP", "PRIME", "PROCEED", "REACTE",
    "READ", "RELEASE", "RETRY", "RETURNE", "RUNSIG", "SELECT", "SET.EVENT", "SINGLE", "UNLOCK", "WEAVE",
    "WINDOW", "WRITE",
))  # fmt: skip
"""Keywords that are recognised but have no meaning here: files, welding, other tasks."""

_ONE_TASK: Final = "there is one program at a time; allowed: CALL program"
UNAVAILABLE: Final = {
    **dict.fromkeys(("ABORT", "CYCLE.END", "EXECUTE", "KILL", "PRIME", "PROCEED", "RETRY"), _ONE_TASK),
    **dict.fromkeys(("CLEAR.EVENT", "SET.EVENT"), "there are no events; allowed: SIGNAL number, WAIT SIG(number)"),
    **dict.fromkeys(("REACTE", "RETURNE"), "an error stops the program"),
    "BITS": "allowed: SIGNAL number, ..",
    "MC": "commands are the monitor's",
    "READ": "there are no files; allowed: PROMPT text, variable",
    "RUNSIG": "allowed: SIGNAL number",
    "WEAVE": "allowed: MOVES location",
    "WINDOW": "there is no conveyor",
}
"""Those of them without whose work a program would do something else: an error where it comes there, and why."""

_REAL_FUNCTIONS: Final = (
    Form("ABS", "x -> real", "Absolute value.", "VAL-II"),
    Form("ASC", "text:string, index?=1 -> real", "Code of a character.", "VAL-II"),
    Form("ATAN2", "y, x -> real", "Angle of a direction [deg].", "VAL-II"),
    Form("BMASK", "bit*=0 -> real", "A number with these bits set, from 1.", "V+"),
    Form("BITS", "first, count?=1 -> real", "Signals from a first one on, as a number.", "V+"),
    Form("COS", "angle -> real", "Cosine of an angle [deg].", "VAL-II"),
    Form("DEFINED", "variable:any -> real", "Whether a variable has a value.", "V+"),
    Form("DISTANCE", "a:frame, b:frame -> real", "Distance of two locations [mm].", "VAL-II"),
    Form("DX", "a:frame -> real", "X of a location [mm].", "VAL-II"),
    Form("DY", "a:frame -> real", "Y of a location [mm].", "VAL-II"),
    Form("DZ", "a:frame -> real", "Z of a location [mm].", "VAL-II"),
    Form("FRACT", "x -> real", "Fractional part.", "VAL-II"),
    Form("INRANGE", "a:location -> real", "0 if a location can be reached.", "V+"),
    Form("INT", "x -> real", "Integer part.", "VAL-II"),
    Form("LAST", "array:array -> real", "Largest index of an array.", "V+"),
    Form("LEN", "text:string -> real", "Length of a string.", "VAL-II"),
    Form("MAX", "x* -> real", "Largest of values.", "V+"),
    Form("MIN", "x* -> real", "Smallest of values.", "V+"),
    Form("OUTSIDE", "low, x, high -> real", "Whether a value is outside a range.", "V+"),
    Form("PARAMETER", "name:any -> real", "Value of a parameter.", "V+"),
    Form("PI", "-> real", "3.14159..", "VAL-II", constant=True),
    Form("POS", "text:string, part:string, from?=1 -> real", "Where a string has another; 0 for nowhere.", "V+"),
    Form("RANDOM", "-> real", "A random number from 0 to 1.", "V+", constant=True),
    Form("SIG", "number* -> real", "Whether all these signals are on, or off where negative.", "VAL-II"),
    Form("SIGN", "x -> real", "-1 or 1.", "VAL-II"),
    Form("SIN", "angle -> real", "Sine of an angle [deg].", "VAL-II"),
    Form("SPEED", "which -> real", "1: the monitor speed [%].", "V+"),
    Form("SQR", "x -> real", "Square.", "V+"),
    Form("SQRT", "x -> real", "Square root.", "VAL-II"),
    Form("SWITCH", "name:any -> real", "Whether a switch is on.", "V+"),
    Form("TAN", "angle -> real", "Tangent of an angle [deg].", "V+"),
    Form("TIMER", "number -> real", "Seconds since a timer was set to 0.", "VAL-II"),
    Form("VAL", "text:string -> real", "The number that a string begins with.", "VAL-II"),
    Form("TRUE", "-> real", "-1.", "VAL-II", constant=True),
    Form("FALSE", "-> real", "0.", "VAL-II", constant=True),
    Form("ON", "-> real", "-1.", "VAL-II", constant=True),
    Form("OFF", "-> real", "0.", "VAL-II", constant=True),
)  # fmt: skip

_STRING_FUNCTIONS: Final = (
    Form("$CHR", "code -> string", "The character of a code.", "VAL-II"),
    Form("$DECODE", "$variable:variable, separators:string, mode?=0 -> string",
         "What stands before, or with mode 1 the run of, separators; it's taken out of the variable.", "V+"),
    Form("$ENCODE", "item:any?* -> string", "What TYPE would print.", "VAL-II"),
    Form("$MID", "text:string, from, length -> string", "Part of a string.", "VAL-II"),
    Form("$TRUNCATE", "text:string -> string", "A string up to its first character of code 0.", "V+"),
)  # fmt: skip

_LOCATION_FUNCTIONS: Final = (
    Form("TRANS", "x?=0, y?=0, z?=0, o?=90, a?=-90, t?=0 -> frame",
         "A transformation [mm, deg]; without angles, no turn.", "VAL-II"),
    Form("SHIFT", "a:frame, dx?=0, dy?=0, dz?=0 -> frame", "A location shifted in world axes [mm].", "VAL-II",
         usage="SHIFT(a BY dx, dy, dz)"),
    Form("INVERSE", "a:frame -> frame", "The transformation back.", "VAL"),
    Form("FRAME", "a:frame, b:frame, c:frame, d:frame -> frame", "A frame at d: x from a to b, c on the side of y.",
         "VAL"),
    Form("RX", "angle -> frame", "A turn about x [deg].", "V+"),
    Form("RY", "angle -> frame", "A turn about y [deg].", "V+"),
    Form("RZ", "angle -> frame", "A turn about z [deg].", "V+"),
    Form("NULL", "-> frame", "No way and no turn.", "VAL", constant=True),
    Form("HERE", "-> frame", "Where the tool is.", "VAL", constant=True),
    Form("DEST", "-> frame", "Where the tool goes.", "VAL-II", constant=True),
    Form("#PPOINT", "j1?=0, j2?=0, j3?=0, j4?=0, j5?=0, j6?=0 -> location", "A precision point [deg].", "VAL-II"),
    Form("#HERE", "-> location", "Where the arm is, as a precision point.", "ours", constant=True),
    Form("#DEST", "-> location", "Where the arm goes, as a precision point.", "V+", constant=True),
)  # fmt: skip

_IDLE_FUNCTIONS: Final = (
    Form("IOSTAT", "lun:any, mode:any? -> real", "State of a file.", "V+", idle=True),
    Form("GETC", "lun:any, mode:any? -> real", "A character of a file.", "V+", idle=True),
    Form("LNGB", "text:string, from:any? -> real", "An integer of bytes.", "V+", idle=True),
    Form("FLTB", "text:string, from:any? -> real", "A number of bytes.", "V+", idle=True),
    Form("TASK", "mode:any?, number:any? -> real", "State of a task.", "V+", idle=True),
    Form("$ERROR", "code:any -> string", "Text of an error.", "V+", idle=True),
    Form("$LNGB", "value:any -> string", "Bytes of an integer.", "V+", idle=True),
    Form("$FLTB", "value:any -> string", "Bytes of a number.", "V+", idle=True),
)  # fmt: skip

FUNCTIONS: Final[dict[str, Form]] = {
    row.name: row for row in (*_REAL_FUNCTIONS, *_STRING_FUNCTIONS, *_LOCATION_FUNCTIONS, *_IDLE_FUNCTIONS)
}
"""Functions and constants, with their prefixes."""

ALIASES: Final = {"PPOINT": "#PPOINT", "#PDEST": "#DEST", "#PHERE": "#HERE"}
"""Other spellings of functions, and what they become."""

CONSTANTS: Final = frozenset([name for name, row in FUNCTIONS.items() if row.constant] + ["#PDEST", "#PHERE"])
"""What may be written without parentheses, and so can't be a variable's name."""

OPERATORS: Final = {
    "AND": "Both hold.", "OR": "One holds, or both.", "XOR": "One holds, not both.", "NOT": "It doesn't hold.",
    "BAND": "Bits of both.", "BOR": "Bits of either.", "BXOR": "Bits that differ.", "COM": "All bits turned.",
    "MOD": "Rest of a division.",
}  # fmt: skip
"""Operators that are words."""

LEVELS: Final = {
    "OR": 1, "XOR": 1, "AND": 2, "==": 4, "<>": 4, "<": 4, "<=": 4, ">": 4, ">=": 4,
    "+": 5, "-": 5, "BOR": 5, "BXOR": 5, "*": 6, "/": 6, "MOD": 6, "BAND": 6, "^": 8,
}  # fmt: skip
"""How tightly operators bind; of one level, from left to right."""
LEVEL_OF_NOT: Final = 3
LEVEL_OF_SIGN: Final = 7
"""Of `-` and `COM` before an operand."""

WORDS: Final = {
    "ALWAYS": "Not for the next motion alone, but until it's changed.",
    "MMPS": "Speed in millimetres a second.",
    "IPS": "Speed in inches a second.",
    "MONITOR": "The monitor speed, which stretches time.",
    "THEN": "Of IF: the steps up to ELSE or END.",
    "GOTO": "Go on at a label.",
    "TO": "Of FOR: the last value.",
    "STEP": "Of FOR: what is added each time.",
    "DO": "Of WHILE: the steps up to END.",
    "OF": "Of CASE: the values up to END.",
    "BY": "Of SHIFT: how far.",
}
"""Words within a line."""

FORMATS: Final = {
    "B": "A bell.", "C": "New lines.", "D": "A number as it is.", "E": "A number with an exponent.",
    "F": "A number with decimals.", "G": "/F or /E, whichever fits.", "H": "An integer, base 16.",
    "I": "An integer.", "O": "An integer, base 8.", "S": "No new line at the end.", "U": "Lines up.",
    "X": "Blanks.",
}  # fmt: skip
"""Control items of TYPE and $ENCODE."""

_SWITCHES: Final = (
    Switch("CP", True, "Continuous path: motions go round their destinations.", "VAL-II"),
    Switch("DRY.RUN", False, "Programs run without motion.", "V+"),
    Switch("MESSAGES", True, "TYPE prints.", "VAL-II"),
    Switch("POWER", True, "The arm has power.", "V+"),
)
SWITCHES: Final = {row.name: row for row in _SWITCHES}
"""What ENABLE and DISABLE turn."""

_PARAMETERS: Final = (
    Parameter("HAND.TIME", 0.05, 0.0, 60.0, "s", "How long OPENI, CLOSEI and RELAXI take.", "VAL-II"),
    Parameter("HAND.LOAD", 0.0, 0.0, 20.0, "kg", "What the real hand holds while it's closed.", "ours"),
)
PARAMETERS: Final = {row.name: row for row in _PARAMETERS}
"""What PARAMETER sets."""
