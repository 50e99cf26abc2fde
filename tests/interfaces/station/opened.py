"""The station in a browser: pages of one server, and what is asked of them."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from tests.interfaces.live_rig import Child
from tests.interfaces.pages import accessible

SERVE = ("serve", "--body", "ideal", "--link-loss", "hold")
"""A server for tests: quick, and its robot waits for a machine that is busy."""
PATIENCE = 60.0
NOTICE = "document.getElementById('notice').textContent"
"""What is said at the control that was used."""


def station(server: Child) -> str:
    """Where a server's station is."""
    return server.url.removesuffix("view")


def until(holds: Callable[[], Any], patience: float = PATIENCE, what: str = "") -> None:
    end = time.monotonic() + patience
    while not holds():
        assert time.monotonic() < end, what
        time.sleep(0.02)


class Page:
    """A page of the station, and the errors that it made."""

    def __init__(self, page: Any, url: str) -> None:
        self.page, self.url = page, url
        self.errors: list[str] = []
        self.elsewhere: list[str] = []
        self.breaks = False
        """Whether its connection is to break, of which browsers complain."""
        self.refused = False
        """Whether it's to ask for what it's refused, of which they complain too."""
        page.on("console", lambda m: self.errors.append(m.text) if m.type == "error" else None)
        page.on("pageerror", lambda e: self.errors.append(str(e)))
        page.on("request", lambda r: None if _own(r.url, url) else self.elsewhere.append(r.url))

    def open(self, *, live: bool = True) -> Page:
        self.page.goto(self.url, timeout=1000 * PATIENCE)
        self.wait("document.getElementById('station')?.dataset.ready === ''")
        # Software draws slowly; tests look at the arms' joints, not at their pictures.
        self.page.evaluate("station.scene.pacing.set(3)")
        if live:
            self.wait("station.session.link === 'live' && station.session.state !== null")
        return self

    def wait(self, expression: str, patience: float = PATIENCE) -> None:
        until(lambda: self.page.evaluate(expression), patience, expression)

    def settled(self, expression: str) -> None:
        """Wait for something in a page that may be loading anew."""
        from playwright.sync_api import Error

        def holds() -> bool:
            try:
                return bool(self.page.evaluate(f"window.station?.session && ({expression})"))
            except Error:
                return False

        until(holds, what=expression)

    def get(self, expression: str) -> Any:
        return self.page.evaluate(expression)

    def shoot(self, name: str) -> None:
        """Keep a picture of the page in the directory that VRS_SHOTS names, if it does."""
        directory = os.environ.get("VRS_SHOTS")
        if directory is None:
            return
        pacing = "station.scene.pacing"
        self.page.evaluate(f"{pacing}.set(0); {pacing}.viewer.set_dirty()")
        self.page.wait_for_timeout(800)
        self.page.screenshot(path=Path(directory) / f"{name}.png")
        self.page.evaluate(f"{pacing}.set(3)")

    def take_control(self) -> Page:
        self.page.click("#take")
        self.wait("station.session.holds")
        self.wait("!station.session.state.halted")
        return self

    @property
    def virtual(self) -> list[float]:
        found: list[float] = self.get("station.session.timeline.joints(station.session.now)")
        return found

    @property
    def real(self) -> list[float]:
        found: list[float] = self.get("station.session.state.q")
        return found

    def until(self, holds: Callable[[], Any]) -> None:
        """Wait; what the page says is told where that's in vain."""
        try:
            until(holds)
        except AssertionError:
            said = self.page.locator("#bar-panels, #receipts, .refused, #alert").all_text_contents()
            raise AssertionError(said) from None

    def accessible(self) -> None:
        """Find no fault that axe finds, light and dark."""
        for scheme in ("light", "dark"):
            self.page.emulate_media(color_scheme=scheme)
            accessible(self.page)

    def rest(self) -> None:
        """Wait until both robots rest where the plan ends."""
        self.wait(
            """(() => { const { timeline, now, state } = station.session; const end = timeline.joints(timeline.end);
            return now > timeline.end && state.q.every((x, k) => Math.abs(x - end[k]) < 1e-3); })()"""
        )


def _own(url: str, base: str) -> bool:
    return url.startswith((base, base.replace("http", "ws", 1), "data:", "blob:"))


@contextmanager
def paged(browser: Any, url: str, *, hints: bool = False, **given: Any) -> Iterator[Page]:
    """A page in a browser of its own; nothing but its server may have been asked, and nothing have failed."""
    options = {"viewport": {"width": 1280, "height": 720}, "color_scheme": "light", **given}
    context = browser.new_context(**options)
    if not hints:
        context.add_init_script("localStorage.setItem('vrs-hints', 'seen')")
    page = Page(context.new_page(), url)
    try:
        yield page
    finally:
        context.close()
    assert page.elsewhere == [], page.elsewhere
    expected = ("WebSocket connection", "ERR_") if page.breaks else ()
    expected += ("the server responded with a status of 40",) if page.refused else ()
    wrong = [text for text in page.errors if not any(word in text for word in expected)]
    assert wrong == [], wrong
