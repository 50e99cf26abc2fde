from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robots.drives import Drives, solve_six
from robots.onboard.servo import Servo, ServoGains
from robots.simulated import Payload, Reality
from vrs.errors import InvalidValueError
from vrs.model import Array


def spd(rng: np.random.Generator) -> Array:
    X = rng.normal(size=(6, 6))
    return np.asarray(X @ X.T + 0.05 * np.eye(6))


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=200, deadline=None)
def test_six_equations_agree_with_numpy(seed: int) -> None:
    rng = np.random.default_rng(seed)
    A, d, b = spd(rng), rng.uniform(0, 1, 6), rng.normal(size=6)
    expected = np.linalg.solve(A + np.diag(d), b)
    got = solve_six(A.tolist(), d.tolist(), b.tolist())
    np.testing.assert_allclose(got, expected, rtol=1e-9, atol=1e-9)


@given(st.integers(0, 2**32 - 1), st.booleans())
@settings(max_examples=300, deadline=None)
def test_friction_laws_hold_at_the_end_of_every_step(seed: int, slow_path: bool) -> None:
    rng = np.random.default_rng(seed)
    dt = 1e-3
    J, B = rng.uniform(0, 1, 6), rng.uniform(0, 5, 6)
    high, low = rng.uniform(0, 5, 6), -rng.uniform(0, 5, 6)
    drives = Drives(armature=J.tolist(), viscous=B.tolist(), coulomb=list(zip(high, low, strict=True)), dt=dt)
    qd = np.zeros(6)
    for _ in range(5):
        M, c, tau = spd(rng), rng.normal(size=6), rng.normal(scale=4, size=6)
        if slow_path:
            rhs = (tau - c - B * qd).tolist()
            a = np.array(drives.relax(M.tolist(), rhs, qd.tolist())[0])
            applied = M @ a + c
        else:
            applied = np.array(drives.joint_torques(M.tolist(), c.tolist(), qd.tolist(), tau.tolist()))
            a = np.linalg.solve(M, applied - c)
        end = qd + dt * a
        coulomb = tau - applied - J * a - B * end
        tolerance = 1e-6
        assert (coulomb <= high + tolerance).all()
        assert (coulomb >= low - tolerance).all()
        for i in range(6):
            if end[i] > 1e-9:
                assert coulomb[i] == pytest.approx(high[i], abs=tolerance)
            elif end[i] < -1e-9:
                assert coulomb[i] == pytest.approx(low[i], abs=tolerance)
        qd = end


def test_a_servo_on_its_reference_sends_the_feedforward_alone() -> None:
    servo = Servo(ServoGains(), inertia=[1.0, 2.0], feedforward=lambda q, qd, qdd: q, q=[0.1, 0.2], dt=1e-3)
    assert servo.torques([0.1, 0.2], [3.0, 4.0], [0.3, 0.4]) == [3.0, 4.0]
    assert servo.torques([0.3, 0.4], [5.0, 6.0], [0.3, 0.4]) == [5.0, 6.0]


def test_a_lasting_error_is_met_with_stiffness_and_a_growing_one_with_damping() -> None:
    gains = ServoGains(bandwidth_hz=10.0, damping=0.7)
    omega = 2 * np.pi * 10.0
    servo = Servo(gains, inertia=[2.0], feedforward=lambda q, qd, qdd: q, q=[0.0], dt=1e-3)
    held = [servo.torques([-0.01], [0.0], [0.0])[0] for _ in range(3)]
    assert held == pytest.approx([2.0 * omega**2 * 0.01] * 3)
    for k in range(300):
        tau = servo.torques([-0.01 - 1e-4 * k], [0.0], [0.0])[0]
    assert tau == pytest.approx(2.0 * (omega**2 * (0.01 + 1e-4 * 299) + 2 * 0.7 * omega * 0.1), rel=1e-6)


@pytest.mark.parametrize(
    "values",
    [
        {"friction": -0.1},
        {"friction": "yes"},
        {"friction": float("nan")},
        {"dt": 0.0},
        {"gravity": float("inf")},
        {"encoder_counts": 0},
        {"encoder_counts": 1.5},
        {"rotor_inertia": 1},
    ],
)
def test_reality_refuses(values: dict[str, object]) -> None:
    with pytest.raises(InvalidValueError, match=next(iter(values))):
        Reality(**values)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    "arguments",
    [
        (0.0,),
        (float("nan"),),
        (-1.0,),
        (1.0, (0.0, 0.0)),
        (1.0, (0.0, 0.0, 2.0)),
        (1.0, (0.0, 0.0, 0.0), (1.0, 1.0, 3.0)),
        (1.0, (0.0, 0.0, 0.0), np.arange(9.0).reshape(3, 3)),
    ],
)
def test_payload_refuses(arguments: tuple[object, ...]) -> None:
    with pytest.raises(InvalidValueError):
        Payload(*arguments)  # type: ignore[arg-type]


@pytest.mark.parametrize("name", ["bandwidth_hz", "damping", "derivative_hz", "friction"])
def test_gains_refuse(name: str) -> None:
    with pytest.raises(InvalidValueError, match=name):
        ServoGains(**{name: -1.0})
