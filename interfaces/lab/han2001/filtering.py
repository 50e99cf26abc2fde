"""Section 3.1, Fig. 7 and 8: what the command filter does to N commands that came at once."""

from __future__ import annotations

from typing import Final

from interfaces.lab.claims import Claim, Findings, Study, Table
from robots.onboard.command_filter import CommandFilter, CommandFilterConfig

T: Final = 0.1
"""Sampling time [s]."""
CASES: Final = ((1, 0.05), (5, 0.02), (10, 0.01), (50, 0.01), (150, 0.002), (600, 0.09))
"""N commands, and T_p [s]."""


def last_output(count: int, interval: float) -> float:
    """When a filter gives out the last of so many commands that came at once [s]."""
    queue: CommandFilter[int] = CommandFilter(CommandFilterConfig(interval))
    for k in range(count):
        queue.receive(k, now=0.0)
    return queue.advance(now=1e6)[-1].t


def work(study: Study, case: str) -> Findings:  # noqa: ARG001
    """Δt = N(T − T_p), measured."""
    rows = []
    for count, T_p in CASES:
        rows.append((count, T_p, count * (T - T_p), last_output(count, T) - last_output(count, T_p)))
    worst = max(abs(measured - formula) for *_, formula, measured in rows)
    claim = Claim(
        "the modified filter saves Δt = N(T − T_p): largest deviation from the formula [s]",
        "Section 3.1, Fig. 8",
        "0, to rounding",
        worst,
        worst < 1e-9,
    )
    columns = ("N", "T_p [s]", "N(T − T_p) [s]", "measured [s]")
    return Findings((claim,), (Table("modified_filter", "The modified filter, T = 0.1 s", columns, tuple(rows)),))
