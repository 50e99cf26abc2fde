"""Hints on the first visit: one at a time, in nobody's way, and gone once they were seen."""

from __future__ import annotations

from typing import Any

import pytest

from tests.interfaces.live_rig import Child
from tests.interfaces.station.opened import Page, paged, station

SHOWN = "!document.getElementById('hint').hidden"


def apart(page: Page) -> bool:
    """Whether the hint leaves STOP, what it says, and what the hint is about alone."""
    hint, *others = [page.page.locator(name).bounding_box() for name in ("#hint", "#stop", "#take", "#live")]
    return all(
        hint["x"] >= box["x"] + box["width"] or box["x"] >= hint["x"] + hint["width"]
        or hint["y"] >= box["y"] + box["height"] or box["y"] >= hint["y"] + hint["height"]
        for box in others if box is not None
    )  # fmt: skip


@pytest.mark.parametrize(("width", "height"), [(1280, 720), (1920, 1080)])
def test_three_hints_one_at_a_time_and_never_again(browser: Any, server: Child, width: int, height: int) -> None:
    viewport = {"width": width, "height": height}
    with paged(browser, station(server), hints=True, viewport=viewport) as page:
        page.open()
        page.wait(SHOWN)
        titles = []
        for _ in range(3):
            titles.append(page.page.locator("#hint-title").text_content())
            assert apart(page)
            page.page.locator("#hint-next").press("Enter")
        assert len(set(titles)) == 3
        assert not page.get(SHOWN)
        assert page.get("document.activeElement.id") == "help"
        page.open()
        assert not page.get(SHOWN)
        page.page.keyboard.press("Tab")
        page.page.locator("#help").press("Enter")
        assert page.get(f"{SHOWN} && document.activeElement.id === 'hint-next'")
        page.page.keyboard.press("Escape")
        assert not page.get(SHOWN)


def test_a_hint_stands_in_nobody_s_way(browser: Any, server: Child) -> None:
    with paged(browser, station(server), hints=True) as page:
        page.open()
        page.wait(SHOWN)
        page.take_control()
        assert page.get(SHOWN)
        page.page.click("[data-pose=ready]")
        page.wait("station.session.orders.entries.length === 1")
        page.page.keyboard.press("Space")
        page.wait("document.getElementById('alert').textContent === 'Stopping'")
        page.page.click("#hint-close")
        assert not page.get(SHOWN)
        page.open()
        assert not page.get(SHOWN)


@pytest.mark.parametrize(("width", "height"), [(390, 844), (844, 390)])
def test_on_a_phone_all_that_is_needed_is_in_sight(browser: Any, server: Child, width: int, height: int) -> None:
    with paged(browser, station(server), hints=True, viewport={"width": width, "height": height}) as page:
        page.open()
        page.wait(SHOWN)
        # Those of the page before may have control for a moment yet.
        page.wait("!document.getElementById('take').hidden && !document.getElementById('stop').hidden")
        page.wait("Boolean(document.getElementById('hint').style.left)")
        page.page.wait_for_timeout(100)
        hint, arrow, take, pane = (
            page.page.locator(name).bounding_box() for name in ("#hint", "#hint .arrow", "#take", "#pane-box")
        )
        tip = arrow["x"] + arrow["width"] / 2
        assert take["x"] < tip < take["x"] + take["width"], (arrow, take)
        assert hint["y"] - take["y"] - take["height"] < 24
        for name in ("#take", "#stop"):
            box = page.page.locator(name).bounding_box()
            assert 0 <= box["x"] <= width - box["width"]
            middle = f"{box['x'] + box['width'] / 2}, {box['y'] + box['height'] / 2}"
            assert page.get(f"document.elementFromPoint({middle}).closest('{name}') !== null"), name
        assert pane["width"] * pane["height"] >= 0.5 * width * height
        titles = []
        for _ in range(3):
            titles.append(page.page.locator("#hint-title").text_content())
            box = page.page.locator("#hint").bounding_box()
            assert 0 <= box["x"] <= width - box["width"]
            assert 0 <= box["y"] <= height - box["height"]
            page.page.click("#hint-next")
        assert len(set(titles)) == 3
        page.take_control()
        for name in ("#give", "#stop"):
            box = page.page.locator(name).bounding_box()
            assert 0 <= box["x"] <= width - box["width"]
        page.shoot(f"phone-{width}")
        page.page.click("#give")
