"""What steering costs and how exactly it follows: inputs, sessions, twists, beside one Jacobian in the same run.

Set VRS_STEERING_SESSION to the virtual seconds of a session (3600 for an hour).
"""

from __future__ import annotations

import os
import statistics
import time
import tracemalloc
from collections.abc import Callable

import numpy as np

from robots import puma560
from vrs.planning.steering import Frame, steer
from vrs.segment import Piece
from vrs.timeline import Timeline

MODEL = puma560.model()
LIMITS = MODEL.limits
SESSION = float(os.environ.get("VRS_STEERING_SESSION", "120"))
TICK = 0.02
HOLD = 0.2


def give(timeline: Timeline, t: float, rates: object, twist: object, frame: Frame) -> tuple[Timeline, float, int]:
    """The timeline after an input, what planning it took [s], and the segments of the plan."""
    state = timeline.state_before(t)
    start = time.perf_counter()
    plan, *_ = steer(state, rates, twist, frame, HOLD, MODEL, LIMITS)
    cost = time.perf_counter() - start
    return timeline.edited(t, [Piece(plan.durations.tolist(), plan.rows(), 1)]), cost, len(plan)


def hand(rng: np.random.Generator, kind: str) -> Callable[[], tuple[object, object]]:
    """A hand on the stick: it moves on from one deflection to another, rests now and then, tends to the middle."""
    goal = now = np.zeros(6)
    scale = 0.6 * LIMITS.qd_max if kind == "rates" else np.array([0.25] * 3 + [0.5] * 3)

    def at() -> tuple[object, object]:
        nonlocal goal, now
        if rng.random() < 0.02:
            goal = rng.uniform(-1, 1, 6) * scale * (rng.random(6) < 0.5) * (rng.random() < 0.8)
        now = now + 0.2 * (goal - now)
        now[np.abs(now) < 0.01 * scale] = 0.0
        asked = now * (1.0 if rng.random() < 0.99 else -1.0)
        return (asked, None) if kind == "rates" else (None, asked)

    return at


def microseconds(costs: list[float]) -> str:
    ordered = sorted(costs)
    middle, tail = statistics.median(ordered), ordered[int(0.99 * (len(ordered) - 1))]
    return f"median {1e6 * middle:7.1f} µs   p99 {1e6 * tail:7.1f} µs"


def session(kind: str, frame: Frame, seconds: float) -> None:
    asked = hand(np.random.default_rng(7), kind)
    timeline = Timeline(MODEL.poses["nominal"])
    costs, lengths = [], []
    tracemalloc.start()
    before = tracemalloc.get_traced_memory()[0]
    ticks = round(seconds / TICK)
    traced = min(ticks, 3000)
    for k in range(ticks):
        if k == traced:
            held = tracemalloc.get_traced_memory()[0] - before
            tracemalloc.stop()
            executed = len(timeline)
        timeline, cost, length = give(timeline, k * TICK, *asked(), frame)
        if k > traced or traced == ticks:
            costs.append(cost)
            lengths.append(length)
    if traced == ticks:
        held, executed = tracemalloc.get_traced_memory()[0] - before, len(timeline)
        tracemalloc.stop()
    tenth = max(len(costs) // 10, 1)
    print(f"{kind} in {frame}, {seconds:g} s at 50 Hz: {len(timeline) / seconds:.1f} segments/s executed, ", end="")
    print(f"{statistics.mean(lengths):.1f} (most {max(lengths)}) in a plan, {held / executed:.0f} B a segment")
    print(f"    first tenth {microseconds(costs[:tenth])}   last tenth {microseconds(costs[-tenth:])}")


def accuracy(dt: float, end: float, count: int) -> None:
    """Deviation from the exact motion of random base twists at 0.25 m/s, condition number 10 or less."""
    rng = np.random.default_rng(11)
    offs: list[float] = []
    turns: list[float] = []
    while len(offs) < count:
        q = rng.uniform(LIMITS.q_min + 0.7, LIMITS.q_max - 0.7)
        J = np.array(MODEL.jacobian(q))
        J[:3] /= 0.4318
        if np.linalg.cond(J) > 10:
            continue
        twist = np.concatenate([rng.normal(size=3), 0.3 * rng.normal(size=3)])
        twist[:3] *= 0.25 / np.linalg.norm(twist[:3])
        timeline = Timeline(q)
        for k in range(round(max(end - 0.15, dt) / dt)):
            timeline, _, _ = give(timeline, k * dt, None, twist, Frame.BASE)
        places = timeline.sample(np.linspace(0, end, 50))
        if (places > LIMITS.q_max - 0.3).any() or (places < LIMITS.q_min + 0.3).any():
            continue
        X = MODEL.forward(places)
        v, w = twist[:3], twist[3:]
        way = (X[:, :3, 3] - X[0, :3, 3]) @ v / (v @ v)
        offs.append(float(np.linalg.norm(X[:, :3, 3] - X[0, :3, 3] - way[:, None] * v, axis=1).max()))
        R = X[:, :3, :3] @ X[0, :3, :3].T
        turn = 0.5 * np.stack([R[:, 2, 1] - R[:, 1, 2], R[:, 0, 2] - R[:, 2, 0], R[:, 1, 0] - R[:, 0, 1]], 1)
        size = np.linalg.norm(turn, axis=1, keepdims=True)
        angle = np.where(size > 0, np.arcsin(size) / np.maximum(size, 1e-12), 1.0)
        turns.append(float(np.degrees(np.linalg.norm(turn * angle - way[:, None] * w, axis=1).max())))
    line = f"twist followed for {end:g} s, an input every {1e3 * dt:g} ms: "
    mm = np.array(offs) * 1e3
    print(f"{line}{np.median(mm):.3f} mm (p95 {np.percentile(mm, 95):.3f}, worst {mm.max():.3f}), ", end="")
    print(f"{np.median(turns):.4f} deg (p95 {np.percentile(turns, 95):.4f}, worst {max(turns):.4f})")


def main() -> None:
    """Print the figures."""
    q = MODEL.poses["nominal"]
    costs = []
    for _ in range(500):
        start = time.perf_counter()
        MODEL.jacobian(q)
        costs.append(time.perf_counter() - start)
    print(f"one Jacobian: {microseconds(costs)}")
    session("rates", Frame.BASE, SESSION)
    session("twist", Frame.BASE, SESSION)
    session("twist", Frame.TOOL, min(SESSION, 120.0))
    for dt, end in ((0.2, 0.35), (0.2, 1.0), (0.02, 1.0), (0.005, 1.0)):
        accuracy(dt, end, 60)


if __name__ == "__main__":
    main()
