"""An arm and a mobile robot in one world: one server, one session clock, and each seen beside the other."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from interfaces import connect, connect_mobile
from interfaces.cli.main import exit_status
from interfaces.messages.control import Lease
from interfaces.recording.recording import open_recording
from interfaces.runtime.live.operator import APART
from interfaces.stream.connection import Connection
from interfaces.stream.meshcat.meshes import bodies
from robots import load
from robots.mobile.robot import place
from tests.interfaces.live_rig import Child, child
from tests.interfaces.station.opened import PATIENCE, Page, paged, station, until
from tests.interfaces.station.test_driving import gone, postures, rest

SERVE = ("serve", "--robot", "puma560", "--robot", "ipr", "--link-loss", "hold", "--body", "ideal", "--port", "0")
PLACE = """name => [['beside', name], ['beside', name, 'real', 'body', '0']].map((path) => {
    const node = station.scene.node(...path);
    node.updateMatrix();
    return node.matrix.toArray(); })"""
"""Where another robot's world is in a page's, and its first body in that."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: Any) -> Path:
    made: Path = tmp_path_factory.mktemp("several")
    return made


@pytest.fixture(scope="module")
def server(folder: Path) -> Iterator[Child]:
    files = ("--record", folder / "run.mcap", "--recordings", folder / "kept", "--jobs", folder / "jobs.json")
    with child(*SERVE, *map(str, files)) as running:
        yield running


def placed(page: Page, name: str) -> np.ndarray:
    """Where another robot's first body is in a page's scene [m]."""
    world, body = (np.array(X).reshape(4, 4).T for X in page.page.evaluate(PLACE, name))
    place: np.ndarray = (world @ body)[:3, 3]
    return place


def leased(robot: Connection) -> None:
    """Have control, once pages that had it are known to be gone."""
    end = time.monotonic() + PATIENCE
    while not (isinstance(answer := robot.acquire(), Lease) and answer.yours):
        assert time.monotonic() < end
        time.sleep(0.1)


@pytest.mark.slow
def test_a_page_of_each_robot_shows_both_and_moves_its_own(browser: Any, server: Child) -> None:
    url = station(server)
    with paged(browser, url) as arm, paged(browser, url) as base:
        arm.open()
        base.open()
        base.page.click("#robots a[href='/robots/ipr/']")
        base.settled("station.drives && station.scene")
        base.page.evaluate("station.scene.pacing.set(3)")
        for page in (arm, base):
            links = page.page.locator("#robots a")
            assert links.all_text_contents() == ["puma560", "ipr"]
        base.wait("Boolean(station.session.state.real)")
        for page, other in ((arm, "ipr"), (base, "puma560")):
            has = f"station.scene.node('beside', '{other}', 'real', 'body', '0').children.length > 0"
            page.wait(has)
        base.take_control()
        arm.take_control()
        start, rested = postures(base), arm.real
        base.page.keyboard.down("ArrowUp")
        base.until(lambda: min(gone(base, start)) > 0.3)
        base.page.keyboard.up("ArrowUp")
        rest(base)
        assert arm.real == pytest.approx(rested, abs=1e-3)
        x, y, theta = place("empty").start
        foot = np.array([x - APART * math.sin(theta), y + APART * math.cos(theta), -bodies(load("puma560"))[1]])
        # Each page has the other robot where it stands in its own robot's frame.
        there = postures(base)[1]
        until(lambda: math.dist(placed(arm, "ipr")[:2] + foot[:2], there[:2]) < 0.02)
        assert placed(base, "puma560") == pytest.approx(foot, abs=1e-6)
        arm.shoot("several-arm")
        base.shoot("several-base")
        base.page.click("#tab-record")
        base.wait("station.recordings.now?.name === 'run-ipr.mcap'")
        base.page.click("#record-end")
        base.wait("station.recordings.now === null")


def test_programs_choose_the_robot_and_share_the_clock(server: Child, folder: Path) -> None:
    at = station(server).removeprefix("http://").rstrip("/")
    with connect(at) as arm, connect_mobile(f"ws://{at}/robots/ipr/ws") as base:
        assert (arm.welcome.robot, base.welcome.robot) == ("puma560", "ipr")
        bound = arm.clock.uncertainty + base.clock.uncertainty + 0.05
        assert abs(arm.now() - base.now()) < bound
        leased(arm)
        leased(base)
    with open_recording(folder / "run-ipr.mcap") as recording:
        assert recording.session.robot == "ipr"


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--robot", "ipr", "--robot", "ipr"), "robot must be each robot once"),
        (
            ("--robot", "puma560", "--robot", "ipr", "--robot-at", "127.0.0.1:1"),
            "of several robots each is started",
        ),
        (("--robot", "ipr", "--robot", "micro", "--offset", "fixed"), "ipr, micro have nothing of the kind"),
    ],
)
def test_what_several_robots_cant_have_is_refused(options: tuple[str, ...], said: str, capsys: Any) -> None:
    assert exit_status(["serve", *options]) == 2
    assert said in " ".join(capsys.readouterr().err.split())
