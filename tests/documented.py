"""The commands that README and docs tell a reader to type, what becomes of each in a test, and the files they need.

A command in a block is run: quickly in `make test` where its page is in `QUICK`, else by `make docs-check`. What
stands within a sentence, or has placeholders, is looked up: the command and its options must be there. `ELSEWHERE`
has the few that neither can run, and who does. `python -m tests.documented` prints what runs where.
"""

from __future__ import annotations

import enum
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final

HOME: Final = Path(__file__).resolve().parents[1]
PAGES: Final = (HOME / "README.md", HOME / "CONTRIBUTING.md", *sorted((HOME / "docs").rglob("*.md")))
QUICK: Final = frozenset({"docs/tutorial.md"})
"""Pages whose blocks `make test` runs, but for `LONG`."""
LONG: Final = (
    "vrs demo --commands plan.jsonl --delay none", "vrs compare", "vrs lab", "vrs run",
    "python examples/")  # fmt: skip
"""Of these pages, what `make docs-check` runs; other tests run the examples."""
ELSEWHERE: Final = {
    "make demo": "the gate, .ci/run",
    "make test": "the gate, .ci/run",
    "make slow": "the gate, .ci/run",
    "make reproduce": "by hand, about an hour; tests/interfaces/test_reproduce.py has every part in small",
    "make bench": "by hand; benchmarks/RESULTS.md is what it wrote",
    "make contract": "by hand; make test and make slow have it",
    "python -m tests.contract.golden": "by hand, where results are to change",
    "make soak": "by hand; tests/vrs/test_soak.py has it in small",
    "make faults": "by hand, some nine hours; tests/fault_suite/test_fault_suite.py has every row in small",
    "make docs": "by hand, and tests/test_docs.py checks links and anchors",
    "make docs-check": "itself",
    "docker": "where there's Docker; tests/test_container.py reads the Dockerfile",
    "ping": "a network",
    ". .venv/bin/activate": "the environment is another one in a test",
    "vrs serve --robot-at arm.example": "two machines; tests/interfaces/test_live.py has both on one",
    "vrs serve --robot ipr --room furnished --robot-at arm.example": "two machines, as above",
    "pip install 'vrs-teleop": "a package index",
    "vrs link --listen 7000 --to robot.example": "a machine that isn't there; README has one that is run",
}
"""Beginnings of commands that no test here runs, and who does."""
PROGRAMS: Final = ("vrs", "make", "python", "docker", "cat", "cd", ".", "pip", "ping", "awk")
"""What a line of a block of commands begins with."""
INLINE: Final = ("vrs ", "make ", "python -m ", "pip install ")
"""What a command within a sentence begins with."""
NO_COMMANDS: Final = ("vrs rsp 1 ",)
"""What looks like one and isn't: labels of keys."""
SHORTER: Final = (
    ("vrs reproduce han2001", "--runs 2 --length 4"),
    ("vrs reproduce", "--runs 2 --length 3"),
    ("vrs lab localization", "--runs 2 --length 4 --starts 1"),
    ("vrs lab", "--runs 1 --length 8"),
    ("vrs middleware train", ""),
)
"""What is added to long commands, so that they are run whole but on little."""


class How(enum.StrEnum):
    """What becomes of a command in a test."""

    QUICK = "run by make test"
    CHECK = "run by make docs-check"
    LOOKED_UP = "command and options looked up by make test"
    ELSEWHERE = "elsewhere"


@dataclass(frozen=True, slots=True)
class Told:
    """A command in a page."""

    page: Path
    line: int
    text: str
    """As a shell takes it, without the comment."""
    block: int | None
    """Line at which its block begins; None within a sentence."""
    document: str = ""
    """What follows it as a here-document."""

    def __str__(self) -> str:
        return f"{self.page.relative_to(HOME)}:{self.line}: {self.text}"

    @property
    def how(self) -> How:
        """What becomes of it."""
        if self.text.startswith(tuple(ELSEWHERE)):
            return How.ELSEWHERE
        placeholder = r"[\[\]|]|\b[A-Z]{2,}\b(?<!II)(?<!III)"
        if self.block is None or (self.text.startswith(INLINE) and re.search(placeholder, self.text)):
            return How.LOOKED_UP
        quick = self.page.relative_to(HOME).as_posix() in QUICK and not self.text.startswith(LONG)
        return How.QUICK if quick and not self.serves else How.CHECK

    @property
    def serves(self) -> bool:
        """Whether it goes on until Ctrl-C."""
        if self.text.startswith("vrs replay"):
            return "--headless" not in self.text and "--commands" not in self.text
        return self.text.startswith(("vrs serve", "vrs robot", "vrs link"))

    @property
    def runnable(self) -> str:
        """The same on ports that are free, and on little where it takes long."""
        text = re.sub(r"(--(?:listen|rsp) \S*?):?\d{4}\b", r"\g<1>:0", self.text)
        if text.startswith(("vrs serve", "vrs replay")) and self.serves:
            text += " --port 0"
        more = next((more for begins, more in SHORTER if text.startswith(begins)), "")
        return f"{text} {more}{self.document}".rstrip(" ")


def told() -> list[Told]:
    """Every command of every page, in order."""
    return [command for page in PAGES for command in _told(page)]


def written_files(page: Path) -> dict[str, str]:
    """The files that a page has its reader write, `cat > NAME <<'END'`, by name."""
    found = {}
    for command in _told(page):
        if command.document:
            name = command.text.split()[2]
            found[name] = command.document.removeprefix("\n").removesuffix("END\n")
    return found


def _told(page: Path) -> list[Told]:
    found: list[Told] = []
    whole, fenced, block = "", False, None
    lines = iter(enumerate(page.read_text(encoding="utf-8").splitlines(), 1))
    for number, line in lines:
        text = line.strip()
        fenced ^= text.startswith("```")
        if not line.startswith("    ") or fenced:
            block = None if text else block
            found.extend(Told(page, number, code, None) for code in _inline(line) if not fenced)
        elif whole or text.split(" ")[0] in PROGRAMS:
            block = block or number
            whole += text.removesuffix("\\")
            if not text.endswith("\\"):
                document = "".join(f"\n{body}" for body in _here(lines)) + "\n" if "<<'END'" in whole else ""
                found.append(Told(page, number, _plain(whole), block, document))
                whole = ""
    return found


def _here(lines: Iterator[tuple[int, str]]) -> Iterator[str]:
    """The lines of a here-document, its end included."""
    for _, line in lines:
        yield line.removeprefix("    ")
        if line.strip() == "END":
            return


def _inline(line: str) -> list[str]:
    codes = re.findall(r"(?<!`)`([^`]+)`(?!`)", line)
    return [code for code in codes if code.startswith(INLINE) and not code.startswith(NO_COMMANDS)]


def _plain(line: str) -> str:
    """A command without its comment, and with one space for several."""
    return re.sub(r"\s+", " ", re.sub(r"\s#\s.*$", "", line)).strip()


if __name__ == "__main__":
    for way in How:
        print(f"\n{way}")  # noqa: T201
        for one in told():
            if one.how is way:
                print(f"  {one}")  # noqa: T201
