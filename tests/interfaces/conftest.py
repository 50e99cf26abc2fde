"""A real browser for tests of pages."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from typing import Any

import pytest

FLAGS = [
    "--no-sandbox",
    "--disable-quic",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    # Else laying out the page is drawn by software too, and takes a core.
    "--disable-gpu-compositing",
]


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    """Chromium; without the program the test is skipped, or fails in continuous integration."""
    program = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
    if program is None:
        if os.environ.get("CI") == "true":
            pytest.fail("no Chromium: install the program chromium")
        pytest.skip("no Chromium: install the program chromium")
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        instance = playwright.chromium.launch(executable_path=program, args=FLAGS)
        yield instance
        instance.close()


@pytest.fixture
def new_page(browser: Any) -> Iterator[Any]:
    """Makes empty pages; at the end none may have shown an error, or have asked for what isn't its own."""
    seen: list[str] = []
    contexts = []

    def start(own: str, width: int, height: int, scheme: str, expected: str | None = None, **options: Any) -> Any:
        """Make a page whose addresses begin with `own`; errors at its console that hold `expected` may be."""
        context = browser.new_context(viewport={"width": width, "height": height}, color_scheme=scheme, **options)
        contexts.append(context)
        page = context.new_page()

        def console(message: Any) -> None:
            if message.type == "error" and (expected is None or expected not in message.text):
                seen.append(message.text)

        page.on("console", console)
        page.on("pageerror", lambda e: seen.append(str(e)))
        page.on("request", lambda r: None if r.url.startswith((own, "data:")) else seen.append(r.url))
        return page

    yield start
    for context in contexts:
        context.close()
    assert seen == []
