"""How tests are shared out to processes, and what runs where a world of physics isn't installed.

`VRS_WITHOUT=pybullet,pybullet_data` or `VRS_WITHOUT=mujoco` hides those modules from tests and from the processes
that they start. A test that fails because of one of them is skipped, and says which; everything else runs with what
is there.

A test against the clock that fails while the machine stood still is tried once more, and counted as tried again.
"""

from __future__ import annotations

import os
import re
import runpy
from collections.abc import Generator, Iterator
from functools import cache
from pathlib import Path
from typing import Any
from zlib import crc32

import pytest
from _pytest.runner import runtestprotocol

from tests.stood_still import LONG, StallWatch

WITHOUT = Path(__file__).parent / "without"
HIDDEN = frozenset(os.environ.get("VRS_WITHOUT", "").split(",")) - {""}
if HIDDEN and str(WITHOUT) not in os.environ.get("PYTHONPATH", "").split(os.pathsep):
    os.environ["PYTHONPATH"] = os.pathsep.join([str(WITHOUT), *filter(None, [os.environ.get("PYTHONPATH")])])
    runpy.run_path(str(WITHOUT / "sitecustomize.py"))

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
    """Run a test against the clock; once more, with new fixtures, if it fails while the machine stands still."""
    if not _matches(LIVE, str(item.path)):
        return None
    if STALLS not in item.config.stash:
        item.config.stash[STALLS] = StallWatch()
    stalls = item.config.stash[STALLS]
    item.ihook.pytest_runtest_logstart(nodeid=item.nodeid, location=item.location)
    stalls.reset()
    reports = runtestprotocol(item, log=False, nextitem=nextitem)
    if any(report.failed for report in reports) and stalls.longest > LONG:
        for report in reports:
            if report.failed:
                report.outcome = AGAIN
                report.sections.append(("machine", f"stood still for {stalls.longest:.3f} s"))
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


def _chain(error: BaseException | None) -> Iterator[BaseException]:
    """An error, and those that it was raised from or amid."""
    while error is not None:
        yield error
        error = error.__cause__ or error.__context__


def _skipped(report: Any, call: Any) -> None:
    """Let a failure for want of a hidden module count as skipped."""
    if HIDDEN and report.outcome == "failed" and call.excinfo is not None:
        for error in _chain(call.excinfo.value):
            if isinstance(error, ModuleNotFoundError) and error.name in HIDDEN:
                report.outcome = "skipped"
                report.longrepr = (report.nodeid.split("::", 1)[0], 0, f"Skipped: needs {error.name}")
                return


@pytest.hookimpl(wrapper=True)
def pytest_make_collect_report(collector: pytest.Collector) -> Generator[None, Any, Any]:
    """Skip files that need a hidden module."""
    report = yield
    _skipped(report, report.call)
    return report


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item, call: pytest.CallInfo[None]) -> Generator[None, Any, Any]:
    """Skip tests that need a hidden module."""
    report = yield
    _skipped(report, call)
    return report
