"""A server with tokens: who comes in as what; and a server that hangs, is killed, and comes again."""

from __future__ import annotations

import signal
import time
from pathlib import Path
from typing import Any

import pytest

from interfaces.messages.control import Role
from interfaces.stream.access import make_tokens
from tests.interfaces.live_rig import child
from tests.interfaces.station.opened import SERVE, Page, paged, station

LOST = (
    "station.on('link', (link) => { if (link === 'lost') lostAt ??= performance.timeOrigin + performance.now(); })"
)


@pytest.fixture(scope="module")
def tokens(tmp_path_factory: Any) -> tuple[Path, dict[Role, str]]:
    path = tmp_path_factory.mktemp("tokens") / "tokens"
    return path, make_tokens(path)


def enter(page: Page, token: str) -> None:
    page.wait("document.getElementById('door').open")
    page.page.fill("#token", token)
    page.page.click("#enter")


def test_tokens_and_a_server_that_goes_and_comes(browser: Any, tokens: tuple[Path, dict[Role, str]]) -> None:
    path, known = tokens
    serve = (*SERVE, "--token-file", str(path))
    with child(*serve, "--port", "0") as server, paged(browser, station(server)) as page:
        page.open(live=False)
        enter(page, "wrong" * 10)
        page.wait("document.getElementById('refused').textContent.includes(\"isn't valid\")")
        assert page.get("station.session.welcome") is None
        assert page.get("sessionStorage.getItem('token')") is None
        page.shoot("token")
        enter(page, known[Role.OPERATOR])
        page.wait("station.session.link === 'live' && station.session.state !== null")
        page.wait("station.scene.node('vrs', 'virtual', 'body', '6').children.length > 0")
        assert page.get("station.session.welcome.role") == "operator"
        assert known[Role.OPERATOR] not in page.page.url
        page.take_control()

        with paged(browser, station(server)) as watching:
            watching.open(live=False)
            enter(watching, known[Role.VIEWER])
            watching.wait("station.session.link === 'live'")
            assert watching.page.locator("#take").is_hidden()
            assert watching.page.locator("#take-over").is_hidden()
        with paged(browser, station(server)) as admin:
            admin.open(live=False)
            enter(admin, known[Role.ADMIN])
            admin.wait("station.session.link === 'live' && station.session.lease.state === 'held'")
            admin.page.click("#take-over")
            admin.page.click("#take-over-yes")
            admin.wait("station.session.holds")
            page.wait("!station.session.holds")
            admin.page.click("#give")
        page.wait("station.session.lease.state === 'free'")
        page.take_control()
        page.breaks = True
        page.page.evaluate(f"window.lostAt = null; {LOST}")
        stopped = time.time()
        server.kill(signal.SIGSTOP)
        page.wait("lostAt !== null")
        assert page.get("lostAt") / 1000 - stopped < 2.0
        assert "old" in page.page.locator("#banner").text_content()
        assert page.page.locator("#link-pill").text_content().endswith("Lost")
        page.shoot("lost")
        page.page.keyboard.press("Space")
        page.wait("document.getElementById('alert').textContent.startsWith('STOP: no')")
        page.wait("document.getElementById('stop').dataset.waits === ''")
        server.kill()
        port = station(server).rstrip("/").rpartition(":")[2]
        server.process.wait(10)
        with child(*serve, "--port", port):
            # The page is loaded anew where the server is another one.
            page.settled("station.session.link === 'live' && station.session.state !== null")
            page.settled("document.getElementById('stop').dataset.waits === undefined")
            assert page.page.locator("#door[open]").count() == 0


def test_a_stop_waits_for_its_connection(browser: Any) -> None:
    with child(*SERVE, "--port", "0") as server, paged(browser, station(server)) as page:
        page.breaks = True
        page.open().take_control().rest()
        page.page.fill("#speed", "5")
        page.page.click("[data-pose=ready]")
        page.wait("station.session.timeline.end > station.session.now + 3")
        page.page.evaluate(f"window.lostAt = null; {LOST}")
        # The page loses its connection; the server keeps the lease for a while.
        page.page.evaluate("station.session.wire.close(); station.session.lose()")
        page.page.keyboard.press("Space")
        page.wait("station.session.link === 'live'")
        page.wait("station.session.timeline.end < station.session.now + 1.5")
        stop = "station.session.orders.entries.filter((entry) => entry.command?.type === 'stop')"
        page.wait(f"{stop}.length > 0 && {stop}[0].outcome !== null")
        assert page.get(f"{stop}[0].outcome.refusal ?? ''") == ""
        page.rest()
