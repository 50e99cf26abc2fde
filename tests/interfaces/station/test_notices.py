"""What can't be done is said at the control that was used, for some seconds, and to those who only listen."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import pytest

from tests.interfaces.live_rig import Child
from tests.interfaces.pages import accessible
from tests.interfaces.station.opened import NOTICE, Page, paged, station
from tests.interfaces.station.test_station import moved


@pytest.fixture
def page(browser: Any, server: Child) -> Iterator[Page]:
    with paged(browser, station(server), viewport={"width": 1280, "height": 800}) as opened:
        opened.open()
        yield opened


def told(page: Page, words: str, at: str) -> None:
    """Wait until something is said at a control."""
    page.wait(f"{NOTICE}.toLowerCase().includes({words.lower()!r})")
    notice, control = (page.page.locator(one).bounding_box() for one in ("#notice", at))
    across = max(control["x"] - notice["x"] - notice["width"], notice["x"] - control["x"] - control["width"], 0)
    along = max(control["y"] - notice["y"] - notice["height"], notice["y"] - control["y"] - control["height"], 0)
    assert math.hypot(across, along) < 16, (notice, control)
    size = page.page.viewport_size
    assert 0 <= notice["x"] <= size["width"] - notice["width"]
    assert 0 <= notice["y"] <= size["height"] - notice["height"]
    live = "document.getElementById('notice').closest('[aria-live]').getAttribute('aria-live')"
    assert page.get(live) in {"polite", "assertive"}


def to_nominal(page: Page) -> None:
    """Send both robots to the pose `nominal`, whence every key can move them."""
    page.page.fill("#speed", "100")
    page.page.click("[data-pose=nominal]")
    page.wait(
        """(() => { const { timeline, welcome } = station.session; const end = timeline.joints(timeline.end);
        return welcome.poses.nominal.every((x, k) => Math.abs(x - end[k]) < 1e-6); })()"""
    )
    page.rest()


def gone(page: Page) -> None:
    page.wait(f"document.getElementById('notice').hidden && {NOTICE} === ''")


def test_what_is_refused_is_said_where_the_hand_is(page: Page) -> None:
    ready = page.page.locator("[data-pose=ready]")
    assert ready.get_attribute("aria-disabled") == "true"
    assert "Take control first" in ready.get_attribute("title")
    ready.click(force=True)
    told(page, "you don't have control", "[data-pose=ready]")
    page.page.keyboard.press("Escape")
    gone(page)
    page.take_control().rest()
    up = page.page.locator("button[aria-label='Joint 1 up']")
    before = page.virtual
    up.hover()
    page.page.mouse.down()
    page.until(lambda: moved(page, 0.02, before))
    page.page.mouse.up()
    page.rest()
    page.page.click("#undo")
    page.wait(f"{NOTICE} !== ''")
    page.shoot("refused-undo")
    why = page.get("station.session.orders.entries.at(-1).outcome.refusal")
    told(page, why, "#undo")
    # The next success takes it away, before its time is over.
    page.page.click("[data-pose=ready]")
    page.wait("station.session.orders.entries.at(-1).outcome?.receipt?.status === 'accepted'")
    gone(page)
    page.page.keyboard.press("Space")
    page.rest()
    # A move can't begin before it's asked for.
    page.page.evaluate("station.session.order({ type: 'retime', command_id: 999, execute_at: 1 })")
    page.wait(f"{NOTICE} !== ''")
    # It goes by itself, too.
    gone(page)


def test_what_the_way_to_the_robot_refuses_is_said_there(page: Page) -> None:
    page.take_control()
    page.page.click("#tab-network")
    page.wait("!document.getElementById('net-delay-forward').disabled")
    page.page.fill("#net-delay-forward", "tomorrow")
    page.page.click("#net-apply")
    told(page, "delay profile must be", "#net-apply")
    accessible(page.page, "#notice")
    page.page.click("#tab-record")
    page.page.fill("#record-name", "")
    page.page.click("#record-begin")
    told(page, "needs a name", "#record-begin")


@pytest.mark.parametrize("width", [1280, 390])
def test_a_robot_that_waits_says_why_and_refuses_at_the_control(browser: Any, server: Child, width: int) -> None:
    with paged(browser, station(server), viewport={"width": width, "height": 800}) as page:
        page.open().take_control().rest()
        # As a robot does that has stopped by itself.
        why = "nothing fresh came: link loss (on a link this slow start vrs serve with --link-loss hold)"
        page.page.evaluate(
            f"""(() => {{ const {{ session }} = station; const take = session.take.bind(session);
            session.take = (message) => take(message.type === "state" ? {{ ...message, halted: "{why}" }}
                : message.type === "outcome" ? {{ type: "outcome", number: message.number, code: "not-following",
                    refusal: "the robot doesn't follow: {why}; resume first" }} : message); }})()"""
        )
        page.wait("document.getElementById('banner').textContent.includes('--link-loss hold')")
        assert page.page.locator("#resume").text_content() == "Resume"
        page.page.click("[data-pose=stretch]")
        told(page, "press resume", "[data-pose=stretch]")
        page.shoot(f"halted-{width}")
        box = page.page.locator("#banner").bounding_box()
        assert 0 <= box["x"] <= width - box["width"]
        # Keys, too: the button that does the same is where it's said.
        page.page.evaluate("document.activeElement.blur()")
        page.page.keyboard.press("w", delay=150)
        told(page, "press resume", "button[aria-label='Joint 2 up']")
        page.page.reload()
        page.wait("window.station?.session?.link === 'live'")


def test_jogging_the_tool_into_a_singularity_says_so_and_what_leads_out(page: Page) -> None:
    page.take_control().rest()
    to_nominal(page)
    page.page.evaluate("document.activeElement.blur()")
    page.page.keyboard.down("PageUp")
    told(page, "near a singularity: jog joint 5", "button[aria-label='Tool along z, plus']")
    page.shoot("singular")
    # It stays as long as the hand does, and a few seconds more.
    page.page.wait_for_timeout(500)
    assert page.get(NOTICE)
    page.page.keyboard.up("PageUp")
    page.rest()
    assert page.get(NOTICE)
    page.page.keyboard.down("PageDown")
    gone(page)
    page.page.keyboard.up("PageDown")
    page.page.fill("#speed", "30")


def test_jogging_and_dragging_change_nothing_of_what_was_shown(page: Page) -> None:
    page.take_control().rest()
    to_nominal(page)
    page.page.fill("#speed", "30")
    page.page.evaluate(
        """window.said = []; new MutationObserver(() => said.push(badge.dataset.status))
        .observe(document.getElementById('badge'), { attributes: true, attributeFilter: ["data-status"] })"""
    )
    page.page.evaluate("document.activeElement.blur()")
    for key in ("q", "ArrowUp", "a"):
        before = page.virtual
        page.page.keyboard.down(key)
        page.until(lambda before=before: moved(page, 0.005, before))
        page.page.keyboard.up(key)
        page.rest()
    pane = page.page.locator("#pane").bounding_box()
    at = page.get("station.drag.project(station.drag.tool())")
    page.page.mouse.move(pane["x"] + at["x"], pane["y"] + at["y"])
    page.page.mouse.down()
    page.page.mouse.move(pane["x"] + at["x"] - 30, pane["y"] + at["y"] - 30, steps=6)
    page.page.mouse.up()
    page.wait("station.drag.target === null")
    page.page.click("[data-pose=ready]")
    page.page.keyboard.press("Space")
    page.rest()
    assert set(page.get("said")) <= {"predicted"}
