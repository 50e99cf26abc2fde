"""The report's file: whole, escaped, repeatable; and its page in a real browser without a network."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from interfaces.cli.demo import tables
from interfaces.messages.recording import CommandPacket, RunEvent
from interfaces.report.html import render, write_report
from interfaces.report.plots import plots
from interfaces.report.scene import chain_of, scene
from interfaces.report.tables import ENDED_SHORT, figures, tiles
from interfaces.runs.summary import summarize
from interfaces.runs.twin_run import TwinRun
from interfaces.teleop import Correction
from robots import load, puma560
from tests.interfaces.recording.recorded import begin
from vrs.ledger import Receipt, Status
from vrs.model import Array

EVIL = '</script><script>window.evil = 1</script><!-- <img src=x onerror="window.evil=2"> & \u2028'


def curve(t: Array) -> Array:
    frequency = np.array([0.11, 0.07, 0.09, 0.21, 0.17, 0.3])
    return np.array([0, 0.7, -2.2, 0, 0.2, 0]) + 0.6 * np.sin(2 * np.pi * frequency * t[:, None])


def make_run(title: str = "Sines", reason: str = "late", k: int = 401) -> TwinRun:
    """A real robot that is further behind in the second half."""
    t = np.linspace(0.0, 20.0, k)
    play = np.maximum.accumulate(np.maximum(t - np.where(t < 10.0, 0.6, 1.1), 0.0))
    real = curve(play)
    answers = (
        Receipt(1, Status.ACCEPTED, 0.5, 1.0, 1.0, 4.0),
        Receipt(2, Status.POSTPONED, 5.0, 4.9, 5.0, 8.0, reason=reason),
        Receipt(3, Status.REJECTED, 9.0, 8.0, reason=reason),
    )
    packets = tuple(
        CommandPacket(number, number, sent, arrived, lost=number == 2)
        for number, sent, arrived in ((1, 0.5, 0.9), (2, 5.0, 6.0), (3, 9.0, 9.4))
    )
    messages = np.array([[0.5, 0.9], [5.0, np.nan], [9.0, 9.4]])
    corrections = (Correction(12.0, 13.0, np.full(6, 0.1), reason),)
    events = (RunEvent(3.0, "payload", reason), RunEvent(13.0, "slowed", reason))
    return TwinRun(
        load("puma560"), begin(title=title, seed=7, delay="thu"), t, play, curve(t), curve(t), real,
        real, real, answers, answers, packets, messages, corrections, events,
    )  # fmt: skip


@pytest.fixture(scope="module")
def report() -> str:
    run = make_run()
    return render(run, summarize(run))


def test_the_same_run_gives_the_same_bytes_and_a_small_file(report: str, tmp_path: Path) -> None:
    run = make_run()
    write_report(tmp_path / "report.html", run, summarize(run))
    assert (tmp_path / "report.html").read_text(encoding="utf-8") == report
    assert (tmp_path / "report.html").stat().st_size < 8e6


def test_it_says_what_was_run(report: str) -> None:
    for fact in (
        "Sines",
        "thu",
        "−1.100 s",
        "adaptive",
        "datagram",
        "hold",
        "network, then payload and friction, then servo",
        "puma560",
    ):
        assert fact in report
    for word in ("joint 6 rms [deg]", "tool rms [mm]", "time difference mean", "postponed", "rejected"):
        assert word in report


def test_it_names_no_outside_resource(report: str) -> None:
    own = re.sub(r"<script>.*?</script>", "", report, flags=re.DOTALL)
    assert not re.search(r"""(?:src|href)\s*=\s*["'](?!#|data:)|@import|url\((?!#|data:)""", own)
    assert "20" + "26-" not in own


def test_ids_are_unique(report: str) -> None:
    own = re.sub(r"<script>.*?</script>", "", report, flags=re.DOTALL)
    ids = re.findall(r'\sid="([^"]+)"', own)
    assert len(ids) == len(set(ids))
    for used in re.findall(r'(?:url\(|href=")#([^)"]+)', own):
        assert used in ids


def test_texts_of_users_stay_texts() -> None:
    run = make_run(title=EVIL, reason=EVIL)
    page = render(run, summarize(run))
    assert "<script>window.evil" not in page
    assert "<img src=x" not in page
    assert page.count("</script>") == 3


def test_figures_of_other_names_are_shown() -> None:
    run = make_run()
    novel = {"novel_m": 0.5, "nested": {"share": 0.25, "list": [1.0, 2.0]}, "note": "<b>hi"}
    page = render(run, {**summarize(run), **novel})
    assert "500.000 mm" in page
    assert "nested: share" in page
    assert "&lt;b&gt;hi" in page


def test_the_chain_rebuilds_the_models_links() -> None:
    model = puma560.model()
    chain = chain_of(model)
    base, *A = (np.reshape(X, (4, 4)).T for X in (chain["base"], *chain["chain"]))
    q = np.random.default_rng(3).uniform(-2, 2, 6)
    X = base
    for i in range(6):
        turn = np.eye(4)
        turn[:2, :2] = [[np.cos(q[i]), -np.sin(q[i])], [np.sin(q[i]), np.cos(q[i])]]
        X = X @ turn @ A[i]
        np.testing.assert_allclose(X, model.links(q)[i + 1], atol=1e-12)


def test_the_summary_takes_the_clock_offset_out_and_says_what_it_was() -> None:
    run = make_run(k=2001)
    value = summarize(run)
    assert value["errors"]["timeline_time"]["tool_max_m"] == 0.0
    assert value["errors"]["user_time"]["tool_max_m"] > 0.05
    assert value["behind"]["max_s"] == pytest.approx(1.1)
    assert value["clock_offset_s"] == pytest.approx(float(run.D.mean()))
    assert value["messages"] == {
        "count": 3, "lost": 1, "delay_mean_s": 0.4, "delay_p95_s": 0.4, "delay_max_s": 0.4
    }  # fmt: skip
    assert value["corrections"][0]["error_deg"] == pytest.approx([np.degrees(0.1)] * 6)


def test_robots_that_stand_have_no_lag() -> None:
    run = make_run()
    rest = np.broadcast_to(curve(np.zeros(1)), run.q_real.shape)
    hum = np.random.default_rng(4).uniform(0.0, 1e-7, rest.shape)
    value = summarize(replace(run, q_virtual=rest, q_shown=rest, q_matched=rest, q_real=rest + hum))
    assert value["lag_timeline_s"] is None
    assert value["lag_user_s"] is None
    assert value["errors"]["lag_removed"] == value["errors"]["timeline_time"]
    assert not any(label.startswith("network: ") for _, label in tiles(value))
    lagging = dict(rows for rows in tiles(summarize(run)) if rows[1].startswith("network: "))
    assert [text.endswith(" + 0.000 s") for text in lagging] == [True]
    assert "control: the joints' lag" not in render(run, value)


def test_a_path_that_wasnt_driven_to_its_end_says_that_means_dont_compare() -> None:
    value, where = summarize(make_run()), "Tool path and time difference, user time"
    for progress, note in ((1.0, ""), (0.4, ENDED_SHORT)):
        shown = figures({**value, "path": {**value["path"], "progress": progress}})
        assert [sheet[3] for sheet in shown if sheet[0] == where] == [note]


def test_the_terminal_has_the_pages_tables_with_their_units(capsys: pytest.CaptureFixture[str]) -> None:
    tables({**summarize(make_run()), "gap_s": 2.0})
    shown = capsys.readouterr().out
    for text in (
        "worst joint, rms, equal timeline time",
        "joint 1 rms [deg]",
        "tool max [mm]",
        "virtual: accepted",
    ):
        assert text in shown
    assert "is in no figure. (2.000 s)" in shown


def test_plots_cover_the_offset_errors_and_every_joint() -> None:
    names = [plot.name for plot in plots(make_run())]
    assert names == ["behind", "joint-errors", "tool-error", *(f"joint-{j}" for j in range(1, 7))]


def test_a_run_of_an_hour_still_gives_a_small_file(tmp_path: Path) -> None:
    run = make_run(k=180_000)
    write_report(tmp_path / "long.html", run, summarize(make_run()))
    assert (tmp_path / "long.html").stat().st_size < 8e6
    assert scene(run)["t_end"] <= 20.0


@pytest.fixture
def open_page(new_page: Any, tmp_path: Path) -> Any:
    """Opens a report offline."""

    def start(page_text: str, width: int = 1280, scheme: str = "light") -> Any:
        path = tmp_path / "report.html"
        path.write_text(page_text, encoding="utf-8")
        page = new_page(path.as_uri(), width, 900, scheme, offline=True)
        page.goto(path.as_uri())
        page.wait_for_function("window.report !== undefined")
        return page

    return start


def shares(page: Any) -> list[float]:
    """Shares of the 3D view's pixels that show the bright solid, and the blue ghost, after a render."""
    found: list[float] = page.evaluate(
        """() => { const v = report.scene.viewer; v.render(); const gl = v.renderer.getContext();
        const n = gl.drawingBufferWidth * gl.drawingBufferHeight, p = new Uint8Array(4 * n);
        gl.readPixels(0, 0, gl.drawingBufferWidth, gl.drawingBufferHeight, gl.RGBA, gl.UNSIGNED_BYTE, p);
        let solid = 0, ghost = 0;
        for (let i = 0; i < p.length; i += 4) {
          if (Math.min(p[i], p[i + 1], p[i + 2]) > 150 && p[i + 3] > 200) solid++;
          if (p[i + 2] > p[i] + 40 && p[i + 3] > 60) ghost++;
        }
        return [solid / n, ghost / n]; }"""
    )
    return found


def test_both_twins_are_drawn_where_the_model_puts_them(open_page: Any, report: str) -> None:
    page = open_page(report)
    run, at = make_run(), 200
    t = float(run.t[at])
    page.evaluate(f"report.seek({t})")
    for twin, q in (("virtual", run.q_virtual[at]), ("real", run.q_real[at])):
        drawn = page.evaluate(f"() => report.links(report.joints('{twin}', {t})).map((X) => Array.from(X))")
        expected = [X.T.ravel() for X in run.model.links(q)]
        np.testing.assert_allclose(drawn, expected, atol=1e-5)
        shown = page.evaluate(
            f"""() => {{ let out; report.scene.viewer.scene.traverse((o) => {{ if (o.name === '{twin}' &&
            o.children.length === 7) out = o.children.map((c) => c.matrix.toArray()); }}); return out; }}"""
        )
        np.testing.assert_allclose(shown, expected, atol=1e-5)
    page.evaluate("report.scene.viewer.scene_tree.find(['Grid']).object.visible = false")
    both = shares(page)
    assert min(both) > 0.005
    page.evaluate("report.scene.viewer.scene_tree.find(['twins']).object.visible = false")
    assert max(shares(page)) < 0.2 * min(both)


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", [1280, 390])
def test_the_page_fits_its_window(open_page: Any, report: str, width: int, scheme: str) -> None:
    page = open_page(report, width, scheme)
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    assert page.evaluate("[document.querySelector('#pane canvas').clientWidth, pane.clientWidth]") == (
        [page.evaluate("pane.clientWidth")] * 2
    )
    light = page.evaluate("getComputedStyle(document.body).backgroundColor") == "rgb(246, 247, 249)"
    assert light == (scheme == "light")


def test_the_view_follows_a_resized_pane(open_page: Any, report: str) -> None:
    page = open_page(report)
    page.set_viewport_size({"width": 700, "height": 900})
    page.wait_for_function("document.querySelector('#pane canvas').clientWidth === pane.clientWidth")
    aspect = page.evaluate("[report.scene.viewer.camera.aspect, pane.clientWidth / pane.clientHeight]")
    assert aspect[0] == pytest.approx(aspect[1])


def test_slider_play_rate_and_markers_move_time(open_page: Any, report: str) -> None:
    page = open_page(report)
    page.locator("#time").fill("12.5")
    assert page.locator("#clock").text_content() == "12.50 s"
    plot, line = (page.locator(f"#plot-joint-2 {part}").bounding_box() for part in (".plot", ".cursor"))
    drawn = next(plot for plot in plots(make_run()) if plot.name == "joint-2")
    share = drawn.left + 12.5 / 20.0 * (drawn.right - drawn.left)
    assert line["x"] - plot["x"] == pytest.approx(share * plot["width"], abs=1.5)
    assert "command 3: rejected" in page.locator("#now").text_content()
    marks = page.locator("#marks .mark")
    assert marks.count() == 6
    assert page.locator("#marks .mark-slowed").count() == 1
    assert page.locator("#marks .mark-lost").count() == 1
    page.locator("#marks .mark-payload").click()
    assert page.locator("#clock").text_content() == "3.00 s"
    page.locator("#rate").select_option("2")
    page.locator("#play").click()
    page.wait_for_function("report.time() > 4")
    page.locator("#play").click()
    stopped = page.evaluate("report.time()")
    page.evaluate("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")
    assert page.evaluate("report.time()") == stopped


def test_aligned_clocks_bring_the_twins_together(open_page: Any, report: str) -> None:
    page = open_page(report)
    page.evaluate("report.seek(8)")
    first = """() => { const out = {}; report.scene.viewer.scene.traverse((o) => { if (o.children.length === 7
        && ['virtual', 'real'].includes(o.name)) out[o.name] = o.children[6].matrix.toArray().slice(12, 15); });
        return Math.hypot(...out.real.map((x, k) => x - out.virtual[k])); }"""
    assert page.evaluate(first) > 0.02
    page.locator("#align").check()
    for t in (8.0, 15.0):
        page.evaluate(f"report.seek({t})")
        assert page.evaluate(first) < 1e-3
    assert page.evaluate("report.whenPlayed(8)") == pytest.approx(8.6, abs=1e-3)
    assert page.evaluate("report.whenPlayed(15)") == pytest.approx(16.1, abs=1e-3)


def test_evil_texts_do_not_run(open_page: Any) -> None:
    run = make_run(title=EVIL, reason=EVIL)
    page = open_page(render(run, summarize(run)))
    assert page.evaluate("window.evil === undefined")
    assert page.locator("h1").text_content().startswith("</script>")
    page.evaluate("report.seek(6)")
    assert "</script>" in page.locator("#now").text_content()


def test_the_figures_of_a_summary_belong_together() -> None:
    run = make_run()
    found = summarize(run)
    behind = run.t - run.play
    assert found["clock_offset_s"] == pytest.approx(-behind.mean())
    assert found["behind"]["p95_s"] == pytest.approx(np.quantile(behind, 0.95))
    assert found["behind"]["max_s"] == pytest.approx(behind.max())
    # The user's lag is what the robot plays behind, and what its joints lag besides.
    assert found["lag_user_s"] == pytest.approx(found["lag_timeline_s"] + behind.mean())
    for errors in found["errors"].values():
        worst = max(range(6), key=lambda joint: errors["joint_rms_deg"][joint])
        assert errors["worst_joint"] == worst + 1
