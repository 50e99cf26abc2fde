"""Public programs of VAL-II and V+: `python -m benchmarks.public_programs DIR` checks and runs those in a folder.

Which files are known, and what stands around their programs, is in `public_programs.toml`: the values and signals
of a cell, in our own arrangement. The files themselves aren't ours to give on. They are found by their digests,
whatever they're called: `git show COMMIT:PATH > DIR/NAME` makes one of a repository's copy.

Each program goes through `vrs check`, and through what `vrs run` does, on an ideal body and without CP, so that the
arm stands at each destination. Where it stood is compared with what `destinations.py` says; where it can't go, with
the Toolbox's closed form. What came of it is written to `public_programs.json`, and from there to docs/val2.md.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import re
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path, PurePosixPath
from typing import Any

from benchmarks.destinations import (
    NAME,
    START,
    TURN,
    WAY,
    Destination,
    Joints,
    Text,
    UnforeseenError,
    compared,
    evaluated,
    reachable,
    stood,
    wrapped,
)
from interfaces.cli.run import read as read_program
from interfaces.link import delay_profile
from interfaces.recording import open_recording
from interfaces.recording.run_recorders import RunRecorder
from interfaces.val2.errors import ValError
from interfaces.val2.source import joined
from interfaces.val2.twins import play
from robots import load
from robots.robot import exact_arm

HOME = Path(__file__).resolve().parent
TABLE = HOME / "public_programs.toml"
FOUND = HOME / "public_programs.json"
PAGE = HOME.parent / "docs" / "val2.md"
LIMIT = 900.0
"""When a program is given up [s]."""
MARKS = re.compile(r"(?<=<!-- public programs -->\n).*?(?=<!-- end -->)", re.S)


@dataclass(frozen=True)
class Finding:
    """What came of a program."""

    repository: str
    path: str
    program: str
    destinations: int
    """How many were compared."""
    way: float
    """By how much one was off at most [mm]."""
    turn: float
    """By how much one was off at most [deg]."""
    verdict: str
    reason: str


@dataclass(frozen=True)
class Known:
    """A program of a file that is known."""

    repository: str
    """Empty for ours, which are VAL-II; others are V+."""
    path: str
    sha256: str
    program: str
    values: str
    """The text of a file of values."""
    prelude: str
    files: Mapping[str, str]
    """Digests of files that it reads, by their names."""
    given: Mapping[str, str]
    """Texts of files that it reads and that are ours, by their names."""
    limit: float
    note: str
    """What a reader may want to know of it."""


def known() -> list[Known]:
    """Every program of the table: those of others, and then ours from textbooks' descriptions."""
    rows = []
    for file in tomllib.loads(TABLE.read_text(encoding="utf-8"))["file"]:
        for run in file["run"]:
            sections = (f".{name.upper()}\n{run[name].strip()}\n.END\n" for name in SECTIONS if name in run)
            rows.append(
                Known(
                    file["repository"], file["path"], file["sha256"], run["program"], "".join(sections),
                    run.get("prelude", ""), run.get("files", {}), run.get("given", {}), run.get("limit", LIMIT),
                    run.get("note", ""),
                )
            )  # fmt: skip
    for path in ours():
        name = next(iter(Text(path.read_text(encoding="utf-8"), vplus=False).routines))
        where = path.relative_to(HOME.parent).as_posix()
        rows.append(Known("", where, digest(path), name, "", "", {}, {}, LIMIT, ""))
    return rows


def ours() -> list[Path]:
    """The files of our own programs."""
    return sorted((HOME.parent / "examples" / "val2" / "textbook").glob("*.v2"))


SECTIONS = ("locations", "reals", "signals")
OUT_OF_REACH = ("Location out of range", "Straight line not possible")
GIVEN_UP = "Program given up"


def tried(one: Known, files: Mapping[str, Path]) -> Finding:
    """Check a program, run it, and compare.

    Args:
        one: The program.
        files: Where files are, by their digests.
    """
    path, text = PurePosixPath(one.path), files[one.sha256].read_text(encoding="utf-8")
    lines, dialect = list[str](), "vplus" if one.repository else "val2"
    with tempfile.TemporaryDirectory() as made:
        here = Path(made)
        for name, said in {
            f"{NAME}.v2": wrapped(one.program, one.prelude), path.name: text, "values.lc": one.values
        }.items():  # fmt: skip
            (here / name).write_text(said, encoding="utf-8")
        (here / "files").mkdir()
        contents = {
            name: files[sha256].read_text(encoding="utf-8") for name, sha256 in one.files.items()
        } | one.given
        for name, said in contents.items():
            (here / "files" / name).write_text(said, encoding="utf-8")
            lines += said.splitlines()
        words = (f"{NAME}.v2", path.name, "values.lc")
        checked = checks(here, words, dialect)
        there, error = ran([here / word for word in words], here / "files", here / "run.mcap", one.limit, dialect)
    whole = Text(
        "\n".join([text, one.values, wrapped(one.program, one.prelude)]), bool(one.repository), path.stem.lower()
    )
    return judged(one, whole, lines, there, checked, error)


def checks(here: Path, words: Sequence[str], dialect: str) -> list[Mapping[str, Any]]:
    """The errors that `vrs check` finds."""
    done = subprocess.run(
        [sys.executable, "-m", "interfaces.cli", "check", *words, "--program", NAME, "--dialect", dialect,
         "--files", "files", "--json"],
        capture_output=True, text=True, cwd=here, check=False,
    )  # fmt: skip
    if not done.stdout:
        return [{"what": done.stderr.strip(), "line": None}]
    rows = [row for part in json.loads(done.stdout) for row in part["findings"]]
    return [row for row in rows if row["severity"] == "error"]


def ran(
    paths: Sequence[Path], files: Path, recording: Path, limit: float, dialect: str
) -> tuple[list[Joints], ValError | None]:
    """Where the arm stood, and what the program ended with: as `vrs run` has it, with an ideal body."""
    from interfaces.cli.options import dialect_of

    recorder = RunRecorder(recording)
    try:
        source = joined([read_program(path, dialect_of(dialect)) for path in paths], NAME)
        played = play(
            source, load("puma560"), delay_profile("none"),
            seed=1, arm=exact_arm, limit=limit, files=files, keeper=recorder,
        )  # fmt: skip
    except ValError as error:
        return [], error
    recorder.finish()
    with open_recording(recording) as opened:
        return stood(opened.timeline), played.error


def judged(
    one: Known,
    text: Text,
    lines: Sequence[str],
    there: Sequence[Joints],
    checked: Sequence[Mapping[str, Any]],
    error: ValError | None,
) -> Finding:
    """What a program's run is worth.

    Args:
        one: The program.
        text: Its text, and what stands around it.
        lines: What it reads.
        there: Where the arm stood.
        checked: Errors that `vrs check` found.
        error: What the run ended with, if it didn't end well.
    """
    n, wanted, unforeseen = len(there), list[Destination](), ""
    try:
        wanted = evaluated(text, there, lines)
    except UnforeseenError as what:
        unforeseen = str(what)
    way, turn = compared(wanted, there)
    line = 0 if error is None or error.step is None else text.routines[error.program].line + error.step
    told = "" if error is None else f"{f'line {line}: ' if line else ''}{error.what}: {error.detail}"
    # What check finds in the text keeps it from planning.
    texts = [row for row in checked if row["what"] not in OUT_OF_REACH]
    full = n == len(wanted) and len(texts) == len(checked)
    if n > len(wanted) or way > WAY or turn > TURN:
        many = f"{n} motions, the evaluation has {len(wanted)} {unforeseen}".rstrip()
        verdict, reason = WRONG, many if n > len(wanted) else "it stood elsewhere"
    elif (error is None or error.what == GIVEN_UP) and full:
        verdict, reason = RIGHT if n else STILL, "it has no end, and is given up" if error else ""
    elif error is None or error.what == GIVEN_UP:
        verdict = WRONG
        reason = "; ".join([f"{n} motions of {len(wanted)}", *(row["what"] for row in checked)])
    elif error.what in OUT_OF_REACH and n < len(wanted):
        seen = bool(texts) or any(row["what"] == error.what and row["line"] == line for row in checked)
        agreed = wanted[n].line == line and not reachable(there[-1] if n else START, wanted[n])
        verdict, reason = (AS_FAR if seen and agreed else WRONG), told
    else:
        verdict, reason = STOPS if line else REFUSED, told
    if verdict != STOPS:
        reason = "; ".join(filter(None, (reason, *(f"check, line {row['line']}: {row['what']}" for row in texts))))
    reason = "; ".join(filter(None, (reason, one.note)))
    return Finding(
        one.repository, one.path, one.program, min(n, len(wanted)), round(way, 6), round(turn, 6), verdict, reason
    )


RIGHT, AS_FAR, STILL = "right", "right as far as the arm reaches", "no motion"
STOPS, REFUSED, WRONG = "stops", "refused", "wrong"


# The table.


def table(findings: Sequence[Finding]) -> str:
    """What docs/val2.md shows of them."""
    rows = ["| program | destinations | off by [mm] | [deg] | verdict | reason |", "|---|--:|--:|--:|---|---|"]
    for one in findings:
        off = (f"{one.way:.6f}", f"{one.turn:.6f}") if one.destinations else ("", "")
        reason = one.reason.replace("|", r"\|")
        name = " ".join([f"`{one.repository}`"] * bool(one.repository) + [f"`{one.path}`: `{one.program}`"])
        rows.append(f"| {name} | {one.destinations or ''} | {off[0]} | {off[1]} | {one.verdict} | {reason} |")
    return "\n".join(["", *rows, "", ""])


def read() -> list[Finding]:
    """What was found last."""
    return [Finding(**row) for row in json.loads(FOUND.read_text(encoding="utf-8"))]


def whole(findings: Sequence[Finding]) -> list[Finding]:
    """The table with what is new: the others are as they were found last."""
    rows = {key(one): one for one in [*(read() if FOUND.exists() else []), *findings]}
    return [rows[key(one)] for one in known() if key(one) in rows]


def key(one: Known | Finding) -> tuple[str, str, str]:
    """What tells programs apart."""
    return one.repository, one.path, one.program


def page(findings: Sequence[Finding]) -> str:
    """docs/val2.md with their table."""
    return MARKS.sub(lambda _: table(findings), PAGE.read_text(encoding="utf-8"))


def main(words: Sequence[str]) -> int:
    """Try the programs of a directory."""
    parser = argparse.ArgumentParser(prog="benchmarks.public_programs", description=__doc__)
    parser.add_argument("directory", type=Path, metavar="DIR", help="where the files are")
    parser.add_argument(
        "--only", action="append", metavar="NAME", help="programs whose path or name has this; may be repeated"
    )
    parser.add_argument("--write", action="store_true", help=f"write {FOUND.name} and the table in {PAGE.name}")
    asked = parser.parse_args(words)
    found = sorted(file for file in asked.directory.rglob("*") if file.is_file())
    files = {digest(file): file for file in [*found, *ours()]}
    findings = []
    for one in known():
        if asked.only and not any(name in f"{one.path} {one.program}" for name in asked.only):
            continue
        if not {one.sha256, *one.files.values()} <= files.keys():
            print(f"{one.repository} {one.path}: not in {asked.directory}", file=sys.stderr)
            continue
        findings.append(tried(one, files))
        print(*asdict(findings[-1]).values(), sep=" | ", flush=True)
    if asked.write:
        findings = whole(findings)
        FOUND.write_text(
            json.dumps([asdict(one) for one in findings], indent=1, ensure_ascii=False) + "\n", "utf-8"
        )
        PAGE.write_text(page(findings), "utf-8")
    return int(any(one.verdict == WRONG for one in findings))


def digest(file: Path) -> str:
    """A file's SHA-256."""
    return hashlib.sha256(file.read_bytes()).hexdigest()


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
