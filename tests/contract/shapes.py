"""The shape of messages and documents: which fields there are and of what kinds, whatever their values.

A shape is a map of paths to kinds, `{"q[]": ["number"], "lease.holder": ["absent", "text"]}`. All elements of an
array are one path, `[]`; `absent` says that a field was missing from some of the maps that may have it.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterable
from typing import Any

KINDS = {bool: "boolean", int: "integer", float: "number", str: "text", bytes: "bytes", type(None): "null"}
Shape = dict[str, list[str]]


def shape(values: Iterable[Any]) -> Shape:
    """What values have in common, and how they differ in kind."""
    seen: defaultdict[str, Counter[str]] = defaultdict(Counter)

    def note(value: Any, path: str) -> None:
        if isinstance(value, dict):
            seen[path]["map"] += 1
            for key, inner in value.items():
                note(inner, f"{path}.{key}" if path else str(key))
        elif isinstance(value, list):
            seen[path]["array"] += 1
            for inner in value:
                note(inner, f"{path}[]")
        else:
            seen[path][KINDS[type(value)]] += 1

    for value in values:
        note(value, "")
    found: Shape = {}
    for path, kinds in seen.items():
        missing = ["absent"] if path and not path.endswith("[]") and kinds.total() < _maps(seen, path) else []
        found[path] = sorted([*kinds, *missing])
    return dict(sorted(found.items()))


def _maps(seen: dict[str, Counter[str]], path: str) -> int:
    """How many maps might have had a field."""
    parent = path.rpartition(".")[0]
    return seen[parent]["map"]


def merged(one: Shape, other: Shape) -> Shape:
    """The shape that admits what two admit: a field that one of them hasn't may be absent."""
    found: Shape = {}
    for path in sorted(one.keys() | other.keys()):
        both = path in one and path in other
        missing = [] if both or path.endswith("[]") else ["absent"]
        found[path] = sorted({*one.get(path, ()), *other.get(path, ()), *missing})
    return found


def differences(found: Shape, golden: Shape) -> list[str]:
    """What of a shape the golden one doesn't admit, and what it asks for and never was there.

    How often a field is absent hangs on the time: those with a default are left out where they are equal to it.
    """
    wrong = []
    for path, kinds in found.items():
        allowed = golden.get(path)
        if allowed is None:
            wrong.append(f"{path} is new")
        elif not set(kinds) <= {*allowed, "absent"}:
            wrong.append(f"{path} is {', '.join(kinds)}, not {', '.join(allowed)}")
    for path, kinds in golden.items():
        parent = path.rpartition(".")[0]
        expected = "map" in found.get(parent, ()) and not path.endswith("[]")
        if expected and "absent" not in kinds and path not in found:
            wrong.append(f"{path} is missing")
    return wrong
