"""Hints on the first visit: one at a time, in nobody's way, and gone once they were seen."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

from tests.interfaces.live_rig import Child, child
from tests.interfaces.station.opened import SERVE, Page, paged, station

SHOWN = "!document.getElementById('hint').hidden"


@pytest.fixture(scope="module")
def server() -> Iterator[Child]:
    with child(*SERVE, "--port", "0") as running:
        yield running


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
