"""What the process of the physics does at each tick; it reads no clock and knows no socket.

A late tick is made good at once, up to `PAUSE`. After a longer pause the missed ticks are left out: they'd be a
burst. Where the references end in mid-motion, jump or were left out, each joint brakes within its limits from the
last reference, and the arm holds until the parent has acknowledged that. Where it rests and the first rows of a
motion come too late, by up to `KEPT` ticks, it begins late, and is on time again when it rests next.
Where it moves and rows come too late, or rests where none of them do, it goes over onto them within its limits, if
it isn't too far from them.

What the body measures is looked at here, before anybody else sees it. Where it isn't sound, the measurement
before it is told again, with its own tick; where that lasts, the arm brakes, and doesn't move while it can't see.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Collection, Iterator, Sequence
from typing import Any, NamedTuple, Protocol

import numpy as np

from interfaces.runtime.physics_messages import (
    Attach,
    Close,
    Fault,
    FaultKind,
    Measurement,
    News,
    Order,
    PhysicsActivity,
    PhysicsReady,
    ReleaseLoad,
    Row,
    Rows,
    TickCounter,
)
from robots.bullet.grasping import HandState
from robots.onboard.following import SensorMonitor
from robots.onboard.servo import from_measured
from vrs.errors import FormatError, VrsError
from vrs.model import Array, Limits, unit_of

KEPT = 300
"""For how many ticks rows are kept that are over."""
_BLOCKS_MOST = 1024
"""Most blocks that are kept; a parent sends one every few ticks, and each cuts the one before."""


class _RowBlock(NamedTuple):
    start: int
    """Tick of the first row."""
    rows: Array
    """(k, 3, n)."""


class RowBuffer:
    """Rows (q, qd, qdd) by tick; it keeps what is still to come, and a little of what was."""

    def __init__(self) -> None:
        self._blocks: deque[_RowBlock] = deque()

    def clear(self) -> None:
        """Forget everything."""
        self._blocks.clear()

    def put(self, start: int, rows: Array) -> bool:
        """Take rows, (k, 3, n), for ticks from `start` on, instead of all those for these and later ticks.

        Returns:
            Whether there was room.
        """
        blocks = self._blocks
        while blocks and blocks[-1].start >= start:
            blocks.pop()
        if len(blocks) >= _BLOCKS_MOST:
            return False
        if blocks and blocks[-1].start + len(blocks[-1].rows) > start:
            last = blocks.pop()
            blocks.append(_RowBlock(last.start, np.array(last.rows[: start - last.start])))
        blocks.append(_RowBlock(start, rows))
        return True

    def take(self, tick: int, most: int) -> Array | None:
        """Rows for this tick and those after it, (1 to most, 3, n).

        After a block that ended at rest its last position is held, a row at a time. Ticks more than `KEPT` before
        this one won't be asked for again.

        Returns:
            The rows; None if there are none for this tick.
        """
        blocks = self._blocks
        while len(blocks) > 1 and blocks[1].start <= tick - KEPT:
            blocks.popleft()
        block = next((block for block in reversed(blocks) if block.start <= tick), None)
        if block is None:
            return None
        start, rows = block
        if tick - start < len(rows):
            return rows[tick - start : tick - start + most]
        if rows[-1, 1].any():
            return None
        held = np.array(rows[-1:])
        held[0, 2] = 0.0
        return held

    def kept(self, tick: int) -> Iterator[tuple[int, Array]]:
        """What there is for this tick and up to `KEPT` before it, a block at a time, the latest first.

        Yields:
            The tick of the first row, and the rows, (k, 3, n), k ≥ 1.
        """
        for start, rows in reversed(self._blocks):
            low, high = max(start, tick - KEPT), min(start + len(rows), tick + 1)
            if low < high:
                yield low, rows[low - start : high - start]


BEGIN = 0.05
"""Two motions that were one until so long ago [s], at most, can be merged."""
ASTRAY = 0.15
"""On the way a joint may get as far from its references as twice its acceleration brings it in so long [s]."""
_SHARE = 1.0
"""Twice the share of the acceleration that's left with which a joint counts for coming to rest beside them."""
_PACE = 8.0
"""Share of what is left that it takes off at most [1/s]: the references may turn away meanwhile."""
_LITTLE = 1e-3
"""What is left is little [rad]."""
_SOFT = 4.0
"""In so many ticks it takes off what is left, where that's little."""
_SAME_POSITION = 1e-11
"""Positions nearer than this [rad] are one: their change in a tick is a speed."""


class ReferenceBlending:
    """Brings joints onto references that came late, a tick at a time, within their limits.

    An arm in motion followed what it had until they came, so they begin elsewhere than it is. Each joint turns onto
    them: at each tick it takes the speed at which it could still brake relative to them, as far as its own limits
    let it. Where the references need all of its acceleration themselves, it waits until they don't.
    """

    def __init__(self, limits: Limits, tick: float) -> None:
        """Keep to limits, in ticks of a length [s]."""
        self._tick = tick
        self._speeds, self._accelerations = limits.qd_max.tolist(), limits.qdd_max.tolist()
        self._low, self._high = limits.q_min.tolist(), limits.q_max.tolist()

    def near(self, q: Sequence[float], qd: Sequence[float], row: Array, *, begun: bool) -> bool:
        """Whether references, (3, n), can be gone over to from positions [rad] and speeds [rad/s].

        Args:
            q: Positions, a tick before.
            qd: Speeds.
            row: The references.
            begun: Whether the arm is on the way to them.
        """
        far, fast = (ASTRAY, math.inf) if begun else (BEGIN, BEGIN)
        return all(
            abs(b - a) <= most * far**2 and abs(w - v) <= 2.0 * most * fast
            for a, v, b, w, most in zip(q, qd, *row[:2].tolist(), self._accelerations, strict=True)
        )

    def there(self, q: Sequence[float], qd: Sequence[float], row: Array) -> bool:
        """Whether references, (3, n), go on from the positions [rad] and speeds [rad/s] of the tick before."""
        h = self._tick
        return all(
            abs(a + 0.5 * h * (v + w) - b) <= _SAME_POSITION and abs(w - v) <= acceleration * h + _SAME
            for a, v, b, w, acceleration in zip(q, qd, *row[:2].tolist(), self._accelerations, strict=True)
        )

    def step(self, q: Sequence[float], qd: Sequence[float], row: Array) -> tuple[list[float], list[float]]:
        """Positions [rad] and speeds [rad/s] of the next tick, whose references are a row, (3, n)."""
        h, positions, speeds = self._tick, [], []
        bounds = zip(self._speeds, self._accelerations, self._low, self._high, strict=True)
        for a, v, b, w, g, (fastest, most, low, high) in zip(q, qd, *row.tolist(), bounds, strict=True):
            ahead = a + 0.5 * h * (v + w) - b
            # What the references take of the acceleration isn't there for coming to rest beside them.
            left = max(most - math.copysign(g, ahead * g), 0.0)
            pace = _PACE if abs(ahead) > _LITTLE else 1.0 / (_SOFT * h)
            wanted = w - math.copysign(min(abs(ahead) * pace, math.sqrt(_SHARE * left * abs(ahead))), ahead)
            up, down = self._stoppable(high - a, v, most), self._stoppable(a - low, -v, most)
            wanted = min(max(wanted, -fastest, -down), fastest, up)
            new = min(max(wanted, v - most * h), v + most * h)
            positions.append(a + 0.5 * h * (v + new))
            speeds.append(new)
        return positions, speeds

    def _stoppable(self, room: float, v: float, most: float) -> float:
        """The speed [rad/s] of the next tick with which a joint can still stop before an end.

        Args:
            room: To the end [rad].
            v: Its speed towards it [rad/s]: until the tick is over it goes on at the mean of both.
            most: Its acceleration [rad/s²].
        """
        change = most * self._tick
        return 0.5 * (math.sqrt(max(change**2 + 4.0 * (2.0 * most * room - change * v), 0.0)) - change)


PAUSE = 0.05
"""Longest time [s] without ticks that is made good."""
AHEAD_MOST = 5000
"""How many ticks ahead references may lie."""

_CHUNK = 8
"""Rows that are prepared together: one alone costs as much as the tick."""
_NEWS_MOST = 64
"""Most messages that wait to be sent; of these the faults stay."""
_OVER = 1.01
"""How many times its limit a reference's speed may be."""
_TICKS = 2.0
"""A reference may change its speed as much as the limits allow in so many ticks."""
_PLACED = 0.05
"""How far from where it's measured a joint may be placed [rad], and from where it will be so much later [s]."""
_HERE = 1e-9
"""A reference that rests nearer than this to where the arm rests [rad] is there."""
_SAME = 1e-9
"""Ticks nearer than this to whole numbers are whole."""


class Moved(NamedTuple):
    """Where a tick brought the body, a number a joint each."""

    q: Sequence[float]
    """Encoder readings [rad]."""
    qd: Sequence[float]
    """[rad/s]."""
    tau: Sequence[float]
    """[N m]; empty if it has no drives."""


class TickBody(Protocol):
    """A body that is moved a tick at a time."""

    def prepare(self, rows: Array) -> Sequence[Any]:
        """Make references, (k, 3, n), ready: what `step` takes for each."""

    def step(self, prepared: Any) -> Moved:
        """Follow a reference for a tick."""

    def attach(self, mass: float) -> None:
        """Take a load [kg]."""

    def release(self) -> None:
        """Drop the load."""


class TickHand(Protocol):
    """A body's hand, and the things around it."""

    def grip(self, opening: float) -> None:
        """Let the fingers go to an opening [m]; infinity opens as far as they go."""

    def state(self) -> HandState:
        """How they're now."""


class _TickState(NamedTuple):
    q: list[float]
    qd: list[float]
    qdd: list[float]
    prepared: Any


class TickLoop:
    """Runs a body on references, and brings it to rest where they fail."""

    def __init__(
        self,
        body: TickBody,
        limits: Limits,
        q: Row,
        *,
        tick: float,
        every: int,
        now: float,
        realtime: bool = False,
        prismatic: Collection[int] = (),
        hand: TickHand | None = None,
    ) -> None:
        """Hold a position.

        Args:
            body: At rest at q.
            limits: Joint limits.
            q: Where it holds [rad].
            tick: Length of a tick [s].
            every: Ticks from one report to the next, ≥ 1.
            now: By the robot's clock [s].
            realtime: What to tell the parent of the process's priority.
            prismatic: Joints that are, from 0: [m] for [rad].
            hand: Of the body; None where there's none.
        """
        self._hand, self._grips = hand, deque[tuple[int, float]]()
        self._body, self._limits, self._tick, self._every = body, limits, tick, every
        self._speeds, self._changes = (_OVER * limits.qd_max).tolist(), (_TICKS * tick * limits.qdd_max).tolist()
        self._last = math.floor(now / tick + _SAME)
        self._at = _TickState(list(q), [0.0] * len(q), [0.0] * len(q), None)
        self._measured, self._measured_tick = Moved(q, [0.0] * len(q), ()), (self._last, self._last)
        self._monitor, self._blind = SensorMonitor(limits, prismatic), False
        self._prismatic = prismatic
        self._buffer, self._ahead = RowBuffer(), deque[tuple[int, _TickState]]()
        self._placing: int | None = None
        self._lag = 0
        self._merging, self._belated = ReferenceBlending(limits, tick), False
        self._merged_at = -1
        self._brake: deque[_TickState] = deque()
        self._doing = PhysicsActivity.FOLLOWING
        self._faults = self._acknowledged = 0
        self._alone = self._failed = False
        self._counter = TickCounter(tick)
        self._news: deque[News] = deque([PhysicsReady(self._last, realtime)])

    @property
    def finished(self) -> bool:
        """Whether there's nothing more to be done: the body failed, or the parent left and the arm rests."""
        return self._failed or (self._alone and self._doing is PhysicsActivity.HOLDING)

    @property
    def failed(self) -> bool:
        """Whether the body failed."""
        return self._failed

    def next_deadline(self) -> float:
        """When the next tick is due, by the robot's clock [s]."""
        return (self._last + 1) * self._tick

    def take(self) -> list[News]:
        """What is to be sent; a report that can't be needn't be, a fault must."""
        news = list(self._news)
        self._news.clear()
        return news

    def receive(self, order: Order) -> None:
        """Take in a message of the parent."""
        try:
            match order:
                case Rows():
                    self._take_rows(order)
                case Attach(mass=mass):
                    self._body.attach(mass)
                case ReleaseLoad():
                    self._body.release()
                case Close():
                    self.leave()
                case _:
                    raise FormatError("message to the physics", f"{type(order).__name__} comes but once")
        except VrsError as problem:
            self.refuse(str(problem))

    def refuse(self, problem: str) -> None:
        """Come to rest, as the parent sends what makes no sense."""
        if self._doing is PhysicsActivity.FOLLOWING:
            self._fail(FaultKind.REFUSED, problem, self._last + 1)

    def leave(self) -> None:
        """Come to rest for good: the parent has ended, or wants it."""
        if not self._alone:
            self._alone = True
            if self._doing is PhysicsActivity.FOLLOWING:
                self._stop()

    def advance(self, *, now: float) -> None:
        """Run the next tick, if it's due by now [s]: one, however many are."""
        k = self._last + 1
        late = now - k * self._tick
        if late < -_SAME * self._tick or self.finished:
            return
        if late > PAUSE:
            self._counter.skipped += (missed := math.floor(now / self._tick + _SAME) - k)
            k += missed
            if self._doing is PhysicsActivity.FOLLOWING and any(self._at.qd):
                self._fail(FaultKind.PAUSED, f"the physics stood still for {late:.3f} s", k)
        self._counter.add(late)
        step = self._step(k)
        try:
            while self._hand is not None and self._grips and self._grips[0][0] <= k - self._lag:
                self._hand.grip(self._grips.popleft()[1])
            moved = self._body.step(step.prepared)
        except VrsError as problem:
            self._failed = True
            self._faults += 1
            here = tuple(self._at.q)
            self._tell(Fault(self._faults, FaultKind.BODY, str(problem), k, here, k))
            return
        self._at, self._last = step, k
        self._see(moved, k)
        if self._doing is PhysicsActivity.BRAKING and not self._brake:
            self._settle()
        if k % self._every == 0:
            q, qd, tau = map(tuple, self._measured)
            seen, followed = self._measured_tick
            hand = None if self._hand is None else self._hand.state()
            counts = self._counter.counts()
            self._tell(Measurement(seen, self._doing, q, qd, tau, tuple(step.q), followed, counts, hand))

    def _see(self, moved: Moved, k: int) -> None:
        """Take what was measured after a tick, if it's sound; brake where it hasn't been for a while."""
        now = k * self._tick
        if self._monitor.look(moved.q, moved.qd, moved.tau, now=now):
            self._measured, self._measured_tick, self._blind = moved, (k, k - self._lag), False
            return
        fault = self._monitor.blind(now=now)
        if fault is not None and self._doing is PhysicsActivity.FOLLOWING and (not self._blind or any(self._at.qd)):
            self._blind = True
            self._fail(FaultKind.SENSOR, str(fault), k + 1)

    def _take_rows(self, message: Rows) -> None:
        if message.run != self._faults or self._alone:
            return
        rows = message.array(len(self._speeds))
        if not np.isfinite(rows).all() or (np.abs(rows[:, 1]) > self._speeds).any():
            raise FormatError("rows", "a reference isn't a number, or faster than the limits")
        if message.start > self._last + AHEAD_MOST:
            raise FormatError("rows", f"tick {message.start} is more than {AHEAD_MOST} ahead")
        if not self._buffer.put(message.start, rows):
            raise FormatError("rows", "too many blocks")
        while self._ahead and self._ahead[-1][0] >= message.start:
            self._ahead.pop()
        while self._grips and self._grips[-1][0] >= message.start:
            self._grips.pop()
        self._grips.extend(message.grips)
        self._belated = self._belated or message.start <= self._last
        if message.placed:
            self._placing = message.start
        self._acknowledged = message.run
        if self._doing is PhysicsActivity.HOLDING:
            self._doing = PhysicsActivity.FOLLOWING

    def _step(self, k: int) -> _TickState:
        """What the body does in a tick."""
        if self._doing is PhysicsActivity.FOLLOWING:
            step = self._following(k)
            if step is not None:
                return step
        return self._brake.popleft() if self._brake else self._held()

    def _following(self, k: int) -> _TickState | None:
        """The reference of a tick; None if the arm must brake instead."""
        if self._lag and not any(self._at.qd):
            self._catch_up(k)
        step = self._row(k - self._lag)
        if step is None:
            if not any(self._at.qd):
                return self._held()
            self._fail(FaultKind.STARVED, "the references ended in mid-motion", k)
            return None
        placing = self._placing is not None and k - self._lag >= self._placing
        joint = self._misplaced(step) if placing else self._jump(step)
        if placing:
            self._placing = None
        else:
            instead = self._belated_step(k, step, jumps=joint is not None)
            if instead is not None:
                return instead
        self._belated = False
        if joint is None:
            return step
        unit = unit_of(joint, self._prismatic)
        way = f"from {self._at.q[joint]:.6g} {unit} at {self._at.qd[joint]:.4g} {unit}/s"
        text = f"joint {joint + 1} would jump {way} to {step.q[joint]:.6g} {unit} at {step.qd[joint]:.4g} {unit}/s"
        self._fail(FaultKind.JUMPED, text, k)
        return None

    def _belated_step(self, k: int, step: _TickState, *, jumps: bool) -> _TickState | None:
        """What to do instead of a reference's step as rows came late; None if it's followed, or not at all."""
        if jumps and not any(self._at.qd):
            later = self._depart_later(k)
            if later is not None:
                return later
        return self._merged(step) if self._belated else None

    def _row(self, tick: int) -> _TickState | None:
        """The reference for a tick; None if there's none."""
        while self._ahead and self._ahead[0][0] < tick:
            self._ahead.popleft()
        if not self._ahead or self._ahead[0][0] > tick:
            rows = self._buffer.take(tick, _CHUNK)
            if rows is None:
                return None
            if len(rows) == 1 and (rows[0, 0] == self._at.q).all() and not rows[0, 1:].any():
                return self._held()
            self._ahead = deque(zip(range(tick, tick + len(rows)), self._prepared(rows), strict=True))
        return self._ahead.popleft()[1]

    def _depart_later(self, k: int) -> _TickState | None:
        """Begin a motion late whose first rows came too late; None if none begins where the arm rests."""
        for first, rows in self._buffer.kept(k):
            rests = (np.abs(rows[:, 0] - self._at.q) <= _HERE).all(axis=1) & ~rows[:, 1].any(axis=1)
            start = first + int(np.flatnonzero(rests)[-1]) if rests.any() else first
            step = self._row(start)
            if step is not None and self._jump(step) is None:
                self._lag = k - start
                return step
        return None

    def _merged(self, step: _TickState) -> _TickState | None:
        """On the way onto a reference whose row came late; None if the arm is there, or too far away."""
        at, row = self._at, np.array((step.q, step.qd, step.qdd))
        here = self._merging.there(at.q, at.qd, row)
        if here or not self._merging.near(at.q, at.qd, row, begun=self._merged_at == self._last):
            return None
        self._counter.merged += 1
        self._merged_at = self._last + 1
        q, qd = self._merging.step(at.q, at.qd, row)
        return self._prepared(np.array((q, qd, (np.array(qd) - at.qd) / self._tick))[None])[0]

    def _catch_up(self, k: int) -> None:
        """Be on time again, if the arm rests until then anyway."""
        for tick in range(k - self._lag, k + 1):
            rows = self._buffer.take(tick, 1)
            if rows is None or (rows[0, 0] != self._at.q).any() or rows[0, 1:].any():
                return
        self._lag = 0

    def _jump(self, step: _TickState) -> int | None:
        """The first joint whose speed or position the limits don't let change like this in a tick or two."""
        h = self._tick
        for j, (q0, v0, q1, v1, change) in enumerate(
            zip(self._at.q, self._at.qd, step.q, step.qd, self._changes, strict=True)
        ):
            if abs(v1 - v0) > change or abs(q1 - q0 - 0.5 * h * (v0 + v1)) > h * change:
                return j
        return None

    def _misplaced(self, step: _TickState) -> int | None:
        """The first joint that moves, or is placed away from where it was measured."""
        for j, (q, v, x, w) in enumerate(zip(step.q, step.qd, *self._measured[:2], strict=True)):
            if v != 0.0 or abs(q - x) > _PLACED * (1.0 + abs(w)):
                return j
        return None

    def _fail(self, kind: FaultKind, text: str, k: int) -> None:
        """Brake, tell it, and take no more references until it's acknowledged."""
        self._faults += 1
        rest = self._stop()
        self._tell(Fault(self._faults, kind, text, k, tuple(rest), k + max(len(self._brake) - 1, 0)))

    def _stop(self) -> list[float]:
        """Begin to brake; return where the references will rest [rad]."""
        self._buffer.clear()
        self._ahead.clear()
        self._grips.clear()
        self._placing, self._lag, self._belated = None, 0, False
        stop = from_measured(0.0, self._at.q, self._at.qd, self._limits)
        ticks = math.ceil(stop.end / self._tick - _SAME) if stop.end > 0 else 0
        t = np.minimum(self._tick * np.arange(1, ticks + 1, dtype=np.float64), stop.end)
        rows = np.stack([stop.timeline.sample(t, derivative=k) for k in range(3)], axis=1)
        if ticks:
            rows[-1, 0], rows[-1, 1:] = stop.rest, 0.0
        self._brake.clear()
        self._brake.extend(self._prepared(rows) if ticks else ())
        self._doing = PhysicsActivity.BRAKING if ticks else PhysicsActivity.HOLDING
        return self._brake[-1].q if self._brake else self._at.q

    def _settle(self) -> None:
        """The references rest."""
        again = self._acknowledged == self._faults and not self._alone
        self._doing = PhysicsActivity.FOLLOWING if again else PhysicsActivity.HOLDING

    def _prepared(self, rows: Array) -> list[_TickState]:
        q, qd, qdd = rows.transpose(1, 0, 2).tolist()
        return list(map(_TickState, q, qd, qdd, self._body.prepare(rows)))

    def _held(self) -> _TickState:
        """Stay at the last reference, at rest."""
        if self._at.prepared is None or any(self._at.qd) or any(self._at.qdd):
            rows = np.zeros((1, 3, len(self._at.q)))
            rows[0, 0] = self._at.q
            self._at = self._prepared(rows)[0]
        return self._at

    def _tell(self, news: News) -> None:
        if len(self._news) >= _NEWS_MOST:
            self._news = deque(n for n in self._news if not isinstance(n, Measurement))
        self._news.append(news)
