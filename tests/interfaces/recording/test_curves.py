"""What a play-back page plots: the figures of `vrs compare`, and curves by the same definitions."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from interfaces.recording.figures import RunFigures, figures, summary
from interfaces.recording.recording import open_recording
from interfaces.station import curves as plotted
from interfaces.station.curves import curves
from tests.interfaces.pages import accessible, until, wait
from tests.interfaces.recording.test_page import near, served
from vrs.comparison import agreement

RECORDINGS = Path(__file__).parents[2] / "contract/data/recordings"
SHIFT = 100.0


def of(name: str) -> tuple[dict[str, Any], dict[str, np.ndarray], dict[str, Any]]:
    """What a page gets of a recording, its table, and what `vrs compare` says."""
    path = RECORDINGS / f"{name}.mcap"
    with open_recording(path) as recording:
        robot, expected = recording.robot, summary(recording)
    found = json.loads(curves(path, robot, SHIFT))
    return found, {column: np.array(values, float) for column, values in found["table"].items()}, expected


def rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.nanmean(values**2)))


@pytest.mark.parametrize("name", ["demo", "val2", "live", "cut"])
def test_an_arms_curves_make_the_figures_of_compare(name: str) -> None:
    found, table, expected = of(name)
    assert found["summary"] == json.loads(json.dumps(expected))
    assert found["joints"] == 6
    for basis in ("timeline", "user"):
        errors = expected["errors"][f"{basis}_time"]
        assert rms(table[f"tool_{basis}"]) == pytest.approx(errors["tool_rms_m"], abs=1e-7)
        assert np.nanmax(table[f"tool_{basis}"]) == pytest.approx(errors["tool_max_m"], abs=1e-7)
        assert np.degrees(rms(table[f"angle_{basis}"])) == pytest.approx(errors["angle_rms_deg"], abs=1e-6)
        joints = [np.degrees(rms(table[f"error_{basis}_{j}"])) for j in range(1, 7)]
        assert joints == pytest.approx(errors["joint_rms_deg"], abs=1e-6)
    assert rms(table["tool_servo"]) == pytest.approx(expected["errors"]["servo"]["tool_rms_m"], abs=1e-7)
    whole = table["offset"] + table["link"] + table["servo"]
    np.testing.assert_allclose(whole, table["tool_user"], rtol=0, atol=1e-7)
    late = np.array(found["paths"]["late"])
    assert late.mean() == pytest.approx(expected["path"]["time_difference_mean"], abs=1e-7)
    assert late.max() == pytest.approx(expected["path"]["time_difference_max"], abs=1e-7)
    assert len(found["lost"]["sent"]) == expected["messages"]["lost"]
    assert max(found["arrived"]["delay"]) == pytest.approx(expected["messages"]["delay_max_s"], abs=1e-7)
    with open_recording(RECORDINGS / f"{name}.mcap") as recording:
        run = figures(recording)
        assert isinstance(run, RunFigures)
        samples = run.run.at_samples
        gaps = len(recording.track("/real/joints").gaps)
    assert np.isfinite(table["tool_user"]).sum() == len(samples.t) >= len(table["t"]) - gaps
    known = np.isfinite(table["tool_user"])
    np.testing.assert_allclose(table["t"][known], samples.t + SHIFT, rtol=0, atol=1e-7)
    one = agreement(run.run.model, samples.q_shown[-1:], samples.q_real[-1:])
    assert table["tool_user"][known][-1] == pytest.approx(one.tool_rms, abs=1e-7)


def test_a_mobile_robots_curves_make_the_figures_of_compare() -> None:
    found, table, expected = of("mobile")
    assert found["summary"] == json.loads(json.dumps(expected))
    assert np.nanmean(table["path_error"]) == pytest.approx(expected["path_error_mean"], rel=1e-5)
    assert np.nanmax(table["path_error"]) == pytest.approx(expected["path_error_max"], rel=1e-5)
    assert np.nanmax(table["time_difference"]) <= expected["time_difference_max"] + 1e-5
    assert max(found["arrived"]["delay"]) == pytest.approx(expected["longest_delay"], rel=1e-5)
    assert np.nanmin(table["behind"]) >= -1e-9


def test_a_long_table_keeps_its_peaks(monkeypatch: pytest.MonkeyPatch) -> None:
    _, table, _ = of("live")
    monkeypatch.setattr(plotted, "MOST_ROWS", 100)
    _, thinned, _ = of("live")
    assert len(thinned["t"]) == 100
    assert (np.diff(thinned["t"]) >= 0).all()
    for name in ("tool_user", "error_timeline_3", "offset"):
        for extreme in (np.nanmin, np.nanmax):
            assert extreme(thinned[name]) == extreme(table[name])


def shown(page: Any) -> dict[str, list[str]]:
    """The page's figures: name, and a value a recording, and the unit."""
    rows = "[...document.querySelectorAll('#plot-figures tbody tr')]"
    rows = page.evaluate(f"{rows}.map((row) => [...row.children].map((cell) => cell.textContent))")
    return {name: cells for name, *cells in rows}


def opened(new_page: Any, server: Any, panes: int, width: int = 1280) -> Any:
    page = new_page(server.url, width, 720 if width == 1280 else 844, "light", expected="WebSocket connection")
    page.goto(f"{server.url}/replay")
    wait(page, f"!!window.replay && replay.known && replay.views.length === {panes}")
    page.keyboard.press("g")
    wait(page, "document.querySelectorAll('#side .plot-area canvas').length > 1")
    return page


def test_a_page_plots_two_recordings_in_step_with_the_seek_bar(new_page: Any) -> None:
    names = ("demo", "live")
    with served(*(RECORDINGS / f"{name}.mcap" for name in names)) as server:
        page = opened(new_page, server, 2)
        page.locator("#plot-figures > summary").click()
        wait(page, "document.querySelectorAll('#plot-figures tbody tr').length > 20")
        figures_shown = shown(page)
        expected = [of(name)[2] for name in names]
        for name, place, factor, digits in (
            ("tool rms, timeline", ("errors", "timeline_time", "tool_rms_m"), 1e3, 3),
            ("angle max, user", ("errors", "user_time", "angle_max_deg"), 1.0, 3),
            ("behind, at most", ("behind", "max_s"), 1.0, 3),
            ("messages lost", ("messages", "lost"), 1.0, 0),
            ("time difference, mean", ("path", "time_difference_mean"), 1.0, 3),
            ("path error, 95 %", ("path", "path_error_p95"), 1e3, 3),
            ("progress", ("path", "progress"), 1e2, 1),
        ):
            for k, value in enumerate(expected):
                for part in place:
                    value = value[part]  # noqa: PLW2901
                assert float(figures_shown[name][k]) == pytest.approx(factor * value, abs=0.5000001 * 10**-digits)
        page.locator("#plot-figures > summary").click()
        page.evaluate("replay.wish('seek', { t: 5.5 })")
        page.locator("#plot-tool-error").scroll_into_view_if_needed()
        hand = "document.querySelector('#plot-tool-error .plot-hand')"
        place = f"{hand} && new DOMMatrix({hand}.style.transform).e / {hand}.parentElement.clientWidth"
        wait(page, f"Math.abs({place} - (5.5 - replay.span[0]) / (replay.span[1] - replay.span[0])) < 0.01")
        wait(page, "document.getElementById('plots-shows').textContent.endsWith('values at 0:05.5')")
        box = page.locator("#plot-tool-error .u-over").bounding_box()
        page.mouse.click(box["x"] + 0.25 * box["width"], box["y"] + 0.5 * box["height"])
        start, end = server.playback.span
        until(lambda: abs(server.playback.place(now=0.0) - (start + 0.25 * (end - start))) < 0.01 * (end - start))
        page.locator("[data-span='5']").click()
        wait(page, "/^A.*mm\\s*B/.test(document.getElementById('value-tool-error').textContent)")
        accessible(page)


def test_a_mobile_robots_recording_is_plotted_on_a_phone(new_page: Any) -> None:
    with served(RECORDINGS / "mobile.mcap") as server:
        page = opened(new_page, server, 1, 390)
        page.evaluate("replay.wish('seek', { t: 3.0 })")
        near(server, 3.0)
        wait(page, "/ cm$/.test(document.getElementById('value-path-error').textContent)")
        root = "document.documentElement"
        assert page.evaluate(f"[{root}.scrollWidth, {root}.scrollHeight]") == [390, 844]
        page.locator("#plot-figures > summary").click()
        wait(page, "document.querySelectorAll('#plot-figures tbody tr').length > 5")
        expected = of("mobile")[2]
        assert float(shown(page)["path error, max"][0]) == pytest.approx(
            100 * expected["path_error_max"], abs=0.006
        )


def test_what_holds_too_little_is_said(new_page: Any, tmp_path: Path) -> None:
    whole = (RECORDINGS / "live.mcap").read_bytes()
    (tmp_path / "short.mcap").write_bytes(whole[:15_000])
    with served(tmp_path / "short.mcap") as server:
        page = new_page(server.url, 900, 600, "light", expected="status of 409")
        page.goto(f"{server.url}/replay")
        wait(page, "!!window.replay && replay.known")
        page.keyboard.press("g")
        wait(page, "document.getElementById('plots-problem').textContent.includes('Nothing can be plotted')")
