"""What a command costs, from analysis to receipt, beside Ruckig's bare plan and the Toolbox's trajectories."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np

from benchmarks import moves
from benchmarks.moves import LIMITS, MODEL
from benchmarks.results import Bar, Chart, Cost, Part, Result
from benchmarks.timing import Stopwatch
from vrs import Engine, Insertion, JointTarget, ManualClock, MotionCommand, Profile, Status
from vrs.model import Array
from vrs.segment import State

COMMANDS = 600
WARM_UP = 20
POINTS = 50
"""Points of a Toolbox trajectory, which has no other form."""
MEDIANS = {Profile.PARABOLIC: 200.0, Profile.JERK_LIMITED: 300.0}
KINDS = {
    Insertion.SPLICE: "splice in mid-motion, a tail behind",
    Insertion.REPLACE: "replace in mid-motion",
    Insertion.APPEND: "append",
}


def part() -> Part:
    """Measure."""
    results: list[Result] = []
    durations: list[Result] = []
    spread: dict[str, list[tuple[float, float]]] = {}
    for profile in Profile:
        for insertion in Insertion:
            ours, bare, ratios, rejected = _commands(profile, insertion)
            results.append(_result(profile, insertion, ours, bare, rejected))
            if insertion is Insertion.SPLICE:
                spread[f"vrs, {profile}"] = [(cost, 0.0) for cost in ours.processor]
                if profile is Profile.JERK_LIMITED:
                    spread["Ruckig alone, jerk-limited"] = [(cost, 0.0) for cost in bare.processor]
            if insertion is Insertion.REPLACE:
                median, p99 = np.percentile(ratios, (50, 99))
                durations.append(
                    Result(
                        f"duration over Ruckig's least, {profile}, replace",
                        Cost(float(median), float(p99)),
                        unit="",
                        note=f"worst {max(ratios):.3f}",
                    )
                )
    results += _toolbox() + durations
    return Part(
        "A whole command",
        f"`engine.execute(MotionCommand(JointTarget(q), ...))` on a PUMA 560 with three scheduled random moves, at "
        f"a random time of the first, in real-time mode: analysis, plan, join, certificate, insertion and receipt. "
        f"{COMMANDS} random commands a row, in processor time; wall time is in the notes. Ruckig plans the same "
        "move from the same state to the same target (six joints, synchronised, the same speed, acceleration and "
        "jerk limits), the request filled in beforehand: no position limits, no certificate, no tail, no "
        f"insertion, no receipt. `jtraj` and `mtraj` only sample a rest to rest curve at {POINTS} points, without "
        "limits.",
        tuple(results),
        (
            Chart(
                "commands",
                "A splice in mid-motion: the whole command",
                "spread",
                "processor time [µs]",
                "share of commands",
                series=spread,
                bars={f"asked, {profile}": median for profile, median in MEDIANS.items()},
            ),
        ),
    )


def _result(profile: Profile, insertion: Insertion, ours: Stopwatch, bare: Stopwatch, rejected: int) -> Result:
    note = ours.in_wall_time
    if rejected:
        note += f"; {rejected} of {COMMANDS} rejected"
    return Result(
        f"{profile}, {KINDS[insertion]}",
        ours.cost,
        bar=Bar(median=MEDIANS[profile], p99=1000.0),
        peer="Ruckig `calculate`",
        theirs=bare.cost,
        ratio=float(np.median(np.divide(bare.processor, ours.processor))),
        note=note,
    )


def _commands(profile: Profile, insertion: Insertion) -> tuple[Stopwatch, Stopwatch, list[float], int]:
    """Costs of commands and of Ruckig's plans, ratios of their durations, and how many commands were rejected."""
    import ruckig

    rng = np.random.default_rng(4)
    source = moves.targets(rng)
    ours, bare = Stopwatch.new(), Stopwatch.new()
    ratios: list[float] = []
    rejected = 0
    for k in range(COMMANDS + WARM_UP):
        clock = ManualClock(0.0)
        engine = Engine(MODEL, q=next(source), clock=clock)
        for _ in range(3):
            engine.execute(MotionCommand(JointTarget(next(source)), insertion=Insertion.APPEND, profile=profile))
        t = engine.receipts[0].end
        assert t is not None
        t *= rng.uniform(0.1, 0.9)
        clock.advance(0.5 * t)
        command = MotionCommand(JointTarget(next(source)), execute_at=t, insertion=insertion, profile=profile)
        append = insertion is Insertion.APPEND
        state = engine.timeline.state_before(engine.timeline.end if append else t)
        plan = _ruckig(state, command.target.q, profile)  # type: ignore[union-attr]
        if k < WARM_UP:
            engine.execute(command)
            plan()
            continue
        receipt = ours.time(partial(engine.execute, command))
        rejected += receipt.status is Status.REJECTED
        assert bare.time(plan) == ruckig.Result.Working, "Ruckig found no plan"
        if receipt.end is not None:
            ratios.append((receipt.end - receipt.execute_at) / plan.args[1].duration)
    return ours, bare, ratios, rejected


def _ruckig(state: State, q: Array, profile: Profile) -> Any:
    """Ruckig's bare calculation, ready to be called."""
    import ruckig

    n = LIMITS.dof
    problem, trajectory = ruckig.InputParameter(n), ruckig.Trajectory(n)
    problem.current_position, problem.current_velocity = state.q.tolist(), state.qd.tolist()
    problem.target_position = q.tolist()
    problem.max_velocity, problem.max_acceleration = LIMITS.qd_max.tolist(), LIMITS.qdd_max.tolist()
    problem.max_jerk = [np.inf] * n
    if profile is Profile.JERK_LIMITED:
        problem.current_acceleration, problem.max_jerk = state.qdd.tolist(), LIMITS.qddd_max.tolist()
    return partial(ruckig.Ruckig(n).calculate, problem, trajectory)


def _toolbox() -> list[Result]:
    """What the Toolbox takes for moves from rest to rest, in turns with ours."""
    from roboticstoolbox.tools.trajectory import jtraj, mtraj, trapezoidal

    source = moves.targets(np.random.default_rng(5))
    peers: dict[str, Any] = {
        f"Toolbox `jtraj`, {POINTS} points": lambda start, goal: jtraj(start, goal, POINTS),
        f"Toolbox `mtraj`, trapezoidal, {POINTS} points": lambda start, goal: mtraj(
            trapezoidal, start, goal, POINTS
        ),
    }
    ours, theirs = Stopwatch.new(), {name: Stopwatch.new() for name in peers}
    engine = Engine(MODEL)
    for _ in range(200):
        start, goal = engine.timeline.final(), next(source)
        ours.time(partial(engine.execute, MotionCommand(JointTarget(goal), insertion=Insertion.APPEND)))
        for name, action in peers.items():
            theirs[name].time(partial(action, start, goal))
    return [
        Result(
            f"{Profile.PARABOLIC}, rest to rest",
            ours.cost,
            peer=name,
            theirs=watch.cost,
            ratio=float(np.median(np.divide(watch.processor, ours.processor))),
        )
        for name, watch in theirs.items()
    ]
