"""Open problem (c): continuous steering. A hand drags the tool; the real robot follows over a link."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Final, TypeAlias

import numpy as np
from numpy.typing import ArrayLike
from typing_extensions import override

from interfaces.lab.claims import OWN_BAR, Findings, Results, Study, Table, at_most
from interfaces.lab.doulgeri.rivals import RobotMaker, adaptive, jumping, postponing
from interfaces.lab.doulgeri.script import HOME, MODEL, limits_used, played, tool, twins
from interfaces.lab.output import INK, MUTED, REAL, VIRTUAL, draw, legend
from interfaces.lab.statistics import bootstrap
from interfaces.link import Conditions, Service, delay_profile
from interfaces.station.dragging import PERIOD, DragLaw
from vrs import Insertion, JointTarget, MotionCommand, Status, SteerCommand
from vrs.commands import Command
from vrs.comparison import best_lag
from vrs.ledger import Receipt
from vrs.model import Array

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Canvas

LENGTH: Final = 10.0
"""For how long a hand drags [s]."""
SPAN: Final = 0.09
"""How far the hand goes from where it began, along each axis [m]."""
DELAY: Final = "domain"
CASES: Final = ("0", "1", "2", "3")
"""Hands."""
SOURCE: Final = f"Section VII, (c); {OWN_BAR}"
OVER: Final = 1e-9

Giver: TypeAlias = Callable[[float, Array, Array], Command]
"""Makes a command of an input: time [s], where the hand is [m], (3,), and the joints [rad], (n,)."""


class Proportional(DragLaw):
    """Feedback alone: what the hand's speed is isn't asked."""

    @override
    def speed(self, t: float, hand: Array, tool: Array, fastest: float) -> Array:
        self._t = None
        return super().speed(t, hand, tool, fastest)


def hand(rng: np.random.Generator) -> Array:
    """Where a hand is at each input [m], (k, 3), counted from where it began.

    A sum of slow waves of random direction that begins and ends gently, at rest.
    """
    t = PERIOD * np.arange(int(LENGTH / PERIOD))
    waves = np.zeros((len(t), 3))
    for f in (0.11, 0.19, 0.31):
        phase, size = rng.uniform(0, 2 * np.pi, 3), rng.uniform(0.3, 1.0, 3) * 0.2 / f
        waves += size * (np.sin(2 * np.pi * f * t[:, None] + phase) - np.sin(phase))
    window = np.clip(np.minimum(t, t[-1] - t) / 1.5, 0.0, 1.0)
    waves *= (window * window * (3 - 2 * window))[:, None]
    p: Array = SPAN * waves / np.abs(waves).max()
    return p


def steering(law: DragLaw) -> Giver:
    """Inputs by a law."""

    def give(now: float, hand: Array, q: Array) -> SteerCommand:
        speed = law.speed(now, hand, tool(q[None])[0], MODEL.tool_speed)
        return SteerCommand(twist=np.concatenate((speed, np.zeros(3))), issued_at=now)

    return give


def queueing() -> Giver:
    """A move to where the hand is for each input, behind those that were given before."""
    pose, near = np.array(MODEL.forward(HOME)), HOME

    def give(now: float, hand: Array, _: Array) -> MotionCommand:
        nonlocal near
        pose[:3, 3] = hand
        near = MODEL.inverse_near(pose, near)
        return MotionCommand(JointTarget(near), now, insertion=Insertion.APPEND)

    return give


def drag(seed: int, give: Giver, robot: RobotMaker) -> Results:
    """A hand drags the virtual tool for some seconds.

    Args:
        seed: Of the hand and the link.
        give: Makes a command of each input.
        robot: Makes the robot's site.
    """
    rng = np.random.default_rng((seed, 9))
    offsets = hand(rng)
    begin = tool(HOME[None])[0]
    lab = twins(Conditions(delay=delay_profile(DELAY), service=Service.DATAGRAM), rng, robot)
    operator = lab.operator
    begun: list[float] = []
    rejected: list[int] = []

    def pull(k: int, now: float) -> None:
        receipt = operator.robot.execute(give(now, begin + offsets[k], operator.robot.engine.joints(now)), now=now)
        assert isinstance(receipt, Receipt)
        if receipt.status is Status.REJECTED or receipt.execute_at is None:
            rejected.append(k)
        else:
            begun.append(max(receipt.execute_at - now, 0.0))

    start = 1.0
    for k in range(len(offsets)):
        lab.schedule(start + PERIOD * k, partial(pull, k))
    lab.run(start + LENGTH + 5.0)
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
        limits=limits_used(reference.q, float(lab.t[1] - lab.t[0])),
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


def work(study: Study, case: str) -> dict[str, Results]:
    """Drag with one hand, by the page's law and by feedback alone; nothing where that's more than there are runs.

    With the first hand also the others: moves that queue, and a robot that has no law, or postpones.
    """
    number = int(case)
    if number >= study.runs:
        return {}
    seed = study.seed + number
    seen = {
        "ours": drag(seed, steering(DragLaw()), adaptive),
        "proportional": drag(seed, steering(Proportional()), adaptive),
    }
    if number == 0:
        seen["queue"] = drag(seed, queueing(), adaptive)
        for name, robot in (("jumps", jumping), ("postpones", postponing(0.0))):
            seen[name] = drag(seed, steering(DragLaw()), robot)
    return seen


def conclude(study: Study, found: tuple[dict[str, Results], ...]) -> Findings:
    """Claims for all hands together, a table with a row a hand."""
    hands = [seen for seen in found if seen]
    seen, others = [one["ours"] for one in hands], [one["proportional"] for one in hands]
    behind = bootstrap([s.real_lag for s in seen], study.seed)
    lag, other_lag = (bootstrap([s.lag for s in x], study.seed) for x in (seen, others))
    following, other_following = (bootstrap([s.following for s in x], study.seed) for x in (seen, others))
    law = "feedback alone, without the hand's speed"
    first = hands[0]
    claims = (
        at_most(
            f"dragging at {1 / PERIOD:g} inputs a second: an input moves the virtual robot after [s], at most",
            SOURCE, PERIOD, max(s.answered for s in seen),
            ("a move for each, behind those before", first["queue"].answered), note=", an input's period",
        ),
        at_most(
            "latency: best lag of the virtual tool behind the hand [s]", SOURCE, 0.1, lag, (law, other_lag)
        ),
        at_most(
            "following error: tool from hand, root mean square [m]", SOURCE, 0.01, following, (law, other_following)
        ),
        at_most(
            "largest distance of tool from hand [m]", SOURCE, 0.02, max(s.largest for s in seen),
            (law, max(s.largest for s in others)),
        ),
        at_most(
            f"limits at the real robot over `{DELAY}`: largest speed or acceleration as a share of its limit",
            SOURCE, 1, max(s.limits for s in seen),
            ("no law of play: it jumps to the present", first["jumps"].limits), slack=OVER,
        ),
        at_most(
            "the real tool is off the virtual one's path by at most [m]", SOURCE, 1e-3, max(s.real for s in seen),
            ("D = 0: what comes late is carried out late", first["postpones"].real),
        ),
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
            ("feedback alone: rms mm", 1e3 * other.following),
            ("its lag s", other.lag),
        )
        for k, (s, other) in enumerate(zip(seen, others, strict=True))
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
