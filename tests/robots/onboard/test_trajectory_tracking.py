"""The operator's trajectory played some time behind: on its path, within limits, starved, behind, with losses."""

from __future__ import annotations

import math
import random

import numpy as np
import pytest

from robots.onboard.driving import IPR_LIMITS, Posture
from robots.onboard.trajectory_tracking import KnownTrajectory, TrackingConfig, TrajectoryTracker
from tests.memory import values_held
from tests.robots.onboard.driven import Unicycle, assert_kept
from vrs import ArcSegment
from vrs.errors import InvalidValueError
from vrs.mobile import advanced, clipped

T, LIMITS, CONFIG = 0.1, IPR_LIMITS, TrackingConfig()


def operated(seconds, seed):
    """Arcs of an operator with some headroom: curves, pivots, reversals, pauses; he rests at the end."""
    rng, arcs, posture = random.Random(seed), [], Posture(0, 0, 0)
    v = w = v_aim = w_aim = 0.0
    n = round(seconds / T)
    for i in range(n):
        if i % 15 == 0:
            kind = rng.random()
            v_aim = rng.uniform(0.1, 0.42) if kind < 0.6 else -rng.uniform(0.05, 0.3) if kind > 0.85 else 0.0
            w_aim = 0.0 if 0.75 < kind < 0.85 else rng.uniform(-0.6, 0.6)
        if i > n - 15:
            v_aim = w_aim = 0.0
        v, w = clipped(v_aim, LIMITS.a_max * T, v), clipped(w_aim, 0.2, w)
        arcs.append(ArcSegment(round(i * T, 9), T, posture, v, w))
        posture = advanced(posture, v, w, T)
    return arcs


def tail(arc):
    """Brakes on the arc's curve."""
    found, v, bend = [], arc.v, arc.w / arc.v if arc.v else 0.0
    posture, t = advanced(arc.posture, arc.v, arc.w, T), arc.end
    while abs(v) > 1e-9:
        v = math.copysign(max(abs(v) - LIMITS.a_max * T, 0.0), v)
        found.append(ArcSegment(t, T, posture, v, bend * v))
        posture, t = advanced(posture, v, bend * v, T), t + T
    return found


def played(arcs, arrival, offset, *, tau=0.0, config=CONFIG, extra=10.0, start=(0, 0, 0)):
    """Rows (t, posture, drive, reference); `arrival(i)` is the delay of packet i, None where it's lost."""
    packets = []
    for i, arc in enumerate(arcs):
        delay = arrival(i)
        if delay is not None:
            packets.append((arc.end + delay, i, [*arcs[max(i - 5, 0) : i + 1], *tail(arc)], arc.end))
    packets += [(arcs[-1].end + 0.5 * j + 0.05, 10**6 + j, arcs[-6:], arcs[-1].end + 0.5 * j) for j in range(40)]
    packets.sort(key=lambda packet: packet[:2])
    tracker, robot, rows = TrajectoryTracker((0, 0, 0), 0.0, now=0.0, config=config), Unicycle(start, tau), []
    tracker.aim(offset)
    for i in range(round((arcs[-1].end + extra) / config.period)):
        now = i * config.period
        while packets and packets[0][0] <= now:
            _, _, some, until = packets.pop(0)
            assert tracker.receive(some, complete_until=until)
        drive = tracker.advance(robot.posture, now=now)
        rows.append((now, robot.posture, drive, tracker.reference))
        assert tracker.reference.t_play <= tracker.complete_until + config.venture + 1e-9
        robot.run(drive, config.period)
    assert_kept([row[2] for row in rows], config.limits, config.period)
    return rows


def off_path(rows, arcs):
    """Largest distance from the operator's path [m]."""
    times = np.arange(0, T, T / 8)
    path = np.array([advanced(a.posture, a.v, a.w, u)[:2] for a in arcs for u in times])
    robot = np.array([row[1][:2] for row in rows])
    return float(np.sqrt(((robot[:, None] - path[None]) ** 2).sum(-1).min(1)).max())


ARRIVALS = {
    "even": (lambda i: 0.02, -0.65),
    "starved": (lambda i: 0.02, -0.05),
    "outage": (lambda i: 6 - (i - 63) * T if 63 < i < 123 else 0.05, -0.7),
    "late": (lambda i: random.Random(i).expovariate(1 / 0.3), -1.5),
    "lossy": (lambda i: None if random.Random(i).random() < 0.3 else 0.05, -0.9),
}


@pytest.mark.parametrize("case", ARRIVALS)
@pytest.mark.parametrize("tau", [0.0, 0.1])
def test_the_robot_stays_on_the_operators_path(case, tau):
    """Within 2 cm under any arrivals, within limits, and it comes to the end."""
    arrival, offset = ARRIVALS[case]
    arcs = operated(30, seed=3)
    rows = played(arcs, arrival, offset, tau=tau)
    assert off_path(rows, arcs) < 0.02
    end = arcs[-1].value(arcs[-1].end)
    # What it's beside the path when it stands, it can't undo.
    assert math.hypot(rows[-1][1].x - end[0], rows[-1][1].y - end[1]) < 0.015
    assert abs(rows[-1][1].theta - end[2]) < 0.03
    behind = [row[0] + offset - row[3].t_play for row in rows]
    if case in ("even", "late", "lossy"):
        assert sum(abs(b) < 0.1 for b in behind) > 0.8 * len(behind)
    assert abs(behind[-1]) < 0.1 or rows[-1][3].t_play > arcs[-1].end


def test_starved_it_slows_along_the_path_and_stops_at_its_end():
    """Nothing comes any more in mid-curve: no brake over a_max, and it stands where what is known ends."""
    arcs = [ArcSegment(0, 1.0, (0, 0, 0), 0.0, 0.0)]
    for i in range(40):
        v = min(0.052 * (i + 1), 0.4)
        arcs.append(ArcSegment(1 + T * i, T, tuple(arcs[-1].value(arcs[-1].end)), v, v))
    tracker, robot = TrajectoryTracker((0, 0, 0), 0.0, now=0.0), Unicycle((0, 0, 0))
    tracker.receive(arcs, complete_until=arcs[-1].end)
    drives = []
    for i in range(300):
        drives.append(tracker.advance(robot.posture, now=i * 0.05))
        robot.run(drives[-1], 0.05)
    assert_kept(drives, LIMITS, 0.05)
    end = arcs[-1].value(arcs[-1].end)
    assert math.hypot(robot.posture.x - end[0], robot.posture.y - end[1]) < 0.003
    assert drives[-1].v == pytest.approx(0.0, abs=1e-3)
    assert tracker.reference.starved
    assert max(drive.v for drive in drives) > 0.39


def test_behind_it_catches_up_within_its_limits():
    arcs = operated(40, seed=1)
    rows = played(arcs, lambda i: 0.05 if i > 100 else 10.0 - i * T, -0.7)
    lag = {round(row[0], 3): row[0] - 0.7 - row[3].t_play for row in rows}
    assert lag[10.0] > 8
    assert lag[39.0] < 1.0
    assert off_path(rows, arcs) < 0.02


def test_far_from_its_reference_it_comes_back():
    arcs = [ArcSegment(0, 40.0, (0, 0, 0), 0.2, 0.0)]
    tracker, robot = TrajectoryTracker((0, 0, 0), 0.0, now=0.0), Unicycle((-0.3, 0.6, 1.0))
    tracker.receive(arcs, complete_until=40.0)
    for i in range(700):
        robot.run(tracker.advance(robot.posture, now=i * 0.05), 0.05)
    assert abs(robot.posture.y) < 0.005
    assert abs(robot.posture.theta) < 0.02


def test_a_pause_is_kept_and_skipped_by_one_that_is_behind():
    drive = ArcSegment(0, 2.0, (0, 0, 0), 0.2, 0.0)
    pause = ArcSegment(2.0, 10.0, (0.4, 0, 0), 0.0, 0.0)
    on = ArcSegment(12.0, 2.0, (0.4, 0, 0), 0.2, 0.0)
    for offset, least, most in ((0.0, 9.0, 11.0), (6.0, 3.0, 5.0)):
        tracker, robot, standing = TrajectoryTracker((0, 0, 0), 0.0, now=0.0), Unicycle((0, 0, 0)), 0
        tracker.receive([drive, pause, on], complete_until=14.0)
        tracker.aim(offset)
        for i in range(400):
            robot.run(tracker.advance(robot.posture, now=i * 0.05), 0.05)
            standing += tracker.reference.drive.v == 0 and abs(robot.posture.x - 0.4) < 0.05
        assert robot.posture.x == pytest.approx(0.8, abs=0.01)
        assert least < standing * 0.05 < most


def test_packets_in_any_order_make_one_chain():
    """Shuffled, repeated, and with arcs cut where they become final: the same postures; gaps wait."""
    arcs, rng = operated(12, seed=4), random.Random(2)
    packets = [([*arcs[max(i - 3, 0) : i + 1], *tail(arcs[i])], arcs[i].end - 0.03) for i in range(len(arcs))]
    for _ in range(10):
        known, order = KnownTrajectory((0, 0, 0), 0.0), packets * 2
        rng.shuffle(order)
        for packet, until in order:
            before = known.complete
            assert known.hear(packet, until)
            assert known.complete >= before
        assert known.complete == pytest.approx(arcs[-1].end - 0.03)
        for t in np.arange(0.0, known.complete, 0.037):
            arc = arcs[min(int(t / T + 1e-9), len(arcs) - 1)]
            assert known.posture_at(t) == pytest.approx(tuple(arc.value(t)), abs=1e-9)
    known = KnownTrajectory((0, 0, 0), 0.0)
    known.hear(arcs[:3], arcs[2].end)
    known.hear(arcs[5:8], arcs[7].end)
    assert known.complete == pytest.approx(0.3)
    known.hear(arcs[2:6], arcs[5].end)
    assert known.complete == pytest.approx(0.8)


def test_what_is_known_is_bounded():
    tracker, posture = TrajectoryTracker((0, 0, 0), 0.0, now=0.0), Posture(0, 0, 0)
    for i in range(3000):
        arc = ArcSegment(i * T, T, posture, 0.2, 0.3 if i % 2 else 0.2)
        posture = Posture(*advanced(posture, 0.02 / T, arc.w, T))
        tracker.receive([arc], complete_until=arc.end)
        tracker.advance(tracker.reference.posture, now=i * T)
    assert values_held(tracker) < 2000
    known = KnownTrajectory((0, 0, 0), 0.0, capacity=20)
    arcs = operated(10, seed=0)
    assert not known.hear(arcs, 10.0)
    assert known.complete == 0.0
    assert known.hear(arcs[:20], 2.0)


def test_wrong_values_are_refused():
    tracker = TrajectoryTracker((0, 0, 0), 0.0, now=1.0)
    with pytest.raises(InvalidValueError):
        tracker.advance((0, 0, 0), now=0.5)
    with pytest.raises(InvalidValueError):
        tracker.aim(math.nan)
    with pytest.raises(InvalidValueError):
        tracker.receive([ArcSegment(0, 1, (0, 0, 0), 0, 0), ArcSegment(2, 1, (0, 0, 0), 0, 0)], complete_until=1.0)
    with pytest.raises(InvalidValueError):
        TrackingConfig(period=0.0)


@pytest.mark.parametrize(("leashes", "pace"), [(0.0, 1.0), (1.0, 1.0), (1.5, 0.5), (4.0, 0.2)])
def test_play_waits_for_a_robot_that_was_left_behind(leashes, pace):
    """From the leash on it slows down; it never stops: beside a reference that stands no robot comes nearer."""
    tracker, posture = TrajectoryTracker((0, 0, 0), 0.0, now=0.0), (0.0, 0.0, 0.0)
    assert tracker.receive([ArcSegment(0.0, 20.0, posture, 0.2, 0.0)], complete_until=20.0)
    for k in range(1, 61):
        now, before = k * CONFIG.period, tracker.reference.t_play
        # It's never late, so that nothing is caught up.
        tracker.aim(before - now)
        tracker.advance(posture, now=now)
        x, y, theta = tracker.reference.posture
        posture = (x, y - leashes * CONFIG.leash, theta)
    assert (tracker.reference.t_play - before) / CONFIG.period == pytest.approx(pace, abs=1e-6)
