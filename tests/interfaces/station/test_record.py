"""Recording on the fly from the page, and replaying it there: one recording, and two side by side."""

from __future__ import annotations

import contextlib
import json
import socket
import time
import urllib.error
import urllib.request
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from websockets.sync.client import connect

from interfaces.cli.main import exit_status
from interfaces.messages.control import Role
from interfaces.recording.recording import open_recording
from interfaces.recording.rerun import rerun
from interfaces.stream.access import make_tokens
from robots import puma560
from tests.interfaces.live_rig import Child, child
from tests.interfaces.pages import accessible
from tests.interfaces.station.opened import SERVE, Page, paged, station, until

MODEL = puma560.model()
LIVE = Path(__file__).parents[2] / "contract/data/recordings/live.mcap"
NOW = "station.recordings.now"
POSES = """([k, twin]) => [0, 1, 2, 3, 4, 5, 6].map((i) => {
    const node = replay.node(k, 'vrs', twin, 'body', String(i));
    node.updateMatrix();
    return node.matrix.toArray(); })"""


class Served(NamedTuple):
    server: Child
    directory: Path
    tokens: dict[Role, str]

    def ask(self, request: object, role: Role | None = Role.OPERATOR, **headers: str) -> tuple[int, dict[str, Any]]:
        """What the server answers to a request, and with which status."""
        given = {"Content-Type": "application/json", **headers}
        if role is not None:
            given["Authorization"] = f"Bearer {self.tokens[role]}"
        data = request if isinstance(request, bytes) else json.dumps(request).encode()
        made = urllib.request.Request(station(self.server) + "recordings", data, given)
        try:
            with urllib.request.urlopen(made, timeout=20) as answer:
                return answer.status, json.load(answer)
        except urllib.error.HTTPError as refused:
            with refused:
                body = refused.read()
            return refused.code, json.loads(body) if body.startswith(b"{") else {}

    def get(self, path: str) -> bytes:
        with urllib.request.urlopen(station(self.server) + path.lstrip("/"), timeout=20) as answer:
            found: bytes = answer.read()
        return found


@pytest.fixture(scope="module")
def served(tmp_path_factory: Any) -> Iterator[Served]:
    folder = tmp_path_factory.mktemp("served")
    tokens = make_tokens(folder / "tokens")
    directory = folder / "kept" / "recordings"
    first = folder / "from the start.mcap"
    options = ("--token-file", str(folder / "tokens"), "--recordings", str(directory), "--record", str(first))
    with child(*SERVE, *options, "--port", "0") as server:
        yield Served(server, directory, tokens)


def enter(page: Page, served: Served, role: Role) -> Page:
    page.open(live=False)
    page.wait("document.getElementById('door').open")
    page.page.fill("#token", served.tokens[role])
    page.page.click("#enter")
    page.wait("station.session.link === 'live' && station.session.state !== null")
    page.page.click("#tab-record")
    return page


@pytest.fixture(scope="module")
def page(browser: Any, served: Served) -> Iterator[Page]:
    with paged(browser, station(served.server)) as opened:
        enter(opened, served, Role.OPERATOR).take_control()
        opened.page.click("#tab-jog")
        opened.page.fill("#speed", "60")
        opened.page.click("#tab-record")
        # What `--record` began with is shown, and ended.
        opened.wait(f"{NOW}?.name === 'from the start.mcap'")
        opened.page.click("#record-end")
        opened.wait(f"{NOW} === null")
        yield opened


def to(page: Page, pose: str) -> None:
    """Let the robot go somewhere."""
    end = page.get("station.session.timeline.end")
    page.page.click("#tab-jog")
    page.page.click(f"[data-pose={pose}]")
    page.page.click("#tab-record")
    page.wait(f"station.session.timeline.end > {end}")
    page.rest()


def record(page: Page, name: str, *poses: str) -> None:
    page.page.fill("#record-name", name)
    page.page.click("#record-begin")
    page.wait(f"{NOW}?.name === '{name}.mcap' && {NOW}.size > 0")
    for pose in poses:
        to(page, pose)
    page.page.click("#record-end")
    page.wait(f"{NOW} === null")
    page.wait(f"station.recordings.items.some((item) => item.name === '{name}.mcap' && item.length > 0)")


@pytest.fixture(scope="module")
def recorded(page: Page, served: Served) -> tuple[Path, Path]:
    """Two recordings that began when the robot had gone elsewhere already."""
    to(page, "ready")
    record(page, "first", "nominal")
    record(page, "second one", "stretch", "ready")
    return served.directory / "first.mcap", served.directory / "second one.mcap"


@pytest.mark.slow
def test_a_recording_begun_late_holds_all_that_compare_needs(recorded: tuple[Path, Path], capsys: Any) -> None:
    for path, commands in zip(recorded, (1, 2), strict=True):
        with open_recording(path) as recording:
            again = rerun(recording)
            assert (again.identical, again.missing) == (True, "")
            # A page that a busy machine holds up loses its lease, and then a stop is among them.
            assert again.commands >= commands
            assert not recording.damage
            assert recording.end is not None
            start, end = recording.span
            assert start > 1.0
            # The way to where it began is in it.
            assert np.ptp(recording.virtual(np.linspace(0.0, start, 500)), axis=0).max() > 0.3
            assert np.isfinite(recording.real(0.5 * (start + end))).all()
    assert exit_status(["compare", str(recorded[1]), "--json"]) == 0
    value = json.loads(capsys.readouterr().out)
    assert value["commands"]["virtual"] == {"accepted": again.commands, "postponed": 0, "rejected": 0}
    assert not any("edits" in line for line in value.get("missing", []))


def replayed(page: Page, *names: str) -> Any:
    """Choose recordings and open their page."""
    while (pressed := page.page.locator(".pick[aria-pressed=true]")).count():
        pressed.first.click()
    for name in names:
        page.page.locator(f"li[data-name='{name}.mcap'] .pick").press("Enter")
    with page.page.context.expect_page() as opened:
        page.page.locator("#record-replay").press("Enter")
    shown = opened.value
    # Software draws slowly.
    shown.set_viewport_size({"width": 640, "height": 400})
    panes = f"window.replay && replay.state && replay.views.length === {len(names)}"
    until(lambda: shown.evaluate(f"Boolean({panes})"), what=panes)
    for k in range(len(names)):
        drawn = f"replay.node({k}, 'vrs', 'virtual', 'body', '6').children.length === 2"
        until(lambda drawn=drawn: shown.evaluate(drawn), what=drawn)
    return shown


def drawn_as(shown: Any, k: int, q: Any) -> None:
    expected = np.array([X.T.ravel() for X in MODEL.links(q)])
    until(lambda: np.abs(np.array(shown.evaluate(POSES, [k, "virtual"])) - expected).max() < 1e-9)


def test_the_page_replays_what_it_recorded(page: Page, recorded: tuple[Path, Path]) -> None:
    shown = replayed(page, "first")
    shown.keyboard.press("Space")
    until(lambda: shown.evaluate("replay.state.mode === 'paused'"))
    with open_recording(recorded[0]) as recording:
        move = recording.commands[-1].receipt
        for t in (move.execute_at + 0.4, move.end + 0.2, move.execute_at + 0.7):
            shown.evaluate("t => replay.wish('seek', { t })", t)
            drawn_as(shown, 0, recording.virtual(t))
            until(lambda t=t: abs(shown.evaluate("replay.state.t") - t) < 1e-5)
        shown.keyboard.press("ArrowLeft")
        drawn_as(shown, 0, recording.virtual(t - 1 / 60))
    shown.evaluate("replay.wish('rate', { rate: -4 })")
    shown.keyboard.press("Space")
    begun = "replay.state.t < replay.state.span[0] + 1e-5 && replay.state.mode === 'paused'"
    until(lambda: shown.evaluate(begun), what=begun)
    assert shown.locator("#aside").is_visible()
    shown.close()
    # The robot has gone on meanwhile.
    assert page.get("station.session.link") == "live"


def test_two_side_by_side_share_the_cursor(page: Page, recorded: tuple[Path, Path]) -> None:
    shown = replayed(page, "first", "second one")
    assert "align=start" in shown.url
    shown.keyboard.press("Space")
    until(lambda: shown.evaluate("replay.state.mode === 'paused'"))
    with open_recording(recorded[0]) as first, open_recording(recorded[1]) as second:
        begins = first.span[0], second.span[0]
        for after in (0.6, 1.4, 0.9):
            shown.evaluate("t => replay.wish('seek', { t })", begins[0] + after)
            for k, recording in enumerate((first, second)):
                drawn_as(shown, k, recording.virtual(begins[k] + after))
                until(lambda k=k, t=begins[k] + after: abs(shown.evaluate(f"replay.state.panes[{k}].t") - t) < 1e-5)
        kinds = shown.evaluate(
            "replay.marks.map((marks) => marks.filter((mark) => mark.kind === 'command').length)"
        )
        assert kinds == [1, 2]
    assert shown.evaluate("replay.state.panes.every((pane) => pane.error !== null && pane.error < 0.5)")
    shown.close()


def test_t15_wrong_names_and_rights_are_refused_with_one_message(page: Page, served: Served) -> None:
    page.refused = True
    taken = served.directory / "taken.mcap"
    taken.write_bytes(b"somebody's")
    page.page.fill("#record-name", "taken")
    page.page.click("#record-begin")
    page.wait("document.getElementById('record-problem').textContent.includes(\"isn't taken\")")
    assert taken.read_bytes() == b"somebody's"
    names = (
        "../x.mcap",
        "a/b.mcap",
        "x",
        "",
        ".mcap",
        ".x.mcap",
        "x.mcap\n",
        "/x.mcap",
        "x" * 99 + ".mcap",
        "a\0.mcap",
    )
    for name in names:
        for do in ("begin", "copy", "delete"):
            status, answer = served.ask({"do": do, "name": name})
            assert status == 400, name
            assert "plain file name" in answer["problem"]
    for request in (b"{", b"[]", {"do": "rm"}, {"do": "begin", "name": 1}, {"do": "begin", "more": 1}, b" " * 5000):
        assert served.ask(request)[0] == 400
    assert served.ask({"do": "copy", "name": "nothing.mcap"})[0] == 400
    begin = {"do": "begin", "name": "refused.mcap"}
    assert served.ask(begin, Role.VIEWER) == (403, {"problem": "this token isn't one for the role operator"})
    assert served.ask(begin, None)[0] == 403
    assert served.ask({"do": "copy", "name": "taken.mcap"}, None)[0] == 403
    assert served.ask(begin, Origin="http://evil.example")[0] == 403
    assert served.ask(begin, Host="evil.example")[0] == 403
    assert not (served.directory / "refused.mcap").exists()
    assert page.get(NOW) is None


def test_a_request_is_waited_for_no_longer_than_it_may_take_and_not_at_all_without_a_token(served: Served) -> None:
    """By raw sockets: a body that drips, with a viewer's token; none of a stranger's is waited for."""
    port = int(station(served.server).rsplit(":", 1)[1].strip("/"))
    head = f"POST /recordings HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nContent-Length: 1000\r\n"

    def answer(token: str) -> tuple[bytes, float]:
        begun = time.monotonic()
        with socket.create_connection(("127.0.0.1", port), timeout=0.1) as peer:
            peer.sendall(f"{head}{token}\r\n".encode())
            while time.monotonic() < begun + 30.0:
                with contextlib.suppress(TimeoutError):
                    try:
                        peer.sendall(b" ")
                        if heard := peer.recv(4096):
                            return heard, time.monotonic() - begun
                    except ConnectionError:
                        heard = b""
                    return heard, time.monotonic() - begun
        raise AssertionError("it's waited for")

    heard, took = answer("")
    assert heard.startswith(b"HTTP/1.1 403")
    assert took < 5.0
    heard, took = answer(f"Authorization: Bearer {served.tokens[Role.VIEWER]}\r\n")
    assert heard == b""
    assert 4.0 < took < 20.0


def test_one_who_watches_sees_it_and_may_replay(browser: Any, served: Served) -> None:
    served.ask({"do": "end"})
    assert served.ask({"do": "begin", "name": "watched.mcap"}) == (200, {})
    with paged(browser, station(served.server), viewport={"width": 900, "height": 560}) as second:
        enter(second, served, Role.VIEWER)
        second.wait(f"{NOW}?.name === 'watched.mcap' && {NOW}.size > 1000")
        assert second.page.locator("#recording").is_visible()
        assert second.page.locator("#record-begin").is_hidden()
        assert second.page.locator("#record-end").is_hidden()
        assert served.ask({"do": "begin", "name": "another.mcap"})[0] == 400
        # What is being recorded is followed live.
        second.wait("station.recordings.items.some((item) => item.name === 'watched.mcap')")
        shown = replayed(second, "watched")
        until(lambda: shown.evaluate("replay.state.mode === 'live'"))
        assert served.ask({"do": "copy", "name": "watched.mcap"})[0] == 400
        assert served.ask({"do": "end"}) == (200, {"problem": None})
        until(lambda: not shown.evaluate("replay.state.growing"))
        shown.close()
    status, answer = served.ask({"do": "copy", "name": "watched.mcap"}, Role.VIEWER)
    assert status == 200
    assert served.get(answer["path"]) == (served.directory / "watched.mcap").read_bytes()
    with pytest.raises(urllib.error.HTTPError) as again:
        served.get(answer["path"])
    again.value.close()
    assert again.value.code == 404


def test_a_name_is_offered_that_is_the_robots_and_not_taken(page: Page) -> None:
    pattern = "/^puma560 [-0-9]{10} [0-9]{2}[.][0-9]{2}$/"
    page.wait(f"{NOW} === null && {pattern}.test(document.getElementById('record-name').value)")
    offered = page.page.locator("#record-name").input_value()
    page.page.click("#record-begin")
    page.wait(f"{NOW}?.name === '{offered}.mcap'")
    page.page.click("#record-end")
    page.wait(f"{NOW} === null && station.recordings.items.some((item) => item.name === '{offered}.mcap')")
    page.wait(f"document.getElementById('record-name').value !== '{offered}'")
    page.refused = True
    page.page.fill("#record-name", "a/b")
    page.page.click("#record-begin")
    page.wait("document.getElementById('record-problem').textContent.includes('plain file name of letters')")
    assert page.page.locator("#record-name").input_value() == "a/b"


def test_a_recording_is_deleted_by_those_who_record_and_while_nobody_needs_it(page: Page, served: Served) -> None:
    data = LIVE.read_bytes()
    assert served.ask({"do": "begin", "name": "growing.mcap"}) == (200, {})
    doomed = served.directory / "doomed.mcap"
    doomed.write_bytes(data)
    request = {"do": "delete", "name": "doomed.mcap"}
    assert served.ask(request, Role.VIEWER) == (403, {"problem": "this token isn't one for the role operator"})
    assert served.ask({"do": "delete", "name": "nothing.mcap"})[0] == 400
    status, answer = served.ask({"do": "delete", "name": "growing.mcap"})
    assert (status, "this one is being written" in answer["problem"]) == (400, True)
    assert served.ask({"do": "end"})[0] == 200
    page.wait("station.recordings.items.some((item) => item.name === 'doomed.mcap' && item.length > 0)")
    board = station(served.server).replace("http", "ws", 1) + "replay/board?a=doomed.mcap"
    with connect(board, max_size=2**24, open_timeout=60) as looking:
        looking.send(json.dumps({"token": served.tokens[Role.VIEWER]}))
        looking.recv(timeout=60)
        status, answer = served.ask(request)
        assert (status, "nobody looks" in answer["problem"]) == (400, True)
    until(lambda: served.ask(request)[0] == 200)
    assert not doomed.exists()
    page.wait("station.recordings.items.every((item) => item.name !== 'doomed.mcap')")
    doomed.write_bytes(data)
    page.wait("station.recordings.items.some((item) => item.name === 'doomed.mcap')")
    button = page.page.locator("[aria-label='Delete doomed.mcap']")
    button.click()
    asked = page.page.locator(".deletion")
    assert "lost for everybody" in (asked.text_content() or "")
    asked.locator("button", has_text="Keep it").click()
    assert doomed.exists()
    button.click()
    page.page.click("#record-delete-yes")
    page.wait("station.recordings.items.every((item) => item.name !== 'doomed.mcap')")
    assert not doomed.exists()


@pytest.mark.parametrize(("scheme", "width", "height"), [("light", 1280, 720), ("dark", 1920, 1080)])
def test_everyone_can_use_it(
    browser: Any, served: Served, recorded: Any, scheme: str, width: int, height: int
) -> None:
    broken = served.directory / "broken.mcap"
    broken.write_bytes(recorded[0].read_bytes()[:20_000])
    options = {"viewport": {"width": width, "height": height}, "color_scheme": scheme}
    with paged(browser, station(served.server), **options) as opened:
        enter(opened, served, Role.OPERATOR)
        opened.wait("station.recordings.items.some((item) => item.problem.startsWith('cut'))")
        for name in ("first", "second one"):
            opened.page.click(f"li[data-name='{name}.mcap'] .pick")
        accessible(opened.page)
        panels = opened.page.locator("#tab-panels")
        assert panels.evaluate(
            "(box) => box.scrollHeight <= box.clientHeight && box.scrollWidth <= box.clientWidth"
        )
        # Another page's path names nothing but what is listed.
        for query in ("a=../tokens", "a=missing.mcap", "b=", "", "a=first.mcap&align=none"):
            opened.page.goto(station(served.server) + "replay?" + query)
            until(lambda: opened.page.locator("#standing[data-kind=failed]").is_visible())
