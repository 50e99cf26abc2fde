"""The page of a relay in a browser, with servers and relays in processes of their own."""

from __future__ import annotations

import signal
import time

import pytest

from interfaces import connect, connect_mobile
from tests.interfaces.live_rig import child
from tests.interfaces.relay.rig import endpoint, routing
from tests.interfaces.station.opened import SERVE, paged, until
from vrs import JointTarget, MotionCommand

pytestmark = [pytest.mark.slow, pytest.mark.needs("zenoh")]


def test_a_page_shows_what_a_viewer_may_see_and_goes_to_another_relay_when_its_own_is_killed(tmp_path, browser):
    at = endpoint()
    view = ("view", "--zenoh", at, "--port", "0")
    with (
        routing(at),
        child(*SERVE, "--port", "0", "--zenoh", at, "--recordings", str(tmp_path)) as server,
        child(*view) as one,
        child(*view) as two,
        connect(server.url.removesuffix("/view")) as robot,
    ):
        one.wait(lambda facts: facts["ok"] and facts["others"])
        two.wait(lambda facts: facts["ok"])
        assert robot.acquire().yours
        assert robot.wait(lambda _: robot.state is not None and not robot.state.halted, 20.0)
        with paged(browser, one.url) as page:
            page.open()
            panels = page.get("station.config.panels.map(({name}) => name)")
            assert {"pane", "strip", "plots", "control"} <= set(panels)
            assert not {"jog", "stop", "drag", "terminal", "record", "network"} & set(panels)
            assert page.get("document.getElementById('served').href") == server.url.removesuffix("view")
            assert page.get("document.getElementById('take').hidden")
            move = MotionCommand(JointTarget(robot.welcome.poses["ready"]), speed=0.9)
            assert robot.designer.issue(move, wait=5.0).receipt.status == "accepted"
            page.wait("station.session.timeline.segments.length > 0")
            page.wait("station.session.lease.holder === 'client'")
            page.wait("document.getElementById('save').ariaDisabled === 'true'")
            page.shoot("relay")

            page.breaks = True
            killed = time.monotonic()
            one.kill()
            page.page.wait_for_url(two.url, wait_until="commit")
            page.settled("station.session.link === 'live' && station.session.timeline?.segments.length > 0")
            took = time.monotonic() - killed
            # Within 2 s on a machine that has time for it.
            assert took < 10.0

            server.kill(signal.SIGKILL)
            page.settled("station.session.link === 'lost' && station.session.unheard")
            assert page.page.url == two.url
            assert all(asked.startswith((two.url, two.url.replace("http", "ws"))) for asked in page.elsewhere)
            page.elsewhere.clear()
            assert not two.health()["ok"]


def test_a_mobile_robot_is_relayed(tmp_path, browser):
    at = endpoint()
    serve = ("serve", "--robot", "ipr", "--link-loss", "hold", "--camera", "0", "--port", "0")
    with (
        routing(at),
        child(
            *serve, "--zenoh", at, "--recordings", str(tmp_path), "--jobs", str(tmp_path / "jobs.json")
        ) as server,
        child("view", "--zenoh", at, "--port", "0") as relay,
    ):
        relay.wait(lambda facts: facts["ok"])
        with (
            connect_mobile(server.url.removesuffix("/view")) as robot,
            connect_mobile(relay.url.rstrip("/"), role="viewer") as one,
        ):
            assert robot.acquire().yours
            assert robot.wait(lambda _: robot.postures is not None and not robot.postures.halted, 20.0)
            end = time.monotonic() + 2.0
            while time.monotonic() < end:
                robot.drive(0.3, 0.0)
                time.sleep(0.1)
            until(lambda: one.postures is not None and one.postures.virtual.x > 0.2)
            assert one.lease.holder == "client"
        with paged(browser, relay.url) as page:
            page.open()
            page.shoot("relay-mobile")
