"""What a run's recording says of it: the run's own figures, to the last digit."""

from __future__ import annotations

import math
from contextlib import nullcontext
from dataclasses import asdict, replace

import numpy as np
import pytest

from interfaces.link import Service, delay_profile
from interfaces.recording.figures import differences, figures, summary
from interfaces.recording.recording import open_recording
from interfaces.recording.rerun import rerun
from interfaces.recording.run_recorders import RunRecorder, extras_of
from interfaces.runs.summary import Attribution, OffsetOutcome, summarize, to_json
from interfaces.runs.twin_run import commands_alone
from interfaces.runtime.plan import parse_plan
from interfaces.runtime.session import run_twins
from interfaces.teleop import OperatorSite, VirtualArm
from interfaces.val2.source import parse_file
from interfaces.val2.twins import play
from robots.robot import ExactArm, exact_arm
from tests.interfaces.recording.taken import MODEL, NOMINAL, PLAN, ROBOT, Sitting, taken
from vrs import JointTarget, MotionCommand, Status
from vrs.commands import Retime
from vrs.errors import FormatError

ARRAYS = ("t", "play", "q_virtual", "q_shown", "q_matched", "q_real", "q_reference", "messages")
STALLS = parse_plan(
    b"\n".join(b'{"issue": %d, "move": [%d, 60, -170, 0, 30, 0], "speed": 0.6}' % (2 * i, 60 - 120 * (i % 2))
               for i in range(4)),
    "stalls.jsonl", MODEL,
)  # fmt: skip
"""An operator who moves on while messages stall."""


class Stuck(ExactArm):
    """A body that doesn't move."""

    def follow(self, prepared):
        return replace(super().follow(prepared), q=np.tile(PLAN.start, (len(prepared.q), 1)))

    def attach(self, mass):
        pass


def trace(folder, *rows):
    path = folder / "trace.csv"
    path.write_text("delay_s\n" + "".join(f"{delay}\n" * count for delay, count in rows))
    return f"trace:{path}"


CASES = {
    "heavy tails": lambda folder: {"delay": "tue", "seed": 2},
    "correlated, in order": lambda folder: {"delay": "wed@20", "seed": 1, "service": Service.IN_ORDER},
    "lost messages": lambda folder: {"delay": trace(folder, (0.1, 8), ('""', 3), (0.1, 20), ('""', 1), (0.1, 400))},
    "late commands": lambda folder: {"delay": "tue", "seed": 2, "offset": "fixed:0.1"},
    "a stall and corrections": lambda folder: {
        "delay": trace(folder, (0.1, 70), (2.5, 30), (0.1, 600)), "plan": STALLS, "offset": "fixed",
        "service": Service.IN_ORDER,
    },
    "a stall that's waited out": lambda folder: {
        "delay": trace(folder, (0.1, 70), (2.5, 30), (0.1, 600)), "plan": STALLS, "service": Service.IN_ORDER,
    },
    "a robot that stops by itself": lambda folder: {
        "delay": "constant:0.4", "offset": "fixed", "arm": lambda q: nullcontext(Stuck()),
    },
}  # fmt: skip
CORRECTED = {"late commands", "a stall and corrections", "a robot that stops by itself"}


def equal(run, other):
    assert [name for name in ARRAYS if getattr(run, name).tobytes() != getattr(other, name).tobytes()] == []
    assert run.events == other.events
    assert run.packets == other.packets


@pytest.mark.parametrize("case", CASES)
def test_a_recording_gives_the_summary_of_its_run_byte_for_byte(tmp_path, case):
    run = taken(tmp_path / "run.mcap", **CASES[case](tmp_path))
    with open_recording(tmp_path / "run.mcap") as recording:
        assert to_json(summary(recording)) == to_json(summarize(run))
        equal(figures(recording).run, run)
        assert rerun(recording).identical
    assert bool(run.corrections) == (case in CORRECTED)


def test_a_programs_recording_does_too(tmp_path):
    text = """.PROGRAM main()
SPEED 60 ALWAYS
DRIVE 1, 30, 100
DRIVE 1, -40, 80
BREAK
TYPE RANDOM()
READY
.END
"""
    recorder = RunRecorder(tmp_path / "run.mcap")
    source = parse_file(text, "test.v2")
    played = play(source, ROBOT, delay_profile("mon"), exact_arm, seed=3, keeper=recorder)
    recorder.finish()
    with open_recording(tmp_path / "run.mcap") as recording:
        assert to_json(summary(recording)) == to_json(summarize(played.run))
        assert recording.session.title == played.run.session.title


def test_what_other_runs_said_comes_back(tmp_path):
    recorder = RunRecorder(tmp_path / "run.mcap")
    run = run_twins(PLAN, ROBOT, delay_profile("none"), exact_arm, seed=0, keeper=recorder)
    causes = (("network", 0.1), ("payload_and_friction", 1 / 3), ("servo", 0.0))
    attributions = (Attribution("tool_rms_user_m", 0.7, causes, 0.1),)
    offsets = (OffsetOutcome("fixed:0.3", 0.1, 0.2, 3, 4, 1e-9),)
    recorder.finish(attributions, offsets)
    with open_recording(tmp_path / "run.mcap") as recording:
        found = figures(recording)
        assert (found.attributions, found.offsets, found.missing) == (attributions, offsets, [])
        assert to_json(summary(recording)) == to_json(summarize(run, attributions, offsets))


@pytest.mark.parametrize(
    "extras",
    [
        {"offsets": [{"offset": "adaptive"}]},
        {"offsets": [{**asdict(OffsetOutcome("a", 0.1, 0.2, 3, 4, 1e-9)), "behind_max_s": "x"}]},
        {"attributions": [{"measure": "beauty", "total": 1.0, "parts": [], "residual": 1.0}]},
        {"attributions": [{"measure": "tool_rms_user_m", "total": 1.0, "parts": [["wind", 1.0]], "residual": 0.0}]},
        {"attributions": 3},
    ],
)
def test_an_end_that_says_something_else_is_refused(extras):
    with pytest.raises(FormatError, match=r"run.mcap: its end"):
        extras_of(extras, "run.mcap")


def test_the_same_seed_gives_the_same_bytes(tmp_path):
    for name in ("a", "b", "other"):
        taken(tmp_path / name, "thu", seed=5 if name != "other" else 6)
    a, b, other = ((tmp_path / name).read_bytes() for name in ("a", "b", "other"))
    assert a == b
    assert a != other


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """A run whose virtual robot was corrected, and its file."""
    path = tmp_path_factory.mktemp("whole") / "run.mcap"
    return taken(path, "tue", seed=2, offset="fixed:0.1"), path


@pytest.mark.parametrize("share", [0.2, 0.4, 0.6])
def test_of_a_cut_file_the_figures_are_those_until_then_and_say_what_is_missing(whole, tmp_path, share):
    run, path = whole
    data = path.read_bytes()
    (tmp_path / "cut.mcap").write_bytes(data[: int(share * len(data))])
    with open_recording(tmp_path / "cut.mcap") as recording:
        found = figures(recording)
        value = summary(recording)
    cut = found.run
    rows = len(cut.t)
    assert rows > 10
    k = min(rows, len(run.t))
    for name in ("t", "play", "q_real", "q_reference"):
        assert (getattr(cut, name)[:k] == getattr(run, name)[:k]).all()
    # The virtual robot is known as the commands until then make it.
    assert (cut.q_shown[: k - 40] == run.q_shown[: k - 40]).all()
    assert "cut" in found.missing[0]
    assert value["missing"] == list(found.missing)
    assert any("other runs" in line for line in found.missing)
    assert [e for e in cut.events if e.kind == "payload"] == [
        e for e in run.events if e.kind == "payload" and e.t <= cut.t[-1]
    ]


def test_of_a_file_with_a_destroyed_block_what_is_left_is_compared_and_it_says_so(whole, tmp_path):
    run, path = whole
    data = bytearray(path.read_bytes())
    middle = len(data) // 2
    data[middle : middle + 40] = bytes(40)
    (tmp_path / "bad.mcap").write_bytes(data)
    with open_recording(tmp_path / "bad.mcap") as recording:
        found = figures(recording)
    assert any("block" in line for line in found.missing)
    seen = found.run.measured
    assert len(found.run.t) == len(run.t)
    assert 0 < np.count_nonzero(~seen) < 20
    assert np.array_equal(found.run.q_real[seen], run.q_real[seen])
    value, whole_ = summarize(found.run), summarize(run)
    assert value["duration_s"] == whole_["duration_s"]
    assert value["gap_s"] == pytest.approx(0.02 * (np.count_nonzero(~seen) + 1), abs=1e-9)
    for name in ("timeline_time", "user_time", "servo"):
        errors = value["errors"][name]
        assert errors["tool_max_m"] <= whole_["errors"][name]["tool_max_m"] + 1e-9
    assert any(f"for {value['gap_s']:.1f} s" in line for line in found.missing)


def test_a_file_without_samples_is_refused(tmp_path):
    made = Sitting(tmp_path / "run.mcap", 0)
    made.go_on(3)
    made.end()
    with open_recording(tmp_path / "run.mcap") as recording:
        assert rerun(recording).identical
        with pytest.raises(FormatError, match=r"run.mcap: holds no samples of the real robot"):
            summary(recording)


def test_commands_alone_keep_the_ids_that_edits_name():
    away = [JointTarget(NOMINAL + 0.1 * k) for k in range(1, 4)]
    site = OperatorSite(VirtualArm(MODEL, NOMINAL, now=0.0))
    told = [
        MotionCommand(JointTarget(NOMINAL + 99.0)), MotionCommand(away[0]), MotionCommand(away[1], execute_at=5.0),
        MotionCommand(JointTarget(NOMINAL - 99.0)), Retime(3, 7.0), MotionCommand(away[2], execute_at=20.0), None,
    ]  # fmt: skip
    sent = []
    for k, command in enumerate(told):
        now = 0.1 * k
        receipt = site.robot.undo(now=now) if command is None else site.robot.execute(command, now=now)
        if receipt.status is not Status.REJECTED:
            sent.append((now, command, receipt))
    assert len(sent) == 5
    assert commands_alone(MODEL, NOMINAL, sent) == site.robot.engine.timeline


def test_differences_are_those_of_numbers_by_their_paths():
    first = {"a": 1.0, "b": {"c": [1.0, 2.0], "d": None, "e": "x"}, "only": 3, "flag": True, "rows": [{"x": 1}]}
    second = {"a": 1.5, "b": {"c": [1.0, 5.0], "d": 2.0, "e": "y"}, "flag": False, "rows": [{"x": 2}]}
    assert differences(first, second) == {"a": 0.5, "b.c[1]": 0.0, "b.c[2]": 3.0}
    assert math.copysign(1.0, differences({"a": 1.0}, {"a": 1.0})["a"]) == 1.0
