"""Steering: laws of every session, limits, singularities, slow and quick inputs."""

from __future__ import annotations

import os

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from robots import puma560
from vrs.commands import Frame
from vrs.errors import InvalidValueError
from vrs.notes import Note, NoteCode
from vrs.planning import Profile, move
from vrs.planning.certificate import violation
from vrs.planning.parabolic import brake
from vrs.planning.plan import Plan, end_state
from vrs.planning.steering import (
    change,
    damped_inverses,
    inverses,
    one_joint,
    run,
    steer,
    weighted_jacobian,
)
from vrs.segment import Piece, State
from vrs.timeline import Timeline

MODEL = puma560.model()
LIMITS = MODEL.limits
ZERO = np.zeros(6)
HOLD = 0.2
NO_SMOOTH_STEERING = (Note(NoteCode.NO_SMOOTH_STEERING),)
MINUTES = float(os.environ.get("VRS_STEERING_MINUTES", "1"))


def condition(q: np.ndarray) -> float:
    J = np.array(MODEL.jacobian(q))
    J[:3] /= 0.4318
    return float(np.linalg.cond(J))


class Hand:
    """A timeline under inputs, and the jumps and marks that they leave."""

    def __init__(self, q: np.ndarray) -> None:
        self.timeline = Timeline(q)
        self.notes = 0
        self.worst = 0.0

    def give(self, t: float, *, rates=None, twist=None, frame=Frame.BASE, hold=HOLD) -> Plan:
        state = self.timeline.state_before(t)
        plan, note, _ = steer(state, rates, twist, frame, hold, MODEL, LIMITS)
        assert violation(plan, LIMITS, jerk=True) is None
        if len(plan):
            c = plan.coefficients[0]
            jumps = [c[0] - state.q, c[1] - state.qd] + ([] if note else [2.0 * c[2] - state.qdd])
            self.worst = max(self.worst, *(float(np.abs(jump).max()) for jump in jumps))
        self.notes += bool(note)
        self.timeline = self.timeline.edited(t, [Piece(plan.durations.tolist(), plan.rows(), 1)])
        return plan


def check_laws(timeline: Timeline, *, noted: int = 0) -> None:
    """Limits and jumps from the segments alone, by roots, apart from the engine's certificate."""
    before = None
    jumps = 0
    bounds = (
        (LIMITS.q_min, LIMITS.q_max), *((-most, most) for most in (LIMITS.qd_max, LIMITS.qdd_max, LIMITS.qddd_max))
    )  # fmt: skip
    for segment in timeline.segments:
        h, ends = segment.duration, []
        a = segment.coefficients
        for order, (low, high) in enumerate(bounds):
            a = a if order == 0 else a[1:] * np.arange(1.0, len(a))[:, None] if len(a) > 1 else np.zeros((1, 6))
            slack = 1e-9 * (1.0 if order == 0 else high)
            for j, column in enumerate(a.T):
                slope = np.polynomial.polynomial.polyder(column)
                turns = np.roots(slope[::-1]) if slope.any() else []
                inside = [0.0, h, *(float(r.real) for r in turns if abs(r.imag) < 1e-9 and 0 < r.real < h)]
                values = np.polynomial.polynomial.polyval(inside, column)
                assert (low - slack)[j] <= values.min(), (order, j)
                assert values.max() <= (high + slack)[j], (order, j)
            ends.append(np.polynomial.polynomial.polyval([0.0, h], a))
        if before is not None:
            assert np.abs(ends[0][:, 0] - before[0]).max() <= 1e-9
            assert np.abs(ends[1][:, 0] - before[1]).max() <= 1e-9
            jumps += bool(np.abs(ends[2][:, 0] - before[2]).max() > 1e-9)
        before = [end[:, 1] for end in ends]
    assert jumps <= 2 * noted


@pytest.mark.parametrize("kind", ["rates", "base", "tool"])
@pytest.mark.parametrize("seed", [1, 2])
def test_laws_hold_for_inputs_at_any_interval(kind: str, seed: int):
    rng = np.random.default_rng(seed)
    hand = Hand(MODEL.poses["nominal"])
    t, rates, twist = 0.0, ZERO, ZERO
    while t < 20.0 * MINUTES:
        if rng.random() < 0.15:
            rates = rng.uniform(-1.3, 1.3, 6) * LIMITS.qd_max * (rng.random(6) < 0.5)
            twist = np.concatenate([rng.uniform(-0.4, 0.4, 3), rng.uniform(-1, 1, 3) * (rng.random() < 0.5)])
            twist *= rng.random() < 0.8
        asked = {"rates": rates} if kind == "rates" else {"twist": twist, "frame": Frame(kind)}
        plan = hand.give(t, **asked)
        assert plan.duration < HOLD + 1.0
        t += 10 ** rng.uniform(-3, 0)
    assert hand.notes == 0
    assert hand.worst <= 1e-9
    assert not hand.timeline.state_before(hand.timeline.end + 1.0).qd.any()
    check_laws(hand.timeline)


@pytest.mark.parametrize("profile", list(Profile))
def test_it_takes_over_from_any_state_of_a_move(profile: Profile):
    rng = np.random.default_rng(5)
    braked = 0
    for _ in range(120):
        start, goal = rng.uniform(LIMITS.q_min, LIMITS.q_max, (2, 6))
        if rng.random() < 0.5:
            goal = np.where(rng.random(6) < 0.5, LIMITS.q_max, LIMITS.q_min)
        plan, _ = move(State(start, ZERO, ZERO), goal, 1.0, profile, LIMITS)
        i = int(rng.integers(len(plan)))
        state = end_state(Plan(plan.durations[i : i + 1] * rng.random(), plan.coefficients[i : i + 1]))
        asked = {"rates": rng.uniform(-1, 1, 6) * LIMITS.qd_max, "twist": None}
        if rng.random() < 0.5:
            asked = {"rates": None, "twist": rng.uniform(-0.3, 0.3, 6)}
        made, note, _ = steer(state, asked["rates"], asked["twist"], Frame.BASE, HOLD, MODEL, LIMITS)
        assert violation(made, LIMITS, jerk=True) is None
        end = end_state(made)
        assert max(np.abs(end.qd).max(), np.abs(end.qdd).max() if not note else 0.0) < 1e-9
        assert np.allclose(made.coefficients[0, :2], [state.q, state.qd], atol=1e-12)
        assert note or np.abs(2.0 * made.coefficients[0, 2] - state.qdd).max() < 1e-9
        braked += note == NO_SMOOTH_STEERING
    if profile is Profile.JERK_LIMITED:
        assert braked == 0


def test_where_no_bounded_jerk_can_stop_it_brakes_with_parabolas_and_says_so():
    V, A = LIMITS.qd_max[0], LIMITS.qdd_max[0]
    q = MODEL.poses["nominal"].copy()
    q[0] = LIMITS.q_max[0] - 0.5 * V * V / A - 1e-6
    qd = np.array([V, 0, 0, 0, 0, 0])
    state = State(q, qd, ZERO)
    plan, note, _ = steer(state, qd, None, Frame.BASE, HOLD, MODEL, LIMITS)
    assert note == NO_SMOOTH_STEERING
    assert np.array_equal(plan.durations, brake(state, LIMITS).durations)
    assert violation(plan, LIMITS, jerk=False) is None


def test_rates_are_reached_in_the_least_time_and_the_stop_begins_with_the_hold():
    J, A = LIMITS.qddd_max[0], LIMITS.qdd_max[0]
    u = 0.5 * A * A / J
    plan, *_ = steer(State(ZERO, ZERO, ZERO), [u, 0, 0, 0, 0, 0], None, Frame.BASE, 0.5, MODEL, LIMITS)
    ramp = 2.0 * (u / J) ** 0.5
    assert np.cumsum(plan.durations) == pytest.approx([ramp / 2, ramp, 0.5, 0.5 + ramp / 2, 0.5 + ramp])
    assert end_state(plan).q[0] == pytest.approx(0.5 * u, rel=1e-12)


def test_rates_beyond_the_limits_keep_their_direction():
    asked = np.array([4.0, -2.0, 1.0, 0, 0, 0])
    hand = Hand(MODEL.poses["nominal"])
    hand.give(0.0, rates=asked, hold=1.0)
    qd = hand.timeline.sample(0.9, derivative=1)
    assert qd == pytest.approx(asked * LIMITS.qd_max[0] / 4.0, abs=1e-9)


def test_a_steady_input_goes_on_with_the_same_polynomial():
    hand = Hand(MODEL.poses["nominal"])
    t = 0.0
    for _ in range(60):
        plan = hand.give(t, rates=[0.2, 0.1, 0, 0, -0.1, 0])
        t += 0.02
    assert len(plan.rows()[0]) == 2
    assert plan.durations[0] == pytest.approx(HOLD)
    assert len(hand.timeline) <= 75


def test_a_joint_stops_exactly_at_its_limit_while_the_others_go_on_and_leaves_at_once():
    q = MODEL.poses["nominal"].copy()
    q[0] = LIMITS.q_max[0] - 0.3
    hand = Hand(q)
    u = np.array([1.2, 0, 0, 0, 0, 0.3])
    for k in range(100):
        hand.give(0.02 * k, rates=u)
    after = np.linspace(1.2, 1.98, 200)
    assert np.abs(hand.timeline.sample(after)[:, 0] - LIMITS.q_max[0]).max() <= 1e-9
    assert not hand.timeline.sample(after, derivative=1)[:, 0].any()
    assert hand.timeline.sample(after, derivative=1)[:, 5] == pytest.approx(0.3, abs=1e-9)
    free = Hand(ZERO)
    for k in range(20):
        hand.give(2.0 + 0.02 * k, rates=-u)
        free.give(0.02 * k, rates=-u)
    left = hand.timeline.sample(2.0 + after - 1.2)[:, 0] - hand.timeline.sample(2.0)[0]
    assert left == pytest.approx(free.timeline.sample(after - 1.2)[:, 0], abs=1e-9)
    check_laws(hand.timeline)


def test_it_turns_back_where_only_that_keeps_the_limit():
    V, A, J = 1.0, 4.0, 40.0
    x = (0.0, 0.5, -A)
    (stop, _, _), _, high = run(x, change(0.5, -A, 0.0, A, J))
    assert high == stop
    limit = 0.5 * 0.5 * 0.5 / A + 1e-4
    assert limit < high
    profile = one_joint(x, 1.0, 0.2, -1.0, limit, V, A, J)
    assert profile is not None
    (_, v, a), _, high = run(x, profile)
    assert high <= limit + 1e-10
    assert (v, a) == pytest.approx((0.0, 0.0), abs=1e-12)


def test_inputs_that_stop_coming_end_in_rest():
    hand = Hand(MODEL.poses["nominal"])
    for k in range(50):
        hand.give(0.02 * k, twist=[0.2, 0.1, -0.1, 0, 0, 0.3])
    assert hand.timeline.end < 0.98 + HOLD + 0.5
    assert np.abs(hand.timeline.sample(0.97 + HOLD, derivative=1)).max() > 0.05


@pytest.mark.parametrize(
    ("rates", "twist", "frame", "hold"),
    [
        (None, None, Frame.BASE, 0.2),
        (ZERO, ZERO, Frame.BASE, 0.2),
        (np.full(6, np.nan), None, Frame.BASE, 0.2),
        (np.zeros(5), None, Frame.BASE, 0.2),
        (None, [0, 0, np.inf, 0, 0, 0], Frame.BASE, 0.2),
        (None, np.zeros((6, 1)), Frame.BASE, 0.2),
        (None, "up", Frame.BASE, 0.2),
        (None, ZERO, "world", 0.2),
        (ZERO, None, Frame.BASE, np.nan),
    ],
)
def test_bad_input_is_refused(rates, twist, frame, hold):
    with pytest.raises(InvalidValueError):
        steer(State(MODEL.poses["nominal"], ZERO, ZERO), rates, twist, frame, hold, MODEL, LIMITS)


def test_huge_and_tiny_inputs_make_finite_plans():
    state = State(MODEL.poses["nominal"], ZERO, ZERO)
    for size in (1e-310, 1e-12, 1e12, 1e308):
        for asked in ((np.full(6, size), None), (None, np.full(6, size))):
            plan, *_ = steer(state, *asked, Frame.TOOL, HOLD, MODEL, LIMITS)
            assert violation(plan, LIMITS, jerk=True) is None


def exact_deviation(hand: Hand, twist: np.ndarray, end: float, begin: float = 0.0) -> tuple[float, float]:
    """Farthest that the tool is from the exact motion of a base twist: [m], [rad]."""
    X = MODEL.forward(hand.timeline.sample(np.linspace(begin, end, 60)))
    v, w = twist[:3], twist[3:]
    way = (X[:, :3, 3] - X[0, :3, 3]) @ v / (v @ v)
    off = np.linalg.norm(X[:, :3, 3] - X[0, :3, 3] - way[:, None] * v, axis=1).max()
    turn = Rotation.from_matrix(X[:, :3, :3] @ X[0, :3, :3].T).as_rotvec()
    turned = float(np.linalg.norm(turn - way[:, None] * w, axis=1).max())
    return float(off), turned


def test_a_twist_is_followed_for_the_whole_hold_and_while_it_stops():
    rng = np.random.default_rng(3)
    tried = 0
    while tried < 25:
        q = rng.uniform(LIMITS.q_min + 0.8, LIMITS.q_max - 0.8)
        twist = np.concatenate([rng.normal(size=3), rng.normal(size=3) * 0.3])
        twist[:3] *= 0.25 / np.linalg.norm(twist[:3])
        if condition(q) > 15:
            continue
        tried += 1
        hand = Hand(q)
        for k in range(21):
            hand.give(0.02 * k, twist=twist)
        # To limits, to singularities, or for as long as it's asked.
        off, turned = exact_deviation(hand, twist, hand.timeline.end)
        assert off <= 1e-5
        assert turned <= 1e-4


@pytest.mark.parametrize("dt", [0.2, 0.02, 0.005])
def test_slow_and_quick_inputs_give_the_same_path(dt: float):
    hand = Hand(MODEL.poses["nominal"])
    twist = np.array([0.1, 0.15, -0.1, 0.2, 0.0, 0.1])
    for k in range(round(1.0 / dt)):
        hand.give(dt * k, twist=twist)
    off, turned = exact_deviation(hand, twist, hand.timeline.end)
    assert off <= 1e-5
    assert turned <= 1e-4


def test_the_tool_frame_turns_with_the_tool():
    hand = Hand(MODEL.poses["nominal"])
    twist = np.array([0.05, 0.0, 0.05, 0.0, 0.6, 0.0])
    for k in range(6):
        hand.give(HOLD * k, twist=twist, frame=Frame.TOOL)
    t = np.array([0.59, 0.79, 0.99])
    for moment in t:
        q, qd = hand.timeline.sample(moment), hand.timeline.sample(moment, derivative=1)
        R = MODEL.forward(q)[:3, :3]
        v, w = np.split(MODEL.jacobian(q) @ qd, 2)
        got = np.concatenate([R.T @ v, R.T @ w])
        # Slow inputs near a singularity: the wrist is about to brake.
        assert 0.95 < got @ twist / (twist @ twist) < 1.01
        assert got == pytest.approx(got @ twist / (twist @ twist) * twist, abs=1e-4)


WRIST = np.array([0, 0.7, -2.6, 0.3, 0.6, 0])
ELBOW = np.array([0, 0.5, -1.9, 0.0, 0.6, 0])
SHOULDER = np.array([0, 1.9, -2.9, 0.2, 0.8, 0])


def towards(q: np.ndarray) -> np.ndarray:
    """A twist that leads into the singularity near q."""
    if q is WRIST:
        return np.asarray(MODEL.jacobian(q) @ [0, 0, 0, 0, -0.5, 0])
    p = MODEL.forward(q)[:3, 3]
    way = p if q is ELBOW else -np.array([p[0], p[1], 0])
    return np.concatenate([0.15 * way / np.linalg.norm(way), ZERO[:3]])


@pytest.mark.parametrize("q", [WRIST, ELBOW, SHOULDER])
def test_near_singularities_it_slows_and_stops_and_goes_back(q: np.ndarray):
    hand = Hand(q)
    twist = towards(q)
    for k in range(150):
        hand.give(0.02 * k, twist=twist)
    t = np.linspace(0, 2.98, 100)
    assert max(condition(p) for p in hand.timeline.sample(t)) < 105
    near = condition(hand.timeline.sample(2.98))
    assert near > 40
    v, w = np.split(MODEL.jacobian(hand.timeline.sample(2.98)) @ hand.timeline.sample(2.98, derivative=1), 2)
    assert np.linalg.norm(v) + np.linalg.norm(w) < 0.1 * np.linalg.norm(twist)
    for k in range(100):
        hand.give(3.0 + 0.02 * k, twist=-twist)
    assert condition(hand.timeline.sample(4.98)) < 20
    assert hand.worst <= 1e-9
    check_laws(hand.timeline)


@pytest.mark.parametrize("axis", range(6))
@pytest.mark.parametrize("sign", [1, -1])
def test_from_ready_possible_directions_move_and_impossible_ones_do_nothing(axis: int, sign: int):
    twist = ZERO.copy()
    twist[axis] = sign * (0.1 if axis < 3 else 0.3)
    ready = MODEL.poses["ready"]
    hand = Hand(ready)
    for k in range(50):
        hand.give(0.02 * k, twist=twist)
    q = hand.timeline.sample(np.linspace(0, 1, 101))
    assert np.isfinite(q).all()
    J = np.array(MODEL.jacobian(ready))
    possible = np.linalg.norm(J @ np.linalg.pinv(J, rcond=1e-6) @ twist) > 1e-6 * np.linalg.norm(twist)
    moved = np.abs(q[-1] - ready).max()
    assert moved > 1e-4 if possible else moved < 1e-9
    assert hand.worst <= 1e-9
    check_laws(hand.timeline)


@pytest.mark.parametrize("joint", range(6))
def test_the_tool_stops_on_its_way_where_a_joint_comes_to_its_limit(joint: int):
    q = np.array([0.3, 0.8, -2.6, 0.2, 0.5, 0.0])
    q[joint] = LIMITS.q_max[joint] - 0.15
    rates = np.full(6, 0.05)
    rates[joint] = 0.5
    twist = np.asarray(MODEL.jacobian(q) @ rates)
    hand = Hand(q)
    for k in range(80):
        hand.give(0.02 * k, twist=twist)
    off, turned = exact_deviation(hand, twist, hand.timeline.end)
    assert off <= 1e-5
    assert turned <= 1e-4
    assert LIMITS.q_max[joint] - 0.03 < hand.timeline.sample(1.58)[joint]
    assert np.abs(hand.timeline.sample(1.58, derivative=1)).max() < 0.02
    check_laws(hand.timeline)
    for k in range(40):
        hand.give(1.6 + 0.02 * k, twist=-twist)
    assert hand.timeline.sample(2.4)[joint] < LIMITS.q_max[joint] - 0.15, "it goes back at once"


def test_inverses_are_exact_away_from_singularities_and_bounded_at_them():
    rng = np.random.default_rng(9)
    q = rng.uniform(LIMITS.q_min, LIMITS.q_max, (200, 6))
    q[::4, 4] = rng.uniform(-0.05, 0.05, 50)
    J = weighted_jacobian(MODEL, q)
    S = np.linalg.svd(J, compute_uv=False)
    P, near = damped_inverses(J)
    assert np.abs(near) == pytest.approx(S[:, -1] / S[:, 0], abs=1e-12)
    sound = S[:, 0] / S[:, -1] < 99
    assert np.abs((J @ P)[sound] - np.eye(6)).max() < 1e-10
    assert (np.linalg.norm(P, ord=2, axis=(1, 2)) <= 100.0 / S[:, 0] * (1 + 1e-9)).all()
    # Those of one place at a time are the same, whichever way is quick there.
    for k in range(0, 200, 7):
        alone, close = inverses(MODEL, q[k : k + 1], J[k : k + 1])
        assert alone[0] == pytest.approx(P[k], rel=1e-9, abs=1e-9)
        assert abs(close[0]) <= abs(near[k]) * (1 + 1e-12)
