"""The threat model and the tests: each promise is shown by tests of its number, and each such test is in a row."""

from __future__ import annotations

import ast
import re
from collections import defaultdict
from pathlib import Path

HOME = Path(__file__).resolve().parents[1]
ROW = re.compile(r"^\| (T\d\d) \|(.*)\|$", re.MULTILINE)


def rows() -> list[tuple[str, list[str]]]:
    """Each promise's number, and the tests that it names."""
    text = (HOME / "docs" / "threat-model.md").read_text(encoding="utf-8")
    return [(found[1], re.findall(r"`(test_\w+)`", found[2])) for found in ROW.finditer(text)]


def numbered() -> dict[str, list[str]]:
    """Tests whose names bear a promise's number, by it."""
    found: dict[str, list[str]] = defaultdict(list)
    for path in (HOME / "tests").rglob("test_*.py"):
        text = path.read_text(encoding="utf-8")
        if "def test_t" in text:
            for node in ast.walk(ast.parse(text)):
                if isinstance(node, ast.FunctionDef) and (named := re.match(r"test_(t\d\d)_", node.name)):
                    found[named[1].upper()].append(node.name)
    return found


def test_each_promise_is_shown_by_tests_of_its_number() -> None:
    numbers = [number for number, _ in rows()]
    assert numbers == [f"T{k:02d}" for k in range(1, len(numbers) + 1)]
    assert len(numbers) >= 19
    assert {number: sorted(tests) for number, tests in rows()} == {
        number: sorted(tests) for number, tests in numbered().items()
    }
