"""How tests are shared out to processes, and what runs where a world of physics isn't installed.

`VRS_WITHOUT=pybullet,pybullet_data` or `VRS_WITHOUT=mujoco` hides those modules from tests and from the processes
that they start; where one isn't installed the same holds. What needs one says so, and is skipped: a test by the
mark `needs("pybullet")`, by a parameter that is the name of a world (`"bullet"`, `"mujoco"`, or a `partial` with
`world="bullet"`), or by importing the module itself. Everything else runs with what is there: if the product can't
do without, that's a failure. So is a mark on a test that passes without.

A test against the clock that fails while the machine stood still or was overloaded is tried once more, and counted
as tried again.
"""

from __future__ import annotations

import os
import re
import runpy
import traceback
from collections.abc import Generator
from functools import cache, partial
from importlib.util import find_spec
from pathlib import Path
from typing import Any
from zlib import crc32

import pytest
from _pytest.runner import runtestprotocol

from tests.stood_still import StallWatch

WITHOUT = Path(__file__).parent / "without"
HIDDEN = frozenset(os.environ.get("VRS_WITHOUT", "").split(",")) - {""}
if HIDDEN and str(WITHOUT) not in os.environ.get("PYTHONPATH", "").split(os.pathsep):
    os.environ["PYTHONPATH"] = os.pathsep.join([str(WITHOUT), *filter(None, [os.environ.get("PYTHONPATH")])])
    runpy.run_path(str(WITHOUT / "sitecustomize.py"))

HOME = Path(__file__).parents[1]
WORLDS = {"bullet": "pybullet", "mujoco": "mujoco"}
"""Modules of the worlds of physics, by the names of bodies."""
ABSENT = HIDDEN | {name for name in ("pybullet", "pybullet_data", "mujoco") if find_spec(name) is None}
"""Modules that aren't there, hidden ones among them."""
PRODUCT = ("vrs", "robots", "interfaces")
BROWSER = re.compile(r"\b(browser|new_page)\b")
LIVE = re.compile(rf"{BROWSER.pattern}|\b(monotonic|perf_counter|sleep|Popen|child)\b")
"""What a test uses that waits for the clock."""
AGAIN = "tried again"
STALLS = pytest.StashKey[StallWatch]()


@cache
def _matches(pattern: re.Pattern[str], file: str) -> bool:
    return bool(pattern.search(Path(file).read_text(encoding="utf-8")))


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    """Two processes have all files with a browser, which wait most of the time; three that draw would be in each
    other's way.

    The other files go whole to whoever is free, so that what a file shares is made once. (xdist's own groups don't
    work with this pytest.)
    """
    from xdist.scheduler import LoadScopeScheduling

    class ByFile(LoadScopeScheduling):
        def _split_scope(self, nodeid: str) -> str:
            file = nodeid.split("::", 1)[0]
            return f"browser {crc32(file.encode()) % 2}" if _matches(BROWSER, str(config.rootpath / file)) else file

    return ByFile(config, log)


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_protocol(item: pytest.Item, nextitem: pytest.Item | None) -> bool | None:
    """Run a test against the clock; once more, with new fixtures, if it fails while the machine holds it up."""
    if not _matches(LIVE, str(item.path)):
        return None
    if STALLS not in item.config.stash:
        item.config.stash[STALLS] = StallWatch()
    stalls = item.config.stash[STALLS]
    item.ihook.pytest_runtest_logstart(nodeid=item.nodeid, location=item.location)
    stalls.reset()
    reports = runtestprotocol(item, log=False, nextitem=nextitem)
    held_up = stalls.found()
    if any(report.failed for report in reports) and held_up:
        for report in reports:
            if report.failed:
                report.outcome = AGAIN
                report.sections.append(("machine", held_up))
                item.ihook.pytest_runtest_logreport(report=report)
        item.session._setupstate.teardown_exact(None)
        reports = runtestprotocol(item, log=False, nextitem=nextitem)
    for report in reports:
        item.ihook.pytest_runtest_logreport(report=report)
    item.ihook.pytest_runtest_logfinish(nodeid=item.nodeid, location=item.location)
    return True


@pytest.hookimpl(tryfirst=True)
def pytest_report_teststatus(report: pytest.TestReport) -> tuple[str, str, str] | None:
    """Count a first try apart: it's neither passed nor failed."""
    return (AGAIN, "A", "TRIED AGAIN") if report.outcome == AGAIN else None


def asked(value: object) -> str:
    """Return the module that a parameter asks for; empty for none."""
    if isinstance(value, partial):
        value = value.keywords.get("world")
    return WORLDS.get(value, "") if isinstance(value, str) else ""


def _lacks(item: pytest.Item) -> tuple[set[str], set[str]]:
    """Modules that aren't there and that a test asks for: by marks, and by parameters."""
    marked = {name for mark in item.iter_markers("needs") for name in mark.args}
    parameters = getattr(item, "callspec", None)
    values = () if parameters is None else parameters.params.values()
    return marked & ABSENT, {asked(value) for value in values} & ABSENT


def _imported(error: BaseException | None) -> str:
    """The module that isn't there and that a test imports itself; empty if the product did, or nobody."""
    while error is not None:
        if isinstance(error, ModuleNotFoundError) and error.name in ABSENT:
            frames = [Path(frame.filename) for frame in traceback.extract_tb(error.__traceback__)]
            inside = [any(path.is_relative_to(HOME / package) for package in PRODUCT) for path in frames]
            return "" if any(inside) else error.name
        error = error.__cause__ or error.__context__
    return ""


def _skip(report: Any, needs: str) -> None:
    report.outcome = "skipped"
    report.longrepr = (report.nodeid.split("::", 1)[0], 0, f"Skipped: needs {needs}")


@pytest.hookimpl(wrapper=True)
def pytest_make_collect_report(collector: pytest.Collector) -> Generator[None, Any, Any]:
    """Skip files that import a hidden module."""
    report = yield
    if ABSENT and report.outcome == "failed" and report.call.excinfo is not None:
        needs = _imported(report.call.excinfo.value)
        if needs:
            _skip(report, needs)
    return report


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item, call: pytest.CallInfo[None]) -> Generator[None, Any, Any]:
    """Skip tests that fail and need a hidden module; let those fail that say that they need one, and don't."""
    report = yield
    if ABSENT:
        marked, others = _lacks(item)
        if report.outcome == "failed":
            error = None if call.excinfo is None else call.excinfo.value
            needs = ", ".join(sorted(marked | others)) or _imported(error)
            if needs:
                _skip(report, needs)
        elif report.when == "call" and report.outcome == "passed" and marked:
            report.outcome = "failed"
            report.longrepr = f"says that it needs {', '.join(sorted(marked))}, and passes without"
    return report
