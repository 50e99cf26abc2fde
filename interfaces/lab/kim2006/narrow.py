"""Section II-B: T is optimized at run time. A link that is too narrow for 20 ms, with T fitted and without."""

from __future__ import annotations

from typing import Any, Final, NamedTuple

import numpy as np

from interfaces.lab.claims import Claim, Findings, Study, Table
from interfaces.lab.kim2006.following import FollowingCase, run
from interfaces.lab.statistics import bootstrap

CASES: Final = ("16", "64", "inf")
"""Bandwidth either way [kbit/s]."""


class BandwidthResult(NamedTuple):
    """Of one bandwidth: T fitted, and fixed at 20 ms."""

    fitted: list[tuple[float, ...]]
    fixed: list[tuple[float, ...]]


def work(study: Study, case: str) -> BandwidthResult:
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


def conclude(study: Study, results: tuple[Any, ...]) -> Findings:
    """Where the link is too narrow T fitted makes commands younger; elsewhere it changes nothing."""
    rows, claims = [], []
    for case, found in zip(CASES, results, strict=True):
        fitted, fixed = np.array(found.fitted), np.array(found.fixed)
        for name, made in (("fitted", fitted), ("20 ms", fixed)):
            error, largest, progress, age, _, _, down, up = made.mean(axis=0).tolist()
            rows.append((f"{case} kbit/s", name, age, 100 * error, 100 * largest, progress, down, up))
        ages = bootstrap(fitted[:, 3] - fixed[:, 3], study.seed)
        narrow = case == CASES[0]
        holds = ages.high < 0 if narrow else abs(ages.value) <= 0.1 * float(fixed[:, 3].mean())
        text = f"{case} kbit/s: age of commands with T fitted − with 20 ms [s]"
        asked = "below 0" if narrow else "within 10 %"
        claims.append(Claim(text, "Section II-B", asked, ages.value, holds, ages.interval))
    columns = (
        "bandwidth", "T", "age of commands [s]", "path error [cm]", "largest [cm]", "progress",
        "to the robot [byte/s]", "from it [byte/s]",
    )  # fmt: skip
    return Findings(tuple(claims), (Table("periods", "T fitted to a narrow link", columns, tuple(rows)),))
