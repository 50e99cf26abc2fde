"""Section IV-B: CUBO led along a path over bad links, and over narrow ones."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, Final, NamedTuple

import numpy as np

from interfaces.lab.claims import Cell, Claim, Figure, Findings, Study, Table
from interfaces.lab.kim2006.following import Followed, FollowingCase, run
from interfaces.lab.output import BAD, GOOD, MUTED, REAL, VIRTUAL, draw, legend
from interfaces.lab.statistics import Estimate, bootstrap
from interfaces.rsp.schemes import SCHEMES

PROFILES: Final = ("none", "constant:0.1", "domain", "country", "mon", "tue", "wed", "thu", "fri", "lunar")
LOSSES: Final = (0.0, 0.05, 0.1)
CASES: Final = PROFILES
SOURCE: Final = "Section IV-B, Fig. 11"
DRAWN: Final = ("mon", 0.05)
"""The case whose first runs are drawn, with CUBO's body in PyBullet."""
COLOURS: Final = {"rsp": VIRTUAL, "tcp": REAL, "fixed": GOOD, "repeated": BAD}
EQUAL: Final = 0.10
"""Figures nearer than this share are called equal."""


class Pair(NamedTuple):
    """RSP's path error beside another scheme's, seed by seed, over the way that both reached."""

    rsp: tuple[float, ...]
    other: tuple[float, ...]

    @property
    def difference(self) -> Estimate | None:
        """RSP's less the other's [m]; None where no seed has both."""
        return bootstrap(np.subtract(self.rsp, self.other), 0) if self.rsp else None

    @property
    def verdict(self) -> str:
        """Who is nearer to the path: the interval of the difference says so, unless they're within 10 %."""
        found = self.difference
        if found is None:
            return "the other never moved"
        a, b = float(np.mean(self.rsp)), float(np.mean(self.other))
        if abs(a - b) <= EQUAL * max(a, b):
            return "equal"
        if found.high < 0:
            return "rsp"
        return "other" if found.low > 0 else "unclear"


class LinkResult(NamedTuple):
    """One network with one loss."""

    delay: str
    loss: float
    means: dict[str, tuple[float, ...]]
    """By scheme: path error, largest, progress, age, command's age, commands missing, bytes down, bytes up."""
    pairs: dict[str, Pair]
    """RSP beside each other scheme."""


def pair(rsp: list[Followed], other: list[Followed]) -> Pair:
    """Compare seed by seed, up to the last centimetre of the path that both reached."""
    both = [
        (a.error_until(cells), b.error_until(cells))
        for a, b in zip(rsp, other, strict=True)
        if (cells := min(len(a.arrivals), len(b.arrivals))) > 1
    ]
    return Pair(tuple(a for a, _ in both), tuple(b for _, b in both))


def work(study: Study, case: str) -> list[LinkResult]:
    """All losses, schemes and seeds of a delay profile."""
    found = []
    for loss in LOSSES:
        runs = {
            name: [
                run(FollowingCase(name, case, loss, study.seed + k, study.length, "bare"))
                for k in range(study.runs)
            ]
            for name in SCHEMES
        }
        means = {name: tuple(np.mean([one[:8] for one in made], axis=0).tolist()) for name, made in runs.items()}
        pairs = {name: pair(runs["rsp"], made) for name, made in runs.items() if name != "rsp"}
        found.append(LinkResult(case, loss, means, pairs))
    return found


def conclude(study: Study, results: tuple[Any, ...]) -> Findings:
    """A claim a network and loss, and the table of all schemes."""
    found: list[LinkResult] = [one for result in results for one in result]
    claims = tuple(wins_claim(one) for one in found)
    columns = (
        "delay", "loss", "scheme", "path error [cm]", "largest [cm]", "progress", "age of commands [s]",
        "age of a single command [s]", "single commands missing", "to the robot [byte/s]", "from it [byte/s]",
        "nearer to the path",
    )  # fmt: skip
    rows = tuple(_row(one, name) for one in found for name in SCHEMES)
    table = Table(
        "schemes", f"Four schemes on the same links, {study.runs} seeds of {study.length:g} s", columns, rows
    )
    return Findings(claims, (table, wins_table(found)), (_drawn(study), _errors(found)))


def wins_claim(one: LinkResult) -> Claim:
    """RSP's path error beside that of TCP with fixed packets, over one link."""
    beside = one.pairs["tcp"]
    found = beside.difference
    text = f"{one.delay}, loss {one.loss:g}: path error of RSP − TCP with fixed packets, way that both reached [cm]"
    if found is None:
        return Claim(text, SOURCE, "not above 0", "TCP's robot never moved", True)
    ends = (100 * found.low, 100 * found.high)
    return Claim(text, SOURCE, "not above 0", 100 * found.value, beside.verdict != "other", ends)


def _row(one: LinkResult, name: str) -> tuple[Cell, ...]:
    error, largest, progress, age, command, missing, down, up = one.means[name]
    verdict = "" if name == "rsp" else one.pairs[name].verdict.replace("other", name)
    return (
        one.delay, one.loss, name, 100 * error, 100 * largest, progress, _finite(age), _finite(command), missing,
        down, up, verdict,
    )  # fmt: skip


def _finite(value: float) -> Cell:
    return value if math.isfinite(value) else "never"


def wins_table(found: list[LinkResult]) -> Table:
    """Where each scheme is better than RSP, in what."""
    rows: list[tuple[Cell, ...]] = []
    measures: tuple[tuple[str, Callable[[tuple[float, ...]], float]], ...] = (
        ("age of commands", lambda means: means[3]),
        ("age of a single command", lambda means: means[4]),
        ("bytes to the robot", lambda means: means[6]),
    )
    for name in SCHEMES:
        if name == "rsp":
            continue
        nearer = [one for one in found if one.pairs[name].verdict == "other"]
        rows.append((name, "path error", len(nearer), len(found), _said(nearer)))
        for what, of in measures:
            better = [one for one in found if of(one.means[name]) < (1 - EQUAL) * of(one.means["rsp"])]
            rows.append((name, what, len(better), len(found), _said(better)))
    columns = ("scheme", "better than RSP in", "of the networks", "of", "which")
    return Table("wins", "Where another scheme is better than RSP, by more than 10 %", columns, tuple(rows))


def _said(found: list[LinkResult]) -> str:
    return ", ".join(f"{one.delay}/{one.loss:g}" for one in found) or "nowhere"


def _drawn(study: Study) -> Figure:
    delay, loss = DRAWN
    runs = {
        name: run(FollowingCase(name, delay, loss, study.seed, min(study.length, 30.0))) for name in ("rsp", "tcp")
    }

    def paint(canvas: Any) -> None:
        ax = canvas.add_subplot()
        path = runs["rsp"].path
        ax.plot(path[:, 0], path[:, 1], color=MUTED, linestyle=":", linewidth=2.0, label="path")
        for name, made in runs.items():
            ax.plot(made.way[:, 0], made.way[:, 1], color=COLOURS[name], label=name)
        ax.set_aspect("equal", adjustable="datalim")
        ax.set(xlabel="x [m]", ylabel="y [m]")
        ax.set_title(f"CUBO led along a path, delay {delay}, loss {loss:g}, seed {study.seed}")
        legend(ax)

    return draw("paths", "Path following, Fig. 11", paint, height=4.2)


def _errors(found: list[LinkResult]) -> Figure:
    def paint(canvas: Any) -> None:
        ax = canvas.add_subplot()
        names = [f"{one.delay}\n{one.loss:g}" for one in found]
        for name in SCHEMES:
            ax.plot(
                range(len(found)), [100 * one.means[name][0] for one in found], "o-", color=COLOURS[name],
                markersize=3, linewidth=0.8, label=name,
            )  # fmt: skip
        ax.set_xticks(range(len(found)), names, fontsize=5.0, rotation=60)
        ax.set(ylabel="path error, mean over time [cm]", yscale="log")
        ax.set_title("All schemes; a robot that stands has no error, see progress in the table")
        legend(ax, columns=4)

    return draw("path_errors", "Path errors of the schemes", paint, height=3.8)


NARROW_CASES: Final = ("16", "64", "inf")
"""Bandwidth either way [kbit/s]."""


class BandwidthResult(NamedTuple):
    """Of one bandwidth: T fitted, and fixed at 20 ms."""

    fitted: list[tuple[float, ...]]
    fixed: list[tuple[float, ...]]


def work_narrow(study: Study, case: str) -> BandwidthResult:
    """All seeds of a bandwidth, a constant delay of 20 ms."""

    def made(adaptive: bool) -> list[tuple[float, ...]]:
        return [
            run(
                FollowingCase(
                    "rsp",
                    "constant:0.02",
                    0.0,
                    study.seed + k,
                    study.length,
                    "bare",
                    1000.0 * float(case),
                    adaptive,
                )
            )[:8]
            for k in range(study.runs)
        ]

    return BandwidthResult(made(True), made(False))


def conclude_narrow(study: Study, results: tuple[Any, ...]) -> Findings:
    """Where the link is too narrow T fitted makes commands younger; elsewhere it changes nothing."""
    rows, claims = [], []
    for case, found in zip(NARROW_CASES, results, strict=True):
        fitted, fixed = np.array(found.fitted), np.array(found.fixed)
        for name, made in (("fitted", fitted), ("20 ms", fixed)):
            error, largest, progress, age, _, _, down, up = made.mean(axis=0).tolist()
            rows.append((f"{case} kbit/s", name, age, 100 * error, 100 * largest, progress, down, up))
        ages = bootstrap(fitted[:, 3] - fixed[:, 3], study.seed)
        narrow = case == NARROW_CASES[0]
        holds = ages.high < 0 if narrow else abs(ages.value) <= 0.1 * float(fixed[:, 3].mean())
        text = f"{case} kbit/s: age of commands with T fitted − with 20 ms [s]"
        asked = "below 0" if narrow else "within 10 %"
        claims.append(Claim(text, "Section II-B", asked, ages.value, holds, ages.interval))
    columns = (
        "bandwidth", "T", "age of commands [s]", "path error [cm]", "largest [cm]", "progress",
        "to the robot [byte/s]", "from it [byte/s]",
    )  # fmt: skip
    return Findings(tuple(claims), (Table("periods", "T fitted to a narrow link", columns, tuple(rows)),))
