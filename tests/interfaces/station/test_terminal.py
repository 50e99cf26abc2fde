"""The terminal on the page: VAL-II under the page's own control, and STOP."""

from __future__ import annotations

import json
import time
from pathlib import Path
from typing import Any

import pytest
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

from interfaces.messages.control import Role
from interfaces.stream.access import make_tokens
from interfaces.val2.pages import LARGEST
from tests.interfaces.live_rig import Child, child
from tests.interfaces.pages import accessible
from tests.interfaces.station.opened import PATIENCE, SERVE, Page, paged, station

TEXT = "station.terminal.text"
PASTE = """(text) => { const data = new DataTransfer(); data.setData("text/plain", text);
    const given = { clipboardData: data, bubbles: true, cancelable: true };
    document.getElementById("terminal-input").dispatchEvent(new ClipboardEvent("paste", given)); }"""
LOOP = "edit loop\n10 drive 1,25,20\ndrive 1,-25,20\ngoto 10\ne\n"


@pytest.fixture(scope="module")
def tokens(tmp_path_factory: Any) -> tuple[Path, dict[Role, str]]:
    path = tmp_path_factory.mktemp("tokens") / "tokens"
    return path, make_tokens(path)


def shows(page: Page, expression: str) -> None:
    """Wait; what stands in the terminal is told where that's in vain."""
    try:
        page.wait(expression)
    except AssertionError:
        raise AssertionError((expression, page.get(TEXT), page.get("station.session.lease"))) from None


def terminal(page: Page) -> Page:
    """Open the tab, and wait for the prompt."""
    page.page.click("#tab-terminal")
    page.wait(f"station.terminal !== null && {TEXT}.endsWith('\\n.')")
    page.page.focus("#terminal-input")
    return page


def said(page: Page, lines: str, until: str) -> str:
    """Type, and wait for what is said."""
    before = len(page.get(TEXT))
    page.page.evaluate(PASTE, lines + "\n")
    shows(page, f"{TEXT}.slice({before}).includes({json.dumps(until)})")
    return str(page.get(TEXT))[before:]


def test_a_person_who_has_control_types_and_moves_and_stops(browser: Any, server: Child) -> None:
    with paged(browser, station(server)) as page:
        terminal(page.open().take_control())
        page.rest()
        begin = page.virtual[0]
        said(page, "do drive 1,20,50", "\n.")
        page.until(lambda: page.virtual[0] == pytest.approx(begin + 0.349066, abs=1e-4))
        assert page.get("station.session.holds")
        said(page, LOOP + "execute loop,-1", "\n*")
        page.wait("station.session.timeline.end > station.session.now")
        # A space that is typed stops nothing; Escape leaves; the space bar stops then.
        page.page.keyboard.press("Space")
        page.page.keyboard.press("Escape")
        assert page.get("document.activeElement.id") == "tab-terminal"
        assert page.get("document.getElementById('alert').textContent") != "Stopping"
        page.page.keyboard.press("Space")
        shows(page, f"{TEXT}.includes('*Motion interrupted*')")
        page.rest()
        still, edits = page.virtual, page.get("station.session.timeline.segments.length")
        time.sleep(1.5)
        assert page.virtual == pytest.approx(still, abs=1e-9)
        assert page.get("station.session.timeline.segments.length") == edits
        # The button works with the focus in the terminal, which keeps it, and so does Ctrl-C.
        page.page.focus("#terminal-input")
        said(page, "execute loop,-1", "\n*")
        page.wait("station.session.timeline.end > station.session.now")
        page.page.click("#stop")
        shows(page, f"{TEXT}.split('*Motion interrupted*').length === 3")
        page.rest()
        assert page.get("document.activeElement.id") == "terminal-input"
        said(page, "retry", "\n*")
        page.page.keyboard.press("Control+c")
        shows(page, f"{TEXT}.includes('(ABORT)')")
        page.rest()
        assert page.get("station.session.holds")


def test_lines_are_edited_completed_and_recalled(browser: Any, server: Child) -> None:
    with paged(browser, station(server)) as page:
        terminal(page.open())
        keys = page.page.keyboard
        page.page.keyboard.type("stat")
        keys.press("Tab")
        shows(page, f"{TEXT}.endsWith('.status')")
        for key in ("Home", "x", "Delete", "s", "End", "ArrowLeft", "ArrowLeft", "Control+k", "Backspace"):
            keys.press(key)
        shows(page, f"{TEXT}.endsWith('.xstat')")
        keys.press("Control+u")
        said(page, "listr 6*7", "42")
        keys.press("ArrowUp")
        shows(page, f"{TEXT}.endsWith('.listr 6*7')")
        keys.press("Control+c")
        # An example is loaded by a click; the page takes control for it once a page before has lost it.
        page.wait("station.session.lease.state === 'free'")
        page.page.select_option("#terminal-file", "05_circle")
        page.page.click("#terminal-load")
        shows(page, f"{TEXT}.includes('05_circle.v2: ')")
        assert page.get("station.session.holds")
        # A program asks, and what is pasted answers.
        said(page, 'edit ask\nprompt "n? ", n\ntype "twice:", 2*n\ne\nexecute ask\n', "n? ")
        said(page, "21", "twice: 42")
        # Control characters of a program do nothing to the terminal.
        assert "[31mred" in said(page, 'do type $chr(27), "[31mred"', "red\n")
        long = "listr " + " + ".join(["1"] * 60)
        said(page, long, "\n60\n")
        columns = page.get("station.terminal.columns")
        page.page.focus("#splitter")
        for _ in range(8):
            keys.press("ArrowLeft")
        page.wait(f"station.terminal.columns > {columns}")
        assert "*Too many" not in page.get(TEXT)


@pytest.mark.slow
def test_who_only_watches_and_who_has_no_control(browser: Any, tokens: tuple[Path, dict[Role, str]]) -> None:
    path, known = tokens
    with child(*SERVE, "--token-file", str(path), "--port", "0") as server:

        def enter(page: Page, token: str) -> Page:
            page.open(live=False)
            page.wait("document.getElementById('door').open")
            page.page.fill("#token", token)
            page.page.click("#enter")
            page.wait("station.session.link === 'live' && station.session.state !== null")
            return page

        with paged(browser, station(server)) as page, paged(browser, station(server)) as viewer:
            enter(page, known[Role.OPERATOR]).take_control()
            terminal(enter(viewer, known[Role.VIEWER]))
            assert "only looks" in viewer.get(TEXT)
            assert viewer.page.locator(".programs").is_hidden()
            assert "*No control*" in said(viewer, "do ready", "only looks\n.")
            assert "X/JT1" in said(viewer, "where", "HAND")
            accessible(viewer.page)
            with paged(browser, station(server)) as second:
                terminal(enter(second, known[Role.OPERATOR]))
                before = page.virtual
                assert "has control" in said(second, "do ready", "has control\n")
                assert page.virtual == before
                assert page.get("station.session.holds")
        url = station(server).replace("http", "ws", 1) + "val"
        for first in (
            '{"type":"hello","token":"wrong"}', '{"type":"lines","lines":["where"]}', "{", "x" * (LARGEST + 1),
            '{"type":"hello","token":null,"holds":1}',
        ):  # fmt: skip
            with connect(url) as stranger:
                stranger.send(first)
                with pytest.raises(ConnectionClosed) as closed:
                    stranger.recv(timeout=PATIENCE)
                assert closed.value.rcvd is not None
                assert closed.value.rcvd.code == 1008
