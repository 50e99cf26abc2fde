"""How tests are shared out to processes."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path
from typing import Any

import pytest

BROWSER = re.compile(r"\b(browser|new_page)\b")


@cache
def _has_browser(file: str) -> bool:
    return bool(BROWSER.search(Path(file).read_text(encoding="utf-8")))


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    """One process has all files with a browser: two browsers that draw by software would take both cores.

    The other files go whole to whoever is free, so that what a file shares is made once. (xdist's own groups don't
    work with this pytest.)
    """
    from xdist.scheduler import LoadScopeScheduling

    class ByFile(LoadScopeScheduling):
        def _split_scope(self, nodeid: str) -> str:
            file = nodeid.split("::", 1)[0]
            return "browser" if _has_browser(str(config.rootpath / file)) else file

    return ByFile(config, log)
