"""Straight lines of the tool. VRS_LINES lines are checked for accuracy, 25 unless it says otherwise."""

from __future__ import annotations

import os
from math import perm

import numpy as np
import pytest

from robots import puma560
from robots.puma560.parameters import A3, D4
from vrs import Profile
from vrs.errors import PlanningError
from vrs.notes import text_of
from vrs.planning import move
from vrs.planning.certificate import violation
from vrs.planning.line import line
from vrs.planning.path import rotation_vector, rotations
from vrs.planning.plan import Plan, end_state
from vrs.segment import State

MODEL = puma560.model()
LIMITS = MODEL.limits
STILL = np.zeros(6)
LINES = int(os.environ.get("VRS_LINES", "25"))
PROFILES = (Profile.PARABOLIC, Profile.JERK_LIMITED)
NOMINAL = np.array([0.2, 0.8, -2.9, 0.3, 0.8, -0.4])


def rest(q) -> State:
    return State(np.asarray(q, dtype=float), STILL, STILL)


def plan_from_rest(q, X, *, speed=1.0, profile=Profile.PARABOLIC, model=MODEL, **asked) -> Plan:
    return line(rest(q), X, speed, profile, model, model.limits, **asked)[0]


def moved(q, way=(0.0, 0.0, 0.0), turn=(0.0, 0.0, 0.0)):
    X = MODEL.forward(q)
    X[:3, 3] += way
    X[:3, :3] = rotations(np.array([turn], dtype=float))[0] @ X[:3, :3]
    return X


def random_lines(seed: int, count: int, profile: Profile):
    """Lines between random poses in one configuration, of those that the planner takes."""
    rng = np.random.default_rng(seed)
    for _ in range(100 * count):
        q, goal = rng.uniform(LIMITS.q_min, LIMITS.q_max, (2, 6))
        if MODEL.configuration(q) != MODEL.configuration(goal):
            continue
        X, speed = MODEL.forward(goal), float(rng.uniform(0.1, 1.0))
        try:
            plan = plan_from_rest(q, X, speed=speed, profile=profile)
        except PlanningError:
            continue
        yield q, X, speed, plan
        count -= 1
        if count == 0:
            return
    pytest.fail(f"{count} lines too few were planned")


def derivatives(a, u, order: int):
    """Derivative of a piece at times u, (k, n)."""
    powers = range(order, len(a))
    return sum((perm(k, order) * a[k] * u[:, None] ** (k - order) for k in powers), np.zeros((len(u), a.shape[1])))


def sampled(plan: Plan, per_piece: int, order: int = 0):
    pieces = zip(plan.coefficients, plan.durations, strict=True)
    return np.concatenate([derivatives(a, np.linspace(0.0, h, per_piece), order) for a, h in pieces])


def excesses(plan: Plan, bounds):
    """Largest relative excess of speed, acceleration, jerk over bounds: a fine grid, then each peak refined."""
    worst = []
    for order, bound in enumerate(bounds, start=1):
        excess = 0.0
        for a, h in zip(plan.coefficients, plan.durations, strict=True):
            u = np.linspace(0.0, h, 200)
            ratio = np.abs(derivatives(a, u, order)) / bound
            for j in np.flatnonzero(ratio.max(0) > 0.98):
                i = int(ratio[:, j].argmax())
                low, high = u[max(i - 1, 0)], u[min(i + 1, len(u) - 1)]
                fine = np.linspace(low, high, 200)
                excess = max(excess, float((np.abs(derivatives(a, fine, order)[:, j]) / bound[j]).max()) - 1.0)
        worst.append(excess)
    return worst


def jumps(plan: Plan):
    """Largest jumps between pieces of q, qd and qdd."""
    worst = np.zeros(3)
    for i in range(len(plan) - 1):
        end = end_state(Plan(plan.durations[i : i + 1], plan.coefficients[i : i + 1]))
        a = plan.coefficients[i + 1]
        step = [np.abs(end.q - a[0]).max(), np.abs(end.qd - a[1]).max(), np.abs(end.qdd - 2.0 * a[2]).max()]
        worst = np.maximum(worst, step)
    return worst


def off_the_line(q, X0, X1):
    """How far tools at q are off the line from X0 to X1 [m], and off its even turn [rad]."""
    way = X1[:3, 3] - X0[:3, 3]
    turn = rotation_vector(X1[:3, :3] @ X0[:3, :3].T)
    X = MODEL.forward(q)
    if way @ way > 1e-12:
        x = (X[:, :3, 3] - X0[:3, 3]) @ way / (way @ way)
    else:
        turned = np.array([rotation_vector(R @ X0[:3, :3].T) for R in X[:, :3, :3]])
        x = turned @ turn / (turn @ turn)
    R = rotations(x[:, None] * turn) @ X0[:3, :3]
    ideal = np.zeros_like(X)
    ideal[:, :3, :3], ideal[:, :3, 3], ideal[:, 3, 3] = R, X0[:3, 3] + x[:, None] * way, 1.0
    between = X[:, :3, :3] @ R.swapaxes(1, 2)
    angles = 0.5 * np.abs(between - between.swapaxes(1, 2))
    return np.abs(X[:, :3, 3] - ideal[:, :3, 3]).max(), angles.max(), ideal


@pytest.mark.parametrize("profile", PROFILES)
def test_lines_are_straight_even_and_within_every_limit(profile: Profile):
    jerky = profile is Profile.JERK_LIMITED
    bounds = (LIMITS.qd_max, LIMITS.qdd_max, LIMITS.qddd_max)[: 3 if jerky else 2]
    for q, X, speed, plan in random_lines(1, LINES, profile):
        at = sampled(plan, 60)
        way, turn, ideal = off_the_line(at, MODEL.forward(q), X)
        assert way < 1e-9
        assert turn < 1e-9
        assert np.abs(MODEL.follow(ideal, q) - at).max() < 1e-9
        assert violation(plan, LIMITS, jerk=jerky) is None
        assert max(excesses(plan, (speed * bounds[0], *bounds[1:]))) < 1e-9
        assert (at <= LIMITS.q_max + 1e-9).all()
        assert (at >= LIMITS.q_min - 1e-9).all()
        assert (jumps(plan)[: 3 if jerky else 2] < 1e-9).all()
        assert len(plan) < 100


@pytest.mark.parametrize("profile", PROFILES)
def test_lines_begin_to_the_bit_and_rest_at_both_ends(profile: Profile):
    for q, X, _, plan in random_lines(2, 10, profile):
        first, last = plan.coefficients[0], end_state(plan)
        assert np.array_equal(first[0], q)
        assert np.array_equal(first[1], STILL)
        assert np.abs(last.qd).max() < 1e-12
        assert np.abs(MODEL.forward(last.q) - X).max() < 1e-9
        assert MODEL.configuration(last.q) == MODEL.configuration(q)
        if profile is Profile.JERK_LIMITED:
            assert np.abs(first[2]).max() < 1e-12
            assert np.abs(last.qdd).max() < 1e-9


@pytest.mark.parametrize("profile", PROFILES)
def test_what_rounding_leaves_of_rest_is_rest(profile: Profile):
    state = State(NOMINAL, np.full(6, 1e-16), np.full(6, 1e-14))
    plan, notes = line(state, moved(NOMINAL, (0.0, 0.2, 0.0)), 1.0, profile, MODEL, LIMITS)
    assert notes == ()
    assert np.array_equal(plan.coefficients[0, 0], NOMINAL)


@pytest.mark.parametrize("profile", PROFILES)
@pytest.mark.parametrize("speed", [1.0, 0.4, 0.05])
def test_the_tool_keeps_its_nominal_speeds(profile: Profile, speed: float):
    for way, turn in (((0.0, 0.4, -0.1), (0, 0, 0.2)), ((0, 0, 0.02), (0.1, 0.3, 1.2)), ((0, 0, 0), (0, 0.6, 0.5))):
        plan = plan_from_rest(NOMINAL, moved(NOMINAL, way, turn), speed=speed, profile=profile)
        q, qd = sampled(plan, 60), sampled(plan, 60, 1)
        twist = np.einsum("kij,kj->ki", MODEL.jacobian(q), qd)
        v = np.linalg.norm(twist[:, :3], axis=1).max() / MODEL.tool_speed
        w = np.linalg.norm(twist[:, 3:], axis=1).max() / MODEL.tool_turn_speed
        assert max(v, w) < speed * (1.0 + 1e-6)
        if speed < 0.5:
            assert max(v, w) > 0.99 * speed


def test_a_turn_on_the_spot_leaves_the_tool_where_it_is():
    X = moved(NOMINAL, turn=(0.3, -0.5, 0.4))
    plan = plan_from_rest(NOMINAL, X)
    way, turn, _ = off_the_line(sampled(plan, 40), MODEL.forward(NOMINAL), X)
    assert way < 1e-9
    assert turn < 1e-9


def test_where_the_tool_is_already_there_is_nothing_to_do():
    assert len(plan_from_rest(NOMINAL, MODEL.forward(NOMINAL))) == 0


def test_a_tiny_line_is_a_line():
    X = moved(NOMINAL, (1e-6, 0.0, 0.0))
    plan = plan_from_rest(NOMINAL, X)
    assert plan.duration < 0.02
    assert np.abs(MODEL.forward(end_state(plan).q) - X).max() < 1e-10


@pytest.mark.parametrize("profile", PROFILES)
@pytest.mark.parametrize("speed", [0.001, 0.01, 0.1, 1.0])
@pytest.mark.parametrize("length", [1e-6, 1e-3, 0.05, 0.3])
def test_pieces_meet_to_rounding_however_short_and_slow_the_line_is(profile: Profile, speed: float, length: float):
    jerky = profile is Profile.JERK_LIMITED
    rng = np.random.default_rng(31)
    bounds = (speed * LIMITS.qd_max, LIMITS.qdd_max, LIMITS.qddd_max)[: 3 if jerky else 2]
    for q in NOMINAL + rng.uniform(-0.2, 0.2, (3, 6)):
        way = rng.normal(size=3)
        X = moved(q, length * way / np.linalg.norm(way), rng.normal(0.0, length, 3))
        plan = plan_from_rest(q, X, speed=speed, profile=profile)
        assert (jumps(plan)[: 3 if jerky else 2] < 1e-13).all()
        assert max(excesses(plan, bounds)) < 1e-9
        assert plan.durations.min() > 1e-6


def test_a_rotation_that_is_rough_is_made_smooth():
    X = moved(NOMINAL, (0.0, 0.1, 0.0))
    X[:3, :3] += 3e-7
    plan = plan_from_rest(NOMINAL, X)
    assert np.abs(MODEL.forward(end_state(plan).q) - X).max() < 1e-6


@pytest.mark.parametrize("profile", PROFILES)
@pytest.mark.parametrize("way", [(0.1, 0.0, -0.3), (-0.1, -0.2, -0.3), (0.0, -0.3, -0.3)])
@pytest.mark.parametrize("q4", [0.0, 0.4])
def test_lines_leave_ready_though_it_is_singular(profile: Profile, way, q4: float):
    start = MODEL.poses["ready"] + [0, 0, 0, q4, 0, 0]
    X = moved(start, way, (0.2, -0.1, 0.3))
    plan, notes = line(rest(start), X, 1.0, profile, MODEL, LIMITS)
    assert "joints 4 and 6 turn on the spot first" in text_of(notes)
    way_off, turn_off, _ = off_the_line(sampled(plan, 40), MODEL.forward(start), X)
    assert way_off < 1e-9
    assert turn_off < 1e-9
    jerky = profile is Profile.JERK_LIMITED
    assert violation(plan, LIMITS, jerk=jerky) is None
    assert (jumps(plan)[: 3 if jerky else 2] < 1e-9).all()
    assert np.array_equal(plan.coefficients[0, 0], start)


@pytest.mark.parametrize("bend", [1e-15, 1e-12, 1e-9, 1e-7, 6e-7, 8e-7, 3e-6, 1e-4, 1e-2])
def test_lines_leave_wrists_that_are_nearly_straight(bend: float):
    start = MODEL.poses["ready"] + [0, 0, 0, 0.3, bend, 0]
    X = moved(start, (-0.1, -0.2, -0.3))
    plan, _ = line(rest(start), X, 1.0, Profile.PARABOLIC, MODEL, LIMITS)
    way, turn, _ = off_the_line(sampled(plan, 40), MODEL.forward(start), X)
    assert max(way, turn) < 1e-6
    assert jumps(plan)[:2].max() < 1e-9
    assert violation(plan, LIMITS, jerk=False) is None


@pytest.mark.parametrize("profile", PROFILES)
@pytest.mark.parametrize("bend", [0.7, 0.0])
def test_lines_leave_the_edge_of_the_workspace_though_joints_go_like_a_root(profile: Profile, bend: float):
    start = np.array([0.3, 0.4, np.arctan2(D4, -A3) - np.pi, 0.2, bend, 0.1])
    X = MODEL.forward(start)
    X[:3, 3] *= 0.7
    plan = plan_from_rest(start, X, profile=profile)
    way, turn, _ = off_the_line(sampled(plan, 40), MODEL.forward(start), X)
    assert max(way, turn) < 1e-9
    assert violation(plan, LIMITS, jerk=profile is Profile.JERK_LIMITED) is None


def cut(plan: Plan, share: float) -> State:
    """The state at a share of a plan's duration."""
    t = share * plan.duration
    for h, a in zip(plan.durations, plan.coefficients, strict=True):
        if t <= h:
            return end_state(Plan(np.array([t]), a[None]))
        t -= h
    raise AssertionError


def moving_states(profile: Profile = Profile.PARABOLIC):
    X = moved(NOMINAL, (0.0, 0.35, -0.1), (0.1, 0.0, 0.3))
    yield cut(plan_from_rest(NOMINAL, X, profile=profile), 0.5)
    yield cut(plan_from_rest(NOMINAL, X, profile=profile), 0.2)
    goal = NOMINAL + np.array([0.5, 0.2, -0.3, 0.4, -0.2, 0.5])
    yield cut(move(rest(NOMINAL), goal, 0.6, profile, LIMITS)[0], 0.5)


@pytest.mark.parametrize("profile", PROFILES)
@pytest.mark.parametrize("way", [(0.1, 0.1, 0.2), (0.0, 0.3, -0.1), (-0.15, -0.1, 0.1)])
def test_a_moving_arm_is_blended_onto_the_line_at_a_named_place(way, profile: Profile):
    jerky = profile is Profile.JERK_LIMITED
    bounds = (LIMITS.qd_max, LIMITS.qdd_max, LIMITS.qddd_max)[: 3 if jerky else 2]
    for state in moving_states(profile):
        X = moved(state.q, way, (0.0, 0.2, 0.1))
        plan, notes = line(state, X, 1.0, profile, MODEL, LIMITS)
        first = plan.coefficients[0]
        assert np.array_equal(first[0], state.q)
        assert np.abs(first[1] - state.qd).max() < 1e-12
        assert not jerky or np.abs(2.0 * first[2] - state.qdd).max() < 1e-12
        assert (jumps(plan)[: 3 if jerky else 2] < 1e-11).all()
        assert violation(plan, LIMITS, jerk=jerky) is None
        assert max(excesses(plan, bounds)) < 1e-9
        assert np.abs(MODEL.forward(end_state(plan).q) - X).max() < 1e-9
        assert text_of(notes).startswith("on the line from ")
        assert text_of(notes).endswith(" m on")
        place = float(text_of(notes).split()[4])
        # The line as what the last part of the plan travels: the place is where the tool comes onto it.
        q = sampled(plan, 200)
        p = MODEL.forward(q)[:, :3, 3]
        direction = (p[-1] - p[int(0.8 * len(p))]) / np.linalg.norm(p[-1] - p[int(0.8 * len(p))])
        off = off_the_end(q)
        joined = int(np.flatnonzero(off > 1e-9)[-1]) + 1 if (off > 1e-9).any() else 0
        ahead = (_parabola_corner if not jerky else _quartic_corner)(
            state, p[-1], direction, times(plan, 200)[joined]
        )
        assert np.linalg.norm(p[joined] - ahead) == pytest.approx(place, abs=0.003)
        assert np.linalg.norm(np.cross(ahead - p[-1], direction)) < 0.003


def times(plan: Plan, per_piece: int):
    starts = np.cumsum(plan.durations) - plan.durations
    return np.concatenate([t + np.linspace(0.0, h, per_piece) for t, h in zip(starts, plan.durations, strict=True)])


def _parabola_corner(state: State, goal, direction, b: float):
    """Where the tool's present straight way comes nearest to the line."""
    p0 = MODEL.forward(state.q)[:3, 3]
    v = (MODEL.jacobian(state.q) @ state.qd)[:3]
    M = np.stack([v, -direction], axis=1)
    ahead, _ = np.linalg.lstsq(M, goal - p0, rcond=None)[0]
    return p0 + ahead * v


def _quartic_corner(state: State, goal, direction, b: float):
    """The same, half of the blend time b ahead, drawn aside by the tool's acceleration."""
    step = 1e-4
    way = state.q + step * np.array([[-1.0], [0.0], [1.0]]) * state.qd
    way[[0, 2]] += 0.5 * step * step * state.qdd
    p = MODEL.forward(way)[:, :3, 3]
    v, growth = (p[2] - p[0]) / (2.0 * step), (p[2] - 2.0 * p[1] + p[0]) / (step * step)
    return p[1] + 0.5 * b * v + b * b / 12.0 * growth


@pytest.mark.parametrize("profile", PROFILES)
def test_a_blend_may_begin_faster_than_the_new_speed(profile: Profile):
    state = next(moving_states(profile))
    plan, notes = line(state, moved(state.q, (0.1, 0.1, 0.2)), 0.1, profile, MODEL, LIMITS)
    assert violation(plan, LIMITS, jerk=profile is Profile.JERK_LIMITED) is None
    assert np.array_equal(plan.coefficients[0, 0], state.q)
    assert text_of(notes).startswith("on the line")
    q, qd = sampled(plan, 50), sampled(plan, 50, 1)
    on = len(plan) * 50 - int(np.flatnonzero(off_the_end(q) > 1e-9)[-1]) - 1
    assert on > 100
    twist = np.einsum("kij,kj->ki", MODEL.jacobian(q[-on:]), qd[-on:])
    assert np.linalg.norm(twist[:, :3], axis=1).max() < 0.05 * (1.0 + 1e-4)


def off_the_end(q):
    """Distances of the tool at q from the straight line on which it arrives [m]."""
    p = MODEL.forward(q)[:, :3, 3]
    direction = p[-1] - p[int(0.8 * len(p))]
    return np.linalg.norm(np.cross(p - p[-1], direction / np.linalg.norm(direction)), axis=1)


def test_where_no_blend_fits_the_arm_brakes_and_the_line_starts_there():
    state = State(NOMINAL, 0.95 * LIMITS.qd_max * [1, 1, -1, 1, 1, 1], STILL)
    X = moved(NOMINAL, (0.05, 0.0, 0.0))
    plan, notes = line(state, X, 0.3, Profile.PARABOLIC, MODEL, LIMITS)
    assert text_of(notes).startswith("braked first")
    assert np.array_equal(plan.coefficients[0, 0], state.q)
    assert jumps(plan)[:2].max() < 1e-9
    assert violation(plan, LIMITS, jerk=False) is None


def test_a_jerk_limited_stop_before_a_line_keeps_the_jerk(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("vrs.planning.line.blend_courses", lambda *_, **__: iter(()))
    first = plan_from_rest(NOMINAL, moved(NOMINAL, (0.0, 0.35, -0.1)), profile=Profile.JERK_LIMITED)
    for share in (0.05, 0.2, 0.5, 0.8, 0.95):
        state = cut(first, share)
        X = moved(NOMINAL, (0.05, 0.0, 0.0))
        plan, notes = line(state, X, 0.3, Profile.JERK_LIMITED, MODEL, LIMITS)
        assert text_of(notes).startswith("braked first")
        assert "parabolas" not in text_of(notes)
        assert violation(plan, LIMITS, jerk=True) is None
        assert jumps(plan).max() < 1e-9
        assert np.abs(2.0 * plan.coefficients[0, 2] - state.qdd).max() < 1e-9
        assert np.abs(MODEL.forward(end_state(plan).q) - X).max() < 1e-9
