"""What README and docs tell a reader to do works, and what they link to is there."""

from __future__ import annotations

import os
import re
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator
from itertools import groupby
from pathlib import Path
from types import SimpleNamespace

import pytest
import typer

from interfaces.cli.main import app
from tests.documented import ELSEWHERE, HOME, INLINE, PAGES, How, Told, told, written_files

SLOW = os.environ.get("VRS_DOCS_SLOW") == "1"
COMMANDS = told()
RUN = [one for one in COMMANDS if one.how is How.QUICK or (SLOW and one.how is How.CHECK)]
ROOT = typer.main.get_command(app)


def named(page: Path) -> str:
    return page.relative_to(HOME).as_posix()


@pytest.fixture(scope="module")
def stock(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What pages take for granted: the tutorial's plan, the program `vrs`; for the slow ones recordings, too."""
    here = tmp_path_factory.mktemp("stock")
    (here / "bin").mkdir()
    for name, asked in (("vrs", "-m interfaces.cli"), ("python", "")):
        (here / "bin" / name).write_text(f'#!/bin/sh\nexec "{sys.executable}" {asked} "$@"\n')
        (here / "bin" / name).chmod(0o755)
    (here / "plan.jsonl").write_text(written_files(HOME / "docs" / "tutorial.md")["plan.jsonl"])
    if SLOW:
        (here / "ping.txt").write_text("[1.0] 64 bytes from robot.example: icmp_seq=1 ttl=50 time=84.2 ms\n" * 3)
        asked = ["vrs", "demo", "--commands", "plan.jsonl", "--delay", "mon", "--out", "out"]
        subprocess.run(asked, cwd=here, env=around(here), check=True, capture_output=True)
        for name in ("monday.mcap", "tuesday.mcap", "lesson.mcap"):
            shutil.copy(here / "out" / "run.mcap", here / name)
    return here


def around(stock: Path) -> dict[str, str]:
    path = f"{stock / 'bin'}:{os.environ['PATH']}"
    return {**os.environ, "PATH": path, "PYTHONPATH": str(HOME), "COLUMNS": "100"}


@pytest.mark.parametrize("page", sorted({one.page for one in RUN}), ids=named)
def test_a_page_followed_word_by_word_works(page: Path, stock: Path, tmp_path: Path) -> None:
    """Each block in the order of the page, in one directory; a block begins in the checkout, as a reader does."""
    home = tmp_path / "home"
    shutil.copytree(stock, home, ignore=shutil.ignore_patterns("bin"))
    shutil.copytree(HOME / "examples", home / "examples", ignore=shutil.ignore_patterns("__pycache__"))
    for _, block in groupby((one for one in RUN if one.page == page), key=lambda one: one.block):
        at = home
        for one in block:
            if one.text.startswith("cd "):
                at /= one.text.split()[1]
            else:
                (serve if one.serves else run)(one, at, stock)


def run(one: Told, at: Path, stock: Path) -> None:
    done = subprocess.run(
        ["sh", "-c", one.runnable], cwd=at, env=around(stock), stdin=subprocess.DEVNULL, capture_output=True,
        text=True, timeout=900, check=False,
    )  # fmt: skip
    assert done.returncode == 0, f"{one}\n{done.stdout[-2000:]}{done.stderr[-2000:]}"


def serve(one: Told, at: Path, stock: Path) -> None:
    """Start it, wait until it says where it is, and end it by Ctrl-C."""
    process = subprocess.Popen(
        ["sh", "-c", f"exec {one.runnable}"], cwd=at, env=around(stock), stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT, text=True, start_new_session=True,
    )  # fmt: skip
    assert process.stdout is not None
    said = process.stdout.readline()
    process.send_signal(signal.SIGINT)
    said += process.communicate(timeout=60)[0]
    assert process.returncode in {0, 130}, f"{one}\n{said[-2000:]}"
    assert re.search(r":\d+", said), f"{one}\n{said[-2000:]}"


@pytest.mark.parametrize("one", [one for one in COMMANDS if one.text.startswith("vrs ")], ids=str)
def test_a_command_and_its_options_are_there(one: Told) -> None:
    assert strangers(one.text) == []


def strangers(text: str) -> list[str]:
    """What the command line doesn't know of a command: its name, or options."""
    command, words = ROOT, [word for word in re.split(r"[\s\[\]|]+", text)[1:] if word != "--help"]
    while words and hasattr(command, "commands"):
        if words[0] not in command.commands:
            return words[:1]
        command = command.commands[words.pop(0)]
    known = {name for parameter in command.params for name in parameter.opts}
    return [word for word in words if word.startswith("--") and word not in known]


def test_a_stranger_is_seen() -> None:
    assert strangers("vrs fly --high") == ["fly"]
    assert strangers("vrs serve --robot ipr --hover [--port N]") == ["--hover"]
    assert strangers("vrs rsp model nothing") == ["nothing"]


def test_make_has_its_targets() -> None:
    asked = sorted({one.text.split()[1] for one in COMMANDS if one.text.startswith("make ")})
    assert {"demo", "test", "docs", "reproduce"} <= set(asked)
    assert not set(asked) - set(re.findall(r"^([\w-]+):", (HOME / "Makefile").read_text(), re.M))


def test_benchmarks_have_their_names() -> None:
    from benchmarks.__main__ import DETAILS, PARTS

    asked = [re.match(r"python -m benchmarks([. ])(\w+)", one.text) for one in COMMANDS]
    of_their_own = {path.stem for path in (HOME / "benchmarks").glob("*.py") if "__main__" in path.read_text()}
    for how, name in (found.groups() for found in asked if found):
        assert name in {*PARTS, *DETAILS} | (of_their_own if how == "." else set())


def test_nothing_is_told_that_nobody_runs() -> None:
    ways = {way: [one for one in COMMANDS if one.how is way] for way in How}
    assert sum(map(len, ways.values())) == len(COMMANDS)
    assert len(ways[How.QUICK]) >= 6
    assert len(ways[How.CHECK]) >= 40
    assert all(one.text.startswith(INLINE) for one in ways[How.LOOKED_UP])
    used = {begins for begins in ELSEWHERE for one in COMMANDS if one.text.startswith(begins)}
    assert used == set(ELSEWHERE)


@pytest.mark.parametrize("page", PAGES, ids=named)
def test_links_lead_somewhere(page: Path) -> None:
    missing = []
    for target in links(page.read_text(encoding="utf-8")):
        if re.match(r"https?:|mailto:|http", target):
            continue
        file, _, anchor = target.partition("#")
        found = (page.parent / file).resolve() if file else page
        if not found.exists() or (anchor and anchor not in anchors(found)):
            missing.append(target)
    assert missing == []


def links(text: str) -> Iterator[str]:
    text = re.sub(r"```.*?```|`[^`\n]*`", "", text, flags=re.S)
    return (found[1] for found in re.finditer(r"\]\(([^)\s]+)\)", text))


def anchors(page: Path) -> set[str]:
    """The anchors of a page's headings, as the site makes them."""
    from markdown.extensions.toc import slugify

    heads = re.findall(r"^#+ (.+)$", page.read_text(encoding="utf-8"), re.M)
    return {slugify(re.sub(r"[`*]|\]\(.*?\)|\[", "", head), "-") for head in heads}


@pytest.mark.parametrize("page", [page for page in PAGES if page.parent != HOME], ids=named)
def test_lists_and_tables_are_seen_by_the_site(page: Path) -> None:
    """Markdown on GitHub lets a list follow a line of text at once; the site doesn't."""
    fenced, before, wrong = False, SimpleNamespace(text="", kind=""), []
    for number, line in enumerate(page.read_text(encoding="utf-8").splitlines(), 1):
        fenced ^= line.startswith("```")
        kind = "list" if re.match(r"([-*]|\d+\.) ", line) else "table" if re.match(r"\|[ -]", line) else ""
        if kind and not fenced and before.text.strip() and before.kind != kind and not before.text.startswith("#"):
            wrong.append(number)
        before = SimpleNamespace(text=line, kind=kind or (before.kind if line.startswith("  ") else ""))
    assert wrong == []
