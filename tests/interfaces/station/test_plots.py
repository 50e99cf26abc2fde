"""Live plots: what they show is what Python makes of the same states and timeline."""

from __future__ import annotations

import csv
import json
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from interfaces import connect
from interfaces.messages.control import State
from robots import puma560
from tests.interfaces.live_rig import Child, child
from tests.interfaces.pages import accessible
from tests.interfaces.station.opened import SERVE, Page, paged, station, until
from vrs.comparison import agreement, compare_paths
from vrs.timeline import Timeline

MODEL = puma560.model()
PLOTS = "station.plots"
ROWS = f"""(() => {{ const {{ table }} = {PLOTS}.samples;
    return Object.fromEntries(table.names.map((name) => [name, [...table.column(name)]])); }})()"""
RNG_SEED = 11


@pytest.fixture(scope="module")
def server() -> Iterator[Child]:
    with child(*SERVE, "--port", "0", "--delay", "constant:0.1") as running:
        yield running


@pytest.fixture(scope="module")
def page(browser: Any, server: Child) -> Iterator[Page]:
    with paged(browser, station(server), accept_downloads=True) as opened:
        opened.open().take_control().rest()
        opened.page.click("#tab-plots")
        yield opened


def drawn(page: Page, name: str) -> np.ndarray:
    """The numbers that a plot was given to draw, a row a time; null is NaN."""
    data = page.get(f"{PLOTS}.charts.find(({{ graph }}) => graph.name === '{name}').plot.data.map((x) => [...x])")
    return np.array(data, float)


def errors(q: np.ndarray, virtual: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Joint errors [rad], tool distance [m] and angle [rad], row by row, by the figures of `vrs compare`."""
    rows = [agreement(MODEL, a[None], b[None]) for a, b in zip(virtual, q, strict=True)]
    return q - virtual, np.array([row.tool_rms for row in rows]), np.array([row.angle_rms for row in rows])


def move(page: Page) -> None:
    """Let both robots move, and wait until they rest."""
    page.page.click("#tab-jog")
    page.page.fill("#speed", "60")
    page.page.click("[data-pose=ready]" if page.virtual[1] < 1.2 else "[data-pose=nominal]")
    page.wait("station.session.timeline.end > station.session.now + 0.2")
    page.page.click("#tab-plots")
    page.rest()


def test_what_is_plotted_is_what_python_finds(page: Page, server: Child) -> None:
    heard: dict[float, State] = {}
    with connect(station(server).rstrip("/").replace("http", "ws") + "/ws", role="viewer") as client:
        viewer = client.viewer()

        def note(connection: Any) -> bool:
            state = connection.state
            if state is not None:
                heard.setdefault(state.t, state)
            return moved.is_set()

        moved = threading.Event()
        listening = threading.Thread(target=client.wait, args=(note, 60.0))
        listening.start()
        move(page)
        moved.set()
        listening.join(70.0)
        until(
            lambda: viewer.timeline is not None and viewer.timeline.end >= page.get("station.session.timeline.end")
        )
        timeline = viewer.timeline
    assert timeline is not None
    rows = {name: np.array(column, float) for name, column in page.get(ROWS).items()}
    check(rows, timeline)
    both = [(k, heard[t]) for k, t in enumerate(rows["t"].tolist()) if t in heard]
    assert len(both) > 10
    for k, state in both:
        assert rows["play"][k] == state.play
        assert [rows[f"real_{j}"][k] for j in range(1, 7)] == state.q.tolist()
    for basis in ("timeline", "user"):
        page.page.select_option("#plots-basis", basis)
        page.wait(f"{PLOTS}.charts.every((chart) => !chart.visible || !chart.wanted)")
        shown = drawn(page, "joint-error")
        at, place = np.isin(shown[0], rows["t"]), np.searchsorted(rows["t"], shown[0])
        assert at.sum() > 20
        for joint in range(6):
            expected = np.degrees(rows[f"error_{basis}_{joint + 1}"][place[at]])
            np.testing.assert_allclose(shown[1 + joint][at], expected, rtol=0, atol=1e-9)


def check(rows: dict[str, np.ndarray], timeline: Timeline) -> None:
    """Compare what the page keeps with what Python makes of the same measurements."""
    q = np.stack([rows[f"real_{j}"] for j in range(1, 7)], axis=1)
    reference = np.stack([rows[f"reference_{j}"] for j in range(1, 7)], axis=1)
    then, now = timeline.sample(rows["play"]), timeline.sample(rows["t"])
    for basis, virtual in (("timeline", then), ("user", now)):
        joint, tool, angle = errors(q, virtual)
        kept = np.stack([rows[f"error_{basis}_{j}"] for j in range(1, 7)], axis=1)
        np.testing.assert_allclose(kept, joint, rtol=0, atol=1e-9)
        np.testing.assert_allclose(rows[f"tool_{basis}"], tool, rtol=0, atol=1e-8)
        np.testing.assert_allclose(rows[f"angle_{basis}"], angle, rtol=0, atol=1e-7)
    place = {
        name: MODEL.forward(x)[:, :3, 3]
        for name, x in (("real", q), ("reference", reference), ("then", then), ("now", now))
    }
    parts = {
        "offset": place["then"] - place["now"],
        "link": place["reference"] - place["then"],
        "servo": place["real"] - place["reference"],
    }
    total = place["real"] - place["now"]
    length = np.linalg.norm(total, axis=1)
    moving = length > 1e-6
    assert moving.sum() > 5
    for name, part in parts.items():
        along = np.sum(part * total, axis=1)[moving] / length[moving]
        np.testing.assert_allclose(rows[name][moving], along, rtol=0, atol=1e-8)
    whole = rows["offset"] + rows["link"] + rows["servo"]
    np.testing.assert_allclose(whole, rows["tool_user"], rtol=0, atol=1e-8)
    playing = np.isfinite(rows["D"])
    np.testing.assert_allclose(rows["D"][playing], (rows["play"] - rows["t"])[playing], rtol=0, atol=1e-9)


MADE = """async ({ states, past }) => {
    const { Samples } = await import("/station/samples.js");
    const listeners = {};
    const session = { timeline: station.session.timeline, past: -Infinity, now: 0 };
    const samples = new Samples({ session, chain: station.chain, on: (type, f) => { listeners[type] = f; } });
    states.forEach((state) => listeners.state(state));
    const early = samples.table.length;
    session.past = past;
    samples.advance();
    const { table, arrived, lost } = samples;
    const columns = Object.fromEntries(table.names.map((name) => [name, [...table.column(name)]]));
    return { early, columns, arrived: [...arrived.column("delay")], lost: [...lost.column("sent")] };
}"""


LOOKED_BACK = """async (states) => {
    const { History } = await import("/station/history.js");
    const listeners = {};
    const history = new History({ on: (type, f) => { listeners[type] = f; } });
    states.forEach((state) => listeners.state(state));
    const at = [0.5, 1.6, 2.7, 3.6, 4.2, 5.5, 6.2].map((t) => history.at(t)?.[0] ?? null);
    return { at, kept: history.rows.length };
}"""


def test_a_look_back_finds_what_was_measured_late(page: Page) -> None:
    states = [
        {"t": 1.0, "q": [1.0], "late": []}, {"t": 5.0, "q": [5.0], "late": []},
        {"t": 6.0, "q": [6.0], "late": [[2.5, [2.5]], [1.5, [1.5]], [3.5, [3.5]]]},
        {"t": 6.1, "q": [6.1], "late": [[3.5, [3.5]]]},
    ]  # fmt: skip
    found = page.page.evaluate(LOOKED_BACK, states)
    assert found == {"at": [None, 1.5, 2.5, 3.5, 3.5, 5.0, 6.1], "kept": 7}


def test_errors_and_their_parts_of_any_states(page: Page, server: Child) -> None:
    with connect(station(server).rstrip("/").replace("http", "ws") + "/ws", role="viewer") as client:
        viewer = client.viewer()
        until(lambda: viewer.timeline is not None and len(viewer.timeline) > 0)
        timeline = viewer.timeline
    assert timeline is not None
    rng = np.random.default_rng(RNG_SEED)
    end = timeline.end
    t = np.linspace(end - 4.0, end + 1.0, 100)
    states = []
    for k, at in enumerate(t.tolist()):
        reference = timeline.sample(at - 0.4) + 0.01 * rng.normal(size=6)
        states.append({
            "t": at, "play": at - 0.3, "D": -0.3, "pace": 1.0,
            "q": (reference + 0.02 * rng.normal(size=6)).tolist(),
            "reference": reference.tolist(), "round_trip": 0.2,
            "messages": [[at - 0.2, at - 0.1], [at - 0.15, None]],
            "halted": "joint 1" if k == 50 else "", "epoch": "6" if k < 52 else "7",
        })  # fmt: skip
    found = page.page.evaluate(MADE, {"states": states, "past": float(t[-1])})
    # Nothing is compared with what may still change.
    assert found["early"] == 0
    rows = {name: np.array(column, float) for name, column in found["columns"].items()}
    assert rows["t"] == pytest.approx(t)
    assert np.flatnonzero(np.isnan(rows["D"])).tolist() == [50, 51]
    check(rows, timeline)
    assert found["arrived"] == pytest.approx([0.1] * 100)
    assert found["lost"] == pytest.approx(t - 0.15)


PATHS = """async ({ t, leader, follower, vMax, cell }) => {
    const { comparePaths } = await import("/station/pathtime.js");
    const flat = (points) => Float64Array.from(points.flat());
    return comparePaths(Float64Array.from(t), flat(leader), flat(follower), { vMax, cell });
}"""


@pytest.mark.parametrize("what", ["late", "aside", "halfway", "noise", "still"])
def test_time_difference_and_path_error_are_those_of_the_comparison(page: Page, what: str) -> None:
    t = np.arange(0.0, 25.0, 0.05)
    s = np.clip(t - 2.0, 0.0, 12.0) / 12.0

    def eight(s: np.ndarray) -> np.ndarray:
        return np.stack([0.4 * np.sin(2 * np.pi * s), 0.2 * np.sin(4 * np.pi * s), 0.1 * s], axis=1)

    leader, follower = eight(s), eight(np.clip(t - 3.0, 0.0, 12.0) / 12.0)
    if what == "aside":
        follower = follower + np.array([0.0, 0.03, 0.0])
    elif what == "halfway":
        follower = eight(np.clip(t - 3.0, 0.0, 6.0) / 12.0)
    elif what == "noise":
        follower = follower + np.random.default_rng(RNG_SEED).normal(size=follower.shape) * 0.003
    elif what == "still":
        leader = np.tile(leader[:1], (len(t), 1))
    expected = compare_paths(t, leader, follower, v_max=0.5, cell=0.01)
    given = {"t": t.tolist(), "leader": leader.tolist(), "follower": follower.tolist(), "vMax": 0.5, "cell": 0.01}
    found = page.page.evaluate(PATHS, given)
    for name in ("mean", "sd", "max", "bound"):
        value = getattr(expected, f"time_difference_{name}")
        assert found[name] == (None if value is None else pytest.approx(value, abs=1e-9))
    progress = expected.progress
    assert found["progress"] == (None if progress is None else pytest.approx(progress))
    path = expected.path_error_mean, expected.path_error_p95, expected.path_error_max
    assert found["pathError"] == pytest.approx(path, abs=1e-9)
    if what == "late":
        assert found["mean"] == pytest.approx(1.0, abs=1e-3)


def test_plots_say_what_they_show_and_look_back(page: Page, tmp_path: Path) -> None:
    move(page)
    page.page.click("#plot-figures > summary")
    page.wait(f"{PLOTS}.samples.compared?.time_difference_mean != null")
    # The adaptive offset hides the delay, with some 50 ms to spare.
    difference = page.get(f"{PLOTS}.samples.compared.time_difference_mean")
    behind = np.nanmean(-np.array(page.get(f"[...{PLOTS}.samples.table.column('D')]"), float))
    assert difference == pytest.approx(behind, abs=0.15)
    delays = page.get(f"[...{PLOTS}.samples.arrived.column('delay')]")
    assert len(delays) > 20
    assert delays == pytest.approx([0.1] * len(delays), abs=1e-6)
    assert "worst: joint" in page.page.locator("#value-joint-error").text_content()
    named = page.page.locator("#plot-joint-error .u-legend .u-label")
    assert [one for one in named.all() if not one.is_visible()] == []
    assert named.all_text_contents() == list("123456")
    assert "round trip" in page.page.locator("#value-delay").text_content()
    label = "document.getElementById('plot-tool-error').getAttribute('aria-label')"
    page.wait(f"{label}?.startsWith('Tool error, mm, Newest 30 s: ')")
    page.wait("document.querySelectorAll('#plot-figures tbody tr').length > 20")
    accessible(page.page)
    page.page.click("#plot-figures > summary")

    page.page.evaluate("document.getElementById('tab-panels').scrollTo(0, 0)")
    cursor = page.get("station.session.now") - 12
    page.page.evaluate(f"station.cursor = {cursor}")
    page.wait("document.getElementById('plots-shows').textContent.includes('values at')")
    chart = f"{PLOTS}.charts[0]"
    page.wait(f"{chart}.cursor === {cursor} && {chart}.plot.scales.x.max < {cursor} + 15.1")
    page.page.evaluate("station.cursor = null")
    page.wait(f"{chart}.cursor === null")

    with page.page.expect_download() as download:
        page.page.click("#plots-save")
    download.value.save_as(tmp_path / "kept.csv")
    with (tmp_path / "kept.csv").open(encoding="utf-8") as file:
        kept = list(csv.DictReader(file))
    times = page.get(f"[...{PLOTS}.samples.table.column('t')]")
    assert [float(row["t_s"]) for row in kept] == times[: len(kept)]
    assert len(kept) > 50
    assert {"tool_timeline_m", "error_user_6_rad", "servo_m"} <= kept[0].keys()


def test_all_that_is_seen_is_drawn_in_turn(page: Page) -> None:
    size, parts = page.page.viewport_size, f"[...{PLOTS}.charts, {PLOTS}.figures]"
    opened = "document.querySelectorAll('#tab-panels details.plot[id]')"
    was = page.get(f"[...{opened}].map((one) => one.open)")
    try:
        # More plots at once than there are turns for them.
        page.page.set_viewport_size({"width": 1280, "height": 3200})
        page.page.evaluate(f"{opened}.forEach((one) => {{ one.open = true; }})")
        page.wait(f"{parts}.every((part) => part.visible)")
        for _ in range(2):
            before = page.get(f"{parts}.map((part) => part.drawn)")
            page.wait(f"{parts}.every((part, k) => part.drawn > {json.dumps(before)}[k])")
        assert page.get("document.querySelectorAll('#plot-figures tbody tr').length") > 20
    finally:
        page.page.evaluate(f"(was) => {opened}.forEach((one, k) => {{ one.open = was[k]; }})", was)
        page.page.set_viewport_size(size)


SEEN = """async (changes) => {
    const { Chart } = await import("/station/chart.js");
    const real = window.IntersectionObserver;
    let tell;
    window.IntersectionObserver = class {
        constructor(told) { tell = told; }
        observe() {}
    };
    try {
        const chart = new Chart({ name: "of-a-test", title: "", unit: "", open: true, note: "", lines: [] });
        chart.attach(document.createElement("div"));
        tell(changes.map((isIntersecting) => ({ isIntersecting })));
        return chart.visible;
    } finally {
        window.IntersectionObserver = real;
    }
}"""


@pytest.mark.parametrize("changes", [[True], [False], [True, False], [False, True], [True, False, True]])
def test_of_several_changes_the_last_says_whether_a_plot_is_seen(page: Page, changes: list[bool]) -> None:
    assert page.page.evaluate(SEEN, changes) is changes[-1]


def test_nothing_is_drawn_that_nobody_sees_and_memory_is_bounded(page: Page) -> None:
    page.page.click("#tab-jog")
    page.wait(f"{PLOTS}.charts.every((chart) => !chart.visible)")
    times = f"{PLOTS}.charts.map((chart) => chart.drawn)"
    before, count = page.get(times), page.get(f"{PLOTS}.samples.heard")
    page.wait(f"{PLOTS}.samples.heard > {count} + 0.5")
    assert page.get(times) == before
    assert page.get(
        """import("/station/table.js").then(({ Table }) => {
            const table = new Table(["t", "x"], 100);
            for (let k = 0; k < 1050; k++) table.push([k, -k]);
            return [table.length, table.get("t", 0), table.newest, table.get("x", 99), table.before(1000),
                table.column("t").buffer.byteLength];
        })"""
    ) == [100, 950, 1049, -1049, 50, 1600]
    page.page.click("#tab-plots")
    page.until(lambda: page.get(times) != before)
