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


@dataclass(frozen=True, slots=True)
class InstructionForm:
    """How an instruction is written."""

    keyword: str
    slots: tuple[OperandSlot, ...]
    words: tuple[tuple[str, ...], ...]
    """Words behind the operands, in their order, one of each group at most."""
    help: str
    origin: Origin
    repeats: bool = False
    """Whether the last operand may come many times."""
    usage: str = ""
    """How it's written."""
    own: bool = False
    """Whether it has a node of its own in the tree, and isn't an `Instruction`."""

    @property
    def allowed_words(self) -> tuple[str, ...]:
        """All the words that may stand behind the operands."""
        return tuple(word for group in self.words for word in group)


@dataclass(frozen=True, slots=True)
class Function:
    """How a function is written."""

    name: str
    slots: tuple[OperandSlot, ...]
    gives: Kind
    help: str
    origin: Origin
    repeats: bool = False
    constant: bool = False
    """It may be written without parentheses, and its name can't be a variable's."""
    usage: str = ""
    idle: bool = False
    """It's recognised, but has no meaning here: 0, or an empty string."""

    def expect(self, arguments: Sequence[object | None], at: TextPosition) -> None:
        """Count the arguments.

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


def slots_of(spelled: str) -> tuple[tuple[OperandSlot, ...], bool]:
    """Slots such as `target:location, hand:real?=0`, and whether the last (`*`) repeats."""
    slots = []
    for part in filter(None, (p.strip() for p in spelled.split(","))):
        named, _, default = part.partition("=")
        name, _, kind = named.rstrip("?*").partition(":")
        otherwise = float(default) if default else None
        slots.append(OperandSlot(name, kind or "real", "?" not in part, otherwise))  # type: ignore[arg-type]
    return tuple(slots), "*" in spelled


def form(
    keyword: str,
    spelled: str,
    explanation: str,
    origin: Origin,
    *,
    words: str = "",
    usage: str = "",
    own: bool = False,
) -> InstructionForm:
    """A row of the table: slots as `slots_of` reads them, words as `MMPS|IPS ALWAYS`."""
    slots, repeats = slots_of(spelled)
    groups = tuple(tuple(group.split("|")) for group in words.split())
    return InstructionForm(
        keyword,
        slots,
        groups,
        explanation,
        origin,
        repeats,
        usage or _usage(keyword, slots, groups, repeats),
        own,
    )


def function(
    name: str,
    spelled: str,
    gives: Kind,
    explanation: str,
    origin: Origin,
    *,
    constant: bool = False,
    usage: str = "",
    idle: bool = False,
) -> Function:
    """A row of the table of functions."""
    slots, repeats = slots_of(spelled)
    shown = usage or (name if constant and not slots else f"{name}({_listed(slots, repeats)})")
    return Function(name, slots, gives, explanation, origin, repeats, constant, shown, idle)


def _usage(keyword: str, slots: tuple[OperandSlot, ...], groups: tuple[tuple[str, ...], ...], repeats: bool) -> str:
    words = "".join(f" [{'|'.join(group)}]" for group in groups)
    return f"{keyword} {_listed(slots, repeats)}".rstrip() + words


def _listed(slots: tuple[OperandSlot, ...], repeats: bool) -> str:
    shown = ""
    for i, slot in enumerate(slots):
        piece = f"{', ' if i else ''}{slot.name}"
        shown += piece if slot.required else f"[{piece}]"
    return shown + (", .." if repeats else "")


def nearest(word: str, words: Iterable[str]) -> str:
    """`; did you mean MOVES?`, or nothing."""
    close = nearest_word(word, words)
    return f"; did you mean {close}?" if close else ""


def nearest_word(word: str, words: Iterable[str]) -> str:
    """The word that is most like another, upper case; empty where none is."""
    return next(iter(difflib.get_close_matches(word.upper(), list(words), n=1, cutoff=0.7)), "")


_MOTION: Final = (
    form("MOVE", "location:location", "Move to a location, the joints together.", "VAL"),
    form("MOVES", "location:location", "Move the tool to a location on a straight line.", "VAL"),
    form("MOVET", "location:location, opening", "MOVE, the hand to an opening [mm], TRUE, FALSE.", "VAL"),
    form("MOVEST", "location:location, opening", "MOVET on a straight line.", "VAL"),
    form("APPRO", "location:location, distance", "Move to a distance [mm] behind a location, along its tool axis.",
         "VAL"),
    form("APPROS", "location:location, distance", "APPRO on a straight line.", "VAL"),
    form("DEPART", "distance", "Move back by a distance [mm] along the tool axis, from the destination.", "VAL"),
    form("DEPARTS", "distance", "DEPART on a straight line.", "VAL"),
    form("DRIVE", "joint, change, speed", "Turn one joint by a change [deg] at a speed [%].", "VAL"),
    form("DRAW", "dx?=0, dy?=0, dz?=0", "Move straight by a way in world axes [mm].", "VAL"),
    form("READY", "", "Move to the ready position: the arm straight up.", "VAL"),
    form("NEST", "", "Move to the position in which the arm is parked.", "VAL-II"),
    form("ALIGN", "", "Turn the tool's axis to the nearest axis of the world.", "VAL"),
    form("DELAY", "seconds", "Stand still for a time, as a motion.", "VAL"),
    form("BREAK", "", "Wait until the arm stands at its destination.", "VAL-II"),
    form("BRAKE", "", "Stop the present motion at once.", "V+"),
    form("AT", "time", "The next motion begins at a time of the session [s].", "ours", usage="AT time [motion]"),
)  # fmt: skip

_SETTINGS: Final = (
    form("SPEED", "speed, turning?", "Speed of the next motion, [%] of the nominal or of the tool; ALWAYS: of all.",
         "VAL", words="MMPS|IPS|MONITOR ALWAYS"),
    form("ACCEL", "up, down?", "Accelerations: [%] of the nominal.", "V+"),
    form("DURATION", "seconds", "Shortest time of the next motion; ALWAYS: each.", "V+", words="ALWAYS"),
    form("COARSE", "percent?", "The next motion may end roughly; ALWAYS: each.", "VAL", words="ALWAYS"),
    form("FINE", "percent?", "The next motion ends exactly; ALWAYS: each.", "VAL-II", words="ALWAYS"),
    form("NULL", "", "The next motion ends when the real arm is there; ALWAYS: each.", "VAL", words="ALWAYS"),
    form("NONULL", "", "The next motion ends without waiting for the real arm; ALWAYS: each.", "VAL",
         words="ALWAYS"),
    form("RIGHTY", "", "The arm is to be right-handed from the next MOVE on.", "VAL"),
    form("LEFTY", "", "The arm is to be left-handed from the next MOVE on.", "VAL"),
    form("ABOVE", "", "The elbow is to be above from the next MOVE on.", "VAL"),
    form("BELOW", "", "The elbow is to be below from the next MOVE on.", "VAL"),
    form("FLIP", "", "The wrist is to be flipped from the next MOVE on.", "VAL"),
    form("NOFLIP", "", "The wrist is not to be flipped from the next MOVE on.", "VAL"),
    form("TOOL", "transformation:frame?", "The tool's tip relative to the flange; NULL without one.", "VAL"),
    form("BASE", "dx?=0, dy?=0, dz?=0, turn?=0",
         "Where the robot stands in the world: shifted [mm], turned about z [deg].", "VAL"),
    form("ENABLE", "", "Turn switches on.", "VAL", usage="ENABLE switch, .."),
    form("DISABLE", "", "Turn switches off.", "VAL", usage="DISABLE switch, .."),
    form("PARAMETER", "value", "Set a parameter.", "VAL-II", usage="PARAMETER name = value"),
    form("ALTER", "channel?=0, mode?=0, dx?=0, dy?=0, dz?=0, rx?=0, ry?=0, rz?=0",
         "Corrections of the path begin: mode 1 cumulative, 2 world axes.", "VAL-II", usage="ALTER (channel) mode"),
    form("ALTOUT", "dx?=0, dy?=0, dz?=0, rx?=0, ry?=0, rz?=0",
         "Correct the tool's place by a way [mm] and a turn [deg], exactly; 28 ms each.", "VAL-II"),
    form("NOALTER", "", "Corrections of the path end.", "VAL-II"),
    form("ALTON", "channel?=0, mode?=0", "As ALTER.", "V+", usage="ALTON (channel) mode"),
    form("ALTOFF", "", "As NOALTER.", "V+"),
)  # fmt: skip

_HAND: Final = (
    form("OPEN", "", "Open the hand with the next motion.", "VAL"),
    form("CLOSE", "", "Close the hand with the next motion.", "VAL"),
    form("RELAX", "", "Let the hand go slack with the next motion.", "VAL"),
    form("OPENI", "", "Open the hand now, where the arm stands.", "VAL"),
    form("CLOSEI", "", "Close the hand now, where the arm stands.", "VAL"),
    form("RELAXI", "", "Let the hand go slack now, where the arm stands.", "VAL"),
    form("GRASP", "opening, label:label?", "Close the hand; go to a label if it's less open than that [mm].",
         "VAL"),
)  # fmt: skip

_LOCATIONS: Final = (
    form("SET", "variable:variable, location:location", "Assign a location.", "VAL",
         usage="SET variable = location", own=True),
    form("HERE", "variable:variable", "Record where the tool is; of a compound, its last part.", "VAL"),
    form("DECOMPOSE", "array:variable, location:location", "Six numbers of a location into an array's elements.",
         "V+", usage="DECOMPOSE array[first] = location", own=True),
    form("SHIFT", "variable:variable, dx?, dy?, dz?", "Shift a location in world axes [mm].", "VAL",
         usage="SHIFT variable BY dx, dy, dz", own=True),
)  # fmt: skip

_SIGNALS: Final = (
    form("SIGNAL", "number*", "Turn outputs on, or off where negative.", "VAL"),
    form("RESET", "", "Turn all outputs off.", "V+"),
    form("WAIT", "condition?", "Wait until a condition holds.", "VAL"),
    form("WAIT.EVENT", "mask?, seconds?", "Wait for a time.", "V+"),
    form("TIMER", "number, seconds", "Set a timer.", "VAL-II", usage="TIMER number = seconds"),
    form("REACT", "signal, program:program?", "Call a program after the present step when a signal turns on.",
         "VAL", words="ALWAYS", own=True),
    form("REACTI", "signal, program:program?", "REACT, stopping the present motion at once.", "VAL", words="ALWAYS",
         own=True),
    form("IGNORE", "signal", "Don't react to a signal any more.", "VAL"),
)  # fmt: skip

_CONTROL: Final = (
    form("IF", "condition, label:label?", "Do steps if a condition holds.", "VAL", own=True,
         usage="IF condition THEN .. ELSE .. END, IF condition GOTO label"),
    form("ELSE", "", "Do steps if the condition of IF doesn't hold.", "VAL-II", own=True),
    form("END", "", "The end of IF, WHILE, FOR or CASE.", "VAL-II", own=True),
    form("WHILE", "condition", "Repeat steps as long as a condition holds.", "VAL-II", own=True,
         usage="WHILE condition DO .. END"),
    form("DO", "", "Repeat steps until a condition holds.", "VAL-II", own=True, usage="DO .. UNTIL condition"),
    form("UNTIL", "condition", "The end of DO.", "VAL-II", own=True),
    form("FOR", "variable:variable, start, stop, step?", "Repeat steps, counting.", "VAL-II", own=True,
         usage="FOR variable = start TO stop [STEP step] .. END"),
    form("CASE", "value:any", "Do the steps of one of several values.", "VAL-II", own=True,
         usage="CASE value OF .. END"),
    form("VALUE", "value:any*", "What of a CASE is done for these values.", "VAL-II", own=True,
         usage="VALUE value, ..:"),
    form("ANY", "", "What of a CASE is done for any other value.", "VAL-II", own=True),
    form("EXIT", "count?", "Leave the innermost loop, or as many.", "VAL-II", own=True),
    form("NEXT", "count?", "Go on with the next turn of the innermost loop.", "VAL-II", own=True),
    form("GOTO", "label:label", "Go on at a label.", "VAL", own=True),
    form("CALL", "argument:any?*", "Call a program; arguments by reference.", "VAL-II", own=True,
         usage="CALL program(argument, ..)"),
    form("GOSUB", "argument:any?*", "Call a program.", "VAL", own=True, usage="GOSUB program"),
    form("RETURN", "", "Go back to the program that called.", "VAL", own=True),
    form("PAUSE", "", "Pause until PROCEED.", "VAL"),
    form("STOP", "", "End this cycle of the program.", "VAL"),
    form("HALT", "", "End the program, whatever cycles are left.", "VAL"),
)  # fmt: skip

_DIALOGUE: Final = (
    form("TYPE", "item:any?*", "Print texts and values; /F8.2 and such say how.", "VAL", own=True),
    form("PROMPT", "text:string?, variable:variable?*", "Print a text, read values.", "VAL-II", own=True),
    form("REMARK", "text:text?", "A comment.", "VAL", own=True, usage="REMARK text"),
    form("AUTO", "name:variable*", "Names of this call of the program alone.", "V+", own=True,
         usage="AUTO [REAL|LOC] name, .."),
    form("LOCAL", "name:variable*", "Names of this program alone.", "V+", own=True,
         usage="LOCAL [REAL|LOC] name, .."),
    form("GLOBAL", "name:variable*", "Names of all programs, as they are without a word.", "V+", own=True,
         usage="GLOBAL [REAL|LOC] name, .."),
)  # fmt: skip

INSTRUCTIONS: Final[dict[str, InstructionForm]] = {
    row.keyword: row for row in (*_MOTION, *_SETTINGS, *_HAND, *_LOCATIONS, *_SIGNALS, *_CONTROL, *_DIALOGUE)
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
    function("ABS", "x", "real", "Absolute value.", "VAL-II"),
    function("ASC", "text:string, index?=1", "real", "Code of a character.", "VAL-II"),
    function("ATAN2", "y, x", "real", "Angle of a direction [deg].", "VAL-II"),
    function("BMASK", "bit*=0", "real", "A number with these bits set, from 1.", "V+"),
    function("BITS", "first, count?=1", "real", "Signals from a first one on, as a number.", "V+"),
    function("COS", "angle", "real", "Cosine of an angle [deg].", "VAL-II"),
    function("DEFINED", "variable:any", "real", "Whether a variable has a value.", "V+"),
    function("DISTANCE", "a:frame, b:frame", "real", "Distance of two locations [mm].", "VAL-II"),
    function("DX", "a:frame", "real", "X of a location [mm].", "VAL-II"),
    function("DY", "a:frame", "real", "Y of a location [mm].", "VAL-II"),
    function("DZ", "a:frame", "real", "Z of a location [mm].", "VAL-II"),
    function("FRACT", "x", "real", "Fractional part.", "VAL-II"),
    function("INRANGE", "a:location", "real", "0 if a location can be reached.", "V+"),
    function("INT", "x", "real", "Integer part.", "VAL-II"),
    function("LAST", "array:array", "real", "Largest index of an array.", "V+"),
    function("LEN", "text:string", "real", "Length of a string.", "VAL-II"),
    function("MAX", "x*", "real", "Largest of values.", "V+"),
    function("MIN", "x*", "real", "Smallest of values.", "V+"),
    function("OUTSIDE", "low, x, high", "real", "Whether a value is outside a range.", "V+"),
    function("PARAMETER", "name:any", "real", "Value of a parameter.", "V+"),
    function("PI", "", "real", "3.14159..", "VAL-II", constant=True),
    function("POS", "text:string, part:string, from?=1", "real", "Where a string has another; 0 for nowhere.",
             "V+"),
    function("RANDOM", "", "real", "A random number from 0 to 1.", "V+", constant=True),
    function("SIG", "number*", "real", "Whether all these signals are on, or off where negative.", "VAL-II"),
    function("SIGN", "x", "real", "-1 or 1.", "VAL-II"),
    function("SIN", "angle", "real", "Sine of an angle [deg].", "VAL-II"),
    function("SPEED", "which", "real", "1: the monitor speed [%].", "V+"),
    function("SQR", "x", "real", "Square.", "V+"),
    function("SQRT", "x", "real", "Square root.", "VAL-II"),
    function("SWITCH", "name:any", "real", "Whether a switch is on.", "V+"),
    function("TAN", "angle", "real", "Tangent of an angle [deg].", "V+"),
    function("TIMER", "number", "real", "Seconds since a timer was set to 0.", "VAL-II"),
    function("VAL", "text:string", "real", "The number that a string begins with.", "VAL-II"),
    function("TRUE", "", "real", "-1.", "VAL-II", constant=True),
    function("FALSE", "", "real", "0.", "VAL-II", constant=True),
    function("ON", "", "real", "-1.", "VAL-II", constant=True),
    function("OFF", "", "real", "0.", "VAL-II", constant=True),
)  # fmt: skip

_STRING_FUNCTIONS: Final = (
    function("$CHR", "code", "string", "The character of a code.", "VAL-II"),
    function("$DECODE", "$variable:variable, separators:string, mode?=0", "string",
             "What stands before, or with mode 1 the run of, separators; it's taken out of the variable.", "V+"),
    function("$ENCODE", "item:any?*", "string", "What TYPE would print.", "VAL-II"),
    function("$MID", "text:string, from, length", "string", "Part of a string.", "VAL-II"),
    function("$TRUNCATE", "text:string", "string", "A string up to its first character of code 0.", "V+"),
)  # fmt: skip

_LOCATION_FUNCTIONS: Final = (
    function("TRANS", "x?=0, y?=0, z?=0, o?=90, a?=-90, t?=0", "frame",
             "A transformation [mm, deg]; without angles, no turn.", "VAL-II"),
    function("SHIFT", "a:frame, dx?=0, dy?=0, dz?=0", "frame", "A location shifted in world axes [mm].", "VAL-II",
             usage="SHIFT(a BY dx, dy, dz)"),
    function("INVERSE", "a:frame", "frame", "The transformation back.", "VAL"),
    function("FRAME", "a:frame, b:frame, c:frame, d:frame", "frame",
             "A frame at d: x from a to b, c on the side of y.", "VAL"),
    function("RX", "angle", "frame", "A turn about x [deg].", "V+"),
    function("RY", "angle", "frame", "A turn about y [deg].", "V+"),
    function("RZ", "angle", "frame", "A turn about z [deg].", "V+"),
    function("NULL", "", "frame", "No way and no turn.", "VAL", constant=True),
    function("HERE", "", "frame", "Where the tool is.", "VAL", constant=True),
    function("DEST", "", "frame", "Where the tool goes.", "VAL-II", constant=True),
    function("#PPOINT", "j1?=0, j2?=0, j3?=0, j4?=0, j5?=0, j6?=0", "location", "A precision point [deg].",
             "VAL-II"),
    function("#HERE", "", "location", "Where the arm is, as a precision point.", "ours", constant=True),
    function("#DEST", "", "location", "Where the arm goes, as a precision point.", "V+", constant=True),
)  # fmt: skip

_IDLE_FUNCTIONS: Final = (
    function("IOSTAT", "lun:any, mode:any?", "real", "State of a file.", "V+", idle=True),
    function("GETC", "lun:any, mode:any?", "real", "A character of a file.", "V+", idle=True),
    function("LNGB", "text:string, from:any?", "real", "An integer of bytes.", "V+", idle=True),
    function("FLTB", "text:string, from:any?", "real", "A number of bytes.", "V+", idle=True),
    function("TASK", "mode:any?, number:any?", "real", "State of a task.", "V+", idle=True),
    function("$ERROR", "code:any", "string", "Text of an error.", "V+", idle=True),
    function("$LNGB", "value:any", "string", "Bytes of an integer.", "V+", idle=True),
    function("$FLTB", "value:any", "string", "Bytes of a number.", "V+", idle=True),
)  # fmt: skip

FUNCTIONS: Final[dict[str, Function]] = {
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

SWITCHES: Final[dict[str, Switch]] = {
    row.name: row
    for row in (
        Switch("CP", True, "Continuous path: motions go round their destinations.", "VAL-II"),
        Switch("DRY.RUN", False, "Programs run without motion.", "V+"),
        Switch("MESSAGES", True, "TYPE prints.", "VAL-II"),
        Switch("POWER", True, "The arm has power.", "V+"),
    )
}
"""What ENABLE and DISABLE turn."""

PARAMETERS: Final[dict[str, Parameter]] = {
    row.name: row
    for row in (
        Parameter("HAND.TIME", 0.05, 0.0, 60.0, "s", "How long OPENI, CLOSEI and RELAXI take.", "VAL-II"),
        Parameter("HAND.LOAD", 0.0, 0.0, 20.0, "kg", "What the real hand holds while it's closed.", "ours"),
    )
}
"""What PARAMETER sets."""
