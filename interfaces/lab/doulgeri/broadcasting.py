"""Section VI-B: several broadcasters on one engine, each with several viewers."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from interfaces import Designer, Viewer
from interfaces.engine_server.broadcast import Broadcaster
from interfaces.lab.claims import Claim, Findings, Study, Table, at_most
from interfaces.lab.doulgeri.script import HOME, MODEL, PortLog, ScriptedSite, target
from interfaces.lab.output import REAL, VIRTUAL, draw
from interfaces.messages import ViewForm
from vrs import Engine, ManualClock, MotionCommand, WallClock

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Canvas

RATES: Final = (10, 20, 30, 40, 50, 60)
"""Frames a second."""
VIEWERS: Final = 4
"""Of each broadcaster."""
DELAY: Final = 0.1
"""Each way [s]."""
TIMED: Final = 2000
"""Frames that are timed."""
SECTION: Final = "Section VI-B"


def work(study: Study, _case: str) -> Findings:
    """All rates at once, on one engine that moves; then the time that a frame takes."""
    rng = np.random.default_rng((study.seed, 4))
    joined = ScriptedSite(0.0)
    broadcasters = [joined.site.broadcast(rate) for rate in RATES]
    taps: dict[int, list[PortLog]] = {rate: [] for rate in RATES}
    for rate in RATES:
        for _ in range(VIEWERS):
            port = joined.connect(DELAY, DELAY)
            joined.add(Viewer(port, rate=rate, form=ViewForm.FRAMES))
            taps[rate].append(PortLog(port))
    designer = Designer(joined.connect(DELAY, DELAY))
    joined.add(designer)
    begin, length = 1.0, min(study.length, 10.0)
    for k in range(int(length)):
        joined.run(begin + k)
        designer.issue(MotionCommand(target(rng)), now=joined.now)
    joined.run(begin + length + 1.0)

    claims, rows = [], []
    delivered: dict[int, int] = {}
    gaps: dict[int, np.ndarray] = {}
    for rate, broadcaster in zip(RATES, broadcasters, strict=True):
        made = broadcaster.number
        missing = [count_missing([frame.number for frame, _ in tap.frames]) for tap in taps[rate]]
        gaps[rate] = np.concatenate([np.diff([came for _, came in tap.frames]) for tap in taps[rate]])
        delivered[rate] = min(len(tap.frames) for tap in taps[rate])
        counted = sum(missing) == 0 and broadcaster.skipped == 0 and delivered[rate] >= rate * length
        even = float(np.abs(gaps[rate] - 1.0 / rate).max())
        rows.append(
            (
                ("frames a second", rate),
                ("viewers", VIEWERS),
                ("frames made", made),
                ("delivered to each, least", delivered[rate]),
                ("missing", sum(missing)),
                ("interval, mean s", float(gaps[rate].mean())),
                ("largest s", float(gaps[rate].max())),
            )
        )
        text = f"{rate} frames a second to {VIEWERS} viewers, beside other rates: missing or skipped"
        claims.append(Claim(text, SECTION, 0, sum(missing) + broadcaster.skipped, counted))
        text = f"{rate} frames a second: interval between frames at the viewers off by at most [s]"
        claims.append(at_most(text, SECTION, 1e-6, even))
    table = Table.of("broadcasters", "Six broadcasters at once on one engine", rows)
    picture = draw("broadcasters", "Frames at the viewers, six broadcasters on one engine", _paint, delivered, gaps)
    return Findings(tuple(claims), (table,), (picture,), load())


def count_missing(numbers: list[int]) -> int:
    """Frames between the first and the last that didn't come."""
    return numbers[-1] - numbers[0] + 1 - len(numbers) if numbers else 1


def load() -> tuple[Claim, ...]:
    """What a frame costs the server: the median of many, made at 50 a second for some viewers."""
    clock, wall = ManualClock(0.0), WallClock()
    engine = Engine(MODEL, q=HOME, clock=clock)
    rng = np.random.default_rng(0)
    broadcaster = Broadcaster(engine, rate=50.0, lead=0.5)
    slots = [broadcaster.join() for _ in range(VIEWERS)]
    costs = []
    for k in range(TIMED):
        if k % 50 == 0:
            engine.execute(MotionCommand(target(rng)))
        begin = wall.now()
        made = broadcaster.advance(now=clock.now())
        costs.append(wall.now() - begin)
        assert len(made) == 1
        assert all(slot.take() for slot in slots)
        clock.set((k + 1) / 50.0)
    cost = float(np.median(costs))
    return (
        at_most(f"a frame for {VIEWERS} viewers costs the server [s], median", SECTION, 0.002, cost),
        at_most(
            "50 frames a second take of one processor, a share",
            SECTION,
            0.1,
            50 * cost,
            note=": no serious overload",
        ),
    )


def _paint(canvas: Canvas, delivered: dict[int, int], gaps: dict[int, np.ndarray]) -> None:
    left, right = canvas.subplots(1, 2)
    x = np.arange(len(delivered))
    left.bar(x, list(delivered.values()), 0.6, color=VIRTUAL)
    left.set_xticks(x, [str(rate) for rate in delivered])
    left.set_title("frames delivered to each viewer")
    left.grid(visible=False, axis="x")
    right.plot(x, [1e3 / rate for rate in delivered], color=VIRTUAL, marker="_", markersize=16, linestyle="none")
    for k, rate in enumerate(delivered):
        times = 1e3 * gaps[rate]
        right.plot([k, k], [times.min(), times.max()], "o", color=REAL, markersize=3.5)
    right.set_xticks(x, [str(rate) for rate in delivered])
    right.set(ylim=(0.0, None), title="interval, ms: asked (–), measured (•)")
    for ax in (left, right):
        ax.set_xlabel("frames a second")
