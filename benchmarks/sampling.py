"""What a sample costs among 100,000 segments, beside SciPy's PPoly and Drake on the same polynomials."""

from __future__ import annotations

import numpy as np

from benchmarks import moves, peers
from benchmarks.results import Bar, Chart, Cost, Part, Result
from benchmarks.timing import Call, Series, alternate, beside

SEGMENTS = 100_000
OURS, DIRECT, SCIPY, DRAKE = "vrs", "vrs, timeline alone", "SciPy PPoly", "Drake"


def part() -> Part:
    """Measure."""
    engine, _ = moves.appended(SEGMENTS)
    timeline = engine.timeline
    knots = moves.knots(timeline)
    segments = list(timeline.segments)
    scipy_value = peers.ppoly(segments, knots)
    drake = peers.drake(segments, knots)
    del segments
    rng = np.random.default_rng(2)
    middle = float(knots[len(knots) // 2])
    anywhere = rng.uniform(knots[0], knots[-1], 20_000)
    sequence = middle + 1e-3 * np.arange(30_000)

    one: dict[str, Call] = {OURS: engine.joints, DIRECT: timeline.sample, SCIPY: scipy_value}
    many: dict[str, Call] = {OURS: engine.joints, SCIPY: scipy_value}
    if drake is not None:
        one[DRAKE], many[DRAKE] = drake.value, drake.vector_values
    for name, call in one.items():
        off = max(np.abs(np.ravel(call(t)) - engine.joints(t)).max() for t in anywhere[:2000].tolist())
        assert off < 1e-9, f"{name} is off by {off}"

    series: dict[str, dict[str, Series]] = {
        "1 kHz sequence": alternate(one, sequence.tolist()),
        "random times": alternate(one, anywhere.tolist()),
    }
    batches = {
        "sorted": [np.sort(rng.uniform(knots[0], knots[-1], 10_000)) for _ in range(8)],
        "random": [rng.uniform(knots[0], knots[-1], 10_000) for _ in range(8)],
        "10 s, sorted": [np.linspace(t, t + 10, 10_000) for t in rng.uniform(0, knots[-1] - 10, 8)],
    }
    asked: dict[str, dict[str, float | None]] = {
        "1 kHz sequence": {SCIPY: 4.0, DRAKE: 0.8},
        "random times": {SCIPY: 2.5, DRAKE: None},
    }
    results: list[Result] = []
    for name, found in series.items():
        note = "0.8: within 1.25 times Drake's time" if name == "1 kHz sequence" else ""
        results += beside(f"`engine.joints(t)`, {name}", OURS, found, asked[name], note=note)
        results += beside(f"`timeline.sample(t)`, {name}", DIRECT, found, dict.fromkeys(asked[name]))
    for name, times in batches.items():
        found = alternate(many, times, calls=1, blocks=48)
        results += beside(f"10,000 times at once, {name}", OURS, found, {SCIPY: 1.0, DRAKE: None})
    t = np.concatenate([anywhere[:5000], knots[rng.integers(0, len(knots), 5000)]])
    batch = timeline.sample(t)
    scalar = np.array([timeline.sample(x) for x in t.tolist()])
    off = float((np.abs(scalar - batch) / np.maximum(1.0, np.abs(batch))).max())
    results.append(
        Result(
            "one time and 10,000 at once differ by at most",
            Cost(off),
            unit="",
            bar=Bar(median=1e-14),
            note="half of the times at knots; relative to max(1, |q|)",
        )
    )
    return Part(
        "A sample among 100,000 segments",
        f"{len(timeline):,} segments of {len(timeline.owners(0, len(timeline))):,} random joint moves, appended by "
        "commands, alternately parabolic and jerk-limited. The peers have the same polynomials and knots; that "
        "they give the same joints to 1e-9 is checked first. Blocks of 500 calls take turns.",
        tuple(results),
        (_chart(series),),
    )


def _chart(series: dict[str, dict[str, Series]]) -> Chart:
    rows = tuple(series)
    points: dict[str, list[tuple[float, float]]] = {}
    for place, name in enumerate(rows):
        for rival, found in series[name].items():
            if rival != DIRECT:
                points.setdefault(rival, []).append((found.cost.median, place))
    return Chart(
        "sampling", "One sample among 100,000 segments", "dots", "median cost [µs]", series=points, rows=rows
    )
