"""Try every fault: `python -m tests.fault_suite` writes out/faults, `--docs` brings docs/faults.md up to it."""

from __future__ import annotations

import argparse
import json
import sys
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, fields
from multiprocessing import get_context
from pathlib import Path
from typing import Any

from benchmarks import machine
from benchmarks.page import VERDICTS
from tests.fault_suite.effort import Effort
from tests.fault_suite.rows import ROWS, tried

HOME = Path(__file__).resolve().parents[2]
PAGE = HOME / "docs" / "faults.md"
DATA = "faults.json"
NO = VERDICTS[False]
HEAD = ("fault", "tries", "promised", "seen", "holds")
INTRO = """# Faults, and what was seen

What was promised, how often it was tried, the worst that was seen. `make faults` tries everything and writes
`out/faults`, `python -m tests.fault_suite --only ROW` one row; `--docs` writes this page from what was run last:
[each row](#how-each-is-tried) says how much that was. A try that fails while the machine is held up is made again,
and counted. Of each row but most loads a mechanism is switched off in a copy of the project: it must fail then, by
`tests/fault_suite/test_fault_suite.py`.
"""


def run(name: str, effort: Effort) -> dict[str, Any]:
    """A row in a fresh process; what it is, and how much of it was tried."""
    row, facts = ROWS[name], machine.facts()
    said = {"title": row.title, "text": row.text, "commit": facts["commit"], "load": facts["load"],
            "effort": asdict(effort)}  # fmt: skip
    with ProcessPoolExecutor(1, get_context("spawn")) as process:
        future = process.submit(tried, name, effort)
        error = future.exception()
    if error is not None:
        return said | {"failed": f"{type(error).__name__}: {error}"[:500]}
    return said | future.result()


def lines(found: dict[str, Any]) -> list[str]:
    """The lines of a row in the table: its title, and its figures."""
    if "failed" in found:
        verdict = NO if "commit" in found else ""
        return [_line(f"**{found['title']}**", "", "", found["failed"].replace("|", "\\|"), verdict)]
    rows = [_line(f"**{found['title']}**", "", "", "", "")]
    for one in found["results"]:
        tries = "" if one["tries"] is None else f"{one['tries']:,}"
        rows.append(_line(one["name"], tries, one["promised"], one["seen"], one["holds"]))
    return rows


def _line(*cells: str) -> str:
    return "|" + "".join(f" {cell} |" if cell else " |" for cell in cells)


def page(rows: dict[str, Any]) -> str:
    """The table of all rows, and how each is tried."""
    table = [_line(*HEAD), "|---|--:|---|---|---|"]
    how = []
    for name, row in ROWS.items():
        found = rows.get(name, {"title": row.title, "failed": "not run yet"})
        table += lines(found)
        effort = " ".join(f"--{key} {found['effort'][key]:g}" for key in row.effort if "effort" in found)
        notes = "; ".join(one["note"] for one in found.get("results", ()) if one["note"])
        much = f"{effort}; {found.get('took', 0):.0f} s, the machine's load {found.get('load', '')}. {notes}"
        how += [f"### {row.title}", row.text, "", f"`--only {name}`: {much}", ""]
    held = [one["holds"] == "yes" for found in rows.values() for one in found.get("results", ())]
    unsaid = sum(one["holds"] == "can't say" for found in rows.values() for one in found.get("results", ()))
    failed = [found["title"] for found in rows.values() if "failed" in found]
    summary = f"**{sum(held)} of {len(held)} figures hold.**" + "".join(f" Failed: {title}." for title in failed)
    summary += f" Of {unsaid} the run can't say, as others kept the machine busy." * bool(unsaid)
    late = [row.title for name, row in ROWS.items() if name not in rows]
    summary += f" Not run yet: {'; '.join(late)}." * bool(late)
    commits = ", ".join(sorted({found["commit"].split()[0] for found in rows.values()}))
    return (
        "\n".join([INTRO, summary, f"Run at {commits}.", "", *table, "", "## How each is tried", *how]).rstrip()
        + "\n"
    )


def main(words: list[str]) -> int:
    """Try what the command line asks for; the exit status is 1 if something doesn't hold."""
    parser = argparse.ArgumentParser(prog="python -m tests.fault_suite", description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--only", action="append", metavar="ROW", choices=list(ROWS), help=", ".join(ROWS))
    parser.add_argument(
        "--docs", action="store_true", help="write docs/faults.md from what was run last, and run nothing"
    )
    parser.add_argument("--out", type=Path, default=HOME / "out" / "faults", metavar="DIR")
    for field in fields(Effort):
        parser.add_argument(f"--{field.name}", type=type(field.default), default=field.default)
    asked = vars(parser.parse_args(words))
    out, only, docs = (asked.pop(name) for name in ("out", "only", "docs"))
    effort = Effort(**asked)
    out.mkdir(parents=True, exist_ok=True)
    data = out / DATA
    rows: dict[str, Any] = json.loads(data.read_text(encoding="utf-8")) if data.exists() else {}
    missed = 0
    for name in () if docs else only or ROWS:
        rows[name] = found = run(name, effort)
        print("\n".join(lines(found)), flush=True)  # noqa: T201
        missed += "failed" in found or any(one["holds"] == NO for one in found["results"])
        data.write_text(json.dumps(rows, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
        (out / "faults.md").write_text(page(rows), encoding="utf-8")
    if docs:
        PAGE.write_text(page(rows), encoding="utf-8")
    return int(missed > 0)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
