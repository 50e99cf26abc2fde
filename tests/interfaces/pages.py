"""Waiting for pages in a real browser."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any


def until(holds: Callable[[], bool], patience: float = 15.0) -> None:
    end = time.monotonic() + patience
    while not holds():
        assert time.monotonic() < end
        time.sleep(0.01)


def wait(page: Any, expression: str, arg: Any = None) -> None:
    """Wait until an expression holds in a page; Playwright's own waiting needs what the page's policy forbids."""
    until(lambda: page.evaluate(expression, arg) is True)
