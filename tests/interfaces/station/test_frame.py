"""The page's frame: by keyboard alone, with a gamepad, and how far what it shows can be trusted."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from typing import Any

import pytest

from tests.interfaces.live_rig import Child
from tests.interfaces.station.opened import Page, paged, station
from tests.interfaces.station.test_station import TOOL, moved, plan

PAD = """
const buttons = Array.from({ length: 17 }, () => ({ pressed: false, value: 0 }));
window.pad = { connected: true, axes: [0, 0, 0, 0], buttons };
navigator.getGamepads = () => [null, window.pad];
"""
FOCUSED = """(() => { const one = document.activeElement; const box = one.getBoundingClientRect();
const style = getComputedStyle(one); const shell = document.getElementById("station");
return one === document.body || !shell.contains(one) ? null : {
    place: ["bar", "hint", "pane-box", "splitter", "side", "strip-box"].findIndex((id) => one.closest("#" + id)),
    name: one.getAttribute("aria-label") || one.textContent.trim() || one.id || one.title,
    index: window.stops.indexOf(one), shown: style.outlineStyle !== "none" && parseFloat(style.outlineWidth) >= 2,
    inside: box.width > 0 && box.right < innerWidth + 2 && box.left > -2 && box.bottom < innerHeight + 2 }; })()"""
STOPS = """var every = "#station :is(button, input, select, summary, [tabindex='0'])";
window.stops = [...document.querySelectorAll(every)]
.filter((one) => one.tabIndex >= 0 && !one.disabled && one.checkVisibility()); stops.length"""


@pytest.fixture
def page(browser: Any, server: Child) -> Iterator[Page]:
    with paged(browser, station(server)) as opened:
        yield opened


def test_a_walk_by_keys_comes_by_everything(page: Page) -> None:
    page.open().take_control().rest()
    plan(page, "nominal" if page.virtual[1] > 1.2 else "ready", 60)
    page.page.click("#zoom-out")
    page.page.click("#zoom-out")
    for tab in ("jog", "network"):
        page.page.click(f"#tab-{tab}")
        count = page.get(STOPS)
        page.page.evaluate(
            "(() => { const begin = document.querySelector('h1'); begin.tabIndex = -1; begin.focus(); })()"
        )
        walked = []
        for _ in range(count + 5):
            page.page.keyboard.press("Tab")
            found = page.get(FOCUSED)
            if found is None:
                break
            walked.append(found)
        # The last one leads out of the page: there's no trap.
        assert found is None, walked[-3:]
        assert sorted({one["index"] for one in walked}) == list(range(count))
        assert [one["place"] for one in walked] == sorted(one["place"] for one in walked)
        assert [one for one in walked if not (one["shown"] and one["inside"] and one["name"])] == []


def test_stop_can_be_pressed_however_narrow_the_page_is(page: Page) -> None:
    page.open()
    # Those of the page before may have control for a moment yet.
    page.wait("!document.getElementById('stop').hidden")
    for width in (390, 640, 820, 1001):
        page.page.set_viewport_size({"width": width, "height": 720})
        box = page.page.locator("#stop").bounding_box()
        assert 0 <= box["x"] <= width - box["width"], width
        middle = f"{box['x'] + box['width'] / 2}, {box['y'] + box['height'] / 2}"
        assert page.get(f"document.elementFromPoint({middle}).closest('#stop') !== null"), width
        pane = page.page.locator("#pane-box").bounding_box()
        assert min(pane["width"], pane["height"]) > 150, width


def test_a_gamepad_moves_the_tool_and_its_b_stops(page: Page) -> None:
    page.page.add_init_script(PAD)
    page.open()
    page.wait("document.querySelector('.gamepad').textContent.includes('B stops')")
    still = page.virtual
    page.page.evaluate("pad.axes = [0, -1, 0, 0]")
    # Without control it moves nothing, and isn't a flood of refusals.
    page.wait("(window.began ??= station.session.now) + 0.5 < station.session.now")
    assert page.virtual == pytest.approx(still, abs=1e-9)
    assert page.get("station.session.orders.entries.length") == 0
    page.page.evaluate("pad.axes = [0, 0, 0, 0]")
    page.take_control().rest()
    still, start = page.virtual, page.get(TOOL)
    page.page.evaluate("pad.axes = [0, 0.05, 0, 0]")
    page.wait("(window.rested ??= station.session.now) + 0.5 < station.session.now")
    assert page.virtual == pytest.approx(still, abs=1e-9), "sticks don't rest quite in the middle"
    page.page.evaluate("pad.axes = [0, 0, 0, 0]; pad.buttons[6].value = 1")
    page.until(lambda: moved(page, 0.02, still))
    page.page.evaluate("pad.buttons[6].value = 0")
    page.rest()
    assert page.get(TOOL)[2] < start[2] - 0.005
    assert page.get(TOOL)[:2] == pytest.approx(start[:2], abs=0.01)
    page.page.evaluate("pad.axes = [0, 1, 0, 0]")
    between = page.virtual
    page.until(lambda: moved(page, 0.02, between))
    page.page.evaluate("pad.buttons[1].pressed = true; pad.axes = [0, 0, 0, 0]")
    page.wait("document.getElementById('alert').textContent === 'Stopping'")
    page.page.evaluate("pad.buttons[1].pressed = false; pad.connected = false")
    page.rest()
    page.wait("document.querySelector('.gamepad').hidden")


def test_what_a_command_changes_of_what_is_shown_is_falsified(page: Page) -> None:
    page.open().take_control().rest()
    move = plan(page, "nominal" if page.virtual[1] > 1.2 else "ready", 40)
    page.page.evaluate(
        """window.said = []; new MutationObserver(() => said.push(badge.dataset.status + " " + badge.textContent))
        .observe(document.getElementById('badge'), { attributes: true, attributeFilter: ["data-status"] })"""
    )
    page.page.evaluate(
        f"""var move = station.session.timeline.segments.find((s) => s.commandId === {move});
        station.cursor = move.start + 0.4"""
    )
    page.wait("badge.dataset.status === 'predicted'")
    page.page.locator(f".move[data-id='{move}']").press("Shift+ArrowRight")
    page.wait(f"said.some((text) => text.startsWith('falsified') && text.includes('Changed by #{move}'))")
    page.wait("badge.dataset.status === 'predicted'")
    # What changes behind the time that is shown falsifies nothing.
    page.page.evaluate("said.length = 0; station.cursor = station.session.now + 3")
    page.page.locator(f".move[data-id='{move}']").press("Delete")
    page.wait(f"!station.session.timeline.segments.some((s) => s.commandId === {move})")
    page.wait("station.session.now > station.cursor - 1")
    assert [text for text in page.get("said") if text.startswith("falsified")] == []
    page.page.evaluate("station.cursor = station.session.now - 1")
    page.wait("badge.dataset.status === 'confirmed'")


def test_live_is_off_while_the_picture_is_old(page: Page, server: Child) -> None:
    page.breaks = True
    page.open()
    live = "document.getElementById('live').getAttribute('aria-pressed') === '%s'"
    page.wait(live % "true")
    server.kill(signal.SIGSTOP)
    try:
        page.wait(f"station.session.link === 'stale' && {live % 'false'} || station.session.link === 'lost'")
        page.wait(f"station.session.link === 'lost' && {live % 'false'}")
        assert "old" in page.page.locator("#live").get_attribute("title")
    finally:
        server.kill(signal.SIGCONT)
    page.settled(f"station.session.link === 'live' && {live % 'true'}")
