"""Tokens of people at every door of a running server: what they opened ends with them, and refusals are logged."""

from __future__ import annotations

import asyncio
import http.client
import json
import socket
import time
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any, NamedTuple

import pytest
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import ClientConnection, connect
from websockets.typing import Subprotocol

from interfaces.cli.main import exit_status
from interfaces.messages.control import Role
from interfaces.stream import sockets
from interfaces.stream.access import ENDED, Access, add_person, end_person, read_tokens
from interfaces.stream.audit import check_audit
from tests.interfaces import live_rig
from tests.interfaces.live_rig import Child, child

SOON = 3.5
"""A token's connections end so soon [s]: a second, and what a busy machine takes."""
HELLO = {"type": "hello", "protocol": 1, "role": "viewer", "name": "Ada"}
DOORS: dict[str, tuple[dict[str, object], int]] = {
    "/meshcat": ({}, 4401),
    "/recordings/board": ({}, 4401),
    "/replay/board?a=kept.mcap": ({}, 4401),
    "/robots/ipr/media": ({}, 4401),
    "/robots/ipr/meshcat": ({}, 4401),
    "/val": ({"type": "hello"}, 1008),
    "/ws": (HELLO, 1008),
}
"""Doors by WebSocket: what else than a token is shown there, and with what they close when it ends."""


class Place(NamedTuple):
    server: Child
    folder: Path
    port: int
    val_port: int

    @property
    def tokens(self) -> Path:
        return self.folder / "tokens"

    def entered(self, stack: ExitStack, door: str, token: str) -> ClientConnection:
        protocols = [Subprotocol("vrs.1.json")] if door == "/ws" else None
        url = f"ws://127.0.0.1:{self.port}{door}"
        line = stack.enter_context(connect(url, subprotocols=protocols, max_size=None))
        line.send(json.dumps({**DOORS[door][0], "token": token}))
        line.recv(20.0)
        return line

    def ask(
        self, method: str, path: str, token: str = "", body: object = None, **headers: str
    ) -> tuple[int, bytes]:
        line = http.client.HTTPConnection("127.0.0.1", self.port, timeout=20.0)
        shown = {"Authorization": f"Bearer {token}"} if token else {}
        line.request(method, path, None if body is None else json.dumps(body), {**shown, **headers})
        answer = line.getresponse()
        found = answer.status, answer.read()
        line.close()
        return found


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Place]:
    folder = tmp_path_factory.mktemp("people")
    add_person(folder / "tokens", "nobody", Role.VIEWER, "2090-01-31")
    (folder / "recordings").mkdir()
    live = Path(__file__).parents[1] / "contract/data/recordings/live.mcap"
    (folder / "recordings" / "kept.mcap").write_bytes(live.read_bytes())
    files = {"token-file": "tokens", "audit": "audit.jsonl", "recordings": "recordings", "jobs": "jobs.json"}
    options = [word for name, file in files.items() for word in (f"--{name}", str(folder / file))]
    robots = ("--robot", "puma560", "--robot", "ipr", "--body", "ideal", "--link-loss", "hold")
    with child("serve", *robots, *options, "--port", "0", "--val-port", "0") as server:
        assert server.process.stdout is not None
        said = next(line for line in iter(server.process.stdout.readline, "") if "VAL-II on" in line)
        yield Place(server, folder, int(server.url.split(":")[2].split("/")[0]), int(said.split()[-1]))


def left(line: ClientConnection, until: float) -> int | None:
    """The code with which a connection is closed; None where it's open still."""
    try:
        while (wait := until - time.monotonic()) > 0.0:
            line.recv(wait)
    except TimeoutError:
        return None
    except ConnectionClosed as closed:
        return None if closed.rcvd is None else closed.rcvd.code
    return None


def val_terminal(place: Place, token: str) -> socket.socket:
    line = socket.create_connection(("127.0.0.1", place.val_port), 20.0)
    line.sendall(f"{token}\r\n".encode())
    said = b""
    while b"VAL-II" not in said:
        said += line.recv(4096)
    return line


def test_t05_all_that_a_token_opened_ends_with_it_and_nothing_else_does(place: Place) -> None:
    ada = add_person(place.tokens, "ada", Role.OPERATOR, "2090-01-31")
    viewer = read_tokens(place.tokens)[Role.VIEWER]
    with ExitStack() as stack:
        hers = {door: place.entered(stack, door, ada) for door in DOORS}
        others = {door: place.entered(stack, door, viewer) for door in DOORS}
        terminal = stack.enter_context(val_terminal(place, ada))
        end_person(place.tokens, "ada")
        until = time.monotonic() + SOON
        codes = {door: left(line, until) for door, line in hers.items()}
        assert codes == {door: code for door, (_, code) in DOORS.items()}
        terminal.settimeout(SOON)
        said = b""
        while data := terminal.recv(4096):
            said += data
        assert ENDED.encode() in said
        assert time.monotonic() < until
        assert {door: left(line, time.monotonic() + 0.05) for door, line in others.items()} == dict.fromkeys(DOORS)


def test_t05_a_ticket_ends_with_its_token_and_follows_no_exchanged_link(place: Place) -> None:
    bo, viewer = add_person(place.tokens, "bo", Role.VIEWER, "2090-01-31"), read_tokens(place.tokens)[Role.VIEWER]
    kept, secret = place.folder / "recordings" / "kept.mcap", place.folder / "audit.jsonl"

    def ticket(token: str, name: str = "kept.mcap") -> str:
        status, data = place.ask("POST", "/recordings", token, {"do": "copy", "name": name})
        assert status == 200
        return str(json.loads(data)["path"])

    assert place.ask("GET", ticket(viewer)) == (200, kept.read_bytes())
    path = ticket(bo)
    end_person(place.tokens, "bo")
    assert place.ask("GET", path)[0] == 404
    large = place.folder / "recordings" / "large.mcap"
    large.write_bytes(bytes(64 << 20))
    cy = add_person(place.tokens, "cy", Role.VIEWER, "2090-01-31")
    with socket.socket() as line:
        line.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 16384)
        line.settimeout(20.0)
        line.connect(("127.0.0.1", place.port))
        line.sendall(f"GET {ticket(cy, 'large.mcap')} HTTP/1.1\r\nHost: 127.0.0.1:{place.port}\r\n\r\n".encode())
        got = len(line.recv(4096))
        end_person(place.tokens, "cy")
        while data := line.recv(65536):
            got += len(data)
        assert got < 64 << 20
    large.unlink()
    for exchange in (lambda one: one.symlink_to(secret), lambda one: one.hardlink_to(secret)):
        name = "exchanged.mcap"
        moved = place.folder / "recordings" / name
        moved.write_bytes(b"mine")
        path = ticket(viewer, name)
        moved.unlink()
        exchange(moved)
        assert place.ask("GET", path)[0] == 404
        moved.unlink()


def test_t14_every_doors_refusals_are_in_the_log(place: Place) -> None:
    wrong, viewer = "x" * 43, read_tokens(place.tokens)[Role.VIEWER]
    asked = [
        ("GET", "/poses"), ("POST", "/poses"), ("GET", "/plan"), ("POST", "/plan"), ("POST", "/recordings"),
        ("GET", "/robots/ipr/media/still"),
    ]  # fmt: skip
    for method, path in asked:
        assert place.ask(method, path, wrong)[0] == 403
    assert place.ask("GET", "/health", wrong) == (200, b'{"ok":true}')
    assert place.ask("POST", "/recordings", viewer, {"do": "begin", "name": "no.mcap"})[0] == 403
    assert place.ask("GET", "/", Origin="http://evil.example")[0] == 403
    with connect(f"ws://127.0.0.1:{place.port}/meshcat") as line:
        line.send(json.dumps({"token": wrong}))
        assert left(line, time.monotonic() + 20.0) == 4401
    with socket.create_connection(("127.0.0.1", place.val_port), 20.0) as line:
        line.sendall(f"{wrong}\r\n".encode())
        said = b""
        while b"Invalid token" not in said:
            said += line.recv(4096)
    log, end = place.folder / "audit.jsonl", time.monotonic() + 20.0
    what = {f"{method} {path}" for method, path in asked}
    what |= {"GET /health", "GET /", "WebSocket /meshcat", "terminal"}
    while True:
        refused = [json.loads(line) for line in log.read_text().splitlines() if '"event":"refused"' in line]
        if what <= {one["what"] for one in refused}:
            break
        assert time.monotonic() < end, what - {one["what"] for one in refused}
        time.sleep(0.05)
    assert all(one["address"] == "127.0.0.1" for one in refused)
    assert wrong not in log.read_text()
    assert next(one["why"] for one in refused if one["what"] == "GET /") == (
        f"Host or Origin: 127.0.0.1:{place.port}, http://evil.example"
    )
    known: dict[str, Any] = json.loads(place.ask("GET", "/health", viewer)[1])
    assert known["audit"] == {"problem": "", "lost": 0}


def test_t14_a_log_is_written_by_one_server(place: Place, capsys: pytest.CaptureFixture[str]) -> None:
    log = place.folder / "audit.jsonl"
    assert exit_status(["robot", "--audit", str(log), "--listen", "127.0.0.1:0"]) == 2
    assert "another process writes it" in capsys.readouterr().err
    assert check_audit(log).problem == ""


def test_t05_a_robot_lets_a_site_go_whose_token_has_ended(tmp_path: Path) -> None:
    tokens = tmp_path / "tokens"
    token = add_person(tokens, "lab", Role.SITE, "2090-01-31")

    async def main() -> None:
        async with (
            live_rig.robot_here(access=Access(free=(), people=tokens)) as (robot, url),
            live_rig.operator_here(url, token=token) as (operator, _),
        ):
            await live_rig.until(lambda: operator.robot.connected)
            end_person(tokens, "lab")
            begun = asyncio.get_running_loop().time()
            await live_rig.until(lambda: not robot.health()["operator"])
            assert asyncio.get_running_loop().time() < begun + SOON
            await live_rig.until(lambda: "this token isn't one" in operator.robot.problem)

    asyncio.run(main())


def test_a_look_that_fails_ends_its_connection_and_no_other(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sockets, "PEOPLE", 0.0)
    ended: list[object] = []

    class Door:
        def end(self, code: int, reason: str) -> None:
            ended.append((code, reason))

        def abort(self) -> None:
            ended.append("aborted")

    def fails() -> bool:
        raise ZeroDivisionError

    async def main() -> None:
        state = sockets.ConnectionState(sockets.SocketLimits())
        state.admitted = {Door(): (fails, 1008), Door(): (lambda: True, 1), Door(): (lambda: False, 4401)}  # type: ignore[dict-item]
        looking = asyncio.create_task(sockets.end_admissions(state))
        while len(ended) < 2:
            await asyncio.sleep(0.001)
        looking.cancel()

    asyncio.run(main())
    assert ended[:2] == ["aborted", (4401, ENDED)]
