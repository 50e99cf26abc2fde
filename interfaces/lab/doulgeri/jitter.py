"""Open problem (a): delay jitter. An adaptive offset beside fixed ones, with which a robot postpones or waits."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from interfaces.lab.claims import (
    OWN_BAR,
    Cell,
    Findings,
    Results,
    Study,
    Table,
    at_least,
    at_most,
    below_zero,
    none_of,
)
from interfaces.lab.doulgeri.rivals import RobotMaker, adaptive, halting, jumping, postponing, waiting
from interfaces.lab.doulgeri.script import Act, limits_used, played, replay, script, tool, twins
from interfaces.lab.output import MUTED, REAL, VIRTUAL, draw, legend
from interfaces.lab.statistics import Estimate, bootstrap, clustered, interval_name
from interfaces.link import Conditions, Service, delay_profile
from interfaces.runtime.laboratory import Laboratory
from vrs import MotionCommand
from vrs.comparison import compare_paths
from vrs.ledger import Receipt
from vrs.model import Array

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Canvas

CASES: Final = tuple(f"{day}@{tau}" for day in ("mon", "wed", "thu") for tau in ("0.2", "2", "20"))
"""Delay profiles."""
SHARE: Final = 0.95
"""Of the packets come in time for a fixed offset."""
WAITED: Final = ("mon@2", "thu@2")
"""Those under which a robot that waits is measured, too."""
FEW: Final = 3
"""Runs of robots that halt, at most."""
NAMES: Final = {
    "adaptive": "adaptive D",
    "postpones": "fixed D, postpones",
    "waits": "fixed D, waits",
    "waits, mean": "D fixed at the mean delay, waits",
    "jumps": "adaptive D, no law of play",
    "halts": "adaptive D, halted by a watchdog",
}
"""Robots, as people are told of them."""
_SHARES: Final = np.linspace(0.005, 0.995, 100)
"""Quantiles whose mean is the mean delay, but for the rarest."""
LONGEST: Final = 900.0
"""How long after the last command is waited for the robot [s]."""
TOGETHER: Final = 0.5
"""Moves given at least so far apart [s] that begin at the robot within half their distance are a burst."""
OVER: Final = 1e-9
"""How far a limit may be passed, by rounding."""
SOURCE: Final = f"Section VII, (a); {OWN_BAR}"


def run(profile: str, seed: int, length: float, robot: RobotMaker = adaptive) -> tuple[Results, Results]:
    """Both sites over datagrams with that delay each way: figures, and what the picture shows.

    Args:
        profile: Of the delay.
        seed: Of the commands and the link; commands don't depend on the robot.
        length: For how long commands are given [s].
        robot: Makes the robot's site.
    """
    acts = script(np.random.default_rng((seed, 1)), length)
    way = Conditions(delay=delay_profile(profile), service=Service.DATAGRAM)
    lab = twins(way, np.random.default_rng((seed, 2)), robot)
    begun: dict[int, float] = {}
    sent: list[int] = []

    def give(act: Act, now: float) -> None:
        receipt = lab.operator.robot.execute(act.command, now=now)
        if not isinstance(receipt, Receipt) or receipt.execute_at is None:
            return
        sent.append(receipt.command_id)
        if isinstance(act.command, MotionCommand):
            begun[receipt.command_id] = receipt.execute_at

    for act in acts:
        lab.schedule(act.t, partial(give, act))
    lab.run(length + 5.0)
    while lab.now < length + LONGEST and not _done(lab, len(sent)):
        lab.run(lab.now + 5.0)
    return _seen(lab, acts, begun), _trace(lab)


def _done(lab: Laboratory, sent: int) -> bool:
    """Whether the operator knows that all was carried out, and the robot has come to its end; or it has halted."""
    if lab.halts:
        return True
    report, timelines = lab.operator.report, (lab.operator.robot.engine.timeline, lab.robot.engine.timeline)
    return report is not None and report.executed >= sent and report.play > max(t.end for t in timelines)


def _seen(lab: Laboratory, acts: tuple[Act, ...], begun: dict[int, float]) -> Results:
    play, reference = played(lab)
    leader, follower = tool(replay(acts).timeline.sample(lab.t)), tool(reference.q)
    step = float(lab.t[1] - lab.t[0])
    v_max = float(np.linalg.norm(np.diff(leader, axis=0), axis=1).max()) / step
    path = compare_paths(lab.t, leader, follower, v_max=max(v_max, 0.5))
    aside = np.linalg.norm(tool(lab.operator.robot.engine.timeline.sample(play.p)) - follower, axis=1).max()
    timeline = lab.robot.engine.timeline
    moved = set(timeline.owners(0, len(timeline)))
    theirs = {i: r for i, r in lab.operator.robot.receipts.items() if r.execute_at is not None}
    both = sorted(
        (begun[i], theirs[i].execute_at or 0.0, theirs[i].command_id in moved) for i in begun if i in theirs
    )
    # What was dropped before it began is no move of the robot's.
    made = [(asked, at) for asked, at, moves in both if moves and at <= play.p[-1]]
    given = np.array([pair[0] for pair in made])
    # When the robot's play first came to where the move begins: until then it may have waited.
    there = np.interp([pair[1] for pair in made], *_first(play.p, lab.t))
    # Who halts before the first move is nowhere on the path.
    figures = {
        name: np.nan if (value := getattr(path, full)) is None else value
        for name, full in {
            "mean": "path_error_mean",  # path error of the tool over time [m], METRICS
            "p95": "path_error_p95",
            "largest": "path_error_max",
            "time_difference": "time_difference_mean",  # over the path that both robots took [s]
            "time_difference_max": "time_difference_max",
            "progress": "progress",  # share of the path reached
        }.items()
    }
    return Results(
        **figures,
        aside=float(aside),  # real tool from the virtual one at the same time on the timeline, at most [m]
        bursts=bursts(given, there),
        limits=limits_used(reference.q, step),  # largest speed or acceleration, as a share of its limit
        pace=float(np.diff(play.p).max()) / step,  # fastest that the timeline was played
        postponed=sum(at > asked + OVER for asked, at, _ in both),  # moves that began later at the robot
        moves=len(both),
        corrections=len(lab.operator.robot.corrections),  # of the virtual robot, by the real one
        slowed=0
        if lab.robot.playout is None
        else len(lab.robot.playout.stretches),  # stops on the way, for messages
    )


def bursts(given: Array, begun: Array) -> int:
    """How many moves begin at the robot within half of the time after which they were given [s], (k,) each."""
    gaps, passed = np.diff(given), np.diff(begun)
    return int(np.count_nonzero((gaps >= TOGETHER) & (passed < 0.5 * gaps)))


def _first(p: Array, t: Array) -> tuple[Array, Array]:
    """Play times that grow, and when each was first reached."""
    new = np.concatenate(([True], np.diff(np.maximum.accumulate(p)) > 0))
    return p[new], t[new]


def _trace(lab: Laboratory) -> Results:
    records = [r for r in lab.link.forward.log.take() if r.arrived is not None]
    t, p = lab.t[::10], played(lab)[0].p[::10]
    return Results(
        t=t,  # [s]
        behind=t - p,  # how far behind the robot plays [s]
        sent=np.array([r.sent for r in records]),  # when packets were sent [s]
        delay=np.array([r.arrived - r.sent for r in records if r.arrived is not None]),  # how long they took [s]
    )


def work(study: Study, case: str) -> Results:
    """Every seed with ours and the paper's robot; under some networks with others, too."""
    profile = delay_profile(case)
    D = -profile.quantile(SHARE)
    D_mean = -float(np.mean([profile.quantile(share) for share in _SHARES]))
    seeds, few = range(study.runs), range(min(study.runs, FEW))
    robots = {"adaptive": (adaptive, seeds), "postpones": (postponing(D), seeds)}
    if case in WAITED:
        robots |= {"waits": (waiting(D), seeds), "waits, mean": (waiting(D_mean), seeds)}
        robots |= {"jumps": (jumping, seeds), "halts": (halting, few)}
    runs = {
        name: [run(case, study.seed + k, study.length, robot) for k in chosen]
        for name, (robot, chosen) in robots.items()
    }
    return Results(
        D={"postpones": D, "waits": D, "waits, mean": D_mean},  # fixed offsets [s]
        runs={name: [figures for figures, _ in seen] for name, seen in runs.items()},  # by robot
        traces=tuple(runs[name][0][1] for name in ("adaptive", "postpones")),
    )


def conclude(study: Study, found: tuple[Any, ...]) -> Findings:
    """Claims for all profiles together, a table with a row a profile and robot."""
    results = dict(zip(CASES, found, strict=True))
    seen = {name: [s for r in found for s in r.runs.get(name, [])] for name in NAMES}
    ours, paper, jumps, halts = (seen[name] for name in ("adaptive", "postpones", "jumps", "halts"))
    runs = f"{len(ours)} runs"
    moves = sum(s.moves for s in ours)
    postpones = "a fixed D, late commands postponed"
    no_law = "no law of play: it jumps to the present"
    claims = (
        at_most(
            f"adaptive D, ideal servo: the real tool is off the virtual one's path by at most [m], {runs}",
            SOURCE, 1e-3, _most(ours, "aside"), (postpones, _most(paper, "aside")),
        ),
        at_most(
            f"adaptive D: mean path error [m], {runs}", SOURCE, 1e-3, _mean(study, results, "adaptive", "mean"),
            (postpones, _mean(study, results, "postpones", "mean")),
        ),
        none_of(
            f"adaptive D: moves postponed at the robot, of {moves}", SOURCE, sum(s.postponed for s in ours),
            (postpones, sum(s.postponed for s in paper)), of=moves,
        ),
        none_of(
            f"adaptive D: bursts (moves that begin at the robot within half of the time between them), {runs}",
            SOURCE, sum(s.bursts for s in ours), (no_law, sum(s.bursts for s in jumps)),
        ),
        at_most(
            "adaptive D: fastest pace of play", SOURCE, 1.05, _most(ours, "pace"), (no_law, _most(jumps, "pace")),
            slack=OVER,
        ),
        at_most(
            "adaptive D: largest speed or acceleration at the real robot, as a share of its limit",
            SOURCE, 1, _most(ours, "limits"), (no_law, _most(jumps, "limits")), slack=OVER,
        ),
        at_least(
            "adaptive D: the real robot takes the whole path, least share",
            SOURCE, 0.97, min(s.progress for s in ours),
            ("a watchdog that halts it for good", min(s.progress for s in halts)),
        ),
        below_zero(
            "mean time difference, adaptive less one that waits at the 95 % quantile and keeps the path [s], "
            f"{' and '.join(WAITED)}",
            SOURCE, _less(study, results, "adaptive"),
            ("one that waits at the mean delay in its place", _less(study, results, "waits, mean")),
        ),
    )  # fmt: skip
    rows = [
        _row(study, case, name, result.D.get(name), result.runs[name])
        for case, result in results.items()
        for name in result.runs
        if name != "halts"
    ]
    title = f"(a) jitter: {study.runs} runs of {study.length:g} s"
    one_run = "(a) one run: how far behind the robot plays, and what packets took"
    pictures = (
        draw(
            "a-jitter", "(a) path error and time difference of the real robot", _paint, study, results, height=5.6
        ),
        draw("a-jitter-run", one_run, _paint_run, results["thu@2"].traces, height=3.0),
    )
    return Findings(claims, (Table.of("jitter", title, rows),), pictures)


def _most(seen: list[Results], field: str) -> float:
    return float(max(getattr(s, field) for s in seen))


def _mean(study: Study, results: dict[str, Results], name: str, field: str) -> Estimate:
    """A figure's mean over all profiles; a seed gives the same commands everywhere, and so counts once."""
    values = [[getattr(s, field) for s in r.runs[name]] for r in results.values()]
    return clustered(np.array(values).T, study.seed)


def _less(study: Study, results: dict[str, Results], name: str) -> Estimate:
    """How much smaller a robot's time difference is than that of one that waits at the 95 % quantile [s]."""
    values = [
        [
            one.time_difference - other.time_difference
            for one, other in zip(r.runs[name], r.runs["waits"], strict=True)
        ]
        for r in (results[case] for case in WAITED)
    ]
    return clustered(np.array(values).T, study.seed)


def _row(study: Study, case: str, name: str, D: float | None, seen: list[Results]) -> tuple[tuple[str, Cell], ...]:
    late = bootstrap([s.time_difference for s in seen], study.seed)
    level = interval_name(study.runs)
    return (
        ("delay", case),
        ("robot", name),
        ("D fixed s", D),
        ("path error mm, mean", 1e3 * float(np.mean([s.mean for s in seen]))),
        (level, 1e3 * float(np.mean([s.p95 for s in seen]))),
        ("max", 1e3 * max(s.largest for s in seen)),
        ("time difference s", late.value),
        (f"{level} over seeds", f"{late.low:.2f} to {late.high:.2f}"),
        ("max", max(s.time_difference_max for s in seen)),
        ("bursts", sum(s.bursts for s in seen)),
        ("limit used", max(s.limits for s in seen)),
        ("postponed", sum(s.postponed for s in seen)),
        ("stops on the way", sum(s.slowed for s in seen)),
        ("corrections", sum(s.corrections for s in seen)),
    )


def _paint(canvas: Canvas, study: Study, results: dict[str, Results]) -> None:
    above, below = canvas.subplots(2, 1, sharex=True)
    x = np.arange(len(results))
    for shift, name, colour in ((-0.18, "adaptive", VIRTUAL), (0.18, "postpones", REAL)):
        for ax, scale, field in ((above, 1e3, "mean"), (below, 1.0, "time_difference")):
            points = [
                bootstrap([scale * getattr(s, field) for s in r.runs[name]], study.seed) for r in results.values()
            ]
            y = np.array([p.value for p in points])
            error = np.array([[p.value - p.low for p in points], [p.high - p.value for p in points]])
            ax.bar(x + shift, y, 0.34, color=colour, label=NAMES[name])
            ax.errorbar(x + shift, y, error, fmt="none", ecolor=MUTED, elinewidth=1.0, capsize=2)
    above.set_title(f"mean path error, mm ({interval_name(study.runs)} over seeds)")
    below.set_title("mean time difference, s")
    below.set_xticks(x, list(results))
    below.set_xlabel("delay each way, @ correlation time in s")
    for ax in (above, below):
        ax.grid(visible=False, axis="x")
        ax.set_ylim(bottom=0.0)
    legend(above, columns=2, place="upper right")


def _paint_run(canvas: Canvas, traces: tuple[Results, Results]) -> None:
    ax = canvas.add_subplot()
    for trace, colour, name in zip(traces, (VIRTUAL, REAL), ("adaptive", "postpones"), strict=True):
        ax.plot(trace.t, trace.behind, color=colour, label=f"the robot is behind, {NAMES[name]}")
    ax.plot(traces[0].sent, traces[0].delay, ".", color=MUTED, markersize=2, label="packet, by when it was sent")
    ax.set(ylim=(0.0, 1.15 * max(float(trace.behind.max()) for trace in traces)), xlabel="time, s", ylabel="s")
    legend(ax, columns=3, place="upper center")
