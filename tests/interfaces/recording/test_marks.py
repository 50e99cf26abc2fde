"""Marks of recordings: each kind, at its time, about what it's about."""

from __future__ import annotations

import time

import numpy as np
import pytest

from interfaces.recording.marks import MarkKind, MarkReader, falsified
from interfaces.recording.recording import open_recording
from tests.interfaces.recording.made import HOME, MODEL, make, to
from vrs import Engine, ManualClock, Timeline
from vrs.commands import Insertion


@pytest.fixture(scope="module")
def marks(tmp_path_factory):
    path = tmp_path_factory.mktemp("made") / "run.mcap"
    make(path, 6.0)
    with open_recording(path) as recording:
        reader = MarkReader(recording)
        assert not reader.read()
        yield reader


def test_each_kind_is_there_at_its_time(marks):
    found = [(mark.t, mark.kind) for mark in marks.marks]
    assert (0.2, MarkKind.COMMAND) in found
    assert (1.6, MarkKind.POSTPONED) in found
    assert (1.6, MarkKind.FALSIFIED) in found
    assert (2.0, MarkKind.REJECTED) in found
    assert (2.8, MarkKind.COMMAND) in found
    assert (3.0, MarkKind.LINK) in found
    assert (3.5, MarkKind.STOPPED) in found
    assert (3.5, MarkKind.OTHER) in found
    assert [t for t, _ in found] == sorted(t for t, _ in found)
    texts = {mark.t: mark.text for mark in marks.marks if mark.kind is not MarkKind.FALSIFIED}
    assert "postponed" in texts[1.6]
    assert "straight line" in texts[2.0]
    assert texts[2.8] == "command 6 was taken back"
    assert "stop" in texts[4.5]
    assert all(mark.text and "\n" not in mark.text for mark in marks.marks)


def test_what_is_appended_to_a_plan_falsifies_nothing(marks):
    false = {mark.t for mark in marks.marks if mark.kind is MarkKind.FALSIFIED}
    assert not false & {0.2, 2.4, 2.5}
    assert {1.6, 2.8, 4.5} <= false


def test_the_nearest_are_found(marks):
    assert marks.latest(0.1) is None
    assert marks.latest(0.2).t == 0.2
    assert marks.latest(2.1).kind is MarkKind.REJECTED
    assert marks.beside(2.0, back=False).t == 2.4
    assert marks.beside(2.0, back=True).t == 1.6
    assert marks.beside(0.2, back=True) is None
    assert [mark.t for mark in marks.passed(0.2, 2.0)] == [0.9, 1.6, 1.6, 2.0]
    assert [mark.t for mark in marks.passed(2.0, 0.2)] == [1.6, 1.6, 0.9, 0.2]


@pytest.mark.parametrize("scale", [1.0, 40.0])
def test_the_falsified_span_is_where_both_plans_differ(scale):
    """Also where a plan is long and little of it changes."""
    clock = ManualClock(0.0)
    engine = Engine(MODEL, q=HOME, clock=clock)
    engine.execute(to(0))
    for k in range(1, 6):
        engine.execute(to(k, insertion=Insertion.APPEND, execute_at=scale * k))
    clock.set(0.1)
    before = engine.timeline
    receipt = engine.execute(to(9, execute_at=3.2 * scale))
    low, high = falsified(before, engine.timeline, 0.1)
    t = np.linspace(0.1, before.end, 200_001)
    differs = t[np.abs(before.sample(t) - engine.timeline.sample(t)).max(axis=1) > 1e-9]
    assert low <= differs[0] + 1e-9
    assert low >= receipt.execute_at - scale * 0.1
    assert high == pytest.approx(differs[-1], abs=scale * 0.1)
    assert falsified(before, before, 0.1) is None
    assert falsified(before, engine.timeline, before.end + 1.0) is None
    assert falsified(Timeline(HOME, 0.0, ()), engine.timeline, 0.0) is None


def test_a_bounded_number_at_a_time_gives_the_same(tmp_path):
    path = tmp_path / "run.mcap"
    make(path, 12.0)
    with open_recording(path) as recording:
        whole, bit = MarkReader(recording), MarkReader(recording)
        begun = time.process_time()
        whole.read()
        assert time.process_time() - begun < 1.0
        turns = 1
        while bit.read(3):
            turns += 1
        assert turns >= 8
        assert bit.marks == whole.marks
