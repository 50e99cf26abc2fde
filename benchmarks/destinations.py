"""Where a program of VAL-II or V+ sends the arm, by an evaluation without anything of `interfaces.val2`.

Lines are taken apart by regular expressions, expressions by Python's parser, frames are spatialmath's, and the arm
is the Robotics Toolbox's Puma560. Time stands still: a WAIT ends at once, timers read 0, and an input is on as soon
as what it waits for (`.SIGNALS`) has happened.
"""

from __future__ import annotations

import ast
import math
import re
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cache
from itertools import pairwise
from typing import Any, NamedTuple, NoReturn, TypeAlias, cast

import numpy as np
import roboticstoolbox
from spatialmath import SE3, SO3

from vrs.timeline import Timeline

Joints: TypeAlias = tuple[float, ...]
"""Of a precision point, with VAL's signs and zeros [deg], six."""
Key: TypeAlias = tuple[str | int, ...]
"""A variable's name, and its indices."""
OFFSETS = (0.0, -180.0, 180.0, 0.0, 0.0, 0.0)
"""VAL's joint values less the Toolbox's [deg] (docs/conventions.md)."""
FLANGE = 56.25
"""From the wrist's centre to the flange [mm]."""
REST = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, -1.0], [-1.0, 0.0, 0.0]])
"""The hand at O = A = T = 0: it points along -Y, its fingers lie along X."""
MOST = 100_000
"""Steps after which a program that doesn't end has shown where it goes."""


class Destination(NamedTuple):
    """Where one motion leads."""

    line: int
    """Of the text, from 1; of all files one after the other."""
    flange: SE3
    """Of the robot's own frame [mm]."""
    joints: Joints | None
    """Where a precision point says them [deg]."""
    straight: bool
    stopped: bool
    """A reaction stops it on the way."""


class UnforeseenError(Exception):
    """What this evaluation doesn't know."""


# The arm and its frames.


@cache
def puma() -> Any:
    """The Toolbox's arm."""
    return roboticstoolbox.models.DH.Puma560()


def flange(joints: Sequence[float]) -> SE3:
    """Of joint values with VAL's signs [deg], in the robot's own frame [mm]."""
    wrist = puma().fkine(np.radians(np.subtract(joints, OFFSETS)))
    at = 1000 * (wrist.t - [0, 0, puma().links[0].d])
    return SE3.Rz(math.pi) * SE3.Rt(wrist.R, at) * SE3.Rz(math.pi) * SE3.Tz(FLANGE)


def solutions(place: SE3) -> list[Joints]:
    """Joint values at a flange, by the Toolbox's closed form, within the Toolbox's limits [deg]."""
    wrist = SE3.Rz(-math.pi) * place * SE3.Tz(-FLANGE) * SE3.Rz(-math.pi)
    wrist = SE3.Rt(wrist.R, wrist.t / 1000 + [0, 0, puma().links[0].d])
    found = []
    for choice in (a + b + c for a in "lr" for b in "ud" for c in "nf"):
        solution = puma().ikine_a(wrist, choice)
        if not solution.success or not np.isfinite(solution.q).all():
            continue
        low, high = puma().qlim
        # A joint may stand a turn farther.
        q = [next((x + k for k in (0, 2 * math.pi, -2 * math.pi) if a <= x + k <= b), math.nan)
             for x, a, b in zip(solution.q, low - 1e-9, high + 1e-9, strict=True)]  # fmt: skip
        if np.isfinite(q).all():
            found.append(tuple(np.degrees(q) + OFFSETS))
    return found


def frame(numbers: Sequence[float | None], vplus: bool) -> SE3:
    """Of X, Y, Z [mm] and O, A, T or yaw, pitch, roll [deg]; what is left out is no way and no turn."""
    x, y, z = (value or 0.0 for value in [*numbers, None, None, None][:3])
    angles = [*numbers[3:6], None, None, None][:3]
    if vplus:
        turn = SO3.Eul([value or 0.0 for value in angles], unit="deg")
    else:
        o, a, t = (usual if value is None else value for value, usual in zip(angles, (90, -90, 0), strict=True))
        turn = SO3.Rz(o, "deg") * SO3(REST) * SO3.Ry(a, "deg") * SO3.Rz(t, "deg")
    return SE3.Rt(turn.R, [x, y, z])


def numbers_of(place: SE3, vplus: bool) -> list[float]:
    """X, Y, Z and the angles of a frame."""
    yaw, pitch, roll = place.eul(unit="deg")
    return [*place.t, *((yaw, pitch, roll) if vplus else (yaw + 90, pitch - 90, roll))]


def spanned(a: SE3, b: SE3, c: SE3, d: SE3) -> SE3:
    """FRAME: at d, x from a to b, c on the side of y."""
    x = (b.t - a.t) / np.linalg.norm(b.t - a.t)
    z = np.cross(x, c.t - a.t)
    z /= np.linalg.norm(z)
    return SE3.Rt(np.column_stack([x, np.cross(z, x), z]), d.t)


def shifted(place: SE3, dx: float | None = 0, dy: float | None = 0, dz: float | None = 0) -> SE3:
    """A place, moved along the world's axes."""
    return SE3.Rt(place.R, place.t + np.array([dx or 0.0, dy or 0.0, dz or 0.0]))


def apart(a: SE3, b: SE3) -> tuple[float, float]:
    """How far two frames are from each other: the way [mm], and the turn [deg]."""
    turn = a.R.T @ b.R
    # Of small angles the sine is exact where the cosine isn't.
    sine = np.linalg.norm([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]]) / 2
    return float(np.linalg.norm(a.t - b.t)), math.degrees(math.atan2(sine, (np.trace(turn) - 1) / 2))


# A text as blocks of steps.


@dataclass
class Step:
    """A line, and the blocks that it governs, each with the line that begins it."""

    line: int
    label: str
    text: str
    blocks: list[tuple[str, list[Step]]] = field(default_factory=list)

    @property
    def word(self) -> str:
        """What it begins with."""
        return word_of(self.text)


@dataclass
class Routine:
    """A program of a text."""

    name: str
    arguments: list[str]
    line: int = 0
    """Of its head."""
    steps: list[Step] = field(default_factory=list)


COMMENT = re.compile(r'^((?:[^";]|"[^"]*")*);.*$')
HEAD = re.compile(r"\.PROGRAM\s+([\w.]+)\s*(?:\((.*)\))?", re.IGNORECASE)
ASSIGNED = re.compile(r"[#$]?[A-Za-z][\w.]*(\[[^=]*\])?\s*=(?!=)")
PARTS = re.compile(r"\s*(\d+(?![\w.]))?\s*(.*?)\s*$")
INPUT = re.compile(r"\s*(\d+)\s*=\s*(.*?)(?:\s+(AFTER|FOR|AT)\s+([\d.]+))?\s*$", re.IGNORECASE)


def word_of(text: str) -> str:
    """The word that a line begins with, upper case."""
    found = re.match(r"[A-Za-z][\w.]*", text)
    return found[0].upper() if found else ""


def assigns(text: str) -> bool:
    """Whether a line is a variable, =, and a value."""
    return ASSIGNED.match(text) is not None and word_of(text) not in {"PARAMETER", "TIMER", "BITS"}


class Text:
    """Programs, values and inputs of a text, V+ or VAL-II."""

    def __init__(self, text: str, vplus: bool, name: str = "main") -> None:
        self.vplus = vplus
        self.routines: dict[str, Routine] = {}
        self.values: dict[Key, Any] = {}
        self.inputs: list[tuple[int, str, str]] = []
        """Signal, what it's set to, and how: AFTER, FOR, AT or nothing."""
        self._section, self._open = "", list[tuple[str, list[Step]]]()
        for n, raw in enumerate(text.splitlines(), 1):
            found = COMMENT.match(raw)
            line = (found[1] if found else raw).strip()
            if line.startswith("."):
                self._directive(line, n)
            elif line and self._section in {".LOCATIONS", ".REALS", ".STRINGS"}:
                self._value(line)
            elif line and self._section == ".SIGNALS":
                signal, what, how, _ = INPUT.match(line).groups()  # type: ignore[union-attr]
                self.inputs.append((int(signal), what, (how or "").upper()))
            elif line:
                if self._section != ".PROGRAM":
                    self._directive(f".PROGRAM {name}()", n - 1)
                self._step(n, line)

    def _directive(self, line: str, n: int) -> None:
        self._section = line.split(maxsplit=1)[0].upper()
        if self._section == ".PROGRAM":
            name, arguments = HEAD.match(line).groups()  # type: ignore[union-attr]
            named = [one.strip().lower() for one in (arguments or "").split(",") if one.strip()]
            routine = Routine(name.lower(), named, n)
            self.routines[routine.name] = routine
            self._open = [("", routine.steps)]

    def _value(self, line: str) -> None:
        name, *rest = line.split(None, 1)
        key = key_of(name)
        if self._section == ".STRINGS":
            self.values[key] = rest[0].strip('"')
        elif self._section == ".REALS":
            self.values[key] = float(rest[0])
        else:
            numbers = [float(one) for one in re.split(r"[\s,]+", rest[0])]
            self.values[key] = tuple(numbers) if name.startswith("#") else frame(numbers, self.vplus)

    def _step(self, n: int, line: str) -> None:
        label, text = PARTS.match(line).groups()  # type: ignore[union-attr]
        step, word = Step(n, label or "", text), word_of(text)
        assigned = assigns(text)
        opens = not assigned and (
            word in {"WHILE", "FOR", "CASE"} or text.upper() == "DO"
            or (word == "IF" and not re.search(r"\bGOTO\s+\d+$|\bTHEN\s+\d+$", text, re.IGNORECASE))
        )  # fmt: skip
        if assigned or not (opens or word in {"ELSE", "ELSEIF", "ELIF", "VALUE", "ANY", "END", "UNTIL"}):
            self._open[-1][1].append(step)
        elif opens:
            self._open[-1][1].append(step)
            step.blocks = [(text, [])]
            self._open.append((word, step.blocks[0][1]))
        else:
            self._open.pop()
            owner = self._open[-1][1][-1]
            owner.blocks.append((text, []))
            if word not in {"END", "UNTIL"}:
                self._open.append((word, owner.blocks[-1][1]))


def key_of(name: str) -> Key:
    """A name with indices in brackets, as variables are kept."""
    bare, _, inner = name.partition("[")
    prefix = bare[:1] if bare[:1] in "#$" else ""
    return (
        prefix + bare[len(prefix) :].lower()[:15],
        *(int(one) for one in inner.rstrip("]").split(",") if one.strip()),
    )


# Expressions, as Python's parser takes them.

TOKEN = re.compile(
    r'\s*("[^"]*"|\^[BOH][0-9A-F]+|(?:\d+\.?\d*|\.\d+)(?:E[+-]?\d+)?(?![\w.])|[#$]?[A-Z][\w.]*|<>|==|<=|>=|=<|=>|\*\*|.)',
    re.IGNORECASE,
)
WORDS = {
    "AND": " and ", "OR": " or ", "NOT": " not ", "XOR": " is not ", "MOD": "%", "BAND": "&", "BOR": "|",
    "BXOR": "^", "COM": "~", "BY": ",", "EQ": "==", "NE": "!=", "LT": "<", "LE": "<=", "GT": ">", "GE": ">=",
}  # fmt: skip
SIGNS = {"<>": "!=", "=<": "<=", "=>": ">=", "=": "==", ":": "@", "^": "**", "]": ")"}
CONSTANTS = {"TRUE", "FALSE", "ON", "OFF", "PI", "NULL", "HERE", "DEST", "TOOL", "RANDOM", "#HERE", "#DEST"}
BASES = {"B": 2, "O": 8, "H": 16}


@cache
def parsed(text: str) -> ast.expr:
    """An expression's tree: variables are calls of `name`, functions of `call`, what is left out is None."""
    code, opened = [], False
    parts = [part for part in TOKEN.findall(text) if part.strip()]
    for part, after, beyond in zip(parts, [*parts[1:], ""], [*parts[2:], "", ""], strict=False):
        upper = part.upper()
        if opened:
            # The parenthesis or bracket that the function or variable before it has opened.
            opened = False
        elif part[0] == '"':
            code.append(repr(part[1:-1]))
        elif part[0] == "^" and len(part) > 1:
            code.append(str(int(part[2:], BASES[upper[1]])))
        elif upper in WORDS:
            code.append(WORDS[upper])
        elif part[0].isalpha() or part[0] in "#$":
            what = "call" if after == "(" or (upper in CONSTANTS and after != "[") else "name"
            opened = after == ("(" if what == "call" else "[")
            code.append(f"{what}({part!r}" + ("" if not opened else "," if beyond not in {")", "]"} else ""))
            code += [] if opened else [")"]
        else:
            code.append(SIGNS.get(part, part))
    source = "".join(code)
    while (filled := re.sub(r"([,(])(?=[,)])", r"\1None", source)) != source:
        source = filled
    return ast.parse(source.strip(), mode="eval").body


def split(text: str) -> list[str]:
    """What stands between commas, outside of parentheses and strings."""
    parts, depth, quoted = [""], 0, False
    for character in text:
        quoted ^= character == '"'
        depth += not quoted and ((character in "([") - (character in ")]"))
        if character == "," and not depth and not quoted:
            parts.append("")
        else:
            parts[-1] += character
    return [part.strip() for part in parts]


# Carrying a program out.


class GotoError(Exception):
    """Control goes to a label."""


class LeaveError(Exception):
    """EXIT, NEXT: of how many loops."""

    def __init__(self, on: bool, count: int) -> None:
        self.on, self.count = on, count


class ReturnError(Exception):
    """Back to the caller."""


class EndedError(Exception):
    """STOP or HALT."""


@dataclass
class Frame:
    """Names of one call."""

    routine: str
    aliases: dict[str, tuple[dict[Key, Any], Key]] = field(default_factory=dict)
    own: dict[Key, Any] = field(default_factory=dict)
    names: dict[str, dict[Key, Any]] = field(default_factory=dict)
    """Which store holds a name of the program's own."""


PASSED = {
    "SPEED", "ACCEL", "DURATION", "PARAMETER", "OPEN", "CLOSE", "RELAX", "OPENI", "CLOSEI", "RELAXI", "BREAK",
    "COARSE", "FINE", "NULL", "NONULL", "RIGHTY", "LEFTY", "ABOVE", "BELOW", "FLIP", "NOFLIP", "ENABLE", "DISABLE",
    "TYPE", "GLOBAL", "WAIT.EVENT", "DELAY", "REMARK", "IGNORE", "FCLOSE", "DETACH", "LOCK", "SELECT", "WRITE",
    "TIMER", "WAIT",
}  # fmt: skip
"""Words that send the arm nowhere."""
MOTIONS = {
    "MOVE", "MOVES", "MOVET", "MOVEST", "APPRO", "APPROS", "DEPART", "DEPARTS", "DRAW", "DRIVE", "READY",
}  # fmt: skip
MATHS: dict[str, Callable[..., Any]] = {
    "ABS": abs, "SQRT": math.sqrt, "SQR": lambda x: x * x, "INT": math.trunc, "FRACT": lambda x: x - math.trunc(x),
    "SIN": lambda x: math.sin(math.radians(x)), "COS": lambda x: math.cos(math.radians(x)),
    "TAN": lambda x: math.tan(math.radians(x)), "ATAN2": lambda y, x: math.degrees(math.atan2(y, x)), "MIN": min,
    "MAX": max, "SIGN": lambda x: -1 if x < 0 else 1, "DX": lambda p: p.t[0], "DY": lambda p: p.t[1],
    "DZ": lambda p: p.t[2], "DISTANCE": lambda a, b: float(np.linalg.norm(a.t - b.t)), "SHIFT": shifted,
    "SCALE": lambda p, by: SE3.Rt(p.R, p.t * by), "INVERSE": lambda p: p.inv(), "FRAME": spanned,
    "RX": lambda x: SE3.Rx(x, "deg"), "RY": lambda x: SE3.Ry(x, "deg"), "RZ": lambda x: SE3.Rz(x, "deg"),
    "#PPOINT": lambda *q: tuple(x or 0.0 for x in q), "PPOINT": lambda *q: tuple(x or 0.0 for x in q),
    "PI": lambda: math.pi,
    "TRUE": lambda: -1, "ON": lambda: -1, "FALSE": lambda: 0, "OFF": lambda: 0, "NULL": SE3, "TIMER": lambda _: 0.0,
    "INRANGE": lambda _: 0, "IOSTAT": lambda *_: 0,
}  # fmt: skip
ARITHMETIC: dict[type, Callable[[Any, Any], Any]] = {
    ast.Add: lambda a, b: a + b, ast.Sub: lambda a, b: a - b, ast.Mult: lambda a, b: a * b,
    ast.Div: lambda a, b: a / b, ast.Mod: math.fmod, ast.Pow: lambda a, b: a**b, ast.MatMult: lambda a, b: a * b,
    ast.BitAnd: lambda a, b: int(a) & int(b), ast.BitOr: lambda a, b: int(a) | int(b),
    ast.BitXor: lambda a, b: int(a) ^ int(b),
}  # fmt: skip
RELATIONS: dict[type, Callable[[Any, Any], bool]] = {
    ast.Eq: lambda a, b: a == b, ast.NotEq: lambda a, b: a != b, ast.Lt: lambda a, b: a < b,
    ast.LtE: lambda a, b: a <= b, ast.Gt: lambda a, b: a > b, ast.GtE: lambda a, b: a >= b,
    ast.IsNot: lambda a, b: bool(a) != bool(b),
}  # fmt: skip


class Evaluation:
    """One run of a text's program."""

    def __init__(self, text: Text, start: Joints, lines: Sequence[str] = (), stops: Sequence[SE3] = ()) -> None:
        """Be ready.

        Args:
            text: The programs, and what they read.
            start: Where the arm stands.
            lines: What READ gets, one after the other.
            stops: Where reactions stopped the arm, one after the other: the time it took isn't known here.
        """
        self.text, self.globals = text, dict(text.values)
        self.found: list[Destination] = []
        self._local: dict[str, dict[Key, Any]] = {}
        self._frame = Frame("")
        self._at, self._joints = flange(start), cast("Joints | None", start)
        self._base, self._tool = SE3(), SE3()
        self._on: set[int] = set()
        self._happened: set[int] = set()
        """Inputs that have come since the output they wait for."""
        self._reactions: dict[int, str] = {}
        self._stops = ""
        """The program that the next motion is stopped for."""
        self._lines, self._stopped, self._steps = iter(lines), iter(stops), 0

    def run(self, name: str = "") -> list[Destination]:
        """Where the program's motions lead, in order; the first program's unless one is named."""
        with suppress(EndedError):
            self._call(name.lower() or next(iter(self.text.routines)), [])
        return self.found

    # Steps.

    def _call(self, name: str, given: list[str]) -> None:
        if name not in self.text.routines:
            raise UnforeseenError(f"no program {name}")
        routine, frame_, caller = self.text.routines[name], Frame(name), self._frame
        for argument, said in zip(routine.arguments, given, strict=False):
            bare = key_of(re.sub(r"\[.*", "", argument))[0]
            if re.fullmatch(r"[#$]?[A-Za-z][\w.]*(\[.*\])?", said) and said.upper() not in CONSTANTS:
                frame_.aliases[str(bare)] = self._place(said)
            elif said:
                frame_.aliases[str(bare)] = ({(bare,): self.value(said)}, (bare,))
        self._frame = frame_
        try:
            self._block(routine.steps)
        except ReturnError:
            pass
        finally:
            self._frame = caller

    def _block(self, steps: list[Step]) -> None:
        labels = {step.label: n for n, step in enumerate(steps) if step.label}
        n = 0
        while n < len(steps):
            self._steps += 1
            if self._steps > MOST:
                raise EndedError
            try:
                self._step(steps[n])
            except GotoError as jump:
                if str(jump) not in labels:
                    raise
                n = labels[str(jump)]
            else:
                n += 1

    def _step(self, step: Step) -> None:
        text, word = step.text, step.word
        rest = text[len(word) :].strip()
        if step.blocks:
            self._structure(step)
        elif assigns(text):
            self._assign(*text.split("=", 1))
        elif word in MOTIONS:
            self._motion(step, word, rest)
        elif (act := getattr(self, f"do_{word.lower()}", None)) is not None:
            act(rest)
        elif word and word not in PASSED:
            raise UnforeseenError(text)

    def _structure(self, step: Step) -> None:
        head, body = step.blocks[0]
        try:
            match step.word:
                case "IF":
                    self._if(step)
                case "CASE":
                    self._case(step)
                case "WHILE":
                    condition = re.sub(r"(?i)\s*\bDO$", "", head)[5:]
                    while self.value(condition):
                        self._turn(body)
                case "DO":
                    while True:
                        self._turn(body)
                        if self.value(step.blocks[1][0][5:]):
                            break
                case _:
                    self._for(head, body)
        except LeaveError as leave:
            if leave.count > 1:
                raise LeaveError(leave.on, leave.count - 1) from None

    def _if(self, step: Step) -> None:
        for head, body in step.blocks:
            word = word_of(head)
            condition = re.sub(r"(?i)\s*\bTHEN$", "", head[len(word) :])
            if word in {"ELSE", "END"} or self.value(condition):
                # EXIT and NEXT leave loops, not this.
                self._through(body)
                return

    def _case(self, step: Step) -> None:
        value = self.value(re.sub(r"(?i)\s*\bOF$", "", step.blocks[0][0])[4:])
        for head, body in step.blocks[1:]:
            word = word_of(head)
            if word != "VALUE" or value in [self.value(one) for one in split(head[5:].rstrip(": "))]:
                self._through(body)
                return

    def _through(self, body: list[Step]) -> None:
        try:
            self._block(body)
        except LeaveError as leave:
            raise LeaveError(leave.on, leave.count + 1) from None

    def _turn(self, body: list[Step]) -> None:
        """One turn of a loop."""
        try:
            self._block(body)
        except LeaveError as leave:
            if not leave.on or leave.count > 1:
                raise

    def _for(self, head: str, body: list[Step]) -> None:
        found = re.match(r"(?i)FOR\s+(.*?)\s*=\s*(.*?)\s+TO\s+(.*?)(?:\s+STEP\s+(.*))?$", head)
        assert found is not None, head
        first, last, by = (self.value(one) for one in (found[2], found[3], found[4] or "1"))
        self._assign(found[1], first)
        while (self.value(found[1]) - last) * (1 if by >= 0 else -1) <= 0:
            self._turn(body)
            self._assign(found[1], self.value(found[1]) + by)

    def do_if(self, rest: str) -> None:
        condition, label = re.split(r"(?i)\s+(?:GOTO|THEN)\s+", rest)
        if self.value(condition):
            raise GotoError(label)

    def do_goto(self, rest: str) -> NoReturn:
        raise GotoError(rest)

    def do_exit(self, rest: str) -> NoReturn:
        raise LeaveError(False, int(rest or 1))

    def do_next(self, rest: str) -> NoReturn:
        raise LeaveError(True, int(rest or 1))

    def do_return(self, _: str) -> NoReturn:
        raise ReturnError

    def do_stop(self, _: str) -> NoReturn:
        raise EndedError

    do_halt = do_stop

    def do_call(self, rest: str) -> None:
        name, _, inner = rest.partition("(")
        self._call(name.strip().lower(), split(inner.rstrip(") ")) if inner.strip(" )") else [])

    do_gosub = do_call

    # Values.

    def do_set(self, rest: str) -> None:
        self._assign(*rest.split("=", 1))

    def _assign(self, name: str, value: Any) -> None:
        value = self.value(value) if isinstance(value, str) else value
        *rest, last = name.strip().split(":")
        if rest:
            value = self.value(":".join(rest)).inv() * value
        store, key = self._place(last.strip())
        store[key] = value

    def do_here(self, rest: str) -> None:
        self._assign(rest, self._joints if rest.startswith("#") else self.tip())

    def do_decompose(self, rest: str) -> None:
        name, value = rest.split("=", 1)
        place = self.value(value)
        store, key = self._place(name.strip().replace("[]", "[0]"))
        for n, number in enumerate(place if isinstance(place, tuple) else numbers_of(place, self.text.vplus)):
            store[(*key[:-1], key[-1] + n)] = number

    def do_shift(self, rest: str) -> None:
        name, ways = re.split(r"(?i)\s+BY\s+", rest)
        self._assign(name, f"SHIFT({name} BY {ways})")

    def _names(self, rest: str, store: dict[Key, Any]) -> None:
        for one in split(re.sub(r"(?i)^(REAL|LOC|DOUBLE)\s+", "", rest)):
            self._frame.names[str(key_of(re.sub(r"\[.*", "", one))[0])] = store

    def do_auto(self, rest: str) -> None:
        self._names(rest, self._frame.own)

    def do_local(self, rest: str) -> None:
        self._names(rest, self._local.setdefault(self._frame.routine, {}))

    def _place(self, said: str) -> tuple[dict[Key, Any], Key]:
        """Where a variable, an element of an array or an array is kept."""
        bare, _, inner = said.partition("[")
        indices = [int(self.value(one)) for one in split(inner.rstrip("] ")) if one] if inner else []
        return self._resolved(bare.strip(), indices)

    def _resolved(self, bare: str, indices: Sequence[int]) -> tuple[dict[Key, Any], Key]:
        (name,) = key_of(bare)
        if name in self._frame.aliases:
            store, key = self._frame.aliases[str(name)]
            return store, (*key, *indices)
        return self._frame.names.get(str(name), self.globals), (name, *indices)

    def value(self, text: str) -> Any:
        """What an expression comes to."""
        return self._evaluated(parsed(text.strip()))

    def _evaluated(self, node: ast.expr) -> Any:
        match node:
            case ast.Constant(value):
                return value
            case ast.UnaryOp(ast.Not(), inner):
                return 0 if self._evaluated(inner) else -1
            case ast.UnaryOp(ast.USub(), inner):
                return -self._evaluated(inner)
            case ast.UnaryOp(ast.Invert(), inner):
                return ~int(self._evaluated(inner))
            case ast.UnaryOp(_, inner):
                return self._evaluated(inner)
            case ast.BinOp(left, op, right):
                return ARITHMETIC[type(op)](self._evaluated(left), self._evaluated(right))
            case ast.BoolOp(op, parts):
                truths = [bool(self._evaluated(part)) for part in parts]
                return -1 if (all if isinstance(op, ast.And) else any)(truths) else 0
            case ast.Compare(left, [op], [right]):
                return -1 if RELATIONS[type(op)](self._evaluated(left), self._evaluated(right)) else 0
            case ast.Call(ast.Name("name"), [ast.Constant(bare), *indices]):
                store, key = self._resolved(bare, [int(self._evaluated(one)) for one in indices])
                if key not in store:
                    raise UnforeseenError(f"{bare} has no value")
                return store[key]
            case ast.Call(ast.Name("call"), [ast.Constant(function), *given]):
                return self._function(str(function).upper(), given)
        raise UnforeseenError(ast.dump(node))

    def _function(self, name: str, given: Sequence[ast.expr]) -> Any:
        if name in {"DEFINED", "LAST"}:
            match given[0]:
                case ast.Call(ast.Name("name"), [ast.Constant(bare), *indices]):
                    store, key = self._resolved(bare, [int(self._evaluated(one)) for one in indices])
            if name == "DEFINED":
                return -1 if key in store else 0
            return max(one[-1] for one in store if one[: len(key)] == key and len(one) > len(key))
        values = [self._evaluated(one) for one in given]
        match name:
            case "RANDOM":
                return 0.5
            case "TRANS":
                return frame(values, self.text.vplus)
            case "HERE" | "DEST":
                return self.tip()
            case "#HERE" | "#DEST":
                return self._joints
            case "TOOL":
                return self._tool
            case "SIG":
                return -1 if all(self._is_on(abs(int(n))) == (n > 0) for n in values) else 0
            case "DISTANCE" | "DX" | "DY" | "DZ":
                values = [self._frame_of(one) for one in values]
        if name not in MATHS:
            raise UnforeseenError(f"{name}()")
        return MATHS[name](*values)

    # Signals.

    def do_signal(self, rest: str) -> None:
        for number in (int(self.value(one)) for one in split(rest)):
            before = {n for n, what, _ in self.text.inputs if self.value(what)}
            (self._on.add if number > 0 else self._on.discard)(abs(number))
            for n, what, how in self.text.inputs:
                if n not in before and self.value(what):
                    self._happened |= {n} if how == "FOR" else set()
                    self._stops = self._reactions.get(n, self._stops)

    def _is_on(self, number: int) -> bool:
        rules = [(what, how) for n, what, how in self.text.inputs if n == number]
        if not rules:
            return number in self._on
        what, how = rules[-1]
        return number in self._happened if how == "FOR" else bool(self.value(what))

    def do_bits(self, rest: str) -> None:
        which, value = rest.split("=", 1)
        first, *count = (int(self.value(one)) for one in split(which))
        for n in range(count[0] if count else 1):
            on = int(self.value(value)) >> n & 1
            self.do_signal(str(first + n if on else -first - n))

    def do_reacti(self, rest: str) -> None:
        signal, program = split(re.sub(r"(?i)\s+ALWAYS$", "", rest))[:2]
        self._reactions[int(self.value(signal))] = program.lower()

    # Motions.

    def tip(self) -> SE3:
        """Where the tool goes, in the world."""
        return self._base * self._at * self._tool

    def _frame_of(self, place: Any) -> SE3:
        return self._base * flange(place) * self._tool if isinstance(place, tuple) else place

    def do_tool(self, rest: str) -> None:
        self._tool = self.value(rest) if rest else SE3()

    def do_base(self, rest: str) -> None:
        dx, dy, dz, turn = ([self.value(one) if one else 0.0 for one in split(rest)] + [0.0] * 4)[:4]
        self._base = SE3(dx, dy, dz) * SE3.Rz(turn, "deg")

    def _motion(self, step: Step, word: str, rest: str) -> None:
        straight = word in {"MOVES", "MOVEST", "APPROS", "DEPARTS", "DRAW"}
        parts = split(rest[1:-1] if re.fullmatch(r"\([^()]*\)", rest) else rest)
        place: Any
        match word:
            case "READY":
                place = (0.0, -90.0, 90.0, 0.0, 0.0, 0.0)
            case "DRIVE":
                if self._joints is None:
                    raise UnforeseenError("DRIVE from a transformation")
                joint = int(self.value(parts[0])) - 1
                place = tuple(q + (self.value(parts[1]) if n == joint else 0.0) for n, q in enumerate(self._joints))
            case "DRAW":
                place = shifted(self.tip(), *(self.value(one) if one else 0.0 for one in parts))
            case "DEPART" | "DEPARTS":
                place = self.tip() * SE3.Tz(-self.value(parts[0]))
            case "APPRO" | "APPROS":
                place = self._frame_of(self.value(parts[0])) * SE3.Tz(-self.value(parts[1]))
            case _:
                place = self.value(parts[0])
        self._joints = place if isinstance(place, tuple) else None
        self._at = flange(place) if isinstance(place, tuple) else self._base.inv() * place * self._tool.inv()
        reaction, self._stops = self._stops, ""
        self.found.append(Destination(step.line, self._at, self._joints, straight, bool(reaction)))
        if reaction:
            self._at, self._joints = next(self._stopped, self._at), None
            self._call(reaction, [])

    # Files.

    def do_attach(self, rest: str) -> None:
        found = re.match(r"\(\s*([\w.]+)\s*,", rest)
        if found:
            self._assign(found[1], 1)

    def do_fopenr(self, _: str) -> None:
        pass

    def do_read(self, rest: str) -> None:
        names = split(re.sub(r"^\([^)]*\)\s*", "", rest))
        line = next(self._lines, None)
        if line is None:
            raise EndedError
        given = [line] if names[0].startswith("$") else [float(one) for one in re.split(r"[\s,]+", line.strip())]
        for name, value in zip(names, given, strict=False):
            store, key = self._place(name)
            store[key] = value


# Where an arm stood, beside where it was to go.

START = (0.0, -135.0, 0.0, 0.0, 45.0, 0.0)
"""Where the arm stands at first, VAL's joint values [deg]."""
NAME = "evaluated"
WAY, TURN = 0.01, 0.01
"""How far a destination may be off [mm], [deg]."""
JUMP = 20.0
"""By how much a joint may turn in a 200th of a straight way [deg]."""


def wrapped(program: str, prelude: str = "") -> str:
    """A program that calls another one, without rounding."""
    return f".PROGRAM {NAME}()\nDISABLE CP\n{prelude}\nCALL {program}()\n.END\n"


def stood(timeline: Timeline) -> list[Joints]:
    """Where the arm stood after each motion that moved it, VAL's joint values [deg]."""
    ends: dict[int, float] = {}
    for segment in timeline.segments:
        if segment.command_id is not None:
            ends[segment.command_id] = segment.end
    still = [t for t in ends.values() if np.abs(timeline.sample(t, derivative=1)).max() < 1e-6]
    places = [START, *(tuple(np.degrees(timeline.sample(t)) + OFFSETS) for t in still)]
    return [b for a, b in pairwise(places) if np.abs(np.subtract(a, b)).max() > 1e-6]


def evaluated(text: Text, there: Sequence[Joints], lines: Sequence[str] = ()) -> list[Destination]:
    """Where the program `wrapped` around another one is to lead the arm.

    Args:
        text: The text, with that program.
        there: Where the arm stood: the evaluation takes from it where reactions stopped it.
        lines: What READ gets.

    Raises:
        UnforeseenError: If it can't say.
    """
    wanted = moved(Evaluation(text, START, lines).run(NAME))
    stops = [flange(joints) for one, joints in zip(wanted, there, strict=False) if one.stopped]
    return moved(Evaluation(text, START, lines, stops).run(NAME)) if stops else wanted


def moved(found: Iterable[Destination]) -> list[Destination]:
    """Destinations but for those where the arm is already."""
    kept, before = [], Destination(0, flange(START), START, False, False)
    for one in found:
        same = one.joints is None or before.joints is None or np.allclose(one.joints, before.joints, atol=1e-6)
        if max(apart(one.flange, before.flange)) > 1e-6 or not same:
            kept.append(one)
        before = one
    return kept


def compared(wanted: Sequence[Destination], there: Sequence[Joints]) -> tuple[float, float]:
    """How far the arm was from where it was to go, at most: [mm], [deg]; joints count as turns."""
    way = turn = 0.0
    begin = flange(START)
    for one, joints in zip(wanted, there, strict=False):
        at = flange(joints)
        off = apart(nearest(begin, one.flange, at) if one.stopped else one.flange, at)
        if one.joints is not None:
            off = (off[0], max(off[1], float(np.abs(np.subtract(one.joints, joints)).max())))
        way, turn, begin = max(way, off[0]), max(turn, off[1]), at
    return way, turn


def nearest(begin: SE3, end: SE3, at: SE3) -> SE3:
    """Where a straight way comes nearest to a place."""
    way = end.t - begin.t
    return begin.interp(end, float(np.clip((at.t - begin.t) @ way / (way @ way), 0, 1)))


def reachable(joints: Sequence[float], wanted: Destination) -> bool:
    """Whether the Toolbox finds joint values at a destination; on a straight way such that no joint jumps."""
    if not wanted.straight:
        return bool(solutions(wanted.flange))
    at, begin = joints, flange(joints)
    for s in np.linspace(0, 1, 201):
        found = [(np.abs(np.subtract(q, at)).max(), q) for q in solutions(begin.interp(wanted.flange, s))]
        if not found or min(found)[0] > JUMP:
            return False
        at = min(found)[1]
    return True
