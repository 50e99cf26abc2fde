"""The page `/replay` in a real browser: what it shows is g, its keys and buttons move the one head of all pages."""

from __future__ import annotations

import json
import time
import urllib.request
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, contextmanager

import numpy as np
import pytest
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

from interfaces.clients.playhead import Mode
from interfaces.recording.playback import Playback
from interfaces.recording.recording import open_recording
from interfaces.station.replay_page import CELLS, ReplayPage, grouped
from interfaces.stream import sockets
from interfaces.stream.access import Admission, hosts
from interfaces.stream.server import application
from tests.interfaces.pages import until, wait
from tests.interfaces.recording.made import MODEL, make
from tests.interfaces.stream.serving import Serving, beside
from vrs.clock import ManualClock, WallClock


class ServingPage(Serving):
    def __init__(self, port: int, page: ReplayPage) -> None:
        super().__init__(port)
        self.page, self.playback = page, page.playback


@asynccontextmanager
async def _serving(paths, **options) -> AsyncIterator[ServingPage]:
    listening = sockets.bind()
    recordings = [open_recording(path) for path in paths]
    try:
        page = ReplayPage(Playback(recordings), WallClock(), **options)
        serving = ServingPage(listening.getsockname()[1], page)
        app = application(page.routes, hosts(["127.0.0.1"], serving.port))
        async with sockets.serve(app, listening), page.running():
            yield serving
    finally:
        for recording in recordings:
            recording.close()


def served(*paths, **options):
    return beside(_serving(paths, **options))


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    folder = tmp_path_factory.mktemp("made")
    return [(folder / name, make(folder / name, length)) for name, length in (("a.mcap", 12.0), ("b.mcap", 9.0))]


@pytest.fixture
def open_page(new_page):
    """Opens pages."""

    def start(server, width=640, height=480, scheme="light", panes=1):
        page = new_page(server.url, width, height, scheme, expected="WebSocket connection")
        page.goto(f"{server.url}/replay")
        if panes:
            wait(page, f"!!window.replay && !!replay.state && replay.views.length === {panes}")
            for k in range(panes):
                wait(page, f"replay.node({k}, 'vrs', 'real', 'body', '6').children.length === 2")
        return page

    return start


POSES = """([k, twin]) => { const out = []; for (let i = 0; i < 7; i++) {
    const node = replay.node(k, 'vrs', twin, 'body', String(i)); node.updateMatrix();
    out.push(node.matrix.toArray());
    } return out; }"""


def drawn_as(page, k, twin, q):
    """Wait until the page draws a robot at some joints, within what a pose may be off when it isn't sent again."""
    expected = np.array([X.T.ravel() for X in MODEL.links(q)])
    until(lambda: np.abs(np.array(page.evaluate(POSES, [k, twin])) - expected).max() < 1e-6)


def near(server, t):
    """Wait until the head stands at a time."""
    until(lambda: abs(server.playback.place(now=server.page.clock.now()) - t) < 1e-9)
    assert server.playback.mode is Mode.PAUSED


def crowded():
    """How many times as long as alone something takes here now, at least 1."""
    wall, own = time.monotonic(), time.process_time()
    while time.process_time() - own < 0.1:
        pass
    return max(1.0, (time.monotonic() - wall) / 0.1)


def test_it_opens_and_moves_and_shows_g(files, open_page):
    path, site = files[0]
    first, took = [], []
    with served(path, first=first.append) as server:
        server.call(server.playback.play, now=server.page.clock.now())
        while min(took, default=5.0) >= 5.0 and len(took) < 3:
            crowd = crowded()
            begun = time.monotonic()
            page = open_page(server)
            wait(page, "replay.state.t > 0.2")
            took.append((time.monotonic() - begun) / crowd)
        assert min(took) < 5.0
        assert len(first) == 1
        page.keyboard.press("Space")
        until(lambda: server.playback.mode is Mode.PAUSED)
        for t in (1.75, 4.2, 11.0, 0.5):
            page.evaluate("t => replay.wish('seek', { t })", t)
            near(server, t)
            drawn_as(page, 0, "virtual", site.engine.joints(t))
            drawn_as(page, 0, "real", server.playback.moment(t).frames[0].q_real)
            wait(page, "t => replay.node(0, 'vrs', 'committed').play === Math.round(100 * (t - 0.35)) / 100", t)
            wait(page, "text => document.getElementById('clock').textContent === text", f"0:{t:06.3f}")
        assert page.locator(".behind").text_content() == "0.350 s"
        assert not page.locator(".own").is_visible()
        assert "a.mcap" in page.locator(".name").text_content()


def test_keys_and_buttons_move_the_head(files, open_page):
    with served(files[0][0]) as server:
        page = open_page(server)
        head = server.playback.head
        press = page.keyboard.press
        press("ArrowRight")
        near(server, 1 / 60)
        press("Shift+ArrowRight")
        near(server, 1 + 1 / 60)
        press("Shift+ArrowLeft")
        press("ArrowLeft")
        near(server, 0.0)
        press("End")
        near(server, 12.0)
        press("PageDown")
        near(server, 2.0)
        wait(page, "replay.marks[0].length > 20 && Math.abs(replay.state.t - 2) < 1e-6")
        press("n")
        near(server, 2.4)
        press("p")
        near(server, 2.0)
        # The page marks the time that it shows.
        wait(page, "Math.abs(replay.state.t - 2) < 1e-6")
        press("a")
        until(lambda: head.loop == (pytest.approx(2.0), 12.0))
        wait(page, "replay.state.loop !== null")
        press("PageUp")
        near(server, 12.0)
        press("o")
        until(lambda: head.loop is None)
        press("Home")
        near(server, 0.0)
        press("r")
        until(lambda: head.rate == -1.0)
        wait(page, "replay.state.rate === -1")
        press("+")
        until(lambda: head.rate == -2.0)
        page.locator("#rates button[data-rate='0.25']").click()
        until(lambda: head.rate == 0.25)
        page.locator("#rate").fill("−3,5")
        press("Enter")
        until(lambda: head.rate == -3.5)
        page.locator("#rate").fill("0")
        press("Enter")
        assert page.locator("#rate").get_attribute("aria-invalid") == "true"
        assert "−8 to 8" in page.locator("#now").text_content()
        page.locator("#help").click()
        assert page.locator("#keys").is_visible()
        press("Escape")
        assert page.locator("#live").is_disabled()
        assert page.locator("#unloop").is_disabled()


def test_the_bar_seeks_loops_and_tells_what_is_marked(files, open_page):
    with served(files[0][0]) as server:
        page = open_page(server, 1000, 600)
        wait(page, "replay.marks[0].length > 20")
        box = page.locator("#track").bounding_box()
        x = lambda t: box["x"] + box["width"] * t / 12.0  # noqa: E731
        y = box["y"] + 6
        page.mouse.click(x(6.0), y)
        until(lambda: abs(server.playback.place(now=0.0) - 6.0) < 0.03)
        page.mouse.move(x(3.5), box["y"] - 8)
        tip = page.locator("#tip").text_content()
        assert "the real robot stopped" in tip
        assert "1.5 kg" in tip
        page.mouse.click(x(3.51), box["y"] - 8)
        near(server, 3.5)
        page.keyboard.down("Shift")
        page.mouse.move(x(4.0), y)
        page.mouse.down()
        page.mouse.move(x(5.0), y)
        page.mouse.up()
        page.keyboard.up("Shift")
        until(lambda: server.playback.head.loop is not None)
        assert server.playback.head.loop == (pytest.approx(4.0, abs=0.03), pytest.approx(5.0, abs=0.03))
        wait(page, "!document.getElementById('loop-end').hidden")
        before = server.playback.head.loop
        page.locator("#loop-end").focus()
        page.keyboard.press("Shift+ArrowRight")
        until(lambda: server.playback.head.loop == (before[0], pytest.approx(before[1] + 1.0)))
        shown = page.locator("#marks .kind-command").count()
        assert shown > 10
        page.locator("#kinds button[data-kind='command']").click()
        assert page.locator("#marks .kind-command").count() == 0
        assert page.locator("#marks .kind-stopped").count() == 1
        bar = page.locator("#bar")
        assert bar.get_attribute("aria-valuemax") == "12.00"
        wait(page, "Math.abs(Number(document.getElementById('bar').getAttribute('aria-valuenow')) - 4) < 0.05")


def test_two_recordings_stand_side_by_side_and_all_pages_agree(files, open_page):
    with served(*[path for path, _ in files]) as server:
        pages = [open_page(server, 900, 500, scheme, panes=2) for scheme in ("light", "dark")]
        pages[0].evaluate("replay.wish('seek', { t: 7.3 })")
        for page in pages:
            for k, (_, site) in enumerate(files):
                drawn_as(page, k, "virtual", site.engine.joints(7.3))
            wait(page, "replay.state.t === 7.3")
            assert page.locator(".own").nth(1).is_visible()
            assert [page.locator(".name").nth(k).text_content() for k in (0, 1)] == ["A · a.mcap", "B · b.mcap"]
        pages[1].evaluate("replay.wish('seek', { t: 10.5 })")
        wait(pages[0], "replay.state.t === 10.5 && replay.node(1, 'vrs', 'real').visible === false")
        wait(pages[0], "!replay.views[1].part('.absent').hidden && replay.views[0].part('.absent').hidden")
        camera = "replay.views.map((view) => view.scene.viewer.camera.position.toArray().map((x) => x.toFixed(6)))"
        pages[0].evaluate(
            "(() => { const v = replay.views[0].scene.viewer; v.camera.position.x += 0.5; v.controls.update(); })()"
        )
        one, other = pages[0].evaluate(camera)
        assert one == other


@pytest.mark.parametrize(("width", "height", "scheme"), [(1280, 720, "dark"), (480, 700, "light")])
def test_it_fits_its_window_and_every_button_has_a_name(files, open_page, width, height, scheme):
    with served(*[path for path, _ in files]) as server:
        page = open_page(server, width, height, scheme, panes=2)
        wait(page, "replay.marks[0].length > 20")
        root = "document.documentElement"
        assert page.evaluate(f"[{root}.scrollWidth, {root}.scrollHeight]") == [width, height]
        dock = page.locator("#dock").bounding_box()
        assert dock["y"] + dock["height"] <= height + 0.5
        assert dock["height"] <= (210 if width >= 1280 else 0.55 * height)
        boxes = page.evaluate(
            """Array.from(document.querySelectorAll('#dock button:not([hidden]), #dock input')).map((e) => {
            const b = e.getBoundingClientRect(); return [b.left, b.top, b.right, b.bottom, e.textContent.trim() ||
            e.getAttribute('aria-label') || e.title]; })"""
        )
        assert len(boxes) > 25
        for left, top, right, bottom, name in boxes:
            assert name
            assert left >= 0
            assert right <= width
            assert top >= dock["y"]
            assert bottom <= height
        controls = [box for box in boxes if box[4] and box[1] > dock["y"] + 60]
        for k, a in enumerate(controls):
            for b in controls[k + 1 :]:
                assert a[2] <= b[0] + 0.5 or b[2] <= a[0] + 0.5 or a[3] <= b[1] + 0.5 or b[3] <= a[1] + 0.5, (a, b)
        page.keyboard.press("Tab")
        assert page.evaluate("getComputedStyle(document.activeElement).outlineStyle") == "solid"


@contextmanager
def board(server, **named):
    url = f"ws://127.0.0.1:{server.port}/replay/board"
    with connect(url, max_size=2**24, open_timeout=10, close_timeout=1, **named) as websocket:
        yield websocket


def refusal(websocket, text):
    """What one is told who asks for something that can't be done."""
    websocket.send(text)
    while True:
        data = websocket.recv(timeout=5.0)
        if isinstance(data, str):
            return json.loads(data)


def test_wishes_that_cannot_be_are_refused_and_change_nothing(files):
    with served(files[0][0]) as server, board(server) as websocket:
        websocket.send("{}")
        for text in (
            "", "[", '{"do":"fly"}', '{"do":"seek"}', '{"do":"seek","t":"1"}', '{"do":"seek","t":1,"x":2}',
            '{"do":"rate","rate":0}', '{"do":"rate","rate":9}', '{"do":"loop","start":3,"end":3}', '{"do":"live"}',
            '{"do":"seek","t":1e999}', "[" * 2000,
        ):  # fmt: skip
            assert refusal(websocket, text)["kind"] == "refused"
        assert server.playback.mode is Mode.PAUSED
        assert server.playback.place(now=0.0) == 0.0


def flood(websocket):
    """Ask for much more than is allowed, until the connection closes."""
    for _ in range(2000):
        websocket.send('{"do":"pause"}')
    while True:
        websocket.recv(timeout=5.0)


def test_a_token_is_asked_for_and_a_flood_is_ended(files):
    with served(
        files[0][0], authorize=lambda _, token: Admission("" if token == "right" else "another one")
    ) as server:
        with board(server) as websocket:
            websocket.send('{"token":"wrong"}')
            with pytest.raises(ConnectionClosed):
                websocket.recv(timeout=5.0)
            assert websocket.close_code == 4401
        with board(server) as websocket:
            websocket.send('{"token":"right"}')
            with pytest.raises(ConnectionClosed):
                flood(websocket)
            assert websocket.close_code == 1008


def test_files_are_served_with_care(files):
    with served(files[0][0]) as server:
        names = (
            "",
            "/replay",
            "/station/replay.js",
            "/station/seekbar.js",
            "/station/controls.js",
            "/replay/replay.css",
            "/replay/scene.js",
            "/replay/licences.txt",
        )
        for name in names:
            with urllib.request.urlopen(server.url + name, timeout=5) as answer:
                assert answer.headers["Content-Security-Policy"].startswith(
                    "default-src 'none'; script-src 'self';"
                )
                assert answer.read()
        with pytest.raises(urllib.error.HTTPError) as missing:
            urllib.request.urlopen(server.url + "/replay/page.py", timeout=5)
        missing.value.close()
        assert missing.value.code == 404


def test_marks_that_are_too_near_are_one(files):
    with open_recording(files[0][0]) as recording:
        playback = Playback([recording])
        playback.read_marks()
        track = playback.tracks[0]
        alone = grouped(track, 0.0, 12.0)
        assert sum(len(group["texts"]) for group in alone) == len(track.marks.marks)
        wide = grouped(track, 0.0, 4.0 * CELLS)
        assert len(wide) < len(alone)
        commands = [group for group in wide if group["kind"] == "command"]
        assert commands[0]["texts"][-1].startswith("and ")
        assert min(group["t"] for group in wide) == pytest.approx(0.2)


def test_while_nobody_watches_it_stands(files):
    clock, first = ManualClock(0.0), []
    with open_recording(files[0][0]) as recording:
        page = ReplayPage(Playback([recording]), clock, first=first.append)
        page.turn(now=0.0)
        page.turn(now=5.0)
        assert first == []
        slot = page.board.join()
        page.turn(now=6.0)
        page.turn(now=7.0)
        assert first == [6.0]
        while slot:
            slot.take(1 << 20)
