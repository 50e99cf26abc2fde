"""What `docs/safety.md` says of safety runs: its diagrams are walked against the objects of running sites."""

from __future__ import annotations

import ast
import asyncio
import gc
import re
import types
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import pytest

from interfaces import connect
from interfaces.messages.control import Role
from interfaces.runtime.live.paced_body import PacedBody, PacedConfig
from interfaces.runtime.live.robot import LiveRobot
from interfaces.runtime.physics_messages import PhysicsSetup
from interfaces.runtime.physics_process import tick_body
from interfaces.runtime.tick_loop import TickLoop
from interfaces.stream.access import Access
from interfaces.teleop import RobotSiteConfig
from interfaces.teleop.following_base import DrivenConfig
from robots import load
from robots.mobile.robot import place
from robots.onboard.watchdog import WatchdogConfig
from tests.interfaces.live_rig import HALT, MODEL, NOMINAL, operator_here, robot_here, until

DOCUMENT = Path(__file__).parents[2] / "docs" / "safety.md"
FUNCTIONS = {"too_far"}
"""Named there, and no classes."""


def diagrams() -> dict[str, set[str]]:
    """The classes and functions that each diagram names, by the line that introduces it."""
    found: dict[str, set[str]] = {}
    title = ""
    for line in DOCUMENT.read_text().split("## Watchdog")[0].splitlines():
        if line.startswith("`vrs"):
            title = line
            found[title] = set()
        elif line.startswith("    ") and title:
            found[title] |= set(re.findall(r"\b(?:[A-Z][a-z]+(?:[A-Z][a-z]+)*\b|too_far)", line))
    return found


def reachable(roots: Iterable[Any]) -> set[str]:
    """Names of the classes of all objects that others hold, from some on."""
    seen: set[int] = set()
    names: set[str] = set()
    waiting = list(roots)
    passed = (type, types.ModuleType, types.FrameType, types.FunctionType, types.CodeType, str, bytes, int, float)
    while waiting:
        one = waiting.pop()
        if id(one) in seen:
            continue
        seen.add(id(one))
        if isinstance(one, types.FunctionType):
            waiting += [cell.cell_contents for cell in one.__closure__ or ()]
            continue
        if isinstance(one, passed):
            continue
        names.add(type(one).__name__)
        home = type(one).__module__
        if home.split(".")[0] in {"vrs", "robots", "interfaces", "builtins", "collections"} or home == "functools":
            waiting += gc.get_referents(one)
    return names


def test_the_document_names_what_there_is() -> None:
    titles = list(diagrams().values())
    assert len(titles) == 3
    assert {"HubSession", "Leasing", "Lease"} <= titles[0]
    assert {"RobotHost", "FollowingArm", "Watchdog", "SensorMonitor", "Engine", "TickLoop", *FUNCTIONS} <= titles[1]
    assert {"FollowingBase", "Watchdog", "SoundPosition", "SensorWatch"} <= titles[2]


def test_what_the_diagrams_show_runs() -> None:
    serve, arm, mobile = diagrams().values()

    async def both() -> tuple[set[str], set[str]]:
        async with (
            robot_here(site=RobotSiteConfig(watchdog=HALT)) as (robot, url),
            operator_here(url) as (site, own),
        ):
            made = await asyncio.to_thread(connect, own, name="someone", timeout=20.0)
            try:
                await until(lambda: robot.host.site is not None)
                return reachable([site]), reachable([robot])
            finally:
                await asyncio.to_thread(made.close)

    operators, robots = asyncio.run(both())
    assert serve - operators == set()
    # The body's process makes its loop so.
    limits = tuple(map(tuple, (MODEL.limits.q_min, MODEL.limits.q_max, *[MODEL.limits.qd_max] * 3)))
    setup = PhysicsSetup("", "ideal", True, 0.001, 10, 0.0, 1, tuple(NOMINAL), limits)  # type: ignore[arg-type]
    with tick_body(setup) as body:
        loop = TickLoop(body, MODEL.limits, tuple(NOMINAL), tick=0.001, every=10, now=0.0)
        in_process = reachable([loop])
    assert arm - FUNCTIONS - robots - in_process == set()
    assert {"Watchdog", "SensorMonitor", "Engine"} <= robots
    assert "SensorMonitor" in in_process
    body = PacedBody(PacedConfig(load("ipr"), place("empty"), driven=DrivenConfig(watchdog=WatchdogConfig())))
    robot = LiveRobot(body, Access(free={Role.SITE}))
    try:
        robot.host.site = body.new_site(robot.clock.now())
        assert mobile - reachable([robot]) == set()
    finally:
        body.body.close()


@pytest.mark.parametrize("name", sorted(set(re.findall(r"`(test_\w+)\.py::(\w+)`", DOCUMENT.read_text()))))
def test_the_tests_that_it_names_are_there(name: tuple[str, str]) -> None:
    files = (DOCUMENT.parents[1] / "tests").rglob(f"{name[0]}.py")
    assert any(f"def {name[1]}(" in file.read_text() for file in files)


def uses(name: str, text: str) -> bool:
    """Whether a module's text has a name elsewhere than where it's defined."""
    return re.search(rf"(?<!class )(?<!def )\b{name}\b", text) is not None


def test_nothing_on_board_is_for_tests_alone() -> None:
    """Each class and function of safety on board is used by what isn't a test, not only defined."""
    root = DOCUMENT.parents[1]
    modules = {
        path: path.read_text() for folder in ("interfaces", "robots") for path in (root / folder).rglob("*.py")
    }
    names = [
        node.name
        for own in ("lease", "watchdog", "following", "servo", "playout")
        for node in ast.parse(modules[root / f"robots/onboard/{own}.py"]).body
        if isinstance(node, (ast.ClassDef, ast.FunctionDef)) and not node.name.startswith("_")
    ]
    assert len(names) > 30
    for name in names:
        assert any(uses(name, text) for text in modules.values()), name
    for text in re.findall(r"`([A-Z]\w+)\.\w+`", DOCUMENT.read_text()):
        assert any(re.search(rf"\bclass {text}\b", module) for module in modules.values()), text
