"""Section IV-B: CUBO led along a path over bad links, and over narrow ones."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any, Final

import numpy as np

from interfaces.lab.claims import OWN_BAR, Cell, Claim, Figure, Findings, Results, Study, Table, at_most, between
from interfaces.lab.kim2006.following import Followed, FollowingCase, run
from interfaces.lab.kim2006.packets import DUTY
from interfaces.lab.kim2006.schemes import LOSS
from interfaces.lab.output import BAD, GOOD, MUTED, REAL, VIRTUAL, draw, legend
from interfaces.lab.statistics import Estimate, bootstrap, ratio

PROFILES: Final = ("none", "constant:0.1", "domain", "country", "mon", "tue", "wed", "thu", "fri", "lunar")
LOSSES: Final = (0.0, 0.05, 0.1)
CASES: Final = PROFILES
SOURCE: Final = "Section IV-B, Fig. 11"
DRAWN: Final = ("mon", 0.05)
"""The case whose first runs are drawn, with CUBO's body in PyBullet."""
COMPARED: Final = ("rsp", "fixed", "tcp", "repeated", "stream")
"""Schemes that follow on all links."""
COLOURS: Final = {"rsp": VIRTUAL, "tcp": REAL, "fixed": GOOD, "repeated": BAD, "stream": MUTED}
EVEN: Final = ("none", "constant:0.1")
"""Profiles under which nothing is late."""
EQUAL: Final = 0.10
"""Figures nearer than this share are called equal; a smaller one is better if it's smaller by more."""


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
            for name in COMPARED
        }
        found.append(
            Results(
                delay=case,
                loss=loss,
                means={name: mean_of(made) for name, made in runs.items()},
                pairs={name: pair(runs["rsp"], made) for name, made in runs.items() if name != "rsp"},
                streamed=pair(runs["stream"], runs["tcp"]),  # RSP's packets on TCP beside TCP with fixed ones
            )
        )
    return found


def mean_of(runs: list[Followed]) -> Results:
    """The means of the figures that are numbers."""
    means = np.mean([one[:8] for one in runs], axis=0).tolist()
    return Results(**dict(zip(Followed._fields, means, strict=False)))


def conclude(study: Study, results: tuple[Any, ...]) -> Findings:
    """A claim a network and loss, where nothing is lost or late another, and the table of all schemes."""
    found: list[Results] = [one for result in results for one in result]
    last = {one.delay: one for one in found}
    claims = (
        *(nearer_claim(one) for one in found),
        *(equal_claim(one, last[one.delay]) for one in found if one.delay in EVEN and not one.loss),
    )
    rows = [_row(one, name) for one in found for name in COMPARED]
    title = f"Schemes on the same links, {study.runs} seeds of {study.length:g} s"
    table = Table.of("schemes", title, rows)
    return Findings(claims, (table, wins_table(found)), (_drawn(study), _errors(found)))


def nearness(pairs: tuple[tuple[float, ...], tuple[float, ...]]) -> Estimate | None:
    """One scheme's path error by another's; None where fewer than two seeds have both."""
    return ratio(*pairs, 0) if len(pairs[0]) >= 2 else None


def compared(
    claim: Callable[[Estimate, tuple[str, Estimate] | None], Claim],
    pairs: tuple[tuple[float, ...], tuple[float, ...]],
    what: str,
    without: tuple[tuple[float, ...], tuple[float, ...]],
    text: str,
) -> Claim:
    """A claim on the ratio of path errors; it isn't shown where robots that are to be compared never moved."""
    measured, other = nearness(pairs), nearness(without)
    if measured is None:
        return Claim(text, SOURCE, f"≤ {1 - EQUAL:g}", "the other's robots never moved", met=True)
    return claim(measured, None if other is None else (what, other))


def nearer_claim(one: Results) -> Claim:
    """RSP is nearer to the path than TCP with fixed packets over a link, and wouldn't be on TCP."""
    text = f"{one.delay}, loss {one.loss:g}: path error of RSP by that of TCP with fixed packets"
    what = "RSP's packets on TCP"
    return compared(partial(at_most, text, SOURCE, 1 - EQUAL), one.pairs["tcp"], what, one.streamed, text)


def equal_claim(one: Results, lossy: Results) -> Claim:
    """Where nothing is late or lost RSP and TCP are equal; with losses they aren't."""
    text = f"{one.delay}, nothing lost: path error of RSP by that of TCP with fixed packets: equal"
    what = f"loss {lossy.loss:g}"
    claim = partial(between, text, OWN_BAR, 1 - EQUAL, 1 + EQUAL)
    return compared(claim, one.pairs["tcp"], what, lossy.pairs["tcp"], text)


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
    for name in COMPARED[1:]:
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
        for name in COMPARED:
            ax.plot(
                range(len(found)), [100 * one.means[name].path_error for one in found], "o-", color=COLOURS[name],
                markersize=3, linewidth=0.8, label=name,
            )  # fmt: skip
        ax.set_xticks(range(len(found)), names, fontsize=5.0, rotation=60)
        ax.set(ylabel="path error, mean over time [cm]", yscale="log")
        ax.set_title("All schemes; a robot that stands has no error, see progress in the table")
        legend(ax, columns=5)

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
    rows, ages = [], {}
    for case, found in zip(NARROW_CASES, results, strict=True):
        fitted, fixed = map(np.array, found)
        for name, made in (("fitted", fitted), ("20 ms", fixed)):
            error, largest, progress, age, _, _, down, up = made.mean(axis=0).tolist()
            rows.append((f"{case} kbit/s", name, age, 100 * error, 100 * largest, progress, down, up))
        ages[case] = fitted[:, 3], fixed[:, 3]
    columns = (
        "bandwidth", "T", "age of commands [s]", "path error [cm]", "largest [cm]", "progress",
        "to the robot [byte/s]", "from it [byte/s]",
    )  # fmt: skip
    narrow, *wide = NARROW_CASES
    young, old = (bootstrap(found, study.seed) for found in ages[narrow])
    text = f"{narrow} kbit/s: age of commands with T fitted [s], no longer than the wheels wait for one"
    changes = {case: bootstrap(np.divide(*ages[case]), study.seed) for case in NARROW_CASES}
    claims = (
        at_most(text, f"Section II-B; {OWN_BAR}", LOSS, young, ("T of 20 ms", old)),
        *(
            between(
                f"{case} kbit/s: age of commands with T fitted by that with 20 ms: equal", OWN_BAR,
                1 - EQUAL, 1 + EQUAL, changes[case], (f"{narrow} kbit/s", changes[narrow]),
            )
            for case in wide
        ),
    )  # fmt: skip
    return Findings(claims, (Table("periods", "T fitted to a narrow link", columns, tuple(rows)),))


_SILENT: Final = " without music"
SIZE_CASES: Final = ("16", "64", "128", "256", f"64{_SILENT}", "inf")
"""Bandwidth either way [kbit/s], with music unless it says so."""
SIZED: Final = ("rsp", "fixed", "padded")
"""Schemes that differ in size alone, or in all but size."""


def work_sizes(study: Study, case: str) -> Results:
    """All seeds of a bandwidth, a constant delay of 20 ms: schemes on the same datagrams."""
    bandwidth, music = 1000.0 * float(case.removesuffix(_SILENT)), 0.0 if case.endswith(_SILENT) else DUTY
    following = FollowingCase(
        "rsp", "constant:0.02", length=study.length, body="bare", bandwidth=bandwidth, music=music
    )
    runs = {
        name: [run(replace(following, scheme=name, seed=study.seed + k)) for k in range(study.runs)]
        for name in SIZED
    }
    return Results(
        means={name: mean_of(made) for name, made in runs.items()},
        pairs={name: pair(runs[name], runs["fixed"]) for name in ("rsp", "padded")},  # beside fixed packets
    )


def _link(case: str) -> str:
    bandwidth = case.removesuffix(_SILENT)
    return f"{bandwidth} kbit/s{_SILENT if case.endswith(_SILENT) else ' with music'}"


def conclude_sizes(_study: Study, results: tuple[Results, ...]) -> Findings:
    """On narrow links RSP's sizes bring it nearer to the path; where there's bandwidth they do nothing."""
    found = dict(zip(SIZE_CASES, results, strict=True))
    *narrow, wide = SIZE_CASES
    claims = []
    for case in narrow:
        text = f"{_link(case)}: path error of RSP by that of fixed packets, both on UDP"
        nearer, one = partial(at_most, text, SOURCE, 1 - EQUAL), found[case]
        claims.append(compared(nearer, one.pairs["rsp"], "RSP's packets filled up", one.pairs["padded"], text))
    text = "bandwidth enough, with music: path error of RSP by that of fixed packets, both on UDP: equal"
    equal, beside = partial(between, text, OWN_BAR, 1 - EQUAL, 1 + EQUAL), "256"
    pairs = found[wide].pairs["rsp"], found[beside].pairs["rsp"]
    claims.append(compared(equal, pairs[0], _link(beside), pairs[1], text))
    rows: list[list[tuple[str, Cell]]] = [
        [
            ("link", _link(case)),
            ("scheme", name),
            ("path error [cm]", 100 * mean.path_error),
            ("progress", mean.progress),
            ("age of commands [s]", _finite(mean.age)),
            ("to the robot [byte/s]", mean.down),
        ]
        for case, one in found.items()
        for name, mean in one.means.items()
    ]
    return Findings(tuple(claims), (Table.of("sizes", "Sizes alone, on the same datagrams", rows),))
