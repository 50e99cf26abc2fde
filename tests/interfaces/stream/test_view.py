"""The page `/view` in a real browser, and viewers on real sockets: late, stalled, strange, without a token."""

from __future__ import annotations

import gzip
import socket
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any

import msgspec
import numpy as np
import pytest
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect

from interfaces.stream.access import Admission
from interfaces.stream.meshcat import Committed, TwinScene
from interfaces.stream.meshcat.meshes import bodies
from interfaces.stream.meshcat.page import BATCHES, PATIENCE, UNAUTHORISED, routes
from robots import load, puma560
from robots.robot import Robot
from tests.interfaces.pages import until, wait
from tests.interfaces.stream.serving import Serving, served
from tests.interfaces.stream.test_meshcat import Shapeless
from vrs import Engine, JointTarget, ManualClock, MotionCommand, Timeline
from vrs.model import Array

MODEL = puma560.model()
NOMINAL = MODEL.poses["nominal"]


def plan() -> Timeline:
    engine = Engine(MODEL, q=NOMINAL, clock=ManualClock(0.0))
    engine.execute(
        MotionCommand(target=JointTarget(NOMINAL + np.array([-1.2, 0.3, -0.4, 0.4, 0.3, 0.5])), speed=0.25)
    )
    return engine.timeline


@pytest.fixture(scope="module")
def made() -> TwinScene:
    robot = load("puma560")
    return TwinScene(robot, looks=bodies(robot))


@pytest.fixture
def server(made: TwinScene) -> Iterator[Serving]:
    with served(routes(made)) as running:
        show(running, made, NOMINAL, NOMINAL)
        yield running
    assert made.readers == 0


def show(server: Serving, scene: TwinScene, virtual: Array, real: Array | None, **named: Any) -> None:
    """Show both robots, and the path without its usual pauses."""
    scene.path_due = -np.inf
    server.call(scene.show, virtual=virtual, real=real, now=0.0, **named)


@contextmanager
def viewer(server: Serving, **named: Any) -> Iterator[Any]:
    url = f"ws://127.0.0.1:{server.port}/meshcat"
    with connect(url, max_size=2**24, open_timeout=10, close_timeout=1, **named) as websocket:
        yield websocket


def first_scene(websocket: Any) -> list[dict[str, Any]]:
    """Commands, one a message, up to the first silence."""
    commands = []
    try:
        while True:
            commands.append(msgspec.msgpack.decode(websocket.recv(timeout=1.0 if commands else 5.0)))
    except TimeoutError:
        return commands


@pytest.fixture
def open_page(new_page: Any) -> Any:
    """Opens the page."""

    def start(server: Serving, width: int = 480, scheme: str = "light", live: bool = True) -> Any:
        page = new_page(server.url, width, 420, scheme, expected="WebSocket connection")
        page.goto(f"{server.url}/view")
        if live:
            wait(page, "document.getElementById('status').dataset.state === 'live'")
            wait(page, "view.node('vrs', 'real', 'body', '6').children.length >= 1")
            wait(page, "view.node('vrs').box !== undefined")
        return page

    return start


POSES = """(twin) => { const out = []; for (let i = 0; i < 7; i++) {
    const node = view.node('vrs', twin, 'body', String(i)); node.updateMatrix(); out.push(node.matrix.toArray()); }
    return out; }"""
NEAR = """([twin, poses]) => poses.every((pose, i) => { const node = view.node('vrs', twin, 'body', String(i));
    node.updateMatrix(); return pose.every((x, k) => Math.abs(x - node.matrix.elements[k]) < 1e-6); })"""


def drawn_as(page: Any, twin: str, q: Array) -> None:
    """Wait until the page's scene graph has a robot's links where the model has them, within 1e-6."""
    wait(page, NEAR, [twin, [X.T.ravel().tolist() for X in MODEL.links(q)]])
    expected = [X.T.ravel() for X in MODEL.links(q)]
    np.testing.assert_allclose(page.evaluate(POSES, twin), expected, rtol=0, atol=1e-6)


def shares(page: Any) -> dict[str, float]:
    """Shares of the canvas that show the bright solid, the blue ghost, and the orange path."""
    found: dict[str, float] = page.evaluate(
        """() => { const v = view.viewer; v.render(); const gl = v.renderer.getContext();
        const n = gl.drawingBufferWidth * gl.drawingBufferHeight, p = new Uint8Array(4 * n);
        gl.readPixels(0, 0, gl.drawingBufferWidth, gl.drawingBufferHeight, gl.RGBA, gl.UNSIGNED_BYTE, p);
        let real = 0, virtual = 0, committed = 0;
        for (let i = 0; i < p.length; i += 4) {
          if (Math.min(p[i], p[i + 1], p[i + 2]) > 150 && p[i + 3] > 200) real++;
          if (p[i + 2] > p[i] + 40 && p[i + 3] > 60) virtual++;
          if (p[i] > p[i + 2] + 120 && p[i + 3] > 200) committed++;
        }
        return { real: real / n, virtual: virtual / n, committed: committed / n }; }"""
    )
    return found


def test_the_page_shows_both_robots_where_they_are_and_the_path(
    server: Serving, made: TwinScene, open_page: Any
) -> None:
    page = open_page(server)
    timeline = plan()
    for t in (0.1, 0.4, 0.7):
        show(server, made, timeline.sample(t + 0.6), timeline.sample(t), path=Committed(timeline, t))
        drawn_as(page, "virtual", timeline.sample(t + 0.6))
        drawn_as(page, "real", timeline.sample(t))
    wait(page, "view.node('vrs', 'committed').play === 0.7")
    page.evaluate("view.node('Grid').visible = false")
    full = shares(page)
    assert full["real"] > 0.01
    assert full["virtual"] > 0.002
    assert full["committed"] > 0.0005
    labels = page.locator("#labels span:visible").all_text_contents()
    assert f"rest in {timeline.end - 0.7:.1f} s" in labels
    assert "0.3 s" in labels
    for name in full:
        page.locator(f"#show-{name}").click()
        assert shares(page)[name] < 0.1 * full[name]
    assert page.locator("#labels span:visible").count() == 0
    show(server, made, timeline.sample(1.6), timeline.sample(1.0), path=Committed(timeline, 1.0))
    drawn_as(page, "real", timeline.sample(1.0))
    assert shares(page)["committed"] < 0.1 * full["committed"]
    page.locator("#show-real").click()
    assert shares(page)["real"] > 0.01


def test_one_who_comes_late_sees_the_same(server: Serving, made: TwinScene, open_page: Any) -> None:
    early = open_page(server)
    timeline = plan()
    for t in np.linspace(0.0, 1.3, 40):
        show(server, made, timeline.sample(t + 0.6), timeline.sample(t), path=Committed(timeline, t))
    drawn_as(early, "real", timeline.sample(1.3))
    late = open_page(server)
    for page in (early, late):
        drawn_as(page, "virtual", timeline.sample(1.9))
        drawn_as(page, "real", timeline.sample(1.3))
        wait(page, "view.node('vrs', 'committed').play === 1.3")
    count = """() => { let shown = 0;
        for (const node of view.node('vrs', 'committed').children) if (node.visible)
            shown += node.children.reduce((n, child) => n + child.children.length, 0);
        return shown; }"""
    assert early.evaluate(count) == late.evaluate(count) > 4


@pytest.mark.parametrize(("width", "scheme"), [(1100, "dark"), (390, "light")])
def test_the_page_fits_its_window(server: Serving, open_page: Any, width: int, scheme: str) -> None:
    page = open_page(server, width, scheme)
    assert page.evaluate("[document.documentElement.scrollWidth, document.documentElement.scrollHeight]") == [
        width,
        420,
    ]
    canvas = (
        "[document.querySelector('#pane canvas').clientWidth, document.querySelector('#pane canvas').clientHeight]"
    )
    assert page.evaluate(canvas) == [width, 420]
    boxes = [page.locator(name).bounding_box() for name in ("#legend", "#home", "#status")]
    for k, a in enumerate(boxes):
        assert a["x"] >= 0
        assert a["x"] + a["width"] <= width
        for b in boxes[k + 1 :]:
            apart_x = a["x"] + a["width"] <= b["x"] or b["x"] + b["width"] <= a["x"]
            assert apart_x or a["y"] + a["height"] <= b["y"] or b["y"] + b["height"] <= a["y"]
    page.set_viewport_size({"width": 700, "height": 500})
    wait(page, f"JSON.stringify({canvas}) === '[700,500]'")
    assert page.evaluate("view.viewer.camera.aspect") == pytest.approx(1.4)


def test_the_page_connects_again_by_itself(made: TwinScene, open_page: Any) -> None:
    with served(routes(made)) as first:
        show(first, made, NOMINAL, NOMINAL, path=Committed(plan(), 0.1))
        page = open_page(first)
        wait(page, "view.node('vrs', 'committed').children.some((node) => node.visible)")
        port = first.port
    wait(page, "document.getElementById('status').dataset.state === 'lost'")
    assert "trying again" in page.locator("#status-text").text_content()
    # A server that was started anew knows nothing of what the page shows.
    shapeless = Robot("shapeless", Shapeless())
    other = TwinScene(shapeless, looks=bodies(shapeless))
    with served(routes(other), port) as second:
        show(second, other, NOMINAL + 0.2, None)
        wait(page, "document.getElementById('status').dataset.state === 'live'")
        drawn_as(page, "virtual", NOMINAL + 0.2)
        wait(page, "view.node('vrs', 'real').visible === false")
        wait(page, "document.getElementById('status').textContent.includes(\"isn't connected\")")
        assert page.evaluate("view.node('vrs', 'committed').children.some((node) => node.visible)") is False


def test_a_token_is_asked_for_where_one_is_needed(made: TwinScene, open_page: Any) -> None:
    with served(
        routes(made, authorize=lambda _, token: Admission("" if token == "right" else "another one"))
    ) as server:
        page = open_page(server, live=False)
        page.wait_for_selector("#enter:not([hidden])")
        assert page.locator("#refused").is_hidden()
        for token, state in (("wrong", "token"), ("right", "live")):
            page.locator("#token").fill(token)
            page.locator("#enter button").click()
            wait(page, f"document.getElementById('status').dataset.state === '{state}' && view.socket !== 0")
            if state == "token":
                page.wait_for_selector("#refused:not([hidden])")
        assert page.locator("#enter").is_hidden()
        assert "right" not in page.url
        for first in ("{}", '{"token": 3}', "[", "x" * 5000, None):
            with viewer(server, subprotocols=[BATCHES]) as websocket:
                if first is not None:
                    websocket.send(first)
                with pytest.raises(ConnectionClosed):
                    websocket.recv(timeout=PATIENCE + 3.0)
                assert websocket.close_code == UNAUTHORISED


def test_meshcats_own_page_may_connect_too(server: Serving, made: TwinScene) -> None:
    with viewer(server) as websocket:
        commands = first_scene(websocket)
        assert {command["type"] for command in commands} >= {"delete", "set_object", "set_transform"}
        show(server, made, NOMINAL + 0.1, NOMINAL)
        paths = {msgspec.msgpack.decode(websocket.recv(timeout=5.0))["path"] for _ in range(6)}
        assert paths == {f"/vrs/virtual/body/{i}" for i in range(1, 7)}


def test_one_who_does_not_read_is_let_go_and_holds_up_nobody(server: Serving, made: TwinScene) -> None:
    stalled = socket.socket()
    stalled.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    stalled.connect(("127.0.0.1", server.port))
    host = f"127.0.0.1:{server.port}"
    stalled.sendall(
        f"GET /meshcat HTTP/1.1\r\nHost: {host}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
        "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 13\r\n\r\n".encode()
    )
    with stalled, viewer(server) as websocket:
        first_scene(websocket)
        begun = time.monotonic()
        delays = []
        while made.readers == 2:
            k = len(delays) + 1
            sent = time.monotonic()
            show(server, made, NOMINAL + 1e-3 * k, NOMINAL)
            for _ in range(6):
                websocket.recv(timeout=5.0)
            delays.append(time.monotonic() - sent)
            assert time.monotonic() < begun + 10.0
            time.sleep(0.02)
        assert np.median(delays) < 0.05
        # Cut off with all that waited for it, not only forgotten.
        until(lambda: server.call(lambda: len(server.connections)) == 1)
        stalled.settimeout(5.0)
        left = 0
        with suppress(ConnectionResetError):
            while data := stalled.recv(65536):
                left += len(data)
        assert left < 256_000


def test_pages_of_others_are_turned_away(server: Serving) -> None:
    for origin in ("http://evil.example", f"http://127.0.0.1:{server.port + 1}", "null"):
        with pytest.raises(InvalidStatus), viewer(server, origin=origin):
            pass
    with viewer(server, origin=server.url) as websocket:
        assert websocket.recv(timeout=5.0)


def flood(websocket: Any) -> None:
    """Send much more than is allowed, until the connection closes."""
    for _ in range(1000):
        websocket.send(b"\x00" * 100)
    while True:
        websocket.recv(timeout=5.0)


def test_one_who_says_too_much_is_closed_and_beats_are_answered(server: Serving) -> None:
    with viewer(server) as websocket:
        first_scene(websocket)
        websocket.send("beat")
        assert websocket.recv(timeout=5.0) == "beat"
        with pytest.raises(ConnectionClosed):
            flood(websocket)
        assert websocket.close_code == 1008


def test_many_come_and_go_and_nothing_stays(server: Serving, made: TwinScene) -> None:
    import asyncio

    def tasks() -> int:
        return len(asyncio.all_tasks(server.loop))

    before = server.call(tasks)
    for k in range(40):
        with viewer(server, subprotocols=[BATCHES]) as websocket:
            if k % 2:
                websocket.recv(timeout=5.0)
    until(lambda: made.readers == 0)
    until(lambda: bool(server.call(tasks) <= before))


def test_files_are_served_with_care(server: Serving) -> None:
    import urllib.error
    import urllib.request

    for name in ("/view", "/view/view.js", "/view/view.css", "/view/meshcat.js", "/view/licences.txt"):
        with urllib.request.urlopen(server.url + name, timeout=5) as answer:
            assert answer.headers["Content-Security-Policy"].startswith("default-src 'none'; script-src 'self';")
            tag = answer.headers["ETag"]
            plain = answer.read()
            assert len(plain) > 300
        packed = urllib.request.Request(server.url + name, headers={"Accept-Encoding": "br, gzip"})
        with urllib.request.urlopen(packed, timeout=5) as answer:
            assert (answer.headers["Content-Encoding"], answer.headers["Vary"]) == ("gzip", "Accept-Encoding")
            assert gzip.decompress(answer.read()) == plain
        known = urllib.request.Request(server.url + name, headers={"If-None-Match": tag})
        with pytest.raises(urllib.error.HTTPError) as unchanged:
            urllib.request.urlopen(known, timeout=5)
        unchanged.value.close()
        assert unchanged.value.code == 304
    for name in ("/view/scene.py", "/view/..%2f__init__.py", "/view/vrs.js"):
        with pytest.raises(urllib.error.HTTPError) as missing:
            urllib.request.urlopen(server.url + name, timeout=5)
        missing.value.close()
        assert missing.value.code == 404
