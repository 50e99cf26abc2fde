"""Arms of random links, in each world of physics: the three ways to their dynamics agree, and they follow."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from robots.chain import Chain, ChainLink, Inertia, together
from robots.simulated import WORLDS, chain_arm
from vrs.model import Array, Limits


def pose(rng: np.random.Generator, reach: float) -> Array:
    X = np.eye(4)
    X[:3, :3], X[:3, 3] = Rotation.random(random_state=rng).as_matrix(), rng.uniform(-reach, reach, 3)
    return X


def ball(rng: np.random.Generator) -> Inertia:
    """Some masses that lie anywhere."""
    points = [Inertia(m, p, 1e-3 * np.eye(3)) for m, p in zip(rng.uniform(0.2, 2, 4), rng.normal(0, 0.1, (4, 3)))]  # noqa: B905
    return together(points)


def chain(seed: int, n: int, **drives: Any) -> Chain:
    """Joints of both kinds about any axes."""
    rng = np.random.default_rng(seed)
    links = []
    for _ in range(n):
        axis = rng.normal(size=3)
        sliding = rng.random() < 0.3
        X = pose(rng, 0.4)
        turn = Rotation.from_matrix(X[:3, :3]).as_quat()
        axis = axis / np.linalg.norm(axis)
        links.append(ChainLink(X[:3, 3], turn, ball(rng), pose(rng, 0.1), axis, sliding, **drives))
    return Chain(tuple(links), pose(rng, 0.1))


def limits(n: int) -> Limits:
    return Limits(-2.0 * np.ones(n), 2.0 * np.ones(n), 2.0 * np.ones(n), 8.0 * np.ones(n))


def states(n: int, count: int) -> tuple[Array, Array, Array]:
    rng = np.random.default_rng(5)
    return rng.uniform(-2, 2, (count, n)), rng.uniform(-3, 3, (count, n)), rng.uniform(-20, 20, (count, n))


@pytest.mark.parametrize("world", WORLDS)
@pytest.mark.parametrize("sliding", [False, True])
def test_a_link_at_the_origin_whose_weight_lies_aside_is_a_body_too(world: str, sliding: bool) -> None:
    # MuJoCo has its own, simpler way with a body in whose origin its weight lies.
    weight = Inertia(2.0, np.array([0.5, 0.0, 0.0]), np.diag([0.01, 0.2, 0.2]))
    link = ChainLink(
        np.zeros(3), np.array([0.0, 0.0, 0.0, 1.0]), weight, np.eye(4), np.array([0.0, 1.0, 0.0]), sliding
    )
    with chain_arm(world, Chain((link,), np.eye(4)), limits(1), 9.81, np.zeros(1)) as arm:
        mass, bias = arm.bodies.dynamics()
    expected = (2.0, 0.0) if sliding else (0.2 + 2.0 * 0.25, -2.0 * 9.81 * 0.5)
    assert (mass[0][0], bias[0]) == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize("world", WORLDS)
@pytest.mark.parametrize("n", [1, 3, 6, 7, 12])
def test_the_worlds_dynamics_are_those_of_the_chain(world: str, n: int) -> None:
    links = chain(n, n)
    q, qd, qdd = states(n, 30)
    tau = links.inverse_dynamics(q, qd, qdd, gravity=9.81)
    np.testing.assert_allclose(
        links.inverse_dynamics(q[4:5], qd[4:5], qdd[4:5], gravity=9.81)[0], tau[4], rtol=1e-12
    )
    with chain_arm(world, links, limits(n), 9.81, np.zeros(n), friction=False) as arm:
        for row in zip(q, qd, qdd, tau, strict=True):
            arm.place(row[0], row[1])
            arm.apply(row[3])
            got = (arm.qd - row[1]) / 1e-3
            assert np.abs(got - row[2]).max() <= 1e-9 * np.abs(row[2]).max()
            np.testing.assert_allclose(arm.q, row[0] + 1e-3 * arm.qd, rtol=0, atol=1e-13)


def swing(n: int, seconds: float) -> tuple[Array, Array, Array]:
    """References from rest and back to it."""
    t = np.arange(1, round(seconds * 1000) + 1)[:, None] * 1e-3
    w = 2 * np.pi / seconds
    sizes = 0.6 * np.cos(np.arange(n))
    return sizes * (1 - np.cos(w * t)) / 2, sizes * w * np.sin(w * t) / 2, sizes * w * w * np.cos(w * t) / 2


def height(links: Chain, q: Array) -> float:
    """Of the flange [m]."""
    X = np.eye(4)
    for link, value in zip(links.links, q, strict=True):
        moved, joint = np.eye(4), np.eye(4)
        joint[:3, :3], joint[:3, 3] = Rotation.from_quat(link.turn).as_matrix(), link.place
        if link.prismatic:
            moved[:3, 3] = value * link.axis
        else:
            moved[:3, :3] = Rotation.from_rotvec(value * link.axis).as_matrix()
        X = X @ joint @ moved
    return float((X @ links.links[-1].X @ links.flange)[2, 3])


DRIVES = {"armature": 0.05, "viscous": 0.2, "coulomb": (0.3, -0.2)}


@pytest.mark.parametrize("world", WORLDS)
def test_an_arm_of_seven_joints_follows(world: str) -> None:
    links, references = chain(7, 7, **DRIVES), swing(7, 2.0)
    with chain_arm(world, links, limits(7), 9.81, np.zeros(7)) as arm:
        whole = arm.follow(arm.prepare(*references))
    assert np.degrees(np.sqrt(np.mean((whole.q - references[0]) ** 2, axis=0))).max() < 0.5
    assert not whole.saturated.any()
    with chain_arm(world, links, limits(7), 9.81, np.zeros(7)) as arm:
        parts = [
            arm.follow(arm.prepare(*(row[a:b] for row in references))) for a, b in ((0, 1), (1, 700), (700, 2000))
        ]
    np.testing.assert_array_equal(np.concatenate([part.q for part in parts]), whole.q)


@pytest.mark.needs("pybullet", "mujoco")
def test_the_worlds_agree_on_an_arm_of_seven_joints() -> None:
    links, references, ends = chain(7, 7, **DRIVES), swing(7, 2.0), []
    for world in ("bullet", "mujoco"):
        with chain_arm(world, links, limits(7), 9.81, np.zeros(7)) as arm:
            ends.append(arm.follow(arm.prepare(*references)).q)
    np.testing.assert_allclose(*ends, rtol=0, atol=1e-9)


@pytest.mark.parametrize("world", WORLDS)
def test_coulomb_friction_holds_a_joint_that_is_pushed_too_little(world: str) -> None:
    links = chain(2, 1, coulomb=(5.0, -5.0))
    level = links.inverse_dynamics(*np.zeros((3, 1, 1)), gravity=9.81)[0]
    with chain_arm(world, links, limits(1), 9.81, [0.0]) as arm:
        for push, moves in ((4.9, False), (5.2, True)):
            for _ in range(50):
                arm.apply(level + push)
            assert bool(np.abs(arm.q) > 1e-9) is moves


@pytest.mark.parametrize("world", WORLDS)
def test_a_load_hangs_at_the_flange_and_efforts_end_at_their_limit(world: str) -> None:
    links = chain(3, 3, effort=1e3)
    rest = np.zeros((3, 1, 3))
    held = links.holding(Inertia(2.0, np.zeros(3), np.zeros((3, 3))))
    # By the principle of virtual work: the load's weight times how its place rises.
    h = 1e-6 * np.eye(3)
    rise = [(height(links, up) - height(links, -up)) / 2e-6 for up in h]
    added = held.inverse_dynamics(*rest, gravity=9.81) - links.inverse_dynamics(*rest, gravity=9.81)
    np.testing.assert_allclose(added[0], 2.0 * 9.81 * np.array(rise), atol=1e-8)
    zero, rows = np.zeros(3), np.zeros((300, 3))
    with chain_arm(world, links, limits(3), 9.81, zero) as arm:
        arm.follow(arm.prepare(rows, rows, rows))
        assert np.abs(arm.q).max() < 1e-9
        arm.attach(2.0)
        sunk = arm.follow(arm.prepare(rows, rows, rows)).q[-1]
        assert np.abs(sunk).max() > 1e-4
        arm.release()
        assert np.abs(arm.follow(arm.prepare(rows, rows, rows)).q[-1]).max() < 0.2 * np.abs(sunk).max()
    with chain_arm(world, chain(3, 3, effort=2.0), limits(3), 9.81, zero) as arm:
        measured = arm.follow(arm.prepare(rows, rows, rows))
        assert np.abs(measured.tau).max() == 2.0
        assert measured.saturated.max() > 100
