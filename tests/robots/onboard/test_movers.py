"""Things that move are found with where they are and how they move; things that stand aren't."""

from __future__ import annotations

import math

import numpy as np
import pytest

from robots.onboard.movers import Mover, MoversConfig, MoverTracker
from tests.robots.onboard.rooms import IPR, Room, box, ring
from vrs.errors import InvalidValueError

MOUNTS = ring(IPR)


def followed(paths, seconds, *, posture=lambda t: (0.0, 0.0, 0.0), things=(), seed=0) -> list[tuple[Mover, ...]]:
    """What moves, at each scan, where people of 0.25 m walk paths p(t) and boxes stand."""
    rng, tracker, found = np.random.default_rng(seed), MoverTracker(MoversConfig(MOUNTS)), []
    for k in range(round(10 * seconds)):
        t = 0.1 * k
        room = Room(list(things), [(*path(t), 0.25) for path in paths])
        ranges = room.scan(MOUNTS, posture(t), rng, noise=0.006, misses=0.01)
        tracker.hear(ranges, (ranges < 3.0).tolist(), posture(t), now=t)
        found.append(tracker.movers(now=t))
    return found


@pytest.mark.parametrize("bearing", np.radians(range(0, 360, 40)).tolist())
@pytest.mark.parametrize("speed", [0.3, 0.7])
def test_somebody_who_comes_is_found_before_he_is_there(bearing: float, speed: float) -> None:
    """In time to go: 1.5 s after he comes within reach, whichever sonars see him."""

    def path(t: float) -> tuple[float, float]:
        r = 3.4 - speed * t
        return r * math.cos(bearing), r * math.sin(bearing)

    seconds = 2.2 / speed
    found = followed([path], seconds)
    entered = round(10 * 0.35 / speed)
    late = found[entered + 18 :]
    assert all(late)
    for k, movers in enumerate(late, start=entered + 18):
        x, y = path(0.1 * k)
        best = min(movers, key=lambda m: math.hypot(m.x - x, m.y - y))
        assert math.hypot(best.x - x, best.y - y) < 0.4
        towards = -(best.vx * math.cos(bearing) + best.vy * math.sin(bearing))
        assert towards == pytest.approx(speed, abs=0.2)


@pytest.mark.parametrize("seed", range(3))
def test_what_stands_does_not_move(seed: int) -> None:
    things = [*box(2.0, 1.2, 0.8, 0.8), *box(1.4, -1.0, 0.4, 0.4, 0.5), (-1.5, -2.0, -1.5, 2.0)]
    found = followed([], 10.0, things=things, seed=seed)
    assert sum(bool(movers) for movers in found) <= 0.05 * len(found)


def test_who_went_away_is_given_up() -> None:
    found = followed([lambda t: (2.0 - 0.5 * t, 0.8) if t < 3 else (9.0, 9.0)], 5.0)
    assert any(found)
    assert not any(found[42:])


def test_two_are_two() -> None:
    found = followed([lambda t: (2.4 - 0.4 * t, 1.0), lambda t: (-2.4 + 0.4 * t, -1.0)], 4.0)
    assert max(len(movers) for movers in found) == 2


@pytest.mark.parametrize("bearing", np.radians(range(0, 360, 30)).tolist())
def test_somebody_who_comes_past_a_box_is_followed_as_himself(bearing: float) -> None:
    """Also where the echoes of both are side by side and equally far."""

    def path(t: float) -> tuple[float, float]:
        return (3.0 - 0.67 * t) * math.cos(bearing), (3.0 - 0.67 * t) * math.sin(bearing)

    aside = bearing + math.radians(40)
    thing = box(1.55 * math.cos(aside), 1.55 * math.sin(aside), 0.8, 0.8, aside)
    found = followed([path], 3.4, things=thing)
    for k in range(20, 34):
        place = path(0.1 * k)
        best = min(found[k], key=lambda m: math.dist((m.x, m.y), place))
        assert math.dist((best.x, best.y), place) < 0.3
        towards = -(best.vx * math.cos(bearing) + best.vy * math.sin(bearing))
        assert towards == pytest.approx(0.67, abs=0.08)


def test_what_is_followed_is_bounded() -> None:
    tracker, rng = MoverTracker(MoversConfig(MOUNTS, most=3)), np.random.default_rng(1)
    for k in range(50):
        tracker.hear(rng.uniform(0.2, 2.9, 16).tolist(), [True] * 16, (0, 0, 0), now=0.1 * k)
        assert len(tracker.movers(now=0.1 * k)) <= 3


def test_wrong_values_are_refused() -> None:
    with pytest.raises(InvalidValueError):
        MoversConfig(())
    with pytest.raises(InvalidValueError):
        MoversConfig(MOUNTS, gate=math.inf)


def test_nothing_is_said_of_what_was_only_just_seen() -> None:
    """Two echoes make a speed; nobody yields to one."""
    tracker = MoverTracker(MoversConfig(MOUNTS, doubt=0.0, start_speed=3.0))
    seen = []
    for k in range(6):
        tracker.see([(2.0 - 0.06 * k, 0.0)], now=0.1 * k)
        seen.append(bool(tracker.movers(now=0.1 * k)))
    assert seen == [False, False, False, True, True, True]
