"""Open problem (c): continuous steering. A hand drags the tool; the real robot follows over a link."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import ArrayLike

from interfaces.lab.claims import OWN_BAR, Findings, Results, Study, Table, at_most, none_of
from interfaces.lab.doulgeri.script import HOME, limits_used, played, tool, twins
from interfaces.lab.output import INK, MUTED, REAL, VIRTUAL, draw, legend
from interfaces.lab.statistics import bootstrap
from interfaces.link import Conditions, Service, delay_profile
from vrs import Status, SteerCommand
from vrs.comparison import best_lag
from vrs.ledger import Receipt
from vrs.model import Array

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Canvas

PERIOD: Final = 0.02
"""Between inputs [s]."""
STIFFNESS: Final = 6.0
"""How fast the tool is drawn to the hand [1/s]."""
SPAN: Final = 0.09
"""How far the hand goes from where it began, along each axis [m]."""
DELAY: Final = "domain"
CASES: Final = ("0", "1", "2", "3")
"""Hands."""
SOURCE: Final = f"Section VII, (c); {OWN_BAR}"
OVER: Final = 1e-9


def hand(rng: np.random.Generator, length: float) -> tuple[Array, Array]:
    """Where a hand is each 20 ms [m], (k, 3), counted from where it began, and how fast it goes [m/s].

    A sum of slow waves of random direction that begins and ends gently, at rest.
    """
    t = PERIOD * np.arange(int(length / PERIOD))
    waves = np.zeros((len(t), 3))
    for f in (0.11, 0.19, 0.31):
        phase, size = rng.uniform(0, 2 * np.pi, 3), rng.uniform(0.3, 1.0, 3) * 0.2 / f
        waves += size * (np.sin(2 * np.pi * f * t[:, None] + phase) - np.sin(phase))
    window = np.clip(np.minimum(t, t[-1] - t) / 1.5, 0.0, 1.0)
    waves *= (window * window * (3 - 2 * window))[:, None]
    p: Array = SPAN * waves / np.abs(waves).max()
    return p, np.gradient(p, PERIOD, axis=0)


def drag(seed: int, length: float) -> Results:
    """A hand drags the virtual tool for some seconds."""
    rng = np.random.default_rng((seed, 9))
    offsets, speeds = hand(rng, length)
    begin = tool(HOME[None])[0]
    lab = twins(Conditions(delay=delay_profile(DELAY), service=Service.DATAGRAM), rng)
    operator = lab.operator
    begun: list[float] = []
    rejected: list[int] = []

    def pull(k: int, now: float) -> None:
        off = begin + offsets[k] - tool(operator.robot.engine.joints(now)[None])[0]
        twist = np.concatenate((speeds[k] + STIFFNESS * off, np.zeros(3)))
        receipt = operator.robot.execute(SteerCommand(twist=twist, issued_at=now), now=now)
        assert isinstance(receipt, Receipt)
        if receipt.status is Status.REJECTED or receipt.execute_at is None:
            rejected.append(k)
        else:
            begun.append(receipt.execute_at - now)

    start = 1.0
    for k in range(len(offsets)):
        lab.schedule(start + PERIOD * k, partial(pull, k))
    lab.run(start + length + 5.0)
    t = start + PERIOD * np.arange(len(offsets))
    pointer, virtual = begin + offsets, tool(operator.robot.engine.timeline.sample(t))
    play, reference = played(lab)
    rows = np.searchsorted(lab.t, t + 1e-9) - 1
    real = tool(reference.q)
    distance = np.linalg.norm(virtual - pointer, axis=1)
    aside = np.linalg.norm(tool(operator.robot.engine.timeline.sample(play.p)) - real, axis=1)
    return Results(
        following=float(np.sqrt(np.mean(distance**2))),  # virtual tool from the hand, root mean square [m]
        largest=float(distance.max()),  # [m]
        lag=_lag(t, pointer, virtual, 1.0),  # of the virtual tool behind the hand [s]
        answered=max(begun, default=np.inf),  # from an input to the virtual robot's motion by it, at most [s]
        # Largest speed or acceleration of the real robot, as a share of its limit.
        limits=limits_used(reference.qd, reference.qdd),
        rejected=len(rejected),
        inputs=len(offsets),
        real=float(aside.max()),  # real tool from the virtual one's path, at equal timeline time, at most [m]
        real_lag=_lag(t, pointer, real[rows], 2.0),  # of the real tool behind the hand [s]
        t=np.asarray(t - start),  # [s]; then the hand and both tools [m], (k, 3)
        hand=pointer,
        virtual=virtual,
        robot=real[rows],
    )


def _lag(t: ArrayLike, hand: ArrayLike, tool: ArrayLike, longest: float) -> float:
    """Best lag of a tool behind the hand [s]; without end where the tool never moved."""
    lag = best_lag(t, hand, tool, longest)
    return np.inf if lag is None else lag


def work(study: Study, case: str) -> Results | None:
    """Drag with one hand; None where that's more than there are runs."""
    return drag(study.seed + int(case), min(study.length, 10.0)) if int(case) < study.runs else None


def conclude(study: Study, found: tuple[Results | None, ...]) -> Findings:
    """Claims for all hands together, a table with a row a hand."""
    seen = [s for s in found if s is not None]
    following = bootstrap([s.following for s in seen], study.seed)
    lag, behind = (bootstrap([getattr(s, name) for s in seen], study.seed) for name in ("lag", "real_lag"))
    largest, answered = max(s.largest for s in seen), max(s.answered for s in seen)
    limits, real = max(s.limits for s in seen), max(s.real for s in seen)
    rejected, inputs = sum(s.rejected for s in seen), sum(s.inputs for s in seen)
    claims = (
        none_of(f"dragging at 50 inputs a second: inputs rejected, of {inputs}", SOURCE, rejected),
        at_most(
            "an input moves the virtual robot after [s], at most",
            SOURCE, PERIOD, answered, note=", an input's period",
        ),
        at_most("latency: best lag of the virtual tool behind the hand [s]", SOURCE, 0.1, lag),
        at_most("following error: tool from hand, root mean square [m]", SOURCE, 0.01, following),
        at_most("largest distance of tool from hand [m]", SOURCE, 0.03, largest),
        at_most(
            f"limits at the real robot over `{DELAY}`: largest speed or acceleration as a share of its limit",
            SOURCE, 1, limits, slack=OVER,
        ),
        at_most("the real tool is off the virtual one's path by at most [m]", SOURCE, 1e-3, real),
    )  # fmt: skip
    rows = [
        (
            ("hand", str(k + 1)),
            ("following error rms mm", 1e3 * s.following),
            ("largest mm", 1e3 * s.largest),
            ("lag s", s.lag),
            ("real robot's lag s", s.real_lag),
            ("limit used", s.limits),
            ("rejected", s.rejected),
        )
        for k, s in enumerate(seen)
    ]
    title = f"(c) dragging over `{DELAY}`: the real robot is behind by {behind.value:.2f} s on average"
    picture = draw("c-dragging", "(c) a hand drags the tool", _paint, seen[0], height=3.4)
    return Findings(claims, (Table.of("dragging", title, rows),), (picture,))


def _paint(canvas: Canvas, seen: Results) -> None:
    left, right = canvas.subplots(1, 2, width_ratios=(1.0, 1.5))
    middle = seen.hand[0]
    for points, colour, style, name in (
        (seen.hand, INK, (0, (1, 1)), "hand"),
        (seen.virtual, VIRTUAL, "-", "virtual tool"),
    ):
        left.plot(*(1e3 * (points - middle)[:, (1, 2)].T), color=colour, linestyle=style, label=name, linewidth=1.2)
    left.set_aspect("equal", "datalim")
    left.set(xlabel="y, mm", ylabel="z, mm", title="from in front")
    for points, colour, name in (
        (seen.hand, INK, "hand"),
        (seen.virtual, VIRTUAL, "virtual"),
        (seen.robot, REAL, "real"),
    ):
        right.plot(seen.t, 1e3 * (points - middle)[:, 2], color=colour, label=name, linewidth=1.2)
    right.fill_between(
        seen.t,
        1e3 * np.linalg.norm(seen.virtual - seen.hand, axis=1),
        color=MUTED,
        alpha=0.4,
        label="virtual from hand",
    )
    right.set(xlabel="time, s", ylabel="z, mm", title="in time")
    legend(right, columns=2, place="lower right")
    right.margins(y=0.25)
