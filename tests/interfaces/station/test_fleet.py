"""A server of a fleet: its robots' processes know where the others are, and one page shows all of them."""

from __future__ import annotations

import os
import signal
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from interfaces import connect, connect_mobile
from interfaces.cli.main import exit_status
from interfaces.messages.control import Lease
from interfaces.runtime.live.whereabouts import Whereabouts, write_starts
from robots.fleet import read_fleet
from tests.interfaces.live_rig import Child, child
from tests.interfaces.pages import accessible, until
from vrs.clock import seconds_since_1970
from vrs.errors import FormatError

FLEET = """
[[robots]]
robot = "ipr"
name = "cart"
count = 2
body = "bare"
start = [2.0, 3.0, 0.0]
step = [1.2, 0.0]

[[robots]]
robot = "puma560"
body = "ideal"
start = [2.0, 1.0, 90.0]
"""
LISTED = "[...document.querySelectorAll('#robots b')].map((name) => name.textContent)"


def test_each_process_reads_what_the_others_wrote(tmp_path: Path) -> None:
    path, starts = tmp_path / "whereabouts", [(1.0, 2.0, 0.5), (3.0, 4.0, -0.5)]
    write_starts(path, starts)
    with Whereabouts(path) as one, Whereabouts(path) as other:
        assert [one.where(k) for k in (0, 1)] == starts
        one.put(0, (1.5, 2.5, 0.25))
        assert (other.where(0), other.where(1)) == ((1.5, 2.5, 0.25), starts[1])
        assert 0.0 <= other.time() < 60.0


def test_a_posture_that_is_half_written_isnt_read(tmp_path: Path) -> None:
    path = tmp_path / "whereabouts"
    write_starts(path, [(1.0, 2.0, 0.5)])
    with Whereabouts(path) as shared:
        row = path.read_bytes()[8:]
        path.write_bytes(struct.pack("=dQ", seconds_since_1970(), 3) + row[8:16] + struct.pack("=2d", 9.0, 9.0))
        assert shared.where(0) == (1.0, 2.0, 0.5)
        shared.put(0, (5.0, 6.0, 0.0))
        assert shared.where(0) == (5.0, 6.0, 0.0)


def test_whereabouts_that_cant_be_read_are_one_clear_error(tmp_path: Path) -> None:
    with pytest.raises(FormatError, match="No such file"):
        Whereabouts(tmp_path / "none")
    (tmp_path / "empty").touch()
    with pytest.raises(FormatError, match="empty"):
        Whereabouts(tmp_path / "empty")


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("serve", "--robots", "{}", "--robot", "ipr"), "robot must be left out: the fleet's file says it"),
        (("serve", "--robots", "{}", "--room", "home"), "room must be left out: the fleet's file says it"),
        (("serve", "--robots", "{}", "--robot-at", "127.0.0.1:1"), "each robot of a fleet is started here"),
        (("serve", "--robots", "nowhere.toml"), "No such file"),
        (("robot", "--robot", "{}#cart-9"), "must be one of cart-1, cart-2, puma560"),
        (("robot", "--robot", "{}#cart-1", "--room", "home"), "the fleet's file says where its robots are"),
        (("robot", "--robot", "ipr", "--whereabouts", "somewhere"), "left out but for a robot of a fleet"),
    ],
)
def test_what_a_fleet_cant_have_is_refused(
    options: tuple[str, ...], said: str, tmp_path: Path, capsys: Any
) -> None:
    path = tmp_path / "fleet.toml"
    path.write_text(FLEET)
    assert exit_status([option.format(path) for option in options]) == 2
    lines = capsys.readouterr().err.splitlines()
    assert said in " ".join(" ".join(lines).split())


@pytest.fixture(scope="module")
def served(tmp_path_factory: Any) -> Iterator[Child]:
    folder = tmp_path_factory.mktemp("fleet")
    (folder / "fleet.toml").write_text(FLEET)
    files = ("--recordings", folder / "kept", "--jobs", folder / "jobs.json")
    with child(
        "serve", "--robots", str(folder / "fleet.toml"), "--link-loss", "hold", "--port", "0", *map(str, files)
    ) as running:
        yield running


@pytest.mark.slow
def test_a_cart_stops_at_another_and_the_page_says_who_is_in_trouble(browser: Any, served: Child) -> None:
    at = served.url.removeprefix("http://").rstrip("/")
    page = browser.new_page(viewport={"width": 1280, "height": 720})
    errors: list[str] = []
    page.on("pageerror", lambda error: errors.append(str(error)))
    page.goto(served.url)
    until(lambda: page.evaluate(LISTED) == ["cart-1", "cart-2", "puma560"], 60.0)
    until(lambda: page.evaluate("document.getElementById('trouble').textContent.trim()") == "All well", 60.0)
    seen = "['cart-1', 'cart-2', 'puma560'].every((name) => fleet.scene.node('beside', name, 'real').visible)"
    until(lambda: page.evaluate(seen), 60.0)
    accessible(page)
    with connect_mobile(f"ws://{at}/robots/cart-1/ws") as cart, connect(f"ws://{at}/robots/puma560/ws") as arm:
        assert (cart.welcome.robot, arm.welcome.robot) == ("cart-1", "puma560")
        until(lambda: isinstance(lease := cart.acquire(), Lease) and lease.yours, 30.0)
        until(lambda: page.evaluate("fleet.robots.get('cart-1').held"), 60.0)
        until(lambda: page.evaluate(LISTED) == ["cart-1", "cart-2", "puma560"], 60.0)
        for _ in range(80):
            cart.drive(0.4, 0.0)
            cart.wait(lambda _: False, 0.1)
        stood = cart.postures
        assert stood is not None
        assert stood.real is not None
        # Boxes touch at 2.68 m; where it thinks it is, its wheels have turned a little more. Alone it'd be at 5 m.
        assert 2.5 < stood.real[0] < 3.0
        until(lambda: "touches something: cart-2" in page.evaluate("fleet.robots.get('cart-1').trouble"), 60.0)
    found = [path for path in Path("/proc").iterdir() if path.name.isdigit() and of(path, "cart-2", served)]
    os.kill(int(found[0].name), signal.SIGKILL)
    until(lambda: "has ended" in page.evaluate("fleet.robots.get('cart-2').trouble"), 60.0)
    page.click("#robots a[href='/robots/cart-1/']")
    until(lambda: page.url.endswith("/robots/cart-1/"))
    page.close()
    assert errors == []


def of(path: Path, name: str, server: Child) -> bool:
    """Whether a process is that of a robot of a fleet that a server started, and not its camera's."""
    try:
        parent = (path / "stat").read_text().rpartition(")")[2].split()[1]
        words = (path / "cmdline").read_bytes()
    except OSError:
        return False
    mine = b"--whereabouts" in words and f"fleet.toml#{name}".encode() in words
    return mine and int(parent) == server.process.pid


def test_a_fleet_of_the_docs_is_one(tmp_path: Path) -> None:
    text = (Path(__file__).parents[3] / "docs/howto/fleet.md").read_text()
    block = text.partition("```toml\n")[2].partition("```")[0]
    (tmp_path / "fleet.toml").write_text(block)
    assert len(read_fleet(tmp_path / "fleet.toml").members) == 24
