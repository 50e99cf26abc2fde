"""Straight lines of the tool: what a command costs, how long a line takes beside the best, how straight it is."""

from __future__ import annotations

from functools import partial

import numpy as np

from benchmarks import lines, peers
from benchmarks.results import Bar, Chart, Cost, Part, Result
from benchmarks.timing import Stopwatch
from vrs import Engine, Motion, MotionCommand, PoseTarget, Profile, Status

LINES = 200
STRAIGHT = 100
COSTS = 100
DENSE = 10


def part() -> Part:
    """Measure."""
    results = [_cost(profile) for profile in Profile]
    durations, chart = _durations()
    results += durations
    for profile in Profile:
        results += _accuracy(profile)
    return Part(
        "Straight lines",
        "A line of 0.5 m with a turn of some 40°, from random poses: the whole command "
        "(`engine.execute(MotionCommand(PoseTarget(X), motion=Motion.LINE))`, six joint polynomials certified). "
        f"Durations of {LINES} random lines over those of TOPP-RA on the same path under the same limits (joint "
        "speeds and accelerations, the tool's speeds), 800 grid points; TOPP-RA itself beside a dense optimum of "
        f"our own on {DENSE} of them. Straightness from 40 points a piece of {STRAIGHT} random lines; "
        "`python -m benchmarks.lines 10000` takes more.",
        tuple(results),
        (chart,) if chart is not None else (),
    )


def _cost(profile: Profile) -> Result:
    source = lines.lines(1, profile, 0.5)
    watch = Stopwatch.new()
    rejected = 0
    for k in range(COSTS + 5):
        move = next(source)
        engine = Engine(lines.MODEL, q=move.q)
        command = MotionCommand(PoseTarget(move.X), motion=Motion.LINE, profile=profile)
        if k < 5:
            engine.execute(command)
            continue
        receipt = watch.time(partial(engine.execute, command))
        rejected += receipt.status is Status.REJECTED
    cost = watch.cost
    return Result(
        f"whole command, a line of 0.5 m, {profile}",
        Cost(cost.median / 1e3, (cost.p99 or np.nan) / 1e3),
        unit="ms",
        bar=Bar(median=10.0),
        note=watch.in_wall_time + (f"; {rejected} rejected" if rejected else ""),
    )


def _durations() -> tuple[list[Result], Chart | None]:
    """Planned durations over the best."""
    source = lines.lines(3, Profile.PARABOLIC)
    found = [next(source) for _ in range(LINES)]
    ours = np.array([move.plan.duration for move in found])
    dense = np.array([lines.dense_optimum(move) for move in found[:DENSE]])
    known = peers.installed("toppra") is not None
    best = np.array([lines.topp_ra(move) or np.nan for move in found]) if known else np.full(LINES, np.nan)
    name = f"duration over TOPP-RA's, {LINES} lines, parabolic"
    peer = "TOPP-RA"
    results = []
    chart = None
    if known:
        ratios = ours / best
        good = ratios[np.isfinite(ratios)]
        results.append(
            Result(
                name,
                Cost(float(np.median(good)), float(np.percentile(good, 99))),
                unit="",
                bar=Bar(median=1.1, p99=1.1),
                peer=peer,
                theirs=Cost(1.0),
                note=f"{good.min():.3f} to {good.max():.3f}; {(good <= 1.1).mean():.1%} of lines within 1.1"
                + (f"; TOPP-RA failed on {LINES - len(good)}" if len(good) < LINES else ""),
            )
        )
        against = best[:DENSE] / dense
        results.append(
            Result(
                f"TOPP-RA's duration over a dense optimum's, {DENSE} lines",
                Cost(float(np.nanmedian(against)), float(np.nanmax(against))),
                unit="",
                note="a check of the yardstick; the second figure is the largest",
            )
        )
        chart = Chart(
            "lines",
            "Duration of a straight line over TOPP-RA's",
            "spread",
            "ratio of durations",
            "share of lines",
            series={"vrs, parabolic": [(float(value), 0.0) for value in good]},
            bars={"asked": 1.1},
            log=False,
        )
    else:
        results.append(Result(name, None, unit="", bar=Bar(median=1.1, p99=1.1), peer=peer))
    over = ours[:DENSE] / dense
    results.append(
        Result(
            f"duration over a dense optimum's, {DENSE} lines, parabolic",
            Cost(float(np.median(over)), float(over.max())),
            unit="",
            bar=Bar(median=1.1, p99=1.1),
            note="the second figure is the largest",
        )
    )
    return results, chart


def _accuracy(profile: Profile) -> list[Result]:
    source = lines.lines(2, profile)
    moves = [next(source) for _ in range(STRAIGHT)]
    errors = np.array([lines.error(move) for move in moves])
    pieces = [len(move.plan) for move in moves]
    worst = errors.max(axis=0)
    middle = np.median(errors, axis=0)
    what = (
        ("off the straight line", "m", 1e-6),
        ("off an even turn", "rad", 1e-6),
        ("joints off the line's inverse kinematics", "rad", 1e-9),
    )
    return [
        Result(
            f"{name}, {profile}, largest of {STRAIGHT} lines",
            Cost(float(worst[i])),
            unit=unit,
            bar=Bar(median=bar),
            note=f"median of lines {middle[i]:.1e} {unit}"
            + (f"; {np.median(pieces):.0f} pieces in the median, {max(pieces)} at most" if not i else ""),
        )
        for i, (name, unit, bar) in enumerate(what)
    ]
