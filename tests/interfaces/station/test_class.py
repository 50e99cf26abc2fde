"""A class: codes bring people in with names, who waits is called, and the teacher gives and takes."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from interfaces.messages.control import Role
from interfaces.stream.access import make_tokens
from tests.interfaces.live_rig import Child, child
from tests.interfaces.station.opened import SERVE, Page, paged, station


@pytest.fixture(scope="module")
def taught(tmp_path_factory: Any) -> Iterator[tuple[Child, dict[Role, str]]]:
    path: Path = tmp_path_factory.mktemp("tokens") / "tokens"
    tokens = make_tokens(path)
    with child(*SERVE, "--class", "--token-file", str(path), "--port", "0") as server:
        yield server, tokens


def join(page: Page, shown: str, name: str = "") -> Page:
    """Come in as somebody, by a code or a token."""
    page.wait("document.getElementById('own-name') !== null")
    if name:
        page.page.fill("#own-name", name)
    if shown:
        page.page.fill("#token", shown)
    page.page.click("#enter")
    page.wait("station.session.link === 'live' && station.session.present !== null")
    return page


def standing(page: Page, name: str) -> str:
    found: str = page.get(
        "[...document.querySelectorAll('#members li')].find((one) => one.textContent.includes("
        f"'{name}'))?.textContent ?? ''"
    )
    return found


def test_a_class_joins_waits_and_is_called(browser: Any, taught: tuple[Child, dict[Role, str]]) -> None:
    server, tokens = taught
    with paged(browser, station(server)) as teacher:
        teacher.open(live=False)
        teacher.wait("document.getElementById('door').open")
        teacher.accessible()
        join(teacher, tokens[Role.ADMIN], "Teacher")
        teacher.page.click("#tab-class")
        teacher.wait("document.querySelectorAll('.invitations img').length === 2")
        teacher.accessible()
        code = teacher.page.locator("#join-operator .code").text_content()
        link = teacher.page.locator("#join-operator a").get_attribute("href")
        assert code is not None
        assert link is not None
        assert link.endswith(f"?code={code}")
        with paged(browser, station(server)) as one, paged(browser, station(server)) as two:
            two.url += f"?code={code}"
            one.open(live=False)
            one.wait("document.getElementById('own-name') !== null")
            one.page.fill("#token", "AAAAAA")
            one.page.click("#enter")
            one.wait("document.getElementById('refused').textContent.includes(\"isn't valid\")")
            join(one, code.lower(), "Ada")
            two.open(live=False)
            join(two, "", "Grace")
            assert "code" not in two.page.url
            teacher.until(lambda: standing(teacher, "Ada") and standing(teacher, "Grace"))
            one.take_control()

            two.wait("!document.getElementById('ask').hidden")
            two.page.click("#ask")
            two.wait("document.getElementById('control-pill').textContent.includes('number 1')")
            teacher.until(lambda: "waits, number 1" in standing(teacher, "Grace"))
            teacher.until(lambda: "has control" in standing(teacher, "Ada"))
            teacher.shoot("class")
            one.page.click("#give")
            two.wait("document.getElementById('control-pill').textContent.includes('your turn')")
            two.take_control()

            teacher.page.click("[data-do=give][aria-label='Give control to Ada']")
            one.wait("!document.getElementById('take').hidden && station.session.lease.offered_until")
            assert not two.get("station.session.holds")
            one.page.click("#withdraw")
            one.wait("!station.session.lease.offered_until")


def test_who_comes_back_needs_no_code_and_the_picture_is_there(
    browser: Any, taught: tuple[Child, dict[Role, str]]
) -> None:
    server, tokens = taught
    with paged(browser, station(server)) as teacher:
        teacher.open(live=False)
        join(teacher, tokens[Role.ADMIN])
        teacher.page.click("#tab-class")
        teacher.wait("document.querySelector('#join-viewer .code') !== null")
        code = teacher.page.locator("#join-viewer .code").text_content()
        assert code is not None
        with paged(browser, station(server)) as page:
            page.open(live=False)
            join(page, code, "Emmy")
            page.wait("station.scene?.node('vrs', 'virtual', 'body', '6').children.length > 0")
            page.page.reload()
            page.wait("window.station?.session.link === 'live' && station.session.welcome.role === 'viewer'")
            page.wait("station.scene?.node('vrs', 'virtual', 'body', '6').children.length > 0")
            assert page.page.locator("#ask").is_hidden()
            assert page.page.locator("#take").is_hidden()
            teacher.until(lambda: "watches" in standing(teacher, "Emmy"))
