"""The panel of the link: what is emulated, changed on the fly, and what is measured."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

from tests.interfaces.live_rig import Child, child
from tests.interfaces.station.opened import SERVE, Page, paged, station, until

CHANGED = "station.session.network?.changed_by"


@pytest.fixture(scope="module")
def server() -> Iterator[Child]:
    with child(*SERVE, "--delay", "constant:0.02", "--seed", "7", "--port", "0") as running:
        yield running


@pytest.fixture
def page(browser: Any, server: Child) -> Iterator[Page]:
    with paged(browser, station(server)) as opened:
        opened.open()
        opened.page.click("#tab-network")
        yield opened


def text(page: Page, name: str) -> str:
    found: str = page.page.locator(f"#net-{name}").text_content()
    return found


def test_the_way_changes_on_the_fly_and_others_see_it(browser: Any, server: Child, page: Page) -> None:
    with paged(browser, station(server)) as other:
        other.open()
        other.page.click("#tab-network")
        until(lambda: "ms" in text(other, "median-backward"))
        assert text(other, "seed") == "7"
        assert "127.0.0.1" in text(other, "robot")
        assert other.page.locator("#net-delay-forward").is_disabled()
        assert "Take control" in text(other, "needs")
        page.take_control()
        page.page.fill("#net-delay-forward", "constant:0.15")
        page.page.fill("#net-loss-forward", "0.1")
        page.page.select_option("#net-service-forward", "in-order")
        assert page.page.input_value("#net-delay-backward") == "constant:0.15"
        page.page.uncheck("#net-same")
        page.page.fill("#net-loss-backward", "0")
        page.page.select_option("#net-service-backward", "datagram")
        page.page.fill("#net-delay-backward", "constant:0.08")
        page.page.press("#net-delay-backward", "Enter")
        page.wait(CHANGED)
        other.wait(CHANGED)
        until(lambda: other.page.input_value("#net-delay-forward") == "constant:0.15")
        assert other.page.input_value("#net-delay-backward") == "constant:0.08"
        assert other.page.input_value("#net-service-forward") == "in-order"
        until(lambda: text(other, "median-backward") == "80 ms")
        # What in order was lost once comes a second late, with all behind it.
        until(lambda: text(other, "median-forward") not in {"–", "20 ms"})
        until(lambda: other.page.locator("#strip-box .event[title*='changed the way']").count() == 1)
        assert server.health()["delay"] == "constant:0.15"


def test_what_is_wrong_is_said_and_stays_to_be_mended(page: Page) -> None:
    page.take_control()
    page.wait("!document.getElementById('net-delay-forward').disabled")
    before = page.get("JSON.stringify([station.session.network.forward, station.session.network.changed_at])")
    page.page.fill("#net-delay-forward", "tomorrow")
    page.page.fill("#net-loss-forward", "0.3")
    page.page.click("#net-apply")
    until(lambda: "delay profile must be none, constant:S" in text(page, "fault"))
    assert page.page.locator("#net-delay-forward").get_attribute("aria-invalid") == "true"
    assert page.page.locator("#net-loss-forward").get_attribute("aria-invalid") is None
    # News of the way doesn't take away what is being written.
    page.wait("(window.seen ??= station.session.network) !== station.session.network")
    assert page.page.input_value("#net-delay-forward") == "tomorrow"
    assert page.page.input_value("#net-loss-forward") == "0.3"
    now = page.get("JSON.stringify([station.session.network.forward, station.session.network.changed_at])")
    assert now == before
    page.page.click("#net-reset")
    assert page.page.input_value("#net-delay-forward") != "tomorrow"
    assert text(page, "fault") == ""


def test_a_hidden_panel_asks_nothing(page: Page) -> None:
    page.page.evaluate("window.told = 0; station.on('network', () => told++)")
    page.wait("told >= 2")
    page.page.click("#tab-jog")
    page.page.evaluate("told = 0")
    heard = page.get("station.session.now")
    page.wait(f"station.session.now > {heard} + 2.5")
    # One that was asked before may come.
    assert page.get("told") <= 1


def test_losses_are_counted_before_their_share_is_shown(page: Page) -> None:
    page.take_control()
    page.page.evaluate(
        """window.told = []; station.on("network", ({ there }) => setTimeout(() =>
        told.push([document.getElementById("net-lost-forward").textContent, there.packets ?? 0])))"""
    )
    wish = "station.session.wish('impair', { forward: { delay: 'constant:1.2', loss: '0.2' } })"
    assert page.get(wish)
    page.wait("station.session.network.forward.loss === '0.2'")
    page.get("told.length = 0")
    assert page.get(wish.replace("0.2", "0.21"))
    page.wait("told.length >= 2 && told.at(-1)[0].includes('%')")
    told = page.get("told")
    assert {"%" in cell for cell, packets in told if packets < 100} == {False}
    share, _, count = told[-1][0].partition(" % of ")
    assert 0.08 < float(share) / 100 < 0.4
    assert int(count) >= 100
    assert any("%" not in cell and " of " in cell for cell, _ in told)
    assert text(page, "span-forward").startswith("in the last ")
    page.shoot("link")
    assert page.get("station.session.wish('impair', { forward: { delay: 'constant:0.02' } })")
    page.wait("station.session.network.forward.delay === 'constant:0.02'")
