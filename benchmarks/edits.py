"""What the bare edit costs anywhere in a long timeline, and whether a command is dearer there."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from benchmarks import moves
from benchmarks.moves import MODEL, PROFILES
from benchmarks.results import Bar, Chart, Cost, Part, Result
from benchmarks.timing import Stopwatch
from vrs import Engine, Insertion, JointTarget, MotionCommand, Profile, Status, Timeline
from vrs.segment import Piece

SEGMENTS = 100_000
EDITS = 5_000
MOST = 50.0
"""Median of a bare edit that is asked for [µs]."""
PLACES = 10
PER_PLACE = 150
COMMANDS = 300

Edit = Callable[[], Timeline]


def part() -> Part:
    """Measure."""
    engine, commands = moves.appended(SEGMENTS)
    timeline = engine.timeline
    pieces = moves.cycle(400)
    results: list[Result] = []
    dots: dict[str, list[tuple[float, float]]] = {}
    rng = np.random.default_rng(6)
    worn = timeline
    for _ in range(EDITS):
        worn = _splice(worn, rng, pieces, rng.uniform())()
    for label, edited in {f"among {len(timeline):,} segments": timeline, f"after {EDITS:,} edits": worn}.items():
        for name, make in {"splice, tail shifted": _splice, "replace all after": _replace}.items():
            cost, slowest, costs = _anywhere(edited, rng, pieces, make)
            results.append(
                Result(
                    f"bare edit {label}: {name}",
                    cost,
                    bar=Bar(median=MOST),
                    note=f"the dearest of {PLACES} places: median {slowest:.0f} µs",
                )
            )
            dots[f"{name}, {label}"] = [(100 * (i + 0.5) / PLACES, value) for i, value in enumerate(costs)]
        results.append(_after(edited, rng, pieces, label))
    results += [_whole(engine, commands, place, profile) for place in ("middle", "end") for profile in PROFILES]
    return Part(
        "Edits of a long plan",
        "`timeline.edited(cut, pieces, tail, tail_start)` at random places of each tenth: two moves of real plans "
        "instead of what lay there, the tail shifted to their end, or nothing left of it. Then the same after "
        "5,000 such edits, and the first sample after an edit. Below, whole commands on the long plan and on a "
        "plan of some ten segments cut out of it, in turns: the same random command in the same move, taken back "
        "after each.",
        tuple(results),
        (
            Chart(
                "edits",
                "The bare edit, from the oldest to the newest segment",
                "lines",
                "place in the timeline [%]",
                "median cost [µs]",
                dots,
                bars={"asked": MOST},
                log=False,
            ),
        ),
    )


def _splice(timeline: Timeline, rng: np.random.Generator, pieces: list[Piece], place: float) -> Edit:
    """Two moves instead of what is left of five segments, and the tail after them."""
    index = int(place * (len(timeline) - 6))
    cut = 0.5 * (timeline.start_of(index) + timeline.start_of(index + 1))
    first = int(rng.integers(0, len(pieces) - 1))
    new = pieces[first : first + 2]
    return partial(timeline.edited, cut, new, index + 5, cut + sum(sum(piece.durations) for piece in new))


def _replace(timeline: Timeline, rng: np.random.Generator, pieces: list[Piece], place: float) -> Edit:
    """A move instead of all that follows."""
    cut = timeline.start + place * (timeline.end - timeline.start)
    return partial(timeline.edited, cut, [pieces[int(rng.integers(0, len(pieces)))]])


def _anywhere(
    timeline: Timeline,
    rng: np.random.Generator,
    pieces: list[Piece],
    make: Callable[[Timeline, np.random.Generator, list[Piece], float], Edit],
) -> tuple[Cost, float, list[float]]:
    """Cost over all places, the median of the dearest place, and the medians of all places."""
    everywhere = Stopwatch.new()
    medians = []
    for k in range(PLACES):
        watch = Stopwatch.new()
        for _ in range(PER_PLACE):
            watch.time(make(timeline, rng, pieces, (k + rng.uniform()) / PLACES))
        medians.append(watch.cost.median)
        everywhere.wall += watch.wall
        everywhere.processor += watch.processor
    return everywhere.cost, max(medians), medians


def _after(timeline: Timeline, rng: np.random.Generator, pieces: list[Piece], label: str) -> Result:
    """The first sample of a timeline just edited, at the cut."""
    watch = Stopwatch.new()
    for _ in range(500):
        edit = _splice(timeline, rng, pieces, rng.uniform())
        edited = edit()
        watch.time(partial(edited.sample, edit.args[0] + 0.01))  # type: ignore[attr-defined]
    return Result(f"first sample after an edit, {label}", watch.cost)


def _whole(engine: Engine, commands: list[MotionCommand], place: str, profile: Profile) -> Result:
    """The same command on the long plan and on a short one cut out of it."""
    where = "in the middle of" if place == "middle" else "at the end of"
    # Two moves: the interrupted one and, in the middle, its tail; at the end, what lies before it.
    m = len(commands) // 2 if place == "middle" else len(commands) - 1
    first = m if place == "middle" else m - 1
    short = Engine(MODEL, q=engine.joints(engine.receipts[first].execute_at))
    for command in commands[first : first + 2]:
        short.execute(command)
    starts = {"long": engine.receipts[m].execute_at, "short": short.receipts[m - first].execute_at}
    end = engine.receipts[m].end
    assert end is not None
    length = end - (starts["long"] or 0.0)
    engines = {"long": engine, "short": short}
    watches = {name: Stopwatch.new() for name in engines}
    rng = np.random.default_rng(7)
    source = moves.targets(rng)
    order = list(engines)
    rejected = 0
    for k in range(COMMANDS + 20):
        target, share = JointTarget(next(source)), rng.uniform(0.1, 0.9)
        for name in order:
            t = (starts[name] or 0.0) + share * length
            command = MotionCommand(target, execute_at=t, profile=profile, insertion=Insertion.SPLICE)
            watch = watches[name] if k >= 20 else Stopwatch.new()
            receipt = watch.time(partial(engines[name].execute, command))
            if receipt.status is Status.REJECTED:
                rejected += 1
            else:
                engines[name].undo()
        order.reverse()
    return Result(
        f"whole command {where} {len(engine.timeline):,} segments, {profile} splice",
        watches["long"].cost,
        bar=Bar(ratio=round(1 / 1.2, 3)),
        peer=f"vrs, {len(short.timeline)} segments",
        theirs=watches["short"].cost,
        ratio=float(np.median(np.divide(watches["short"].processor, watches["long"].processor))),
        note="0.833: at most 1.2 times" + (f"; {rejected} of {2 * COMMANDS + 40} rejected" if rejected else ""),
    )
