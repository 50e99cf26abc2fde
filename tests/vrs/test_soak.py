"""The laws on random edits of every kind, as many as VRS_SOAK_EDITS says; `make soak` makes a million of them.

As a program it prints what was made and the worst figure of each law, or with BASE SHARD SESSION replays a session;
VRS_SOAK_ON has a Dask scheduler's workers, or another executor's, make the shards.
"""

from __future__ import annotations

import os
import sys
from collections import Counter
from concurrent.futures import Executor, ProcessPoolExecutor, as_completed
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from functools import cache

import pytest
from rich.console import Console
from rich.markup import escape
from rich.progress import Progress, TextColumn, TimeRemainingColumn
from rich.table import Table

from robots import puma560
from tests.vrs.laws import BOUNDS, Figures, LawBrokenError
from tests.vrs.sessions import Generator, Session, lines_are_planned
from vrs import Status
from vrs.errors import VrsError

EDITS = int(os.environ.get("VRS_SOAK_EDITS", "3000"))
SEED = int(os.environ.get("VRS_SOAK_SEED", "4"))
SHARD = 375 if EDITS <= 10_000 else 2_500
SESSION = 40
SHARDS = max(1, -(-EDITS // SHARD))
MODEL = puma560.model()
LEAST = {
    "move: splice": 40, "move: append": 40, "move: replace": 18, "move: parabolic": 60, "move: jerk-limited": 60,
    "move: line": 8, "move: pose": 25, "move: rounded": 18, "move: continuous": 18,
    "move: pace": 20, "move: acceleration": 15, "move: tool": 30, "steer: rates": 25, "steer: twist in base": 10,
    "steer: twist in tool": 10, "retime": 12, "cancel": 12, "via": 7, "via: rounded": 3, "scaletime": 9, "stop": 18,
    "resume": 9, "undo": 25, "parameterchange": 5, "positionquery": 8, "branch": 2,
}  # fmt: skip
"""How many of each kind are to be carried out, of a thousand."""
DONE = {Status.ACCEPTED.value, Status.POSTPONED.value, "answered", "made"}


@dataclass
class Result:
    """What a shard saw."""

    edits: int = 0
    figures: Figures = field(default_factory=Figures)
    answers: Counter = field(default_factory=Counter)
    reasons: Counter = field(default_factory=Counter)
    broken: list[str] = field(default_factory=list)

    def add(self, other: Result) -> None:
        self.edits += other.edits
        self.figures.add(other.figures)
        self.answers += other.answers
        self.reasons += other.reasons
        self.broken += other.broken

    def rare(self) -> dict[str, int]:
        """Kinds of which too few were carried out."""
        done = Counter()
        for (kind, outcome), count in self.answers.items():
            done[kind] += count if outcome in DONE else 0
        asked = {kind: least for kind, least in LEAST.items() if lines() or kind != "move: line"}
        return {kind: done[kind] for kind, least in asked.items() if done[kind] < least * self.edits / 1000}


@cache
def lines() -> bool:
    return lines_are_planned(MODEL)


def session(seed: list[int], figures: Figures) -> Session:
    return Session(MODEL, Generator(seed), figures, lines=lines())


def soak(shard: int, edits: int) -> Result:
    result, number = Result(), 0
    while result.edits < edits:
        seed = [SEED, shard, number]
        one = session(seed, result.figures)
        try:
            one.go_on(min(SESSION, edits - result.edits))
            one.audit()
        except LawBrokenError as error:
            result.broken.append(f"session {seed}, command {len(one.script)}: {error}")
        except Exception as error:  # noqa: BLE001
            # A crash is told with its seed, as a broken law is.
            result.broken.append(f"session {seed}, command {len(one.script)}: {type(error).__name__} {error}")
        result.edits += max(len(one.script), 1)
        result.answers += one.answers
        result.reasons += one.reasons
        number += 1
    return result


@pytest.mark.parametrize("shard", range(SHARDS))
def test_laws_hold_on_edits_of_every_kind(shard: int) -> None:
    result = soak(shard, min(SHARD, EDITS - shard * SHARD))
    assert not result.broken, "\n".join(result.broken)
    assert set(result.figures.worst) == set(BOUNDS) or result.edits < 300
    if result.edits >= 2000:
        assert not result.rare(), result.rare()


def tables(total: Result, console: Console) -> None:
    kinds = Table("kind", "accepted", "postponed", "rejected", "other", title=f"{total.edits} edits")
    for kind in sorted({kind for kind, _ in total.answers}):
        mine = Counter({outcome: n for (name, outcome), n in total.answers.items() if name == kind})
        known = [mine.pop(status.value, 0) for status in (Status.ACCEPTED, Status.POSTPONED, Status.REJECTED)]
        other = ", ".join(f"{outcome} {count}" for outcome, count in sorted(mine.items()))
        kinds.add_row(kind, *map(str, known), other)
    laws = Table("law", "worst", "allowed")
    for law, bound in BOUNDS.items():
        laws.add_row(escape(law), f"{total.figures.worst.get(law, float('nan')):.3g}", f"{bound:g}")
    reasons = Table("count", "kind", "rejected because")
    for (kind, reason), count in total.reasons.most_common(40):
        reasons.add_row(str(count), kind, escape(reason))
    for table in (kinds, laws, reasons):
        console.print(table)


def main() -> int:
    console, total = Console(), Result()
    if on := os.environ.get("VRS_SOAK_ON", ""):
        # Workers elsewhere find what they're told by the module's name, which this process has as a program.
        from interfaces.lab.executors import executor
        from tests.vrs.test_soak import soak as work

        who: AbstractContextManager[Executor] = executor(on, console.print)
    else:
        who, work = ProcessPoolExecutor(os.cpu_count() or 1), soak
    lines()  # what loads late is loaded once, before the workers are forked
    columns = (
        *Progress.get_default_columns()[:-1],
        TextColumn("{task.fields[broken]} laws broken"),
        TimeRemainingColumn(),
    )
    with who as pool, Progress(*columns, console=console) as progress:
        task = progress.add_task("edits", total=EDITS, broken=0)
        shards = [pool.submit(work, k, min(SHARD, EDITS - k * SHARD)) for k in range(SHARDS)]
        for done in as_completed(shards):
            result = done.result()
            total.add(result)
            progress.update(task, advance=result.edits, broken=len(total.broken))
            for line in result.broken:
                console.print(line, markup=False, soft_wrap=True)
    tables(total, console)
    rare = total.rare() if total.edits >= 2000 else {}
    if rare:
        console.print(f"too few of these were carried out: {rare}")
    console.print(f"{len(total.broken)} laws broken")
    return 1 if total.broken or rare else 0


def replay(seed: list[int]) -> int:
    console, one = Console(soft_wrap=True), session(seed, Figures())
    try:
        one.go_on(SESSION)
        one.audit()
    except (LawBrokenError, VrsError) as error:
        console.print(str(error), markup=False)
    for now, command in one.script:
        console.print(f"{now!r}: {'undo' if command is None else command}", markup=False)
    return 0


if __name__ == "__main__":
    sys.exit(replay([int(word) for word in sys.argv[1:]]) if len(sys.argv) > 1 else main())
