"""Recorded commands once more: the very same timeline, or the first that differs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from interfaces.messages.recording import Anchor, CommandRecord
from interfaces.recording.recording import open_recording
from interfaces.recording.rerun import rerun
from robots import puma560
from tests.interfaces.recording.taken import MODEL, NOMINAL, Sitting
from vrs import JointTarget, MotionCommand, Receipt
from vrs.commands import Cancel, Insertion, ParameterChange, Resume, Retime, ScaleTime, SteerCommand, Stop
from vrs.record import set_field


def same(one, other):
    return one == other and all(
        (a.start, a.duration, a.command_id, a.coefficients.tobytes())
        == (b.start, b.duration, b.command_id, b.coefficients.tobytes())
        for a, b in zip(one.segments, other.segments, strict=True)
    )


def facts(receipts):
    """All that receipts say."""
    names = [name for name in Receipt.__slots__ if not name.endswith("names") and name != "q"]
    return [
        (*(getattr(r, name) for name in names), None if r.q is None else r.q.tolist(), r.shifted, r.superseded)
        for r in receipts
    ]


@pytest.fixture(scope="module")
def sittings(tmp_path_factory):
    """Some random sittings, and their files."""
    found = []
    for seed in range(6):
        path = tmp_path_factory.mktemp("sitting") / "run.mcap"
        made = Sitting(path, seed)
        made.go_on(50)
        made.end()
        found.append((made, path))
    return found


@pytest.mark.parametrize("seed", range(6))
def test_commands_of_every_kind_make_the_same_timeline_again(sittings, seed):
    made, path = sittings[seed]
    with open_recording(path) as recording:
        again = rerun(recording)
        assert (again.difference, again.missing) == ("", "")
        assert again.identical
        assert again.versions == len(made.timelines) - 1
        assert same(again.timeline, made.site.robot.engine.timeline)
        # Whoever has no engine puts the edits together.
        assert len(recording.edits) == len(made.timelines)
        for edit, timeline in zip(recording.edits, made.timelines, strict=True):
            t = np.linspace(0.0, timeline.end + 1.0, 50)
            assert edit.timeline.sample(t) == pytest.approx(timeline.sample(t), abs=1e-12)
        kept = facts(made.site.robot.engine.receipts)
        assert facts(again.receipts) == facts(recording.receipts("virtual")) == kept


def test_every_kind_is_among_them(sittings):
    kinds, refused, rejected, anchors = set(), 0, 0, 0
    for _, path in sittings:
        with open_recording(path) as recording:
            for entry in recording.commands:
                if isinstance(entry, Anchor):
                    anchors += 1
                    continue
                kinds.add(type(entry.command).__name__)
                refused += entry.refused
                rejected += entry.receipt is not None and entry.receipt.status == "rejected"
    assert kinds == {
        "MotionCommand", "SteerCommand", "Retime", "Cancel", "InsertVia", "ScaleTime", "Stop", "Resume",
        "ParameterChange", "NoneType",
    }  # fmt: skip
    assert min(refused, rejected, anchors) > 2


def told(path):
    """A site that's told one of each, in this order."""
    made = Sitting(path, 0)
    away = JointTarget(NOMINAL + 0.2)
    commands = [
        MotionCommand(away), MotionCommand(JointTarget(NOMINAL), execute_at=3.0), Retime(2, 4.0), ScaleTime(0.5),
        MotionCommand(JointTarget(NOMINAL + 90.0)), None, Stop(), Resume(), Cancel(2),
        SteerCommand(rates=np.full(6, 0.1)), MotionCommand(away, insertion=Insertion.REPLACE),
    ]  # fmt: skip
    for k, command in enumerate(commands):
        made.clock = 0.1 + 0.1 * k
        made.tell(command)
    made.clock = made.site.robot.engine.timeline.end
    made.tell(ParameterChange("qd_max", MODEL.limits.qd_max * 0.5))
    made.tell(MotionCommand(JointTarget(NOMINAL)))
    made.end()
    return made


def test_a_robot_with_other_limits_makes_something_else_and_the_first_is_named(tmp_path, monkeypatch):
    told(tmp_path / "run.mcap")
    with open_recording(tmp_path / "run.mcap") as recording:
        assert rerun(recording).identical
        other = puma560.model(limits=replace(MODEL.limits, qdd_max=0.999999 * MODEL.limits.qdd_max))
        monkeypatch.setattr(recording, "model", other)
        again = rerun(recording)
    assert not again.identical
    assert again.difference.startswith("command 1 at 0.100000 s ")
    assert again.versions == 0


class Without:
    """A recording that lacks a message."""

    def __init__(self, recording, lost):
        self._recording = recording
        self.commands = tuple(entry for entry in recording.commands if entry.number != lost)

    def __getattr__(self, name):
        return getattr(self._recording, name)


def test_what_follows_a_missing_command_is_not_run_again(tmp_path):
    told(tmp_path / "run.mcap")
    with open_recording(tmp_path / "run.mcap") as recording:
        again = rerun(Without(recording, 4))
        whole, void = rerun(recording), rerun(Without(recording, 1))
    assert (again.is_void, whole.is_void, void.is_void) == (False, False, True)
    assert again.missing == "command 4 is missing: what follows can't be run again"
    assert again.identical
    assert again.commands == 3
    assert whole.commands == 13
    assert whole.missing == ""


def test_what_follows_a_command_that_is_there_twice_is_not_run_again(tmp_path):
    told(tmp_path / "run.mcap")
    with open_recording(tmp_path / "run.mcap") as recording:
        twice = Without(recording, None)
        twice.commands = recording.commands * 2
        assert rerun(twice).missing == "command 1 is there twice: what follows can't be run again"


def test_an_altered_coefficient_is_found(tmp_path):
    told(tmp_path / "run.mcap")
    with open_recording(tmp_path / "run.mcap") as recording:
        changed = next(entry for entry in recording.changes if getattr(entry, "segments", ()))
        altered = changed.segments[0].coefficients.copy()
        altered[0, 3] += 1e-15
        object.__setattr__(changed.segments[0], "coefficients", altered)
        again = rerun(recording)
    assert not again.identical
    assert "of new segment 0, coefficients" in again.difference


def test_an_altered_receipt_is_found(tmp_path):
    told(tmp_path / "run.mcap")
    with open_recording(tmp_path / "run.mcap") as recording:
        entries = [entry for entry in recording.commands if isinstance(entry, CommandRecord) and entry.receipt]
        receipt = entries[1].receipt
        set_field(receipt, "q", receipt.q + 1e-15)
        again = rerun(recording)
    assert not again.identical
    assert again.difference.startswith("command 2 at 0.200000 s is answered with q")
