"""Edits of arcs as they stand in a recording: what comes back is what went in."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from interfaces.messages.recording import ArcChange
from interfaces.recording.history import Chain, changed_arcs, edit_entries, whole, whole_entries
from robots import ipr
from vrs import DriveCommand, Engine, ManualClock, Stop
from vrs.errors import FormatError, InvalidValueError
from vrs.mobile import ArcTimeline

DRIVES = st.tuples(
    st.floats(0.0, 0.5),
    st.floats(-0.5, 0.5),
    st.floats(-0.7, 0.7),
    st.floats(0.05, 0.6),
    st.one_of(st.none(), st.floats(0.0, 1.5)),
    st.booleans(),
)


SPLICE = 0.0, 0.2, 0.1, 0.5, 0.0, False


# A splice whose tail's starts aren't the sums of the durations before them.
@example([(0.0, 0.1, 0.0, d, None, False) for d in (0.3093201063609129, 0.05, 0.5, 0.5, 0.5)] + [SPLICE])
@settings(max_examples=40)
@given(st.lists(DRIVES, min_size=1, max_size=8))
def test_edits_come_back_whatever_is_commanded(told: list[Any]) -> None:
    clock = ManualClock(0.0)
    engine = Engine(ipr.model(), posture=(0.3, -0.2, 1.0), clock=clock)
    chain, made, before = Chain("here"), [engine.timeline], engine.timeline
    for entry in whole_entries(before, 0, 0.0):
        chain.add(entry)
    for wait, v, w, duration, later, stops in told:
        clock.advance(wait)
        at = None if later is None else clock.now() + later
        engine.execute(Stop() if stops else DriveCommand(v, w, duration, execute_at=at))
        if engine.timeline is before:
            continue
        for entry in edit_entries(before, engine.timeline, len(made), clock.now(), None):
            chain.add(entry)
        made.append(engine.timeline)
        before = engine.timeline
    assert [edit.timeline for edit in chain.edits] == made
    assert [edit.timeline.version for edit in chain.edits] == [timeline.version for timeline in made]
    t = np.linspace(-1.0, before.end + 1.0, 100)
    assert chain.edits[-1].timeline.sample(t).tobytes() == before.sample(t).tobytes()


def driven(count: int) -> ArcTimeline:
    engine = Engine(ipr.model(), posture=(0.0, 0.0, 0.0))
    for k in range(count):
        engine.execute(DriveCommand(0.3, 0.2 * (-1) ** k, 0.1))
    timeline = engine.timeline
    assert isinstance(timeline, ArcTimeline)
    return timeline


def test_a_long_history_comes_in_parts() -> None:
    timeline = driven(600)
    entries = list(whole_entries(timeline, 3, 1.0))
    assert [entry.index for entry in entries] == [0, 256, 512]
    assert whole(entries[-1], [part for entry in entries for part in entry.segments]) == timeline
    chain = Chain("here")
    for entry in entries[1:]:
        chain.add(entry)
    assert chain.edits == []


def test_a_change_that_fits_nothing_is_refused() -> None:
    base, after = driven(3), driven(5)
    (entry,) = edit_entries(base, after, 1, 0.0, None)
    assert isinstance(entry, ArcChange)
    assert changed_arcs(base, entry) == after
    for wrong in (
        replace(entry, first=9),
        replace(entry, end=7.0),
        replace(entry, segments=(replace(entry.segments[0], v=0.2), *entry.segments[1:])),
    ):
        with pytest.raises(InvalidValueError):
            changed_arcs(base, wrong)


def test_edits_of_an_arm_and_of_a_mobile_robot_dont_mix() -> None:
    from tests.interfaces.recording.recorded import history, motion

    _, arm, _ = motion(0.5)
    chain = Chain("here")
    chain.add(history(arm, 0))
    (entry,) = edit_entries(driven(3), driven(5), 1, 0.0, None)
    with pytest.raises(FormatError, match="another kind"):
        chain.add(entry)
