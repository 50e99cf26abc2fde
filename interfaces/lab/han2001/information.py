"""What a delay does to a sine and how many commands come at once (Fig. 3, 4), and what the filter makes of them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Final

import numpy as np

from interfaces.lab.claims import Figure, Findings, Study, Table, above, at_most, none_of
from interfaces.lab.output import REAL, VIRTUAL, draw, legend
from interfaces.lab.statistics import Estimate, bootstrap
from interfaces.link import Channel, Conditions, Service, delay_profile
from interfaces.link.delays import TraceDelay
from robots.onboard.command_filter import CommandFilter, CommandFilterConfig
from vrs.model import Array

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Canvas

T: Final = 0.1
"""Sampling time [s]."""
LASTING: Final = 60.0
"""Of the sine [s]: six periods."""
DELAYS: Final = (0.05, 0.25, 0.53, 1.0, 2.35, 7.77)
"""T_d of Fig. 4 [s]."""
PROFILE: Final = "country"
"""Of Fig. 3: the paper's long connection."""
NEAR: Final = "domain"


def commands_at_once(T_d: float, service: Service = Service.IN_ORDER) -> int:
    """How many commands come together with one that takes T_d [s], over an ordered link or datagrams."""
    commands = math.ceil(T_d / T) + 10
    late = TraceDelay("one late", (T_d, *[0.0] * commands))
    way: Channel[int] = Channel(Conditions(delay=late, service=service), np.random.default_rng(0))
    for k in range(commands):
        way.send(k, k * T)
    arrivals = [(found.payload, found.arrived) for found in way.receive(T_d + 100.0)]
    # The late one itself isn't one of them.
    return sum(k > 0 and abs(arrived - T_d) < 1e-9 for k, arrived in arrivals)


def received(seed: int, profile: str) -> tuple[Array, Array, Array]:
    """The sine as it's sent, and as the last command received says: times, sent, received, (k,) each."""
    way: Channel[float] = Channel(
        Conditions(delay=delay_profile(profile), service=Service.IN_ORDER), np.random.default_rng([seed, 3])
    )
    t: Array = T * np.arange(round(LASTING / T), dtype=np.float64)
    sent: Array = 5.0 * np.sin(0.2 * math.pi * t) + 5.0
    there = np.empty_like(t)
    value = 5.0
    for k, now in enumerate(t.tolist()):
        way.send(float(sent[k]), now)
        for found in way.receive(now):
            value = found.payload
        there[k] = value
    return t, sent, there


def work(study: Study, _case: str) -> Findings:
    """Both figures."""
    counts = [(T_d, math.floor(T_d / T + 1e-9), commands_at_once(T_d)) for T_d in DELAYS]
    runs, near = ([received(study.seed + k, profile) for k in range(study.runs)] for profile in (PROFILE, NEAR))
    unordered = sum(commands_at_once(T_d, Service.DATAGRAM) != expected for T_d, expected, _ in counts)
    columns = ("T_d [s]", "⌊T_d/T⌋", "counted")
    wrong = sum(expected != found for _, expected, found in counts)
    claims = (
        none_of(
            "N = ⌊T_d/T⌋ commands come at once with one that is T_d late: delays for which it isn't so",
            "Section 2.3, Fig. 4", wrong,
            ("datagrams", unordered),
        ),
        above(
            f"a 0.1 Hz sine is distorted severely under {PROFILE}: rms error as a share of its own rms",
            "Section 2.3, Fig. 3", 0.5, _lost(study, runs), (f"`{NEAR}`, a short connection", _lost(study, near)),
        ),
    )  # fmt: skip
    table = Table("commands_at_once", "Commands at once, T = 0.1 s", columns, tuple(counts))
    return Findings(claims, (table,), (_figure(*runs[0]),))


def _lost(study: Study, runs: Sequence[tuple[Array, Array, Array]]) -> Estimate:
    """Root mean square error of what is received, as a share of the sine's own."""
    size = 5.0 / math.sqrt(2.0)
    return bootstrap([float(np.sqrt(np.mean((there - sent) ** 2))) / size for _, sent, there in runs], study.seed)


def _figure(t: Array, sent: Array, there: Array) -> Figure:
    def paint(canvas: Canvas) -> None:
        ax = canvas.subplots()
        ax.plot(t, sent, color=VIRTUAL, label="sent")
        ax.step(t, there, where="post", color=REAL, label="received")
        ax.set(xlabel="time [s]", ylabel="y(t)")
        legend(ax, columns=2, place="upper right")

    return draw("fig3", f"A sine through the internet ({PROFILE}), Fig. 3", paint)


FILTER_CASES: Final = ((1, 0.05), (5, 0.02), (10, 0.01), (50, 0.01), (150, 0.002), (600, 0.09))
"""N commands, and T_p [s]."""


def last_output(count: int, interval: float) -> float:
    """When a filter gives out the last of so many commands that came at once [s]."""
    queue: CommandFilter[int] = CommandFilter(CommandFilterConfig(interval))
    for k in range(count):
        queue.receive(k, now=0.0)
    return queue.advance(now=1e6)[-1][0]


def work_filter(_study: Study, _case: str) -> Findings:
    """Δt = N(T − T_p), measured."""
    rows = []
    for count, T_p in FILTER_CASES:
        rows.append((count, T_p, count * (T - T_p), last_output(count, T) - last_output(count, T_p)))
    worst = max(abs(measured - formula) for *_, formula, measured in rows)
    # Unmodified, it saves nothing.
    plain = max(formula for _, _, formula, _ in rows)
    text = "the modified filter saves Δt = N(T − T_p): largest deviation from the formula [s]"
    claim = at_most(text, "Section 3.1, Fig. 8", 1e-9, worst, ("the filter as it was, with T", plain))
    columns = ("N", "T_p [s]", "N(T − T_p) [s]", "measured [s]")
    return Findings((claim,), (Table("modified_filter", "The modified filter, T = 0.1 s", columns, tuple(rows)),))
