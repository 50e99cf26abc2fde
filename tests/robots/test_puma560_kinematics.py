import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robots import puma560
from robots.puma560 import parameters
from robots.puma560.branches import forward as forward_in_floats
from vrs.errors import InvalidValueError
from vrs.model import Limits, RobotModel

MODEL = puma560.model()


@pytest.fixture(scope="module")
def toolbox():
    import roboticstoolbox

    return roboticstoolbox.models.DH.Puma560()


@pytest.fixture(scope="module")
def random_q():
    return np.random.default_rng(1).uniform(-2 * np.pi, 2 * np.pi, (200, 6))


def test_parameters_are_the_toolbox_s(toolbox):
    links = toolbox.links
    assert np.allclose([link.a for link in links], parameters.DH_A, rtol=0, atol=1e-15)
    assert np.allclose([link.alpha for link in links], parameters.DH_ALPHA, rtol=0, atol=1e-15)
    pedestal = np.array([parameters.PEDESTAL, 0, 0, 0, 0, 0])
    assert np.allclose([link.d for link in links], parameters.DH_D + pedestal, rtol=0, atol=1e-15)
    assert np.allclose(toolbox.qlim, [MODEL.limits.q_min, MODEL.limits.q_max], rtol=0, atol=1e-14)


def test_named_poses_are_the_toolbox_s(toolbox):
    named = {"ready": toolbox.qr, "zero": toolbox.qz, "nominal": toolbox.qn, "stretch": toolbox.qs}
    assert set(MODEL.poses) == set(named)
    for name, q in named.items():
        assert np.array_equal(MODEL.poses[name], q)
        assert not MODEL.poses[name].flags.writeable
        MODEL.limits.check(MODEL.poses[name])


def test_forward_agrees_with_the_toolbox(toolbox, random_q):
    expected = np.array([T.A for T in toolbox.fkine(random_q)])
    expected[:, 2, 3] -= parameters.PEDESTAL
    assert np.abs(MODEL.forward(random_q) - expected).max() < 1e-12
    one_by_one = np.array([MODEL.forward(q) for q in random_q])
    assert np.abs(one_by_one - expected).max() < 1e-12


def test_links_agree_with_the_toolbox(toolbox, random_q):
    expected = np.array([[T.A for T in toolbox.fkine_all(q)] for q in random_q[:50]])
    expected[:, 1:, 2, 3] -= parameters.PEDESTAL
    assert np.abs(MODEL.links(random_q[:50]) - expected).max() < 1e-12
    assert np.array_equal(MODEL.links(random_q[0]), MODEL.links(random_q[:1])[0])


def test_jacobian_agrees_with_the_toolbox(toolbox, random_q):
    expected = np.array([toolbox.jacob0(q) for q in random_q])
    assert np.abs(MODEL.jacobian(random_q) - expected).max() < 1e-12
    assert np.array_equal(MODEL.jacobian(random_q[0]), MODEL.jacobian(random_q[:1])[0])


def test_jacobian_is_the_derivative_of_forward(random_q):
    step = 1e-6
    for q in random_q[:20]:
        J = MODEL.jacobian(q)
        R = MODEL.forward(q)[:3, :3]
        for j in range(6):
            move = step * np.eye(6)[j]
            dX = (MODEL.forward(q + move) - MODEL.forward(q - move)) / (2 * step)
            W = dX[:3, :3] @ R.T
            assert np.allclose(J[:3, j], dX[:3, 3], atol=1e-8)
            assert np.allclose(J[3:, j], (W[2, 1], W[0, 2], W[1, 0]), atol=1e-8)


@given(st.lists(st.floats(-20, 20), min_size=6, max_size=6))
def test_forward_is_a_rigid_motion_within_reach(q):
    X = MODEL.forward(q)
    assert np.abs(X[:3, :3] @ X[:3, :3].T - np.eye(3)).max() < 1e-14
    assert np.linalg.norm(X[:3, 3]) <= np.hypot(parameters.A2 + np.hypot(0.0203, 0.4318), 0.15005) + 1e-14


def test_empty_batches_have_their_shapes():
    none = np.empty((0, 6))
    assert MODEL.forward(none).shape == (0, 4, 4)
    assert MODEL.links(none).shape == (0, 7, 4, 4)
    assert MODEL.jacobian(none).shape == (0, 6, 6)


@pytest.mark.parametrize("method", ["forward", "links", "jacobian", "configuration"])
@pytest.mark.parametrize(
    "q", [[0.0] * 5, [[0.0] * 5], 0.0, [0, 0, 0, np.nan, 0, 0], [np.inf] + [0] * 5, "home", [[[0.0] * 6]]]
)
def test_bad_joints_are_refused(method, q):
    with pytest.raises(InvalidValueError, match="q must be finite joint values"):
        getattr(MODEL, method)(q)


def test_model_is_a_frozen_robot_model():
    assert isinstance(MODEL, RobotModel)
    assert MODEL.name == "puma560"
    assert MODEL.tool_speed == 0.5
    with pytest.raises(dataclasses.FrozenInstanceError):
        MODEL.tool_speed = 1.0


def test_documented_limits():
    limits = MODEL.limits
    assert np.allclose(np.degrees(limits.q_min), (-160, -45, -225, -110, -100, -266))
    assert np.allclose(np.degrees(limits.q_max), (160, 225, 45, 170, 100, 266))
    assert np.allclose(np.degrees(limits.qd_max), (82, 74, 122, 228, 241, 228))
    assert np.allclose(limits.qdd_max, limits.qd_max / 0.25)
    assert np.allclose(limits.qddd_max, limits.qdd_max / 0.1)


def test_limits_and_speed_are_configurable():
    narrow = Limits(-np.ones(6), np.ones(6), np.ones(6), np.ones(6))
    custom = puma560.model(limits=narrow, tool_speed=0.2)
    assert custom.limits is narrow
    assert custom.tool_speed == 0.2
    assert (np.abs(custom.inverse(custom.forward(np.full(6, 0.5)))) <= 1).all()


@pytest.mark.parametrize("speed", [0, -1.0, np.nan, "fast", True])
def test_bad_tool_speed_is_refused(speed):
    with pytest.raises(InvalidValueError, match="tool_speed"):
        puma560.model(tool_speed=speed)


@pytest.mark.parametrize(("n", "bound"), [(5, 1.0), (6, 13.0)])
def test_bad_limits_are_refused(n, bound):
    one = np.ones(n)
    with pytest.raises(InvalidValueError, match="limits"):
        puma560.model(limits=Limits(-bound * one, bound * one, one, one))


def test_floats_and_arrays_agree(random_q):
    floats = np.array([forward_in_floats(tuple(q.tolist())) for q in random_q]).reshape(-1, 3, 4)
    assert np.abs(MODEL.forward(random_q)[:, :3] - floats).max() < 1e-14
