"""`import vrs`: its names, the engine by examples with their numbers, the rules of insertion (DESIGN, *Contract*).

Numbers are compared to 1e-12, bits only where they are promised.
"""

from __future__ import annotations

import ast
import importlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import interfaces
import vrs
from robots import ipr, puma560
from vrs import (
    ArcSegment,
    DriveCommand,
    Engine,
    Insertion,
    JointTarget,
    Lateness,
    ManualClock,
    Motion,
    MotionCommand,
    ParameterChange,
    PolynomialSegment,
    PoseTarget,
    PositionQuery,
    Profile,
    Status,
    Timeline,
    WallClock,
)

MODEL = puma560.model()
A, B, C = [0.5, 0.7, -2.8, 0.1, 0.6, 0.2], [-0.3, 0.9, -2.5, 0.0, 0.4, -0.1], [0.0, 1.0, -2.9, 0.3, 0.2, 0.0]
NAMES = {
    "vrs": [
        "ArcSegment", "Cancel", "Clock", "DriveCommand", "Engine", "Frame", "InsertVia", "Insertion", "JointTarget",
        "Lateness", "Limits", "ManualClock", "Motion", "MotionCommand", "OffsetClock", "ParameterChange",
        "PolynomialSegment", "PoseTarget", "Position", "PositionQuery", "Profile", "Receipt", "Resume", "Retime",
        "RobotModel", "ScaleTime", "Segment", "SlewedClock", "Status", "SteerCommand", "Stop", "Timeline",
        "WallClock",
    ],
    "interfaces": ["Designer", "Observer", "Supervisor", "Viewer", "connect", "connect_mobile"],
}  # fmt: skip
PUBLIC = {"vrs": set(vrs.__all__), "robots": {"ipr", "puma560"}, "interfaces": set(interfaces.__all__)}


def near(found: Any, expected: Any) -> None:
    """Equal to 1e-12."""
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12)


def to(q: list[float], **how: Any) -> MotionCommand:
    """A joint move."""
    return MotionCommand(JointTarget(q), **how)


def offline() -> Engine:
    """An engine without a clock: any time may be edited."""
    return Engine(MODEL, q=MODEL.poses["nominal"], clock=None)


def coefficients(engine: Engine, command_id: int) -> list[bytes]:
    """The bits of a command's segments: duration and coefficients."""
    return [
        np.float64(segment.duration).tobytes() + segment.coefficients.tobytes()
        for segment in engine.timeline.segments
        if segment.command_id == command_id
    ]


class TestNames:
    @pytest.mark.parametrize("package", NAMES)
    def test_every_name_is_there(self, package: str) -> None:
        module = importlib.import_module(package)
        assert set(NAMES[package]) <= set(module.__all__)
        assert all(hasattr(module, name) for name in NAMES[package])

    @pytest.mark.parametrize("path", sorted(Path(__file__).parent.glob("*.py")), ids=lambda path: path.name)
    def test_this_suite_imports_public_names_alone(self, path: Path) -> None:
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Import):
                assert not {name.name for name in node.names if name.name.split(".")[0] in PUBLIC} - set(PUBLIC)
            elif isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] in PUBLIC:
                assert {name.name for name in node.names} <= PUBLIC.get(str(node.module), set())


class TestModel:
    def test_limits_and_poses(self) -> None:
        limits = MODEL.limits
        near(limits.q_min, np.radians([-160, -45, -225, -110, -100, -266]))
        near(limits.q_max, np.radians([160, 225, 45, 170, 100, 266]))
        near(np.degrees(limits.qd_max), [82.0, 74.0, 122.0, 228.0, 241.0, 228.0])
        near(limits.qdd_max, 4.0 * np.asarray(limits.qd_max))
        near(limits.qddd_max, 10.0 * np.asarray(limits.qdd_max))
        assert set(MODEL.poses) == {"ready", "zero", "nominal", "stretch"}
        near(MODEL.poses["ready"], [0, np.pi / 2, -np.pi / 2, 0, 0, 0])
        near(MODEL.poses["nominal"], [0, np.pi / 4, -np.pi, 0, np.pi / 4, 0])

    def test_values_cant_be_written(self) -> None:
        with pytest.raises(ValueError, match="read-only"):
            MODEL.limits.q_min[0] = 0.0
        with pytest.raises(AttributeError):
            MODEL.limits = None

    def test_kinematics(self) -> None:
        X = MODEL.forward(MODEL.poses["nominal"])
        near(X[:3, :3], [[0, 0, 1], [0, 1, 0], [-1, 0, 0]])
        near(X[:3, 3], [0.5963031485746156, -0.15005, -0.01435426765808689])
        near(MODEL.forward(np.stack([A, B]))[1], MODEL.forward(B))
        assert MODEL.links(A).shape == (7, 4, 4)
        near(MODEL.links(A)[-1], MODEL.forward(A))

    def test_every_branch_of_the_inverse_is_found(self) -> None:
        X = MODEL.forward(A)
        found = MODEL.inverse(X, within_limits=True)
        near(found, [
            A,
            [0.5, -0.577000196687763, -0.247636820893628, -0.08980572873147, -0.679668018934176, 0.352544698090221],
        ])  # fmt: skip
        near([MODEL.forward(q) for q in found], [X] * len(found))
        assert len(MODEL.inverse(MODEL.forward(MODEL.poses["nominal"]), within_limits=False)) == 8


class TestEngine:
    def test_a_move_its_receipt_and_its_values(self) -> None:
        engine = Engine(MODEL, q=MODEL.poses["ready"], clock=ManualClock(0.0), lateness=Lateness.POSTPONE)
        receipt = engine.execute(
            MotionCommand(
                target=JointTarget(MODEL.poses["nominal"]), issued_at=None, execute_at=0.5, speed=0.8,
                motion=Motion.JOINT, profile=Profile.PARABOLIC, insertion=Insertion.SPLICE,
            )
        )  # fmt: skip
        assert (receipt.status, receipt.execute_at, receipt.reason, receipt.command_id) == (
            Status.ACCEPTED,
            0.5,
            "",
            1,
        )
        near(receipt.end, 1.6221311475409836)
        hold, *move = engine.timeline.segments
        assert (hold.start, hold.duration, hold.command_id, [one.command_id for one in move]) == (
            0.0,
            0.5,
            None,
            [1] * 3,
        )
        assert [one.coefficients.shape for one in move] == [(3, 6), (2, 6), (3, 6)]
        near(move[0].coefficients[2], [0, -2.1293016874330822, -4.2586033748661645, 0, 2.1293016874330822, 0])
        assert move[0].end == move[1].start
        near(engine.joints(receipt.end), MODEL.poses["nominal"])
        assert engine.joints(0.3).tobytes() == MODEL.poses["ready"].tobytes()

    def test_positions_and_speeds_at_times(self) -> None:
        engine = offline()
        first, second = engine.execute(to(A, execute_at=0.5, speed=0.8)), engine.execute(to(B, execute_at=3.0))
        near([first.end, second.end], [1.1367056365326396, 3.8089832147617786])
        expected = [
            [
                0.028623399732707,
                0.78050939186272,
                -3.12203756745088,
                0.005724679946541,
                0.774784711916179,
                0.011449359893083,
            ],
            [
                0.446507356739837,
                0.709136346979386,
                -2.836545387917542,
                0.089301471347968,
                0.619834875631418,
                0.178602942695935,
            ],
            [
                0.249545252338814,
                0.762613686915297,
                -2.706079469627055,
                0.068693156542352,
                0.537386313084704,
                0.106079469627055,
            ],
        ]
        near(engine.joints([0.6, 1.0, 3.3]), expected)
        near(engine.timeline.sample(0.6, derivative=1)[:2], [0.57246799465414, -0.09777543069456764])
        near(engine.timeline.sample(0.6, derivative=2)[0], 5.7246799465414)
        near(engine.timeline.sample(0.6, derivative=3), np.zeros(6))
        near(engine.pose([0.6, 1.0]), MODEL.forward(engine.joints([0.6, 1.0])))
        near(engine.links(1.0), MODEL.links(engine.joints(1.0)))
        near(engine.joints(-5.0), MODEL.poses["nominal"])
        near(engine.joints(99.0), B)

    def test_a_line_is_straight_and_ends_where_it_should(self) -> None:
        engine = offline()
        engine.execute(to(B, execute_at=0.0))
        start = engine.timeline.end
        X = np.array(engine.pose(start))
        X[2, 3] -= 0.1
        receipt = engine.execute(MotionCommand(PoseTarget(X), motion=Motion.LINE, insertion=Insertion.APPEND))
        near(receipt.end - start, 0.29600948445357)
        near(receipt.q, [-0.3, 0.8527135827305397, -2.657427477377418, 0.0, 0.6047138946468683, -0.1])
        path = engine.pose(np.linspace(start, receipt.end, 200))[:, :3, 3]
        assert np.abs(path[:, :2] - X[:2, 3]).max() < 1e-6
        np.testing.assert_allclose(engine.pose(receipt.end), X, rtol=0, atol=1e-9)
        assert all(isinstance(segment, PolynomialSegment) for segment in engine.timeline.segments)

    def test_a_jerk_limited_move_keeps_to_its_limits(self) -> None:
        engine = offline()
        receipt = engine.execute(to(A, execute_at=0.0, profile=Profile.JERK_LIMITED))
        t = np.linspace(0.0, receipt.end, 2001)
        for order, limit in enumerate([MODEL.limits.qd_max, MODEL.limits.qdd_max, MODEL.limits.qddd_max], 1):
            assert (np.abs(engine.timeline.sample(t, derivative=order)) <= np.asarray(limit) * (1 + 1e-9)).all()

    def test_edits_and_taking_back(self) -> None:
        engine = offline()
        moved = engine.execute(to(A, execute_at=0.5))
        engine.execute(to(B, execute_at=3.0))
        before = engine.timeline
        assert engine.retime(2, 6.0).status is Status.ACCEPTED
        assert engine.receipt(2).execute_at == 6.0
        engine.undo()
        assert engine.receipt(2).execute_at == 3.0
        assert engine.timeline.sample([0.7, 3.2]).tobytes() == before.sample([0.7, 3.2]).tobytes()
        engine.cancel(2)
        near(engine.joints(99.0), A)
        engine.scale_time(0.5)
        near(engine.receipt(1).end, 2.0 * moved.end)

    def test_a_stop_keeps_to_the_path_and_a_resume_goes_on(self) -> None:
        engine = offline()
        engine.execute(to(A, execute_at=0.5, speed=0.8))
        engine.execute(to(B, execute_at=3.0))
        path = engine.joints(np.linspace(0.5, 1.2, 70001))
        stopped = engine.stop(execute_at=0.9)
        assert stopped.superseded_names == (1, 2)
        near(stopped.q, engine.joints(99.0))
        assert np.abs(path - stopped.q).max(axis=1).min() < 1e-4
        near(engine.timeline.sample(stopped.end, derivative=1), np.zeros(6))
        assert engine.resume().status is Status.ACCEPTED
        near(engine.joints(99.0), B)

    def test_a_branch_leaves_the_other_alone(self) -> None:
        engine = offline()
        engine.execute(to(A, execute_at=0.5))
        timeline = engine.timeline
        assert isinstance(timeline, Timeline)
        branch = Engine(MODEL, timeline=timeline, clock=None)
        branch.execute(to(B, execute_at=0.8))
        assert engine.timeline is timeline
        near(engine.joints(99.0), A)
        near(branch.joints(99.0), B)

    def test_queries_and_parameters(self) -> None:
        engine = offline()
        there = engine.execute(PositionQuery(0.0))
        near(there.q, MODEL.poses["nominal"])
        near(there.X, MODEL.forward(MODEL.poses["nominal"]))
        engine.execute(ParameterChange("lateness", "reject"))
        with pytest.raises(ValueError, match="lateness, qd_max, qdd_max, qddd_max"):
            engine.execute(ParameterChange("nothing", 1))

    def test_a_wall_clock_goes_on(self) -> None:
        clock = WallClock()
        assert clock.now() <= clock.now()

    def test_a_mobile_robot_runs_on_the_same_engine(self) -> None:
        engine = Engine(ipr.model(), posture=(0.1, 0.2, 0.3))
        engine.execute(DriveCommand(0.3, 0.2, 2.0))
        engine.execute(DriveCommand(0.2, -0.5, 1.0, execute_at=1.0))
        near(engine.posture([0.5, 1.5, 9.0]), [
            [0.24084720347096636, 0.2514132426840814, 0.4],
            [0.4686666296541672, 0.35316283478095883, 0.25],
            [0.5676282133559765, 0.3655978660967009, 0.0],
        ])  # fmt: skip
        assert engine.posture(1.0).shape == (3,)
        assert [type(segment) for segment in engine.timeline.segments] == [ArcSegment, ArcSegment]


class TestInsertion:
    """DESIGN's rules by their numbers."""

    def test_1_a_command_at_the_very_start_of_a_move_replaces_it_whole(self) -> None:
        engine = offline()
        engine.execute(to(A, execute_at=0.5))
        assert engine.execute(to(B, execute_at=0.5)).superseded_names == (1,)
        assert {segment.command_id for segment in engine.timeline.segments} == {None, 2}

    def test_1_a_hold_is_no_move(self) -> None:
        engine = offline()
        engine.execute(to(A, execute_at=2.0))
        receipt = engine.execute(to(B, execute_at=0.5))
        assert (receipt.status, receipt.superseded_names) == (Status.ACCEPTED, ())

    def test_2_after_a_splice_the_tail_is_shifted_as_a_whole_and_keeps_its_bits(self) -> None:
        engine = offline()
        engine.execute(to(A, execute_at=0.5, speed=0.8))
        engine.execute(to(B, execute_at=3.0))
        engine.execute(to(A, execute_at=5.0))
        past, tail = (
            engine.joints(np.linspace(0.0, 0.9, 50)).tobytes(),
            [coefficients(engine, one) for one in (2, 3)],
        )
        receipt = engine.execute(to(C, execute_at=0.9))
        near([receipt.end, receipt.shift], [1.67, 1.1326588726934719])
        assert (receipt.superseded_names, receipt.shifted_names) == ((1,), (2, 3))
        assert engine.joints(np.linspace(0.0, 0.9, 50)).tobytes() == past
        assert [coefficients(engine, one) for one in (2, 3)] == tail
        near([engine.receipt(one).execute_at for one in (2, 3)], [3.0 + receipt.shift, 5.0 + receipt.shift])
        near(engine.joints(receipt.end), C)
        near(engine.timeline.sample(receipt.end, derivative=1), np.zeros(6))

    def test_3_a_joining_move_that_cant_be_made_within_the_limits_rejects_the_command(self) -> None:
        engine = offline()
        engine.execute(to(A, execute_at=0.5, speed=0.8))
        engine.execute(to(B, execute_at=3.0))
        version = engine.timeline.version
        receipt = engine.execute(to([9.0, *C[1:]], execute_at=0.9))
        assert (receipt.status, receipt.execute_at, receipt.end) == (Status.REJECTED, None, None)
        assert receipt.reason
        assert engine.timeline.version == version

    @pytest.mark.parametrize("lateness", list(Lateness))
    def test_4_late_and_contradictory_stamps(self, lateness: Lateness) -> None:
        clock = ManualClock(0.0)
        engine = Engine(MODEL, q=MODEL.poses["nominal"], clock=clock, lateness=lateness)
        clock.advance(1.0)
        engine.execute(to(A, execute_at=1.0))
        active = engine.timeline.segments[1]
        clock.advance(0.05)
        contradictory = engine.execute(to(B, issued_at=1.04, execute_at=1.03))
        assert (contradictory.status, contradictory.issued_at) == (Status.REJECTED, 1.04)
        late = engine.execute(to(B, issued_at=1.0, execute_at=1.01))
        if lateness is Lateness.REJECT:
            assert late.status is Status.REJECTED
        else:
            assert (late.status, late.execute_at, late.asked_at) == (Status.POSTPONED, active.end, 1.01)

    def test_4_a_late_command_in_a_hold_begins_now(self) -> None:
        clock = ManualClock(2.0)
        engine = Engine(MODEL, q=MODEL.poses["nominal"], clock=clock, lateness=Lateness.POSTPONE)
        receipt = engine.execute(to(B, issued_at=1.0, execute_at=1.0))
        assert (receipt.status, receipt.execute_at) == (Status.POSTPONED, 2.0)

    def test_5_replace_drops_what_is_scheduled_and_says_so(self) -> None:
        engine = offline()
        for q, t in ((A, 0.5), (B, 3.0), (A, 5.0)):
            engine.execute(to(q, execute_at=t))
        receipt = engine.execute(to(C, execute_at=0.8, insertion=Insertion.REPLACE))
        assert receipt.superseded_names == (1, 2, 3)
        assert engine.timeline.end == receipt.end
        near(engine.joints(99.0), C)

    def test_5_append_keeps_everything(self) -> None:
        engine = offline()
        first = engine.execute(to(A, execute_at=0.5))
        kept = coefficients(engine, 1)
        receipt = engine.execute(to(B, execute_at=0.6, insertion=Insertion.APPEND))
        assert (receipt.status, receipt.execute_at) == (Status.POSTPONED, first.end)
        assert coefficients(engine, 1) == kept

    def test_6_a_pose_is_resolved_to_joints(self) -> None:
        engine = offline()
        receipt = engine.execute(MotionCommand(PoseTarget(MODEL.forward(B)), execute_at=0.5))
        near(MODEL.forward(receipt.q), MODEL.forward(B))
        assert receipt.q.shape == (6,)

    def test_7_a_receipt_belongs_to_a_version(self) -> None:
        engine = offline()
        first = engine.execute(to(A, execute_at=0.5))
        second = engine.execute(to(B, execute_at=0.8))
        assert (first.version, second.version, engine.timeline.version) == (1, 2, 2)
        assert first.superseded_by is None
        assert engine.receipt(1).superseded_by == 2

    def test_8_braking_first_is_said(self) -> None:
        engine = offline()
        edge, back = (
            np.array([angle, *MODEL.poses["nominal"][1:]]) for angle in (MODEL.limits.q_max[0] - 0.001, 2.2)
        )
        engine.execute(MotionCommand(JointTarget(edge), execute_at=0.0))
        command = MotionCommand(
            JointTarget(back), execute_at=1.93, profile=Profile.JERK_LIMITED, insertion=Insertion.REPLACE
        )
        receipt = engine.execute(command)
        assert receipt.status is Status.ACCEPTED
        assert receipt.reason.startswith("braked with parabolas first")
        q = engine.joints(np.linspace(0.0, receipt.end, 4001))
        assert (q <= np.asarray(MODEL.limits.q_max) + 1e-12).all()

    def test_9_a_stop_that_limits_forbid_on_the_path_brakes_each_joint(self) -> None:
        engine = offline()
        engine.execute(to(A, execute_at=0.0))
        receipt = engine.stop(execute_at=0.3)
        assert receipt.status is Status.ACCEPTED
        t = np.linspace(0.3, receipt.end, 1001)
        assert (
            np.abs(engine.timeline.sample(t, derivative=2)) <= np.asarray(MODEL.limits.qdd_max) * (1 + 1e-9)
        ).all()
        near(engine.timeline.sample(receipt.end, derivative=1), np.zeros(6))
