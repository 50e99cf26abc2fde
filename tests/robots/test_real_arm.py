from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from roboticstoolbox.models.DH import Puma560

from robots.bullet import WorldClosedError
from robots.bullet.chain import BulletChain
from robots.onboard.servo import ServoGains
from robots.puma560 import dynamics
from robots.puma560.body import RealArm
from robots.puma560.parameters import DH_A, DH_ALPHA, DH_D, FLANGE, default_limits
from robots.simulated import WORLDS, Payload, Reality
from vrs.errors import InvalidValueError
from vrs.model import Array

BARE = Reality(friction=False, rotor_inertia=False, torque_limits=False, encoder_counts=None)
START = (0.0, np.pi / 2, -np.pi / 2, 0.0, 0.0, 0.0)


WORLD = ["bullet"]


@pytest.fixture(autouse=True, params=WORLDS)
def _world(request: pytest.FixtureRequest) -> None:
    """Every law of this module holds in each world."""
    WORLD[0] = request.param


def real_arm(*given: Any, **named: Any) -> RealArm:
    return RealArm(*given, **named, world=WORLD[0])


def quintic_moves(seed: int, moves: int = 4, speed: float = 0.95) -> tuple[Array, Array, Array]:
    """Moves between random positions, near the speed or acceleration limits, with short pauses."""
    rng, limits = np.random.default_rng(seed), default_limits()
    q, parts = np.array(START), []
    for _ in range(moves):
        step = (rng.uniform(limits.q_min, limits.q_max) - q) * rng.uniform(0.3, 0.9)
        T = max(
            np.max(np.abs(step) * 1.875 / (speed * limits.qd_max)),
            np.sqrt(np.max(np.abs(step) * 5.7735 / (speed * limits.qdd_max))),
        )
        k = int(np.ceil(T * 1000))
        T = k * 1e-3
        s = (np.arange(1, k + 1) / k)[:, None]
        parts.append(
            (
                q + step * (10 * s**3 - 15 * s**4 + 6 * s**5),
                step / T * (30 * s**2 - 60 * s**3 + 30 * s**4),
                step / T**2 * (60 * s - 180 * s**2 + 120 * s**3),
            )
        )
        q = q + step
        parts.append((np.tile(q, (150, 1)), np.zeros((150, 6)), np.zeros((150, 6))))
    q_ref, qd_ref, qdd_ref = (np.concatenate(rows) for rows in zip(*parts, strict=True))
    return q_ref, qd_ref, qdd_ref


def worst_rms_deg(reference: Array, followed: Array) -> float:
    return float(np.degrees(np.sqrt(np.mean((followed - reference) ** 2, axis=0))).max())


def states(count: int, seed: int = 0) -> Iterator[tuple[Array, Array, Array]]:
    rng, limits = np.random.default_rng(seed), default_limits()
    for _ in range(count):
        q = rng.uniform(limits.q_min, limits.q_max)
        yield q, rng.uniform(-1, 1, 6) * limits.qd_max, rng.uniform(-1, 1, 6) * limits.qdd_max


def toolbox() -> Puma560:
    robot = Puma560()
    for link in robot.links:
        link.Jm, link.B, link.Tc = 0.0, 0.0, [0.0, 0.0]
    return robot


def test_tables_are_the_toolboxs() -> None:
    for j, link in enumerate(Puma560().links):
        assert (dynamics.MASS[j], dynamics.GEAR[j]) == (link.m, link.G)
        assert (dynamics.ROTOR_INERTIA[j], dynamics.VISCOUS[j]) == (link.Jm, link.B)
        assert dynamics.COULOMB[j] == tuple(link.Tc)
        assert dynamics.CENTRE[j] == tuple(link.r)
        np.testing.assert_array_equal(np.diag(dynamics.INERTIA[j]), link.I)
        assert (DH_A[j], DH_ALPHA[j]) == (link.a, link.alpha)
        assert j == 0 or DH_D[j] == link.d


def test_torques_of_rne_give_the_wanted_acceleration() -> None:
    robot = toolbox()
    with real_arm(BARE) as arm:
        for q, qd, qdd in states(1000):
            arm.place(q, qd)
            arm.apply(robot.rne(q, qd, qdd))
            got = (arm.qd - qd) / BARE.dt
            assert np.abs(got - qdd).max() <= 1e-9 * np.abs(qdd).max()
            np.testing.assert_allclose(arm.q, q + BARE.dt * arm.qd, rtol=0, atol=1e-14)


@pytest.mark.parametrize("payload", [None, Payload(2.5, (0.01, -0.02, 0.05), (0.01, 0.012, 0.008))])
def test_rotors_act_as_M_plus_G2J_says(payload: Payload | None) -> None:
    reality = Reality(friction=False, torque_limits=False)
    with real_arm(reality, payload=payload) as arm:
        for q, qd, qdd in states(300, seed=1):
            tau = arm.inverse_dynamics(q, qd, qdd)
            bias = arm.inverse_dynamics(q, qd, np.zeros(6))
            expected = np.linalg.solve(arm.mass_matrix(q), tau - bias)
            arm.place(q, qd)
            arm.apply(tau)
            got = (arm.qd - qd) / reality.dt
            assert np.abs(got - qdd).max() <= 1e-9 * np.abs(qdd).max()
            assert np.abs(got - expected).max() <= 1e-9 * np.abs(qdd).max()


def test_dynamics_are_the_toolboxs_with_every_payload_in_turn() -> None:
    plain, G2J = toolbox(), np.diag(dynamics.ARMATURE)
    with real_arm() as arm:
        for mass, centre in ((0.0, None), (2.5, (0.0, 0.0, 0.1)), (1.0, (0.05, -0.03, 0.0)), (0.0, None)):
            robot = toolbox()
            if centre is None:
                arm.release()
            else:
                arm.attach(Payload(mass, centre))
                robot.payload(mass, np.array(centre) + np.array([0.0, 0.0, FLANGE]))
            for q, qd, qdd in states(20, seed=2):
                tau = robot.rne(q, qd, qdd) + G2J @ qdd
                np.testing.assert_allclose(arm.inverse_dynamics(q, qd, qdd), tau, rtol=0, atol=1e-11)
                np.testing.assert_allclose(arm.mass_matrix(q), robot.inertia(q) + G2J, rtol=0, atol=1e-11)
                assert centre is None or np.abs(tau - G2J @ qdd - plain.rne(q, qd, qdd)).max() > 0.1


def test_a_payload_changes_hands_without_a_trace() -> None:
    refs = [x[:200] for x in quintic_moves(8, moves=1)]
    with real_arm(q=START) as arm:
        arm.run(*refs)
        q, qd = arm.q, arm.qd
        arm.attach(Payload(2.5))
        np.testing.assert_array_equal(arm.q, q)
        np.testing.assert_array_equal(arm.qd, qd)
        arm.attach(Payload(1.0))
        arm.release()
        assert arm.payload is None
        after = arm.run(*refs)
    with real_arm(q=START) as other:
        other.run(*refs)
        np.testing.assert_array_equal(other.run(*refs).q, after.q)


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_tracking_and_what_an_unknown_payload_does_to_it(seed: int) -> None:
    refs = quintic_moves(seed)
    with real_arm(q=START) as arm:
        unloaded = worst_rms_deg(refs[0], arm.run(*refs).q)
    with real_arm(q=START, payload=Payload(2.5)) as arm:
        loaded = worst_rms_deg(refs[0], arm.run(*refs).q)
    assert unloaded <= 0.2
    assert loaded >= 1.15 * unloaded


@pytest.mark.parametrize("bandwidth", [10.0, 15.0])
def test_tracking_holds_without_friction_compensation(bandwidth: float) -> None:
    refs = quintic_moves(3)
    gains = ServoGains(bandwidth_hz=bandwidth, friction=0.0)
    with real_arm(q=START, gains=gains) as arm, real_arm(q=START, gains=gains) as other:
        other.attach(Payload(2.5))
        unloaded = worst_rms_deg(refs[0], arm.run(*refs).q)
        assert unloaded <= 0.2
        assert worst_rms_deg(refs[0], other.run(*refs).q) >= 1.15 * unloaded


def test_blocks_of_any_length_and_other_worlds_change_no_bit() -> None:
    refs = [x[:900] for x in quintic_moves(4, moves=2)]
    with real_arm(q=START) as arm:
        whole = arm.run(*refs)
    cuts = [0, 1, 2, 57, 57, 400, 900]
    with real_arm(q=START) as arm, real_arm(q=START, payload=Payload(4.0)) as other:
        parts = []
        for start, end in pairwise(cuts):
            rows = [x[start:end] for x in refs]
            parts.append(arm.run(*rows))
            other.run(*rows)
        assert arm.time == pytest.approx(0.9)
    for name in ("q", "qd", "tau"):
        joined = np.concatenate([getattr(part, name) for part in parts])
        assert joined.tobytes() == getattr(whole, name).tobytes()


def test_at_rest_it_holds_still() -> None:
    refs = [np.tile(START, (500, 1)), np.zeros((500, 6)), np.zeros((500, 6))]
    with real_arm(q=START) as arm:
        measured = arm.run(*refs)
        assert np.abs(arm.q - START).max() < 1e-12
        assert np.ptp(measured.tau[10:], axis=0).max() == 0
        assert not measured.saturated.any()


def test_friction_stops_the_wrist_and_never_turns_it_round() -> None:
    reality = Reality(gravity=0.0)
    with real_arm(reality, q=START) as arm:
        arm.place(START, (0.0, 0.0, 0.0, 0.0, 0.0, 0.5))
        speeds = []
        for _ in range(400):
            arm.apply(np.zeros(6))
            speeds.append(arm.qd[5])
        assert min(speeds) > -1e-12
        assert abs(speeds[-1]) < 1e-12
        rest = arm.q
        arm.apply(0.9 * np.array([high for high, _ in dynamics.JOINT_COULOMB]))
        assert np.abs(arm.qd).max() < 1e-12
        arm.apply(1.5 * np.array([high for high, _ in dynamics.JOINT_COULOMB]))
        assert (arm.qd > 1e-5).sum() >= 5
        assert np.abs(arm.q - rest).max() < 1e-3


def test_free_swing_converges_to_an_independent_simulation() -> None:
    from scipy.integrate import solve_ivp

    robot, T = toolbox(), 0.3
    q0 = np.array([0.3, 0.4, -0.6, 0.2, 0.5, 0.1])

    def rates(t: float, y: Array) -> Array:
        bias = robot.rne(y[:6].copy(), y[6:].copy(), np.zeros(6))
        return np.concatenate((y[6:], np.linalg.solve(robot.inertia(y[:6].copy()), -bias)))

    exact = solve_ivp(rates, (0, T), np.concatenate((q0, np.zeros(6))), rtol=1e-9, atol=1e-9).y[:6, -1]
    errors = []
    for dt in (1e-3, 5e-4):
        reality = Reality(friction=False, rotor_inertia=False, torque_limits=False, encoder_counts=None, dt=dt)
        with real_arm(reality, q=q0) as arm:
            for _ in range(round(T / dt)):
                arm.apply(np.zeros(6))
            errors.append(np.abs(arm.q - exact).max())
    assert errors[0] < 0.05
    assert 1.7 < errors[0] / errors[1] < 2.3


@pytest.mark.parametrize("step", [1.0, -1.0])
def test_torque_limits_hold_either_way_and_are_counted(step: float) -> None:
    refs = [np.tile(np.array(START) + step, (50, 1)), np.zeros((50, 6)), np.zeros((50, 6))]
    with real_arm(q=START) as arm:
        measured = arm.run(*refs)
    # From the second step on it knows that it's far away.
    assert (measured.tau[1] == step * np.array(dynamics.TORQUE_MAX)).any()
    assert (measured.tau[1] * step > 0).all()
    assert (np.abs(measured.tau) <= dynamics.TORQUE_MAX).all()
    assert (measured.saturated == (np.abs(measured.tau) == dynamics.TORQUE_MAX).sum(axis=0)).all()
    assert measured.saturated.any()
    with real_arm(Reality(torque_limits=False), q=START) as arm:
        assert (np.abs(arm.run(*refs).tau) > dynamics.TORQUE_MAX).any()


def test_encoders_count() -> None:
    refs = [x[:300] for x in quintic_moves(5, moves=1)]
    with real_arm(Reality(encoder_counts=50), q=START) as arm:
        measured = arm.run(*refs)
        counts = measured.q * np.abs(dynamics.GEAR) * 50 / (2 * np.pi)
        assert np.abs(counts - np.round(counts)).max() < 1e-9
        assert 0 < np.abs(measured.q[-1] - arm.q).max() <= (np.pi / 50 / np.abs(dynamics.GEAR)).max() + 1e-12


@pytest.mark.parametrize("row", range(3))
@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf, 1e9])
def test_bad_references_are_refused_and_nothing_moves(row: int, bad: float) -> None:
    good = [x[:200] for x in quintic_moves(7, moves=1)]
    with real_arm(q=START) as arm, real_arm(q=START) as untouched:
        spoilt = [x.copy() for x in good]
        spoilt[row][150, 3] = bad
        with pytest.raises(InvalidValueError, match="finite"):
            arm.run(*spoilt)
        assert arm.time == 0
        np.testing.assert_array_equal(arm.run(*good).tau, untouched.run(*good).tau)


@pytest.mark.parametrize("shape", [(6,), (3, 5), (3, 7), (2, 6), (1, 3, 6)])
def test_wrong_shapes_are_refused(shape: tuple[int, ...]) -> None:
    with real_arm() as arm, pytest.raises(InvalidValueError, match="shape"):
        arm.run(np.zeros(shape), np.zeros((3, 6)), np.zeros((3, 6)))


def test_no_reference_is_no_step() -> None:
    with real_arm() as arm:
        assert arm.run(np.empty((0, 6)), np.empty((0, 6)), np.empty((0, 6))).q.shape == (0, 6)
        assert arm.time == 0


def test_a_closed_arm_has_given_its_client_back() -> None:
    with real_arm() as arm:
        chain = arm.bodies
    if isinstance(chain, BulletChain):
        assert chain.world.closed
    arm.close()
    with pytest.raises(WorldClosedError):
        arm.apply(np.zeros(6))
