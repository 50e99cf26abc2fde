"""What wakes a state machine, on a loop in virtual time whose timers are whole milliseconds, as uvloop's are."""

from __future__ import annotations

import asyncio
import math
from collections.abc import Callable
from dataclasses import dataclass

import pytest

from interfaces.timer import LONGEST, Turning

ROUND = 1e-4
"""What a round of the loop takes [s]."""


@dataclass
class Handle:
    when: float
    call: Callable[[], None]
    cancelled: bool = False

    def cancel(self) -> None:
        self.cancelled = True


class Loop:
    """A loop, and its clock."""

    def __init__(self) -> None:
        self.t = 0.0
        self.handles: list[Handle] = []

    def now(self) -> float:
        return self.t

    def call_soon(self, call: Callable[[], None]) -> Handle:
        return self.call_later(0.0, call)

    def call_later(self, wait: float, call: Callable[[], None]) -> Handle:
        self.handles.append(Handle(self.t + max(round(wait, 3), ROUND), call))
        return self.handles[-1]

    def run(self, until: float) -> None:
        while due := [handle for handle in self.handles if handle.when <= until]:
            first = min(due, key=lambda handle: handle.when)
            self.handles.remove(first)
            if not first.cancelled:
                self.t = max(self.t, first.when)
                first.call()
        self.t = until


@pytest.fixture
def loop(monkeypatch: pytest.MonkeyPatch) -> Loop:
    loop = Loop()
    monkeypatch.setattr(asyncio, "get_running_loop", lambda: loop)
    return loop


def test_it_turns_at_its_deadlines_and_never_before(loop: Loop) -> None:
    deadlines, turns = [0.0104, 0.0236, 0.0371], []

    def turn(now: float) -> float | None:
        turns.append(now)
        return deadlines[len(turns) - 1] if len(turns) <= len(deadlines) else None

    turning = Turning(loop, turn, longest=math.inf)
    turning.start()
    loop.run(10.0)
    assert len(turns) == 4
    for deadline, now in zip(deadlines, turns[1:], strict=True):
        assert 0.0 <= now - deadline < 1.1e-3
    assert turning.lateness.count == 3
    assert turning.lateness.worst == pytest.approx(max(t - d for d, t in zip(deadlines, turns[1:], strict=True)))


@pytest.mark.parametrize("deadline", [None, math.inf, 100.0])
@pytest.mark.parametrize(("longest", "count"), [(LONGEST, 4), (math.inf, 1)])
def test_it_turns_now_and_then_where_nothing_is_due_for_long(
    loop: Loop, deadline: float | None, longest: float, count: int
) -> None:
    turns: list[float] = []
    turning = Turning(loop, lambda now: [turns.append(now), deadline][1], longest=longest)
    turning.start()
    loop.run(0.9)
    assert len(turns) == count


def test_a_deadline_that_is_past_is_turned_for_at_once_and_is_not_late(loop: Loop) -> None:
    turns: list[float] = []
    turning = Turning(loop, lambda now: [turns.append(now), now - 5.0 if len(turns) < 3 else None][1])
    turning.start()
    loop.run(0.1)
    assert len(turns) == 3
    assert turns[-1] < 0.001
    assert turning.lateness.worst < 0.001


def test_asked_for_often_it_turns_once_and_after_the_end_never(loop: Loop) -> None:
    turns: list[float] = []
    turning = Turning(loop, lambda now: [turns.append(now), now + 0.01][1])
    turning.soon()
    loop.run(0.1)
    assert turns == []
    turning.start()
    for _ in range(3):
        turning.soon()
    loop.run(0.105)
    assert len(turns) == 1
    turning.soon()
    turning.stop()
    loop.run(1.0)
    assert len(turns) == 1
    assert not turning.running
