"""Messages of every kind, drawn from what their definitions say: types, ranges, lengths, defaults.

What types can't say stands in `RULES`: which fields must go together.
"""

from __future__ import annotations

import base64
import math
import sys
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from random import Random
from typing import Any

import msgspec
import numpy as np
from hypothesis import strategies as st
from msgspec import inspect as kinds

from interfaces.messages.description import Described, alternatives, bounds, described, is_nullable, type_of, words
from interfaces.stream import Encoding, decode
from interfaces.stream.codec import KINDS

LETTERS = 'abcxyzABC019 _-.,:/é€θ−\U0001f916\0\n"\\'
EPOCHS = 2**64 - 1
LONGEST = 1 << 22
"""Messages are drawn up to this size [B]."""


def plain(kind: type, random: Random) -> dict[str, Any]:
    """A message of a kind, as JSON has it, drawn."""
    found: dict[str, Any] = _fields(type_of(kind), random)
    return found


def value(kind: type, seed: int) -> Any:
    """A message of a kind, as programs have it, drawn."""
    return decode(msgspec.json.encode(plain(kind, Random(seed))), Encoding.JSON, allowed=kind, largest=LONGEST)


def frozen(values: Any) -> Any:
    """A read-only array."""
    array = np.array(values, dtype=np.float64)
    array.flags.writeable = False
    return array


class _Messages(Mapping[type, st.SearchStrategy[Any]]):
    """What draws each message; of one that is added, too."""

    def __getitem__(self, kind: type) -> st.SearchStrategy[Any]:
        return st.integers(0, 2**32 - 1).map(partial(value, kind))

    def __iter__(self) -> Iterator[type]:
        return iter(KINDS)

    def __len__(self) -> int:
        return len(KINDS)


messages = _Messages()


def _fields(kind: Any, random: Random) -> Any:
    message = described(kind)
    found = {message.tag_field: message.tag} if message.tag else {}
    for field in message.fields:
        if not field.required and not message.is_array and random.random() < 0.4:
            continue
        null = field.nullable and random.random() < 0.2
        found[field.name] = None if null else _one_of(alternatives(field.type), random)
    for needed, rule in RULES:
        if needed <= {field.name for field in message.fields}:
            rule(found, random)
    return list(found.values()) if message.is_array else found


def _place(kind: kinds.Type, random: Random) -> Any:
    if is_nullable(kind) and random.random() < 0.3:
        return None
    return _one_of(alternatives(kind), random)


def _one_of(found: tuple[kinds.Type, ...], random: Random) -> Any:
    return _draw(random.choice(found), random)


def _draw(kind: kinds.Type, random: Random) -> Any:
    match kind:
        case kinds.BoolType():
            return random.random() < 0.5
        case kinds.IntType():
            low, high = (int(end) for end in _ends(kind))
            ends = low, high, low + 1, high - 1
            return random.choice((*ends, random.randint(low, high), random.randint(low, min(low + 9, high))))
        case kinds.FloatType():
            return _real(*_ends(kind), random)
        case kinds.StrType(pattern=str()):
            return str(random.choice((1, EPOCHS, random.randint(1, EPOCHS))))
        case kinds.StrType(least, most):
            longest = random.choice((1, 12, 12, 40, most or 40))
            size = random.randint(least or 0, max(least or 0, min(most or 40, longest)))
            return "".join(random.choices(LETTERS, k=size))
        case kinds.EnumType() | kinds.LiteralType():
            return random.choice(words(kind))
        case kinds.ListType(item, least, most) | kinds.VarTupleType(item, least, most):
            return [_place(item, random) for _ in range(_size(least, most, random))]
        case kinds.TupleType(items):
            return [_place(item, random) for item in items]
        case kinds.DictType(key, item, least, most):
            return {_place(key, random): _place(item, random) for _ in range(_size(least, most, random))}
        case _:
            return _fields(kind, random)


def _ends(kind: kinds.IntType | kinds.FloatType) -> tuple[float, float]:
    low, high = bounds(kind)
    return -1e6 if low is None else low, 1e6 if high is None else high


def _real(low: float, high: float, random: Random) -> float:
    """A number of a range, none of them subnormal: that's for programs to refuse."""
    size = 10 ** random.uniform(-300, math.log10(max(abs(low), abs(high))))
    usual = random.uniform(max(low, -10.0), min(high, 10.0))
    drawn = random.choice((low, high, 0.0, -0.0, size, -size, usual, usual))
    kept = min(max(drawn, low), high)
    return float(kept) if kept == 0 or abs(kept) >= sys.float_info.min else max(low, sys.float_info.min)


def _size(least: int | None, most: int | None, random: Random) -> int:
    low = least or 0
    return random.randint(low, min(low + 4, low + 4 if most is None else most))


# What types can't say.

Rule = Callable[[dict[str, Any], Random], None]


def _widths(found: dict[str, Any], random: Random) -> None:
    """Segments have a coefficient for each joint, and the width stands beside them."""
    found["dof"] = n = random.randint(1, 8)
    for row in found.get("segments", ()):
        row[2] = [[_real(-1e300, 1e300, random) for _ in range(n)] for _ in range(random.randint(1, 6))]


def _one_width(found: dict[str, Any], random: Random) -> None:
    """A robot has one number of joints."""
    found["dof"] = n = random.randint(1, 8)
    found["limits"] = {name: [low] * n for name, low in LIMITS.items()}
    found["poses"] = {name: [_real(-9, 9, random) for _ in range(n)] for name in found["poses"]}


LIMITS = {"q_min": -3.0, "q_max": 3.0, "qd_max": 2.0, "qdd_max": 4.0, "qddd_max": 40.0}


def _drives(found: dict[str, Any], random: Random) -> None:
    found.update({name: 10 ** random.uniform(-3, 3) for name in found})


def _pose(found: dict[str, Any], random: Random) -> None:
    """A pose has a proper rotation."""
    for name in {"X", "tool"} & found.keys():
        if found[name] is not None:
            found[name] = _proper(random)


def _proper(random: Random) -> list[list[float]]:
    X = np.eye(4)
    turned = np.linalg.qr(np.random.default_rng(random.randrange(1000)).normal(size=(3, 3)))[0]
    X[:3, :3] = turned * np.sign(np.linalg.det(turned))
    X[:3, 3] = [_real(-10, 10, random) for _ in range(3)]
    rows: list[list[float]] = X.tolist()
    return rows


def _either(found: dict[str, Any], random: Random) -> None:
    """Steering is by joints or by the tool."""
    found.pop(random.choice(("rates", "twist")), None)
    if found.get("rates") is None and found.get("twist") is None:
        found["rates"] = [0.5, -0.25]


def _one_shape(found: dict[str, Any], random: Random) -> None:
    """A thing is a box or a cylinder."""
    found.pop(random.choice(("box", "cylinder")), None)
    if found.get("box") is None and found.get("cylinder") is None:
        found["box"] = [0.5, 0.25, 0.125]


def _named_apart(found: dict[str, Any], random: Random) -> None:
    """Things have names of their own."""
    for number, thing in enumerate(found.get("things") or ()):
        thing["name"] = f"thing {number}"


def _one_task(found: dict[str, Any], random: Random) -> None:
    """One thing is asked at a time."""
    given = [name for name in ("go", "jobs") if found.get(name) is not None]
    name = random.choice([*given, "do"])
    value, progress = found.get(name), found.get("progress")
    found.clear()
    found[name] = random.choice(("run", "pause", "resume", "abort", "key")) if name == "do" else value
    if name == "jobs" and progress is not None:
        found["progress"] = progress


def _jobs(found: dict[str, Any], random: Random) -> None:
    """Each job has a number of its own, words that can be read, and a goal that's known."""
    for number, job in enumerate(found.get("jobs") or (), random.randint(1, 9)):
        job["number"] = number
        for name in {"text", "program"} & job.keys():
            job[name] = "said " + job[name][:9].replace("\0", "")
        if isinstance(job.get("to"), str):
            job["to"] = {"x": 1.0, "y": -2.0}
    if "places" in found:
        found["places"] = {f"place {number}": goal for number, goal in enumerate(found["places"].values())}


def _signs(found: dict[str, Any], random: Random) -> None:
    """Of times that are equal, 0.0 and −0.0, one stands for both."""
    for name, other in (("tail_start", "end"), ("past", "now")):
        if name in found and found[name] == found.get(other):
            found[name] = found[other]


def _base64(found: dict[str, Any], random: Random) -> None:
    """Bytes cross as base64."""
    if isinstance(found["q"], str):
        found["q"] = base64.b64encode(random.randbytes(random.choice((2, 3, 40, 32768)))).decode()


RULES: tuple[tuple[set[str], Rule], ...] = (
    ({"dof", "segments"}, _widths),
    ({"dof", "limits", "poses"}, _one_width),
    ({"v_max", "alpha_max"}, _drives),
    ({"q", "falsified"}, _base64),
    ({"X"}, _pose),
    ({"tool", "speed"}, _pose),
    ({"tool", "stays"}, _pose),
    ({"rates", "twist"}, _either),
    ({"box", "cylinder"}, _one_shape),
    ({"floor", "things"}, _named_apart),
    ({"go", "do", "jobs"}, _one_task),
    ({"jobs", "places"}, _jobs),
    ({"tail_start", "end"}, _signs),
    ({"past", "now"}, _signs),
)
"""Fields that must be there, and what puts them right together."""


def edges() -> tuple[Any, ...]:
    """What is at the edge of some field's range, and just beyond."""
    found: dict[str, Any] = {}
    for wire in KINDS:
        for one in _inner(type_of(wire)):
            found |= {repr(value): value for value in _edges(one)}
    return tuple(found.values())


def _inner(kind: kinds.Type) -> Iterator[kinds.Type]:
    for one in alternatives(kind):
        yield one
        if isinstance(one, Described):
            for field in one.fields:
                yield from _inner(field.type)
        for name in ("item_type", "item_types", "key_type", "value_type"):
            inner = getattr(one, name, ())
            for part in inner if isinstance(inner, tuple) else (inner,):
                yield from _inner(part)


def _edges(kind: kinds.Type) -> Iterator[Any]:
    match kind:
        case kinds.IntType():
            low, high = (int(end) for end in _ends(kind))
            yield from (low - 1, low, high, high + 1)
        case kinds.FloatType():
            low, high = _ends(kind)
            yield from (math.nextafter(low, -math.inf), low, high, math.nextafter(high, math.inf))
        case kinds.StrType(pattern=str()):
            yield from ("0", "01", "1", str(EPOCHS), str(EPOCHS + 1), "9" * 20, "1\n")
        case kinds.StrType(max_length=int(most)):
            yield from ("", "é" * most, "é" * (most + 1))
        case kinds.EnumType() | kinds.LiteralType():
            yield words(kind)[-1]
