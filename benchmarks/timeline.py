"""What the timeline costs: edits, samples and memory, beside SciPy's PPoly and Drake on the same polynomials.

Drake is left out where it isn't installed. VRS_STEERING_HOURS sets how long the steering session lasts.
"""

from __future__ import annotations

import gc
import os
import statistics
import time
import tracemalloc
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from scipy.interpolate import PPoly

from vrs import Timeline
from vrs.model import Array
from vrs.segment import Piece

N = 6
SIZES = (10, 1_000, 100_000, 1_000_000)
YARDSTICK = PPoly(np.ones((4, 10, N)), np.arange(11.0))
"""What the machine does at the moment, beside each edit."""
STEERING_HOURS = float(os.environ.get("VRS_STEERING_HOURS", "0.5"))


def moves(count: int, rng: np.random.Generator) -> list[Piece]:
    """Pieces of 3 to 7 continuous cubics, with `count` segments in all."""
    pieces = []
    q = np.zeros(N)
    while count > 0:
        m = min(int(rng.integers(3, 8)), count)
        count -= m
        durations = rng.uniform(0.02, 0.5, m)
        a = rng.normal(size=(m, 4, N))
        for i, h in enumerate(durations.tolist()):
            a[i, 0] = q
            a[i, 3] = -(0.1 * q + h * a[i, 1] + h**2 * a[i, 2]) / h**3
            q = 0.9 * q
        pieces.append(Piece(durations.tolist(), list(a), len(pieces) + 1))
    return pieces


def built(count: int) -> Timeline:
    """A timeline of so many segments, made by appends."""
    timeline = Timeline(np.zeros(N))
    for piece in moves(count, np.random.default_rng(count)):
        timeline = timeline.edited(timeline.end, [piece])
    return timeline


def plan(rng: np.random.Generator, duration: float, count: int = 5) -> Piece:
    """A move of so many segments that takes so long [s]."""
    shares = rng.uniform(0.2, 1.0, count)
    durations = duration * shares / shares.sum()
    return Piece(durations.tolist(), list(rng.normal(size=(count, 4, N))), int(rng.integers(1, 10**6)))


def splice(timeline: Timeline, rng: np.random.Generator, extra: float) -> Callable[[], Timeline]:
    """An edit somewhere: a move and a joining move instead of three segments, and a tail later by `extra` [s]."""
    index = int(rng.integers(0, len(timeline) - 5))
    cut = timeline.start_of(index) + 0.4 * (timeline.start_of(index + 1) - timeline.start_of(index))
    begin = timeline.start_of(index + 3) + extra
    new = [plan(rng, 0.6 * (begin - cut)), plan(rng, 0.4 * (begin - cut), 3)]
    return lambda: timeline.edited(cut, new, index + 3, begin)


def replacement(timeline: Timeline, rng: np.random.Generator) -> Callable[[], Timeline]:
    cut, new = float(rng.uniform(timeline.start, timeline.end)), [plan(rng, 1.0)]
    return lambda: timeline.edited(cut, new)


def append(timeline: Timeline, rng: np.random.Generator) -> Callable[[], Timeline]:
    new = [plan(rng, 1.0)]
    return lambda: timeline.edited(timeline.end, new)


KINDS: dict[str, Callable[[Timeline, np.random.Generator], Callable[[], Timeline]]] = {
    "splice, later tail": lambda timeline, rng: splice(timeline, rng, 0.7),
    "splice, same tail": lambda timeline, rng: splice(timeline, rng, 0.0),
    "replace": replacement,
    "append": append,
}


def seconds(action: Callable[[], object]) -> float:
    start = time.perf_counter()
    action()
    return time.perf_counter() - start


def edits(timeline: Timeline, label: str) -> None:
    rng = np.random.default_rng(1)
    for kind, make in KINDS.items():
        pairs = [(seconds(make(timeline, rng)), seconds(lambda: YARDSTICK(0.5))) for _ in range(1000)]
        costs, yards = sorted(cost for cost, _ in pairs), [yard for _, yard in pairs]
        tracemalloc.start()
        before = tracemalloc.get_traced_memory()[0]
        versions = []
        for _ in range(100):
            action = make(timeline, rng)
            versions.append(action())
        new = (tracemalloc.get_traced_memory()[0] - before) / 100
        tracemalloc.stop()
        middle, p99 = 1e6 * statistics.median(costs), 1e6 * costs[int(0.99 * len(costs))]
        print(
            f"{label:>17s} {kind:20s} median {middle:6.1f} µs   p99 {p99:6.1f} µs   new {new / 1e3:4.1f} kB"
            f"   (a PPoly call here: {1e6 * statistics.median(yards):.1f} µs)"
        )


def edited_at_random(timeline: Timeline, count: int) -> Timeline:
    rng = np.random.default_rng(2)
    for _ in range(count):
        timeline = splice(timeline, rng, 0.7)()
    return timeline


def memory() -> None:
    pieces = moves(100_000, np.random.default_rng(3))
    gc.collect()
    tracemalloc.start()
    timeline = Timeline(np.zeros(N))
    for piece in pieces:
        timeline = timeline.edited(timeline.end, [piece])
    gc.collect()
    bare = tracemalloc.get_traced_memory()[0] / len(timeline)
    timeline.sample(np.linspace(timeline.start, timeline.end, 100_000))
    stacked = tracemalloc.get_traced_memory()[0] / len(timeline)
    tracemalloc.stop()
    print(f"memory a segment: {bare:.0f} B; with the stacks of a dense sampling of all of it {stacked:.0f} B")


def polynomials(timeline: Timeline) -> tuple[Array, Array]:
    """Coefficients in descending powers, (4, m, n), and knots, (m + 1,)."""
    a = np.zeros((4, len(timeline), N))
    for i, segment in enumerate(timeline.segments):
        a[4 - len(segment.coefficients) :, i] = segment.coefficients[::-1]
    return a, np.array([timeline.start_of(i) for i in range(len(timeline) + 1)])


def drake(a: Array, knots: Array) -> Callable[[float], Any] | None:
    """Drake's trajectory over the first segments, None where Drake isn't installed."""
    try:
        from pydrake.polynomial import Polynomial
        from pydrake.trajectories import PiecewisePolynomial
    except ImportError:
        return None
    m = min(20_000, a.shape[1])
    pieces = [np.array([[Polynomial(a[::-1, i, j])] for j in range(N)]) for i in range(m)]
    trajectory = PiecewisePolynomial(pieces, knots[: m + 1])
    value: Callable[[float], Any] = trajectory.value
    return value


def compare(title: str, rivals: dict[str, Callable[[Any], Any]], arguments: Sequence[Any], repeats: int) -> None:
    """Print the mean time of a call, each run of 50 arguments at its best, the rivals taking turns."""
    runs = [arguments[i : i + 50] for i in range(0, len(arguments), 50)]
    costs = {name: np.full(len(runs), np.inf) for name in rivals}
    for _ in range(repeats):
        for i, run in enumerate(runs):
            for name, function in rivals.items():
                start = time.perf_counter()
                for argument in run:
                    function(argument)
                costs[name][i] = min(costs[name][i], time.perf_counter() - start)
    best = {name: float(cost.sum()) / len(arguments) for name, cost in costs.items()}
    ours = best["timeline"]
    rest = "   ".join(
        f"{name} {1e6 * t:8.2f} µs, ratio {t / ours:5.2f}" for name, t in best.items() if t is not ours
    )
    print(f"{title:44s} timeline {1e6 * ours:8.2f} µs   {rest}")


def samples(timeline: Timeline) -> None:
    a, knots = polynomials(timeline)
    peers: dict[str, Callable[[Any], Any]] = {"PPoly": PPoly(a, knots)}
    value = drake(a, knots)
    scalar = {"timeline": timeline.sample, **peers, **({"Drake": value} if value else {})}
    middle = float(knots[len(knots) // 10])
    sequence = (middle + 1e-3 * np.arange(2000)).tolist()
    rng = np.random.default_rng(4)
    within = rng.uniform(knots[0], knots[min(20_000, len(knots) - 1)], 2000).tolist()
    compare("1 kHz sequence", scalar, sequence, 15)
    compare("1 kHz sequence, times of numpy", scalar, list(np.array(sequence)), 15)
    compare("random times, first 20,000 segments", scalar, within, 15)
    anywhere = rng.uniform(knots[0], knots[-1], 2000)
    both = {"timeline": timeline.sample, **peers}
    compare("random times", both, anywhere.tolist(), 15)
    many = {
        "10,000 times, anywhere, sorted": np.sort(rng.uniform(knots[0], knots[-1], 10_000)),
        "10,000 times, anywhere, unsorted": rng.uniform(knots[0], knots[-1], 10_000),
        "10,000 times, 10 s, sorted": np.linspace(middle, middle + 10, 10_000),
        "10,000 times, 10 s, unsorted": rng.permutation(np.linspace(middle, middle + 10, 10_000)),
    }
    for title, t in many.items():
        for order in range(4):
            functions = {
                "timeline": lambda t, order=order: timeline.sample(t, derivative=order),
                "PPoly": lambda t, order=order: peers["PPoly"](t, order),
            }
            compare(f"{title}, derivative {order}", functions, [t], 30)
    t = many["10,000 times, anywhere, sorted"]
    each = np.array([timeline.sample(x) for x in t.tolist()])
    batch = timeline.sample(t)
    worst = float((np.abs(each - batch) / np.maximum(1, np.abs(batch))).max())
    print(f"scalar and batch differ by at most {worst:.1e}")


def steering(hours: float) -> None:
    """At 50 Hz a plan of 8 segments replaces what lies after now, so that about two are carried out."""
    rng = np.random.default_rng(5)
    plans = [[Piece(([0.011, 0.009] + [0.05] * 6), list(rng.normal(size=(8, 4, N))), k + 1)] for k in range(64)]
    gc.collect()
    tracemalloc.start()
    timeline = Timeline(np.zeros(N))
    ticks = int(hours * 3600 * 50)
    for k in range(ticks):
        timeline = timeline.edited(0.02 * k, plans[k % 64])
    gc.collect()
    size = tracemalloc.get_traced_memory()[0]
    tracemalloc.stop()
    costs, reads = [], []
    for k in range(ticks, ticks + 1000):
        costs.append(seconds(lambda k=k, timeline=timeline: timeline.edited(0.02 * k, plans[k % 64])))
        timeline = timeline.edited(0.02 * k, plans[k % 64])
        reads.append(seconds(lambda k=k, timeline=timeline: timeline.sample(0.02 * k + 0.005)))
    collection = seconds(gc.collect)
    print(
        f"{hours:g} h of steering: {len(timeline)} segments, {size / len(timeline):.0f} B each, "
        f"{size / 1e9 / hours * 24:.2f} GB a day; edit {1e6 * statistics.median(costs):.1f} µs, first sample after "
        f"it {1e6 * statistics.median(reads):.1f} µs, full garbage collection {1e3 * collection:.0f} ms"
    )


def queries(timeline: Timeline) -> None:
    rng = np.random.default_rng(6)
    times = rng.uniform(timeline.start, timeline.end, 2000).tolist()
    indices = rng.integers(0, len(timeline), 2000).tolist()
    calls: dict[str, tuple[Callable[[Any], object], list[Any]]] = {
        "index_at": (timeline.index_at, times),
        "start_of": (timeline.start_of, indices),
        "owner_of": (timeline.owner_of, indices),
        "state_before": (timeline.state_before, times),
        "state_after": (timeline.state_after, indices),
        "segment": (timeline.segment, indices),
    }
    found = []
    for name, (call, arguments) in calls.items():
        best = min(
            seconds(lambda call=call, arguments=arguments: [call(x) for x in arguments]) for _ in range(7)
        ) / len(arguments)
        found.append(f"{name} {1e6 * best:.1f}")
    print(f"{len(timeline)} segments, µs: " + ", ".join(found))


def main() -> None:
    """Print the figures."""
    memory()
    for size in SIZES:
        timeline = built(size)
        edits(timeline, f"{size} segments")
        queries(timeline)
        if size == 100_000:
            edits(edited_at_random(timeline, 5000), "after 5,000 edits")
            samples(timeline)
            samples(edited_at_random(timeline, 5000))
    steering(STEERING_HOURS)


if __name__ == "__main__":
    main()
