"""Moves for a tool; and what commands with a pace, an acceleration, a tool may hold."""

from __future__ import annotations

from math import inf, nan

import numpy as np
import pytest

from robots import puma560
from tests.vrs.test_continuous import TOOL, along, corner, lawful
from vrs import Engine, Insertion, InsertVia, JointTarget, Motion, MotionCommand, PoseTarget, Profile
from vrs.errors import InvalidValueError
from vrs.planning.path import Tooled, bare, rotation_vector, rotations, tooled

MODEL = puma560.model()
LIMITS = MODEL.limits
HOME = MODEL.poses["nominal"]
A = np.array([0.0, 0.8, -2.4, 0.0, 0.6, 0.0])


class TestTool:
    def test_it_is_the_robot_seen_through_a_tool(self):
        seen = tooled(MODEL, TOOL)
        assert tooled(MODEL, None) is MODEL
        assert bare(seen) is MODEL
        assert isinstance(seen, Tooled)
        q = np.random.default_rng(2).uniform(LIMITS.q_min, LIMITS.q_max, (5, 6))
        assert np.abs(seen.forward(q) - MODEL.forward(q) @ TOOL).max() < 1e-12
        J, step = seen.jacobian(q), 1e-6
        for j in range(6):
            ahead, behind = seen.forward(q + step * np.eye(6)[j]), seen.forward(q - step * np.eye(6)[j])
            assert np.abs((ahead - behind)[:, :3, 3] / (2 * step) - J[:, :3, j]).max() < 1e-8
            turns = [rotation_vector(a[:3, :3] @ b[:3, :3].T) for a, b in zip(ahead, behind, strict=True)]
            assert np.abs(np.array(turns) / (2 * step) - J[:, 3:, j]).max() < 1e-8
        assert np.abs(seen.jacobian(q[0]) - J[0]).max() < 1e-15
        X = seen.forward(HOME)
        assert np.abs(seen.forward(seen.inverse(X)) - X).max() < 1e-9
        assert np.abs(seen.inverse_near(X, HOME) - HOME).max() < 1e-9
        assert np.abs(seen.follow(X[None], HOME)[0] - HOME).max() < 1e-9

    @pytest.mark.parametrize("profile", Profile)
    @pytest.mark.parametrize("joints", [False, True])
    def test_its_tip_goes_straight_while_it_turns(self, profile, joints):
        X = MODEL.forward(HOME)
        X[:3, 3] += -0.1, 0.12, 0.05
        X[:3, :3] = rotations(np.array([[0.3, -0.4, 0.5]]))[0] @ X[:3, :3]
        engine = Engine(MODEL, q=HOME)
        target = JointTarget(MODEL.inverse_near(X, HOME)) if joints else PoseTarget(X)
        answer = engine.execute(MotionCommand(target, motion=Motion.LINE, profile=profile, tool=TOOL))
        assert answer.stands
        lawful(engine, {1} if profile is Profile.JERK_LIMITED else ())
        assert np.abs(engine.pose(engine.timeline.end) - X).max() < 1e-9
        link = MODEL.forward(along(engine))
        tip = link @ TOOL
        begin, end = tip[0], tip[-1]
        way = end[:3, 3] - begin[:3, 3]
        away = tip[:, :3, 3] - begin[:3, 3]
        off = away - np.outer(away @ way / (way @ way), way)
        assert np.linalg.norm(off, axis=1).max() < 1e-6
        # Evenly about one axis.
        whole = rotation_vector(end[:3, :3] @ begin[:3, :3].T)
        share = away @ way / (way @ way)
        for x, one in zip(share[::50], tip[::50], strict=True):
            assert np.abs(rotation_vector(one[:3, :3] @ begin[:3, :3].T) - x * whole).max() < 1e-6
        bent = link[:, :3, 3] - link[0, :3, 3]
        chord = bent[-1]
        assert np.linalg.norm(bent - np.outer(bent @ chord / (chord @ chord), chord), axis=1).max() > 1e-3
        speed = np.linalg.norm(np.diff(tip[:, :3, 3], axis=0), axis=1) / (engine.timeline.end / 2000)
        assert speed.max() <= MODEL.tool_speed * (1 + 1e-6)

    def test_the_deviation_is_the_tools(self):
        def nearest_tip(tool):
            engine = Engine(MODEL, q=HOME)
            turned = corner(1).X.copy()
            turned[:3, :3] = rotations(np.array([[0.0, 0.0, 1.0]]))[0] @ turned[:3, :3]
            for X in (turned, corner(2).X):
                how = {"speed": 0.3, "deviation": 0.02, "tool": tool}
                engine.execute(MotionCommand(PoseTarget(X), insertion=Insertion.APPEND, **how))
            tips = MODEL.forward(along(engine, 8001)) @ TOOL
            return np.linalg.norm(tips[:, :3, 3] - (turned @ TOOL)[:3, 3], axis=1).min()

        assert 0.019 < nearest_tip(TOOL) <= 0.02 * (1 + 1e-3)
        assert nearest_tip(None) > 0.025

    def test_a_singular_pose_is_one_whatever_the_tool(self):
        up = np.array(MODEL.poses["ready"])
        down, upwards = MODEL.forward(HOME), MODEL.forward(HOME)
        down[2, 3] -= 0.02
        upwards[2, 3] += 0.02
        long = np.eye(4)
        long[2, 3] = 30.0
        for tool in (None, TOOL, long):
            stands = [
                Engine(MODEL, q=HOME).execute(MotionCommand(target, motion=Motion.LINE, tool=tool)).stands
                for target in (PoseTarget(down), PoseTarget(upwards), JointTarget(up))
            ]
            assert stands == [True, True, False]


class TestForm:
    @pytest.mark.parametrize(
        "wrong",
        [
            {"pace": 0.0}, {"pace": 1.5}, {"pace": nan}, {"pace": "fast"}, {"acceleration": 0.0},
            {"acceleration": 1.01}, {"acceleration": inf}, {"tool": np.eye(3)}, {"tool": 2.0 * np.eye(4)},
            {"tool": np.full((4, 4), nan)}, {"deviation": -inf}, {"deviation": nan}, {"deviation": np.eye(2)},
        ],
    )  # fmt: skip
    def test_nonsense_is_refused(self, wrong):
        with pytest.raises(InvalidValueError):
            MotionCommand(JointTarget(A), **wrong)

    def test_only_moves_may_be_endless(self):
        with pytest.raises(InvalidValueError):
            InsertVia(1, JointTarget(A), deviation=inf)

    def test_commands_are_values(self):
        one, same = (MotionCommand(JointTarget(A), tool=TOOL, pace=0.5, deviation=inf) for _ in range(2))
        assert one == same
        assert hash(one) == hash(same)
        assert one.tool is not TOOL
        assert not one.tool.flags.writeable
        others = [{"tool": None}, {"tool": np.eye(4)}, {"pace": 0.4}, {"acceleration": 0.5}, {"deviation": 0.1}]
        for other in others:
            assert one != MotionCommand(JointTarget(A), **{"tool": TOOL, "pace": 0.5, "deviation": inf, **other})
        assert one != "a move"
