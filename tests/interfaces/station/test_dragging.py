"""The law by which the tool follows a hand: one in the page and in Python, quick enough, without looking ahead."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import interfaces.station
from interfaces.lab.doulgeri import dragging
from interfaces.lab.doulgeri.script import HOME, MODEL, tool
from interfaces.station.dragging import PERIOD, DragLaw
from vrs import Engine, ManualClock
from vrs.comparison import best_lag
from vrs.model import Array

STATIC = Path(interfaces.station.__file__).parent / "static"
FOLLOW = "(samples) => { const law = new window.DragLaw(); return samples.map((s) => law.speed(...s)); }"


def samples(seed: int) -> list[tuple[float, list[float], list[float], float]]:
    """Inputs as a page makes them: at uneven times, some at once, some after a long pause."""
    rng = np.random.default_rng(seed)
    t = np.cumsum(rng.choice([0.0, 0.01, 0.04, 0.05, 0.19, 0.3], 60))
    hand, at = np.cumsum(rng.normal(0, 0.01, (60, 3)), axis=0), rng.normal(0, 0.03, (60, 3))
    return [
        (*row, float(rng.uniform(0.01, 1.0))) for row in zip(t.tolist(), hand.tolist(), at.tolist(), strict=True)
    ]


def test_the_page_has_the_same_law(browser: Any) -> None:
    page = browser.new_page()
    try:
        law = (STATIC / "dragging.js").read_text(encoding="utf-8")
        page.add_script_tag(content=f"{law}\nwindow.DragLaw = DragLaw;", type="module")
        page.wait_for_function("Boolean(window.DragLaw)")
        given = samples(1)
        ours = DragLaw()
        expected = [ours.speed(t, np.array(hand), np.array(at), most) for t, hand, at, most in given]
        np.testing.assert_allclose(page.evaluate(FOLLOW, given), expected, rtol=0, atol=1e-12)
        assert any(np.linalg.norm(v) > 0.99 * most for v, (*_, most) in zip(expected, given, strict=True))
        assert "const PERIOD = 40;" in (STATIC / "steer.js").read_text(encoding="utf-8")
        assert PERIOD == 0.04
    finally:
        page.close()


def test_it_never_looks_ahead() -> None:
    given = samples(2)
    for k in (1, 20, 59):
        speeds = []
        for later in (0.0, 1.0):
            law = DragLaw()
            path = [
                (t, np.array(hand) + later * (i > k), np.array(at), most)
                for i, (t, hand, at, most) in enumerate(given)
            ]
            speeds.append([law.speed(*row) for row in path][: k + 1])
        np.testing.assert_array_equal(*speeds)


def followed(seed: int, law: DragLaw) -> tuple[float, float, float | None]:
    """Root mean square and largest distance from the hand [m], and the lag [s], without a link."""
    begin = tool(HOME[None])[0]
    hand: Array = begin + dragging.hand(np.random.default_rng((seed, 9)))
    clock, give = ManualClock(0.0), dragging.steering(law)
    engine = Engine(MODEL, q=HOME, clock=clock)
    t = PERIOD * np.arange(len(hand))
    for now, place in zip(t.tolist(), hand, strict=True):
        clock.set(now)
        engine.execute(give(now, place, engine.joints(now)))
    at = tool(engine.timeline.sample(t))
    distance = np.linalg.norm(at - hand, axis=1)
    return float(np.sqrt(np.mean(distance**2))), float(distance.max()), best_lag(t, hand, at, 1.0)


@pytest.mark.parametrize("seed", range(200, 220))
def test_hands_that_it_wasnt_tuned_to(seed: int) -> None:
    rms, largest, lag = followed(seed, DragLaw())
    assert lag is not None
    assert abs(lag) <= 0.1
    assert rms <= 0.01
    assert largest <= 0.03


def test_feedback_alone_is_too_late() -> None:
    rms, _, lag = followed(200, dragging.Proportional())
    assert lag is not None
    assert lag > 0.2
    assert rms > 0.01
