"""Waiting for pages in a real browser."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

from axe_core_python.sync_playwright import Axe


def until(holds: Callable[[], bool], patience: float = 15.0) -> None:
    end = time.monotonic() + patience
    while not holds():
        assert time.monotonic() < end
        time.sleep(0.01)


def wait(page: Any, expression: str, arg: Any = None) -> None:
    """Wait until an expression holds in a page; Playwright's own waiting needs what the page's policy forbids."""
    until(lambda: page.evaluate(expression, arg) is True)


def accessible(page: Any, within: str | None = None) -> None:
    """Find no fault that axe finds in a page, or within an element of it."""
    found = Axe().run(page, context=within)["violations"]
    assert not found, [(fault["id"], [node["html"] for node in fault["nodes"]]) for fault in found]
