"""Brings the tables of docs/reproduce up to a run: `.venv/bin/python .ci/figures.py out/reproduce`.

A row of claims is found by its claim, any other table by its head; those of one head come in the run's order. Text
between tables stays: read it.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

from interfaces.lab.claims import interval_said, said

DOCS: Final = Path(__file__).resolve().parents[1] / "docs" / "reproduce"
CLAIMS: Final = "| claim | source | expected | measured | 95 % | holds |"


def _row(cells: list[Any]) -> str:
    return f"| {' | '.join(map(said, cells))} |"


def _claimed(claim: dict[str, Any]) -> str:
    verdict = "yes" if claim["holds"] else "**no**"
    return _row(
        [
            *(claim[name] for name in ("claim", "source", "expected", "measured")),
            interval_said(claim["interval"]),
            verdict,
        ]
    )


def brought_up(text: str, result: dict[str, Any]) -> str:
    """A page with a result's figures.

    Raises:
        ValueError: If the page has a claim that the result hasn't.
    """
    claims = {claim["claim"]: _claimed(claim) for claim in [*result["claims"], *result["timings"]]}
    tables: dict[str, list[list[str]]] = {}
    for table in result["tables"]:
        tables.setdefault(_row(table["columns"]), []).append([_row(cells) for cells in table["rows"]])

    def newest(head: str, rows: list[str]) -> list[str]:
        if head != CLAIMS:
            left = tables.get(head)
            return left.pop(0) if left else rows
        names = [one.removeprefix("| ").split(" | ")[0] for one in rows]
        unknown = [name for name in names if name not in claims]
        if unknown:
            raise ValueError(f"no claims any more: {'; '.join(unknown)}")
        return [claims[name] for name in names]

    return "\n".join(_rewritten(text.split("\n"), newest))


def _rewritten(lines: list[str], newest: Callable[[str, list[str]], list[str]]) -> list[str]:
    """Lines whose tables have other rows."""
    made, k = [], 0
    while k < len(lines):
        made.append(lines[k])
        k += 1
        if k < len(lines) and lines[k].startswith("|--"):
            end = next((i for i in range(k + 1, len(lines)) if not lines[i].startswith("|")), len(lines))
            made += [lines[k], *newest(lines[k - 1], lines[k + 1 : end])]
            k = end
    return made


def _main() -> None:
    for page in sorted(DOCS.glob("*.md")):
        found = Path(sys.argv[1]) / f"{page.stem}.json"
        if found.exists():
            text = page.read_text(encoding="utf-8")
            new = brought_up(text, json.loads(found.read_text(encoding="utf-8")))
            changed = sum(a != b for a, b in zip(text.split("\n"), new.split("\n"), strict=False))
            page.write_text(new, encoding="utf-8")
            print(f"{page.name}: {changed} lines differ")


if __name__ == "__main__":
    _main()
