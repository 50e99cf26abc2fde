"""Section IV-B: CUBO led along a path over bad links, and over narrow ones."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any, Final

import numpy as np

from interfaces.lab.claims import Cell, Claim, Figure, Findings, Results, Study, Table
from interfaces.lab.kim2006.following import Followed, FollowingCase, run
from interfaces.lab.kim2006.schemes import SCHEMES
from interfaces.lab.output import BAD, GOOD, MUTED, REAL, VIRTUAL, draw, legend
from interfaces.lab.statistics import Estimate, bootstrap

PROFILES: Final = ("none", "constant:0.1", "domain", "country", "mon", "tue", "wed", "thu", "fri", "lunar")
LOSSES: Final = (0.0, 0.05, 0.1)
CASES: Final = PROFILES
SOURCE: Final = "Section IV-B, Fig. 11"
DRAWN: Final = ("mon", 0.05)
"""The case whose first runs are drawn, with CUBO's body in PyBullet."""
COLOURS: Final = {"rsp": VIRTUAL, "tcp": REAL, "fixed": GOOD, "repeated": BAD}
EQUAL: Final = 0.10
"""Figures nearer than this share are called equal."""


def difference(rsp: tuple[float, ...], other: tuple[float, ...]) -> Estimate | None:
    """RSP's path error less another scheme's, seed by seed [m]; None where no seed has both."""
    return bootstrap(np.subtract(rsp, other), 0) if rsp else None


def verdict(rsp: tuple[float, ...], other: tuple[float, ...]) -> str:
    """Who is nearer to the path: the interval of the difference says so, unless they're within 10 %."""
    found = difference(rsp, other)
    if found is None:
        return "the other never moved"
    a, b = float(np.mean(rsp)), float(np.mean(other))
    if abs(a - b) <= EQUAL * max(a, b):
        return "equal"
    if found.high < 0:
        return "rsp"
    return "other" if found.low > 0 else "unclear"


def pair(rsp: list[Followed], other: list[Followed]) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Path errors of both, seed by seed, up to the last centimetre of the path that both reached."""
    both = [
        (a.error_until(cells), b.error_until(cells))
        for a, b in zip(rsp, other, strict=True)
        if (cells := min(len(a.arrivals), len(b.arrivals))) > 1
    ]
    return tuple(a for a, _ in both), tuple(b for _, b in both)


def work(study: Study, case: str) -> list[Results]:
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
        found.append(
            Results(
                delay=case,
                loss=loss,
                means={name: mean_of(made) for name, made in runs.items()},
                pairs={name: pair(runs["rsp"], made) for name, made in runs.items() if name != "rsp"},
            )
        )
    return found


def mean_of(runs: list[Followed]) -> Results:
    """The means of the figures that are numbers."""
    means = np.mean([one[:8] for one in runs], axis=0).tolist()
    return Results(**dict(zip(Followed._fields, means, strict=False)))


def conclude(study: Study, results: tuple[Any, ...]) -> Findings:
    """A claim a network and loss, and the table of all schemes."""
    found: list[Results] = [one for result in results for one in result]
    claims = tuple(wins_claim(one) for one in found)
    rows = [_row(one, name) for one in found for name in SCHEMES]
    title = f"Four schemes on the same links, {study.runs} seeds of {study.length:g} s"
    table = Table.of("schemes", title, rows)
    return Findings(claims, (table, wins_table(found)), (_drawn(study), _errors(found)))


def wins_claim(one: Results) -> Claim:
    """RSP's path error beside that of TCP with fixed packets, over one link."""
    found = difference(*one.pairs["tcp"])
    text = f"{one.delay}, loss {one.loss:g}: path error of RSP − TCP with fixed packets, way that both reached [cm]"
    if found is None:
        return Claim(text, SOURCE, "not above 0", "TCP's robot never moved", True)
    ends = (100 * found.low, 100 * found.high)
    return Claim(text, SOURCE, "not above 0", 100 * found.value, verdict(*one.pairs["tcp"]) != "other", ends)


def _row(one: Results, name: str) -> tuple[tuple[str, Cell], ...]:
    mean = one.means[name]
    return (
        ("delay", one.delay),
        ("loss", one.loss),
        ("scheme", name),
        ("path error [cm]", 100 * mean.path_error),
        ("largest [cm]", 100 * mean.path_error_max),
        ("progress", mean.progress),
        ("age of commands [s]", _finite(mean.age)),
        ("age of a single command [s]", _finite(mean.command_age)),
        ("single commands missing", mean.commands_missing),
        ("to the robot [byte/s]", mean.down),
        ("from it [byte/s]", mean.up),
        ("nearer to the path", "" if name == "rsp" else verdict(*one.pairs[name]).replace("other", name)),
    )


def _finite(value: float) -> Cell:
    return value if math.isfinite(value) else "never"


def wins_table(found: list[Results]) -> Table:
    """Where each scheme is better than RSP, in what."""
    rows: list[tuple[Cell, ...]] = []
    measures = (
        ("age of commands", "age"),
        ("age of a single command", "command_age"),
        ("bytes to the robot", "down"),
    )
    for name in SCHEMES:
        if name == "rsp":
            continue
        nearer = [one for one in found if verdict(*one.pairs[name]) == "other"]
        rows.append((name, "path error", len(nearer), len(found), _said(nearer)))
        for what, field in measures:
            better = [
                one
                for one in found
                if getattr(one.means[name], field) < (1 - EQUAL) * getattr(one.means["rsp"], field)
            ]
            rows.append((name, what, len(better), len(found), _said(better)))
    columns = ("scheme", "better than RSP in", "of the networks", "of", "which")
    return Table("wins", "Where another scheme is better than RSP, by more than 10 %", columns, tuple(rows))


def _said(found: list[Results]) -> str:
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


def _errors(found: list[Results]) -> Figure:
    def paint(canvas: Any) -> None:
        ax = canvas.add_subplot()
        names = [f"{one.delay}\n{one.loss:g}" for one in found]
        for name in SCHEMES:
            ax.plot(
                range(len(found)), [100 * one.means[name].path_error for one in found], "o-", color=COLOURS[name],
                markersize=3, linewidth=0.8, label=name,
            )  # fmt: skip
        ax.set_xticks(range(len(found)), names, fontsize=5.0, rotation=60)
        ax.set(ylabel="path error, mean over time [cm]", yscale="log")
        ax.set_title("All schemes; a robot that stands has no error, see progress in the table")
        legend(ax, columns=4)

    return draw("path_errors", "Path errors of the schemes", paint, height=3.8)


NARROW_CASES: Final = ("16", "64", "inf")
"""Bandwidth either way [kbit/s]."""


def work_narrow(study: Study, case: str) -> tuple[list[Any], list[Any]]:
    """All seeds of a bandwidth, a constant delay of 20 ms: T fitted, and fixed at 20 ms."""
    following = FollowingCase(
        "rsp", "constant:0.02", length=study.length, body="bare", bandwidth=1000.0 * float(case)
    )

    fitted, fixed = (
        [run(replace(following, seed=study.seed + k, adaptive=adaptive))[:8] for k in range(study.runs)]
        for adaptive in (True, False)
    )
    return fitted, fixed


def conclude_narrow(study: Study, results: tuple[Any, ...]) -> Findings:
    """Where the link is too narrow T fitted makes commands younger; elsewhere it changes nothing."""
    rows, claims = [], []
    for case, found in zip(NARROW_CASES, results, strict=True):
        fitted, fixed = map(np.array, found)
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
