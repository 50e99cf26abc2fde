"""Section VI-B: several broadcasters on one engine, each with several viewers."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, ClassVar, Final

import numpy as np
from typing_extensions import override

from interfaces import Designer, Viewer
from interfaces.engine_server.broadcast import DUE, Broadcaster
from interfaces.engine_server.site import Site
from interfaces.lab.claims import OWN_BAR, Claim, Findings, Results, Study, Table, at_most, none_of
from interfaces.lab.doulgeri import real_sockets
from interfaces.lab.doulgeri.script import HOME, MODEL, PortLog, ScriptedSite, target
from interfaces.lab.output import REAL, VIRTUAL, draw
from interfaces.messages import Broadcast, ViewForm
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
TIMED_ANEW: Final = 20
"""Those of the engine that keeps no timeline."""
SOCKETS: Final = 2
"""Viewers of a server behind real sockets."""
SECTION: Final = "Section VI-B"
OURS: Final = f"{SECTION}; {OWN_BAR}"
TICK: Final = 0.02
"""Of the loop that serves all rates [s]."""


class TickedBroadcaster(Broadcaster):
    """Served by a loop that looks 50 times a second what is due, at whatever rate."""

    @override
    def next_deadline(self) -> float | None:
        due = super().next_deadline()
        return None if due is None else math.ceil(due / TICK - 1e-6) * TICK

    @override
    def advance(self, *, now: float) -> tuple[Broadcast, ...]:
        due = self.next_deadline()
        return () if due is not None and now < due - DUE else super().advance(now=now)


class SleepingBroadcaster(Broadcaster):
    """The obvious loop: send a frame, then sleep for a period. What each turn takes comes on top."""

    @override
    def advance(self, *, now: float) -> tuple[Broadcast, ...]:
        made = super().advance(now=now)
        if made:
            self._begun, self._beat = now, 1
        return made


class TickedSite(Site):
    """A site with other broadcasters."""

    kind: ClassVar[type[Broadcaster]] = TickedBroadcaster

    @override
    def broadcast(self, rate: float, *, lead: float = 0.0) -> Broadcaster:
        assert self.journal is not None
        self._broadcasters.append(self.kind(self.journal, rate=rate, lead=lead))
        return self._broadcasters[-1]


class SleepingSite(TickedSite):
    """Another one."""

    kind = SleepingBroadcaster


def together(kind: type[Site], seed: int, length: float) -> dict[int, Results]:
    """All rates at once, on one engine that moves."""
    rng = np.random.default_rng((seed, 4))
    joined = ScriptedSite(0.0, kind)
    broadcasters = [joined.site.broadcast(rate) for rate in RATES]
    taps: dict[int, list[PortLog]] = {rate: [] for rate in RATES}
    for rate in RATES:
        for _ in range(VIEWERS):
            port = joined.connect(DELAY, DELAY)
            joined.add(Viewer(port, rate=rate, form=ViewForm.FRAMES))
            taps[rate].append(PortLog(port))
    designer = Designer(joined.connect(DELAY, DELAY))
    joined.add(designer)
    begin = 1.0
    for k in range(int(length)):
        joined.run(begin + k)
        designer.issue(MotionCommand(target(rng)), now=joined.now)
    joined.run(begin + length + 1.0)
    seen = {}
    for rate, broadcaster in zip(RATES, broadcasters, strict=True):
        missing = sum(count_missing([frame.number for frame, _ in tap.frames]) for tap in taps[rate])
        delivered = min(len(tap.frames) for tap in taps[rate])
        # What came to nobody from the beginning on, or from some time on, has no number that is seen.
        short = max(0, int(rate * length) - delivered)
        seen[rate] = Results(
            made=broadcaster.number,
            delivered=delivered,  # to each viewer, least
            lacking=missing + broadcaster.skipped + short,  # frames that were missed, skipped, or never came
            gaps=np.concatenate([np.diff([came for _, came in tap.frames]) for tap in taps[rate]]),  # [s]
        )
    return seen


def work(study: Study, _case: str) -> Findings:
    """All rates at once, then over real sockets; then the time that a frame takes."""
    length = min(study.length, 10.0)
    ours, ticked = (together(kind, study.seed, length) for kind in (Site, TickedSite))
    loop = f"one loop of {1 / TICK:g} ticks a second serves all"
    named = f"{', '.join(map(str, RATES))} frames a second at once, {VIEWERS} viewers each"
    claims = (
        none_of(
            f"{named}: missing or skipped", SECTION, _lacking(ours), (loop, _lacking(ticked)),
            of=min(s.delivered for s in ours.values()),
        ),
        at_most(
            f"{named}: interval between frames at the viewers off by at most [s]", OURS, 1e-6, _uneven(ours),
            (loop, _uneven(ticked)),
        ),
    )  # fmt: skip
    rows = [
        (
            ("frames a second", rate),
            ("viewers", VIEWERS),
            ("frames made", s.made),
            ("delivered to each, least", s.delivered),
            ("missing or skipped", s.lacking),
            ("interval, mean s", float(s.gaps.mean())),
            ("largest s", float(s.gaps.max())),
            ("one loop for all: missing or skipped", ticked[rate].lacking),
            ("its largest interval s", float(ticked[rate].gaps.max())),
        )
        for rate, s in ours.items()
    ]
    table = Table.of("broadcasters", "Six broadcasters at once on one engine", rows)
    picture = draw("broadcasters", "Frames at the viewers, six broadcasters on one engine", _paint, ours)
    return Findings(claims, (table,), (picture,), (*over_sockets(min(study.length, 4.0)), load()))


def _lacking(seen: dict[int, Results]) -> int:
    return sum(s.lacking for s in seen.values())


def _uneven(seen: dict[int, Results]) -> float:
    """How far an interval between frames is off, at most [s]."""
    return max(float(np.abs(s.gaps - 1.0 / rate).max()) for rate, s in seen.items())


def over_sockets(length: float) -> tuple[Claim, ...]:
    """What share of the frames comes through real sockets and a bad link."""
    ours, slept = real_sockets.lacking((Site, SleepingSite), SOCKETS, length)
    text = (
        f"{real_sockets.RATE} frames a second over real sockets to {SOCKETS} viewers, {real_sockets.DELAY:g} s "
        f"each way, {100 * real_sockets.LOSS:g} % lost: share of the frames due that a viewer lacks"
    )
    return (at_most(text, OURS, 0.02, ours, ("a loop that sleeps for a period after each frame", slept)),)


def count_missing(numbers: list[int]) -> int:
    """Frames between the first and the last that didn't come."""
    return numbers[-1] - numbers[0] + 1 - len(numbers) if numbers else 1


def load() -> Claim:
    """What a frame costs the server: the median of many, made at 50 a second for some viewers."""
    clock, wall = ManualClock(0.0), WallClock()
    engine = Engine(MODEL, q=HOME, clock=clock)
    rng = np.random.default_rng(0)
    broadcaster = Broadcaster(engine, rate=50.0, lead=0.5)
    slots = [broadcaster.join() for _ in range(VIEWERS)]
    costs, given = [], []
    for k in range(TIMED):
        if k % 50 == 0:
            given.append((clock.now(), MotionCommand(target(rng))))
            engine.execute(given[-1][1])
        begin = wall.now()
        made = broadcaster.advance(now=clock.now())
        costs.append(wall.now() - begin)
        assert len(made) == 1
        assert all(slot.take() for slot in slots)
        clock.set((k + 1) / 50.0)
    anew = []
    for k in range(TIMED_ANEW):
        begin = wall.now()
        again = ManualClock(0.0)
        without = Engine(MODEL, q=HOME, clock=again)
        for t, command in given:
            again.set(t)
            without.execute(command)
        without.joints(given[-1][0] + k / 50.0)
        anew.append(wall.now() - begin)
    return at_most(
        f"50 frames a second for {VIEWERS} viewers take of one processor, a share", OURS, 0.1,
        50 * float(np.median(costs)),
        (f"no timeline is kept: each frame plans {len(given)} commands anew", 50 * float(np.median(anew))),
        note=": no serious overload",
    )  # fmt: skip


def _paint(canvas: Canvas, seen: dict[int, Results]) -> None:
    left, right = canvas.subplots(1, 2)
    x = np.arange(len(seen))
    left.bar(x, [s.delivered for s in seen.values()], 0.6, color=VIRTUAL)
    left.set_xticks(x, [str(rate) for rate in seen])
    left.set_title("frames delivered to each viewer")
    left.grid(visible=False, axis="x")
    right.plot(x, [1e3 / rate for rate in seen], color=VIRTUAL, marker="_", markersize=16, linestyle="none")
    for k, s in enumerate(seen.values()):
        times = 1e3 * s.gaps
        right.plot([k, k], [times.min(), times.max()], "o", color=REAL, markersize=3.5)
    right.set_xticks(x, [str(rate) for rate in seen])
    right.set(ylim=(0.0, None), title="interval, ms: asked (–), measured (•)")
    for ax in (left, right):
        ax.set_xlabel("frames a second")
