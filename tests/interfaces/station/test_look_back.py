"""Looking back at a mobile robot that is driven and recorded meanwhile: `vrs serve --robot ipr --record`."""

from __future__ import annotations

import math
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from interfaces.recording.recording import open_recording
from tests.interfaces.live_rig import child
from tests.interfaces.station.opened import PATIENCE, Page, paged, station, until
from tests.interfaces.station.test_driving import SERVE as DRIVEN
from tests.interfaces.station.test_driving import gone, postures, rest

SERVE = (*DRIVEN[:-1], "0")
"""As there, without pictures."""
PLACE = """twin => { const node = replay.node(0, 'vrs', twin, 'body', '0');
    node.updateMatrix();
    return node.matrix.toArray(); }"""


def drawn(shown: Any, twin: str) -> list[float]:
    """Where a robot is drawn: x, y [m] and the cosine and sine of its heading."""
    X = shown.evaluate(PLACE, twin)
    return [X[12], X[13], X[0], X[1]]


def placed(posture: Any) -> list[float]:
    x, y, theta = np.asarray(posture).tolist()
    return [x, y, math.cos(theta), math.sin(theta)]


def replayed(page: Page) -> Any:
    """Open the page of what is chosen."""
    with page.page.context.expect_page() as opened:
        page.page.locator("#record-replay").press("Enter")
    shown = opened.value
    shown.set_viewport_size({"width": 640, "height": 400})
    until(lambda: shown.evaluate("Boolean(window.replay && replay.state && replay.views.length === 1)"))
    return shown


@pytest.mark.slow
def test_what_is_driven_is_looked_back_at_while_it_is_recorded(browser: Any, tmp_path: Path) -> None:
    path = tmp_path / "drive.mcap"
    recorded = ("--record", str(path), "--recordings", str(tmp_path), "--jobs", str(tmp_path / "jobs.json"))
    with child(*SERVE, *recorded) as server, paged(browser, station(server)) as page:
        page.open()
        page.wait("Boolean(station.session.state.real)")
        page.take_control()
        start, began = postures(page), page.get("station.session.state.now")
        page.page.keyboard.down("ArrowUp")
        page.until(lambda: min(gone(page, start)) > 0.4)
        page.page.keyboard.up("ArrowUp")
        rest(page)
        rested = page.get("station.session.state.now")
        page.page.click("#tab-record")
        page.wait("station.recordings.now?.name === 'drive.mcap' && station.recordings.now.problem === null")
        page.page.locator("li[data-name='drive.mcap'] .pick").press("Enter")
        shown = replayed(page)
        end = time.monotonic() + PATIENCE
        while shown.evaluate("replay.state.span[1]") < rested:
            # It's played back as far as it was written when its page was opened.
            assert time.monotonic() < end
            shown.close()
            shown = replayed(page)
        until(lambda: shown.evaluate("replay.node(0, 'vrs', 'virtual', 'body', '0').children.length > 0"))
        shown.keyboard.press("Space")
        until(lambda: shown.evaluate("replay.state.mode === 'paused'"))
        seen = {}
        for t in (0.25 * began + 0.75 * rested, 0.5 * (began + rested), rested):
            shown.evaluate("t => replay.wish('seek', { t })", t)
            until(lambda t=t: abs(shown.evaluate("replay.state.t") - t) < 1e-5)
            # The picture follows what the page is told.
            shown.wait_for_timeout(500)
            seen[t] = drawn(shown, "virtual"), drawn(shown, "real")
        # The robot is driven on, and what is looked at stays where it is.
        page.page.keyboard.down("ArrowDown")
        page.until(lambda: min(gone(page, start)) < 0.25)
        page.page.keyboard.up("ArrowDown")
        rest(page)
        assert drawn(shown, "virtual") == seen[rested][0]
        shown.close()
        page.page.click("#record-end")
        page.wait("station.recordings.now === null")
    with open_recording(path) as recording:
        assert recording.end is not None
        assert not recording.damage
        for t, (virtual, real) in seen.items():
            assert np.allclose(virtual, placed(recording.virtual(t)), atol=1e-6)
            assert np.allclose(real, placed(recording.real(t)), atol=1e-6)
        went = recording.virtual(rested)[:2] - recording.virtual(0.0)[:2]
        assert math.hypot(*went) > 0.3
