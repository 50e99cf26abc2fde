"""The station of a mobile robot in a real browser: driving it, stopping it, watching it, losing it."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import pytest

from tests.interfaces.live_rig import Child, child
from tests.interfaces.pages import accessible
from tests.interfaces.station.opened import Page, paged, station

SERVE = (
    "serve",
    "--robot",
    "ipr",
    "--link-loss",
    "hold",
    "--delay",
    "constant:0.05",
    "--port",
    "0",
    "--camera",
    "12",
)
"""Its robot waits for a machine that is busy, and so many pictures are asked for that some come on one, too."""


@pytest.fixture(scope="module")
def server() -> Iterator[Child]:
    with child(*SERVE) as running:
        yield running


@pytest.fixture
def page(browser: Any, server: Child) -> Iterator[Page]:
    with paged(browser, station(server)) as opened:
        opened.open()
        opened.wait("Boolean(station.session.state.real)")
        yield opened


def postures(page: Page) -> tuple[list[float], list[float]]:
    """Of the virtual and of the real robot."""
    state = page.get("station.session.state")
    return state["virtual"], state["real"]


def gone(page: Page, since: tuple[list[float], list[float]]) -> list[float]:
    """How far both robots went [m]."""
    return [math.dist(now[:2], then[:2]) for now, then in zip(postures(page), since, strict=True)]


def rest(page: Page) -> None:
    page.wait("station.session.state.command[0] === 0 && station.session.state.command[1] === 0")
    page.until(lambda: math.dist(*(posture[:2] for posture in postures(page))) < 0.03)


def test_keys_and_stick_drive_both_robots_and_the_space_bar_stops_them(page: Page) -> None:
    assert "Take control first" in page.page.locator("#drive-needs").text_content()
    page.page.keyboard.press("ArrowUp")
    page.take_control()
    start = postures(page)
    page.page.keyboard.down("ArrowUp")
    page.until(lambda: min(gone(page, start)) > 0.2)
    page.page.keyboard.down("KeyA")
    page.until(lambda: page.get("station.session.state.command[1]") > 0.3)
    page.shoot("drive")
    page.page.keyboard.press("Space")
    page.wait("document.getElementById('alert').textContent === 'Stopping'")
    rest(page)
    for key in ("KeyA", "ArrowUp"):
        page.page.keyboard.up(key)
    between = postures(page)
    stick = page.page.locator(".stick").bounding_box()
    page.page.mouse.move(stick["x"] + 52, stick["y"] + 52)
    page.page.mouse.down()
    page.page.mouse.move(stick["x"] + 52, stick["y"] + 90, steps=3)
    page.until(lambda: min(gone(page, between)) > 0.1)
    assert page.get("station.session.state.command[0]") < 0
    page.page.mouse.up()
    rest(page)
    assert page.get("station.session.state.path_error") < 0.05


def test_another_page_watches_and_takes_over_once_it_may(browser: Any, server: Child, page: Page) -> None:
    page.take_control()
    with paged(browser, station(server)) as other:
        other.open()
        other.wait("document.getElementById('control-pill').textContent.includes('has control')")
        before = postures(other)
        other.page.keyboard.down("KeyW")
        other.page.wait_for_timeout(500)
        other.page.keyboard.up("KeyW")
        assert max(gone(other, before)) < 0.02
        page.page.click("#give")
        other.wait("!document.getElementById('take').hidden")
        other.take_control()
        button = other.page.locator("button[aria-label='Turn left']")
        button.hover()
        other.page.mouse.down()
        other.until(lambda: postures(other)[1][2] > before[1][2] + 0.2)
        other.page.mouse.up()
        rest(other)
        assert not page.get("station.session.holds")


def test_the_way_is_changed_on_the_fly_and_plots_are_drawn(page: Page) -> None:
    page.take_control()
    page.page.click("#tab-network")
    page.page.fill("#net-delay-forward", "constant:0.2")
    page.page.click("#net-apply")
    page.wait("station.session.network?.forward.delay === 'constant:0.2'")
    page.page.click("#tab-plots")
    page.page.keyboard.down("ArrowUp")
    page.wait("station.session.state.time_difference > 0.25", 30.0)
    page.wait("document.querySelectorAll('.plot-area canvas').length >= 3")
    page.wait("/[0-9]/.test(document.getElementById('value-time-difference').textContent)")
    page.page.keyboard.up("ArrowUp")
    page.shoot("drive-plots")
    for scheme in ("light", "dark"):
        page.page.emulate_media(color_scheme=scheme)
        for tab in ("drive", "camera", "plots", "network"):
            page.page.click(f"#tab-{tab}")
            accessible(page.page)


LISTEN = """() => {
  const context = new AudioContext();
  const analyser = context.createAnalyser();
  context.createMediaStreamSource(station.camera.video.srcObject).connect(analyser);
  const samples = new Float32Array(analyser.fftSize);
  window.level = () => {
    analyser.getFloatTimeDomainData(samples);
    return Math.max(...samples.map(Math.abs));
  };
}"""
"""How loud what arrives is."""
PIXELS = """() => {
  const { video } = station.camera;
  const canvas = document.createElement("canvas");
  [canvas.width, canvas.height] = [video.videoWidth, video.videoHeight];
  const context = canvas.getContext("2d");
  context.drawImage(video, 0, 0);
  const at = (x, y) => [...context.getImageData(x * canvas.width, y * canvas.height, 1, 1).data].slice(0, 3);
  return [canvas.width, canvas.height, at(0.5, 0.4), at(0.5, 0.9)];
}"""
"""Size of the newest picture, and what is in its middle and at its bottom."""
CAMERA = "station.camera"


def test_the_camera_is_seen_by_rtp_turned_and_heard_by_who_has_control_and_its_message_stands(page: Page) -> None:
    page.page.click("#tab-camera")
    page.wait(f"{CAMERA}.receiver.rate >= 5", 90.0)
    width, height, wall, floor = page.get(PIXELS)
    assert (width, height) == (352, 264)
    # The room's far wall is of a warm white, the floor before the robot of a cold grey.
    assert wall[0] > wall[2] + 5
    assert min(wall) > 90
    assert abs(floor[0] - floor[2]) <= 6
    page.page.keyboard.press("KeyJ")
    page.page.click("#camera-say", force=True)
    assert page.get(f"{CAMERA}.facts.target") == [0, 0]
    page.take_control()
    page.page.click("#camera-sound")
    page.page.evaluate(LISTEN)
    page.wait("level() === 0")
    page.page.fill("#camera-text", "Hello!")
    page.page.click("#camera-say")
    page.wait("level() > 0.05")
    page.wait("document.getElementById('camera-saying').textContent.includes('Hello!')")
    page.page.click("#camera-show")
    page.wait("document.getElementById('robot-screen').textContent === 'Hello!'")
    page.page.locator("button[aria-label='Look left']").hover()
    page.page.mouse.down()
    page.wait(f"{CAMERA}.facts.pan > 0.2")
    page.page.mouse.up()
    page.shoot("camera")
    page.page.click("#camera-clear")
    page.wait("document.getElementById('robot-screen').hidden")
    page.page.click("button[aria-label='Look ahead']")
    page.wait(f"{CAMERA}.facts.pan === 0")
    page.page.keyboard.press("KeyL")
    page.wait(f"{CAMERA}.facts.pan < 0")
    page.page.click("#give")


def test_a_browser_without_rtp_shows_single_pictures_and_says_so(browser: Any, server: Child) -> None:
    with paged(browser, station(server)) as other:
        other.page.add_init_script("delete window.RTCPeerConnection")
        other.open()
        other.page.click("#tab-camera")
        other.wait(f"{CAMERA}.stills.frames >= 2", 60.0)
        assert other.page.locator("#camera-still").is_visible()
        assert other.get("document.getElementById('camera-still').naturalWidth") == 352
        assert server.health()["media"]["peers"] <= 1


def test_a_server_that_is_gone_shows_and_a_stop_waits(server: Child, page: Page) -> None:
    """The last one: there's no server any more."""
    page.breaks = True
    server.process.kill()
    page.wait("station.session.link === 'lost'", 10.0)
    assert "Lost" in page.page.locator("#banner").text_content()
    page.page.keyboard.press("Space")
    page.wait("document.getElementById('stop-note').textContent.includes('no connection')")
