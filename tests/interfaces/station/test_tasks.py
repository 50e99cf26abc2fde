"""Goals and jobs in a real browser: clicked on the map, listed, tried, done, and there again after a restart."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from robots import mobile
from tests.interfaces.live_rig import Child, child
from tests.interfaces.pages import accessible
from tests.interfaces.station.opened import Page, paged, station
from tests.interfaces.station.test_notices import told

SERVE = ("serve", "--robot", "ipr", "--link-loss", "hold", "--port", "0")
A, B = (4.7, 5.3), (4.8, 6.1, math.pi / 2)
"""Of the scenario, in the hall: B is before the front door."""


@pytest.fixture(scope="module")
def kept(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("jobs") / "jobs.json"


@pytest.fixture(scope="module")
def server(kept: Path) -> Iterator[Child]:
    home = (Path(mobile.__file__).parent / "rooms" / "home.room").read_text()
    room = kept.with_name("hall.room")
    hall = home.replace("start 1.2 5.4 0", "start 4.65 5.0 90").replace("place A 1.2 5.4 0", "place A 4.7 5.3")
    room.write_text(hall)
    with child(*SERVE, "--room", str(room), "--jobs", str(kept)) as running:
        yield running


@pytest.fixture(scope="module")
def page(browser: Any, server: Child) -> Iterator[Page]:
    with paged(browser, station(server)) as opened:
        opened.open()
        opened.wait("Boolean(station.session.state.real && station.session.plan && station.session.tasks.loss)")
        yield opened


def on_map(page: Page, x: float, y: float) -> tuple[float, float]:
    """Where a place of the map is on the page."""
    found = page.get(
        f"(() => {{ const p = new DOMPoint({x}, {y}).matrixTransform("
        "document.querySelector('#map g').getScreenCTM()); return [p.x, p.y]; })()"
    )
    return found[0], found[1]


def real(page: Page) -> list[float]:
    found: list[float] = page.get("station.session.state.real")
    return found


def test_a_click_on_the_map_sends_the_robot_there_and_a_drag_says_how_it_stands(page: Page) -> None:
    page.page.click("#tab-map")
    page.wait("Boolean(document.querySelector('.plan-things')?.getAttribute('d'))")
    page.page.mouse.click(*on_map(page, 4.65, 5.5))
    assert "Take control first" in page.page.locator("#goal-fault").text_content()
    page.take_control()
    page.page.mouse.move(*on_map(page, 4.65, 5.5))
    page.page.mouse.down()
    page.page.mouse.move(*on_map(page, 4.4, 6.3), steps=4)
    page.page.mouse.up()
    page.wait("station.session.tasks.doing === 'goal'")
    page.wait("station.session.tasks.route?.length >= 2")
    page.shoot("map")
    accessible(page.page, "#side")
    assert "On its way" in page.page.locator("#journey").text_content()
    page.wait("station.session.tasks.journey === 'arrived'")
    x, y, theta = real(page)
    # A pixel of this map is 3 cm.
    assert math.dist((x, y), (4.65, 5.5)) < 0.08
    assert abs(math.remainder(theta - math.atan2(0.8, -0.25), math.tau)) < math.radians(6)
    page.wait("Boolean(station.session.seen?.points?.length > 20 && station.session.seen.doubt)")
    # A typed goal in a wall, or out of the map, is refused with a reason, and doesn't end one that's under way.
    send(page, 4.7, 4.3)
    page.wait("station.session.tasks.doing === 'goal'")
    for x, y, why in ((3.6, 4.0, "inside a wall"), (50.0, 1.0, "outside the map")):
        send(page, x, y)
        page.until(lambda why=why: why in page.page.locator("#goal-fault").text_content())
        told(page, why, "#goal-go")
        assert page.get("[station.session.tasks.doing, station.session.tasks.goal.y]") == ["goal", 4.3]
    page.page.evaluate("document.activeElement.blur()")
    page.page.keyboard.press("Space")
    page.wait("(station.session.tasks.doing ?? 'nothing') === 'nothing'")
    page.wait("!station.session.state.halted")
    x, y, _ = real(page)
    page.until(
        lambda: f"x {x:.2f} m, y {y:.2f} m, θ" in page.page.locator("#map-robot").text_content().replace("−", "-")
    )
    page.page.mouse.move(*on_map(page, 3.0, 2.0))
    page.until(lambda: "x 3.0" in page.page.locator("#map-pointer").text_content())


def send(page: Page, x: float, y: float) -> None:
    page.page.fill("#goal-x", str(x))
    page.page.fill("#goal-y", str(y))
    page.page.click("#goal-go")


def add(page: Page, kind: str, text: str) -> None:
    count = page.page.locator("#jobs li").count()
    page.page.select_option("#job-kind", kind)
    page.page.fill("#job-text", text)
    page.page.click("#job-add-it")
    page.until(lambda: page.page.locator("#jobs li").count() == count + 1)


def stages(page: Page) -> list[str | None]:
    return [item.get_attribute("data-stage") for item in page.page.locator("#jobs li").all()]


def stands_at(page: Page, place: tuple[float, float, float]) -> bool:
    x, y, theta = real(page)
    return math.dist((x, y), place[:2]) < 0.05 and abs(math.remainder(theta - place[2], math.tau)) < math.radians(2)


@pytest.mark.slow
def test_the_papers_scenario_is_listed_tried_and_done(page: Page, kept: Path) -> None:
    if not page.get("station.session.holds"):
        page.take_control()
    page.page.click("#theme")
    page.page.click("#tab-jobs")
    add(page, "wait", "key")
    add(page, "move", "B")
    add(page, "voice", "Hello!")
    add(page, "message", "Please put the book on my top side!")
    add(page, "move", "A")
    for place in (1, 2, 3):
        page.page.click(f"[aria-label='Later job {place}']")
    page.wait("station.session.tasks.jobs.jobs.map((job) => job.do).join() === 'move,voice,message,wait,move'")
    page.page.fill("#job-text", "nowhere")
    page.page.click("#job-add-it")
    assert "no place of this list" in page.page.locator("#jobs-fault").text_content()
    page.page.click("#jobs-dry-run")
    page.wait("station.session.tasks.forecast?.length === 5")
    assert "and what nobody knows" in page.page.locator("#jobs-stage").text_content()
    page.page.evaluate("window.said = new Set(); setInterval(() => said.add(station.camera.facts?.saying), 20)")
    page.page.click("#jobs-run")
    page.wait("station.session.tasks.progress.jobs[3].stage === 'running'")
    page.wait("!document.getElementById('jobs-key').ariaDisabled")
    assert stands_at(page, B)
    assert page.page.locator("#jobs-shows").text_content() == "Please put the book on my top side!"
    page.wait("said.has('Hello!')")
    page.wait("document.getElementById('robot-screen').textContent === 'Please put the book on my top side!'")
    page.shoot("jobs")
    accessible(page.page, "#side")
    page.page.evaluate("document.activeElement.blur()")
    page.page.keyboard.press("Enter")
    page.wait("station.session.tasks.progress.jobs[4].stage === 'running'")
    page.page.click("#jobs-pause")
    page.wait("station.session.tasks.progress.stage === 'paused'")
    page.page.click("#jobs-resume")
    page.wait("station.session.tasks.progress.stage === 'done'")
    assert math.dist(real(page)[:2], A) < 0.05
    page.until(lambda: stages(page) == ["done"] * 5)
    written = json.loads(kept.read_text())
    assert [job["do"] for job in written["list"]["jobs"]] == ["move", "voice", "message", "wait", "move"]
    assert written["progress"]["stage"] == "done"
