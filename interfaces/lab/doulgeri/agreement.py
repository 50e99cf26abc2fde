"""Open problem (e): a direct link between the virtual and the real robot. How soon do they agree again?"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from interfaces.lab.claims import OWN_BAR, Claim, Findings, Results, Study, Table, at_most, none_of
from interfaces.lab.doulgeri.rivals import adaptive, postponing
from interfaces.lab.doulgeri.script import HOME, MODEL, Act, limits_used, played, replay, script, twins
from interfaces.lab.output import BAD, MUTED, REAL, VIRTUAL, draw, legend
from interfaces.lab.statistics import bootstrap, interval_name, median
from interfaces.link import BernoulliLoss, Conditions, ConstantDelay, Service, delay_profile
from interfaces.runtime.laboratory import Laboratory
from interfaces.teleop import Correction
from vrs import JointTarget, MotionCommand, Timeline
from vrs.commands import Command
from vrs.model import Array

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Canvas

DELAY: Final = 0.3
"""Each way [s]."""
SHORT: Final = -0.1
"""An offset that hides too little of it: commands come late by 0.2 s [s]."""
AGREE: Final = 1e-9
"""Joints nearer than this [rad] agree."""
AHEAD: Final = 30.0
"""How far into the future timelines are compared [s]."""
GRID: Final = 0.01
"""Step at which speeds and accelerations are looked at [s]."""
LOOK: Final = 0.05
"""How often they are compared [s]."""
PATIENCE: Final = 60.0
"""How long agreement is waited for [s]."""
LIMIT: Final = 10.0
"""How soon the timelines must agree after the last command [s]: our own figure."""
SOURCE: Final = f"Section VII, (e); {OWN_BAR}"
FEW: Final = 3
"""Runs of what stands beside others, at most."""
CASES: Final = ("late", "blocked", "lossless", "lossy", "lossy, late")


def apart(mine: Timeline, other: Timeline, now: float) -> float:
    """Largest difference of two timelines' joints from now on [rad]."""
    t = np.arange(now, max(mine.end, other.end, now) + 1.0, 0.02)
    t = t[t <= now + AHEAD]
    return float(np.abs(mine.sample(t) - other.sample(t)).max())


def _watch(lab: Laboratory, since: float) -> tuple[float, Array, Array]:
    """Compare the timelines until they agree; when they did for good, and how far they were apart."""
    t, gaps = [], []
    while lab.now < since + PATIENCE:
        t.append(lab.now - since)
        gaps.append(apart(lab.operator.robot.engine.timeline, lab.robot.engine.timeline, lab.now))
        if len(gaps) > 100 and max(gaps[-100:]) <= AGREE:
            break
        lab.run(lab.now + LOOK)
    away = [i for i, gap in enumerate(gaps) if gap > AGREE]
    agreed = t[away[-1] + 1] if away and away[-1] + 1 < len(t) else np.inf if away else 0.0
    return float(agreed), np.array(t), np.array(gaps)


def _seen(lab: Laboratory, since: float, unlinked: Timeline) -> Results:
    """What is seen from some time on; `unlinked` is the virtual robot's timeline where nothing comes back."""
    agreed, t, gaps = _watch(lab, since)
    made: list[Correction] = lab.operator.robot.corrections
    after = [c.t - since for c in made if c.t >= since]
    grid = np.arange(0.0, lab.now, GRID)
    timeline = lab.operator.robot.engine.timeline
    return Results(
        agreed=agreed,  # until the timelines agree for good [s]; infinite where they don't
        noticed=min(after, default=np.inf),  # until the virtual robot was corrected [s]; infinite where it wasn't
        corrections=tuple(float(np.abs(c.error).max()) for c in made),  # largest error of a joint at each [rad]
        durations=tuple(c.end - c.t for c in made),  # of each [s]
        unlinked=apart(unlinked, lab.robot.engine.timeline, lab.now),  # how far the two are apart at the end [rad]
        # Speed of the virtual robot if it were put at once where the real one is, as a share of its limit.
        jump=max((float((np.abs(c.error) / GRID / MODEL.limits.qd_max).max()) for c in made), default=0.0),
        # Largest speed or acceleration, corrections included, as a share of its limit.
        limits=limits_used(timeline.sample(grid), GRID),
        t=t,  # from then on [s]
        apart=gaps,  # how far the timelines are apart at t, and from then on [rad]
    )


def _lab(seed: int, way: Conditions, D: float | None) -> Laboratory:
    return twins(way, np.random.default_rng((seed, 21)), adaptive if D is None else postponing(D))


def _say(lab: Laboratory, command: Command, now: float) -> None:
    lab.operator.robot.execute(command, now=now)


def _give(lab: Laboratory, acts: tuple[Act, ...]) -> float:
    """Let the commands be given; when the last one is [s]."""
    for act in acts:
        lab.schedule(act.t, partial(_say, lab, act.command))
    return max(act.t for act in acts)


def talk(seed: int, length: float, way: Conditions, D: float | None) -> Results:
    """Commands for some seconds, then quiet."""
    acts = script(np.random.default_rng((seed, 20)), length)
    lab = _lab(seed, way, D)
    last = _give(lab, acts)
    lab.run(last)
    return _seen(lab, last, replay(acts).timeline)


def block(seed: int) -> Results:
    """The real arm is held in the middle of a move."""
    rng = np.random.default_rng((seed, 22))
    lab = _lab(seed, Conditions(delay=ConstantDelay("constant", DELAY)), None)
    command = MotionCommand(
        JointTarget(HOME + rng.choice((-0.8, 0.8), 6) * (0.7, 0.4, 0.4, 0.8, 0.6, 0.8)), speed=0.5
    )
    lab.schedule(0.5, partial(_say, lab, command))
    moment = 1.6 + rng.uniform(0.0, 0.4)
    lab.run(moment)
    _, reference = played(lab)
    held = reference.q[-1] + 0.5 * (HOME - reference.q[-1])
    lab.robot.measured(held, now=lab.now)
    return _seen(lab, lab.now, lab.operator.robot.engine.timeline)


def work(study: Study, case: str) -> list[Results]:
    """Measure a case for every seed."""
    seeds = range(study.seed + 700, study.seed + 700 + study.runs)
    length = min(study.length, 15.0)
    constant = Conditions(delay=ConstantDelay("constant", DELAY))
    lossy = Conditions(delay=delay_profile("mon"), loss=BernoulliLoss(0.2), duplicate=0.1, service=Service.DATAGRAM)
    if case == "blocked":
        return [block(seed) for seed in seeds]
    if case == "lossy, late":
        # What stands beside the adaptive offset there, for a few seeds.
        seeds = seeds[:FEW]
    way = lossy if case.startswith("lossy") else constant
    return [talk(seed, length, way, SHORT if case.endswith("late") else None) for seed in seeds]


def conclude(study: Study, found: tuple[Any, ...]) -> Findings:
    """How soon they agree, and by how much the virtual robot was corrected."""
    cases: dict[str, list[Results]] = dict(zip(CASES, found, strict=True))
    claims: list[Claim] = []
    names = {
        "late": f"commands late by {DELAY + SHORT:g} s at the robot",
        "blocked": "the real arm blocked in a move",
        "lossless": "adaptive D, no losses",
        "lossy": "adaptive D, `mon`, 20 % lost, 10 % twice",
    }
    fixed = f"D fixed at {SHORT:g} s"
    beside = {"late": "late", "blocked": "blocked", "lossless": "late", "lossy": "lossy, late"}
    rows = []
    for case, name in names.items():
        seen, others = cases[case], cases[beside[case]]
        agreed = [s.agreed for s in seen]
        finite = bool(np.isfinite(agreed).all())
        middle = bootstrap(agreed, study.seed, median) if finite else None
        since = "the block" if case == "blocked" else "the last command"
        text = f"{name}: timelines agree to 1e-9 rad after {since}, at most [s]"
        # Late commands may by chance lead to where they lead in time; elsewhere the two never agree.
        without = max(np.inf if s.unlinked > AGREE else s.agreed for s in others)
        off = "no direct link" if others is seen else f"{fixed}, no direct link"
        claims.append(at_most(text, SOURCE, LIMIT, max(agreed), (off, without)))
        sizes = [size for s in seen for size in s.corrections]
        spans = [span for s in seen for span in s.durations]
        if others is seen:
            text = f"{name}: limits of the virtual robot, corrections included, as a share"
            jump = f"put in {1e3 * GRID:g} ms where the real one is", max(s.jump for s in seen)
            claims.append(at_most(text, SOURCE, 1, max(s.limits for s in seen), jump, slack=1e-9))
        else:
            text = f"{name}: corrections of the virtual robot"
            claims.append(none_of(text, SOURCE, len(sizes), (fixed, sum(len(s.corrections) for s in others))))
        rows.append(
            (
                ("what", name),
                ("agree after s, median", None if middle is None else middle.value),
                (
                    interval_name(study.runs, of_median=True),
                    None if middle is None else f"{middle.low:.2f} to {middle.high:.2f}",
                ),
                ("max", max(agreed)),
                ("corrections", len(sizes)),
                ("size deg, mean", float(np.degrees(np.mean(sizes))) if sizes else None),
                ("max", float(np.degrees(max(sizes))) if sizes else None),
                ("lasts s, mean", float(np.mean(spans)) if spans else None),
                ("max", max(spans) if spans else None),
            )
        )
    blocked = cases["blocked"]
    text = "the virtual robot turns to where the blocked one is after [s], at most: the way back and two beats"
    unnoticed = max(np.inf if s.unlinked > AGREE else s.noticed for s in blocked)
    noticed = max(s.noticed for s in blocked)
    claims.append(at_most(text, SOURCE, DELAY + 2 * 0.05, noticed, ("no direct link", unnoticed), slack=1e-6))
    table = Table.of("agreement", f"(e) virtual and real, {DELAY} s each way; {study.runs} runs", rows)
    picture = draw(
        "e-agreement", "(e) how far the timelines of the virtual and the real robot are apart", _paint, cases
    )
    return Findings(tuple(claims), (table,), (picture,))


def _paint(canvas: Canvas, cases: dict[str, list[Results]]) -> None:
    axes = canvas.subplots(1, 2, sharey=True)
    titles = ("after the last of some late commands", "after the real arm was blocked")
    for ax, case, title in zip(axes, ("late", "blocked"), titles, strict=True):
        for k, seen in enumerate(cases[case]):
            gaps = np.maximum(seen.apart, 1e-12)
            ax.semilogy(
                seen.t,
                gaps,
                color=VIRTUAL if k else REAL,
                linewidth=1.5 if k == 0 else 0.7,
                alpha=1.0 if k == 0 else 0.5,
                label="first seed" if k == 0 else ("others" if k == 1 else None),
            )
        ax.axhline(AGREE, color=BAD, linewidth=0.9)
        ax.axvline(2 * DELAY if case == "late" else DELAY, color=MUTED, linewidth=0.9, linestyle=(0, (4, 3)))
        ax.set(title=title, xlim=(0.0, 4.0), xlabel="s (dashed: there and back, or the way back)")
    axes[0].set_ylabel("largest joint difference from then on, rad")
    axes[0].annotate("1e-9", (3.9, AGREE), (0, 3), textcoords="offset points", ha="right", color=BAD)
    legend(axes[1], place="upper right")
