"""A mobile robot's page: styles and refusals where they belong, the room from above and by ear, people in order."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

from tests.interfaces.live_rig import Child, child
from tests.interfaces.station.opened import Page, paged, station
from tests.interfaces.station.test_class import standing
from tests.interfaces.station.test_driving import CAMERA, LISTEN
from tests.interfaces.station.test_notices import told

SERVE = ("serve", "--robot", "ipr", "--room", "home", "--in-order", "--link-loss", "hold", "--port", "0")
OWNERS = {
    "camera.css": ["camera"],
    "driving.css": ["drive", "plots", "floor"],
    "tasks.css": ["map", "jobs"],
    "plots.css": ["plots"],
}
"""The panels that each style sheet is for, beside the page's own."""
LEAKS = """(owners) => [...document.styleSheets].flatMap((sheet) => {
    const name = (sheet.href ?? "").split("/").at(-1);
    if (!(name in owners)) return [];
    const flat = (rules) => [...rules].flatMap((rule) => rule.selectorText ? [rule] : flat(rule.cssRules ?? []));
    return flat(sheet.cssRules).flatMap(({ selectorText }) => {
        const plain = selectorText.replace(/:not\\(:[a-z]+\\)/g, "")
            .replace(/::?(before|after|hover|active|focus[a-z-]*|disabled|empty)/g, "");
        return [...document.querySelectorAll(plain)].flatMap((one) => {
            const panel = one.closest(".panel")?.id.replace("panel-", "") ?? null;
            return panel === null || owners[name].includes(panel) ? [] : [`${name}: ${selectorText} in ${panel}`];
        });
    });
})"""


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Child]:
    with child(*SERVE, "--jobs", str(tmp_path_factory.mktemp("jobs") / "jobs.json")) as running:
        yield running


@pytest.fixture
def page(browser: Any, server: Child) -> Iterator[Page]:
    with paged(browser, station(server)) as opened:
        opened.open()
        opened.wait("Boolean(station.session.state.real && station.session.plan && station.session.tasks.loss)")
        yield opened


def test_a_panels_style_sheet_dresses_no_other_panel(page: Page) -> None:
    page.take_control()
    jobs = "[1, 2].map((number) => ({ do: 'wait', number, seconds: 1 }))"
    page.get(f"station.session.wish('task', {{ task: {{ jobs: {{ jobs: {jobs}, places: {{}} }} }} }})")
    page.page.click("#tab-jobs")
    page.wait("document.querySelectorAll('#jobs li').length === 2")
    page.shoot("jobs-planned")
    icon = page.page.locator("#jobs li:first-child .stage")
    dressed = icon.evaluate("(one) => { const { backgroundColor, cursor } = getComputedStyle(one); return"
                            " [backgroundColor, cursor]; }")  # fmt: skip
    assert dressed == ["rgba(0, 0, 0, 0)", "auto"]
    box = icon.bounding_box()
    assert box["height"] < 22
    assert sorted(set(page.page.evaluate(LEAKS, OWNERS))) == []


def test_what_is_refused_is_said_where_the_hand_is(page: Page) -> None:
    page.page.keyboard.press("Escape")
    if page.get("station.session.holds"):
        page.page.click("#give")
        page.wait("!station.session.holds")
    forward = "button[aria-label='Forward']"
    page.page.click("#tab-drive")
    page.page.click(forward, force=True)
    told(page, "you don't have control", forward)
    page.page.click("#tab-map")
    page.wait("Boolean(document.querySelector('.plan-things')?.getAttribute('d'))")
    page.page.click("#map")
    told(page, "take control first", "#map")
    page.page.fill("#goal-x", "1")
    page.page.fill("#goal-y", "1")
    page.page.click("#goal-go", force=True)
    told(page, "take control first", "#goal-go")
    page.shoot("mobile-refused")
    page.page.click("#tab-jobs")
    page.page.fill("#job-text", "nowhere")
    page.page.click("#job-add-it", force=True)
    told(page, "take control first", "#job-add-it")
    page.take_control()
    page.page.click("#job-add-it")
    told(page, "no place of this list", "#job-add-it")
    page.page.keyboard.press("Escape")
    page.wait("document.getElementById('notice').hidden")


CORNER = f"""() => {{
  const {{ video }} = {CAMERA};
  const canvas = document.createElement("canvas");
  [canvas.width, canvas.height] = [video.videoWidth, video.videoHeight];
  const context = canvas.getContext("2d");
  context.drawImage(video, 0, 0);
  return [...context.getImageData(3, canvas.height / 2, 1, 1).data].slice(0, 3);
}}"""
"""Colour at the left edge of the newest picture."""


def test_the_room_is_seen_from_above_and_heard_by_who_wants_to(page: Page) -> None:
    page.page.click("#tab-camera")
    page.wait(f"{CAMERA}.receiver.rate >= 3", 90.0)
    page.page.select_option("#camera-view", "overhead")
    # Beside the room there's nothing but a light blue.
    page.until(lambda: (lambda r, _, b: b > r + 10)(*page.page.evaluate(CORNER)))
    assert page.page.locator("#camera-video").get_attribute("aria-label") == "The room from above"
    page.page.evaluate(LISTEN)
    page.wait("level() === 0")
    assert page.get(f"{CAMERA}.facts.level") > 0
    page.page.click("#camera-hear")
    page.wait("level() > 0.0003")
    assert not page.get(f"{CAMERA}.video.muted")
    page.page.click("#camera-hear")
    page.wait("level() === 0")
    page.page.select_option("#camera-view", "both")
    page.until(lambda: not (lambda r, _, b: b > r + 10)(*page.page.evaluate(CORNER)))
    page.shoot("camera-both")


@pytest.mark.slow
def test_who_connects_first_has_control_first_and_then_it_is_the_next_ones_turn(
    browser: Any, server: Child, page: Page
) -> None:
    page.take_control()
    with paged(browser, station(server)) as other:
        other.open()
        other.wait("document.getElementById('control-pill').textContent.includes('number 1 in the queue')")
        assert other.page.locator("#take").is_hidden()
        other.page.click("#tab-class")
        other.until(lambda: "waits, number 1" in standing(other, other.get("station.session.name")))
        assert other.page.locator(".invitations").count() == 0
        other.accessible()
        page.page.click("#give")
        other.wait("document.getElementById('control-pill').textContent.includes('your turn')")
        other.take_control()
        page.wait("document.getElementById('ask').hidden === false")
