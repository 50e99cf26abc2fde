"""What stands before NiceGUI: paths, visitors, messages, scripts."""

from __future__ import annotations

import asyncio
import re
from collections.abc import Callable
from typing import Any

import pytest

from interfaces.station.bounds import SOCKET, BoundsConfig, RequestBounds
from vrs.errors import InvalidValueError

PAGE = b'<script>one</script><scripted><script src="/x"></script>'


class Inner:
    """What NiceGUI is here: it notes who comes, and answers."""

    def __init__(self) -> None:
        self.seen: list[Any] = []
        self.forever = False

    async def __call__(self, scope: Any, receive: Callable[[], Any], send: Callable[[Any], Any]) -> None:
        self.seen.append(scope["path"])
        if scope["type"] == "http":
            headers = [(b"content-length", b"1"), (b"cache-control", b"public"), (b"x-other", b"stays")]
            await send({"type": "http.response.start", "status": 200, "headers": headers})
            await send({"type": "http.response.body", "body": PAGE[:9], "more_body": True})
            await send({"type": "http.response.body", "body": PAGE[9:]})
            return
        await send({"type": "websocket.accept"})
        while (message := await receive())["type"] != "websocket.disconnect":
            self.seen.append(message.get("text"))
            if self.forever:
                await send({"type": "websocket.send", "text": "x"})
        self.seen.append(message["code"])


def ask(bounds: RequestBounds, path: str, method: str = "GET") -> tuple[int, dict[str, str], bytes]:
    sent: list[Any] = []

    async def run() -> None:
        async def send(message: Any) -> None:
            sent.append(message)

        async def receive() -> Any:
            return {"type": "http.request"}

        await bounds({"type": "http", "path": path, "method": method, "headers": []}, receive, send)

    asyncio.run(run())
    headers = {name.decode(): value.decode() for name, value in sent[0]["headers"]}
    assert len(headers) == len(sent[0]["headers"])
    return sent[0]["status"], headers, b"".join(part.get("body", b"") for part in sent[1:])


def test_only_the_page_and_its_parts_are_there() -> None:
    inner = Inner()
    bounds = RequestBounds(inner, "/", lambda most: True)
    for path, method in (("/elsewhere", "GET"), ("/", "POST"), (SOCKET + "socket.io/", "GET"), ("//", "GET")):
        assert ask(bounds, path, method)[0] == 404
    assert inner.seen == []
    assert ask(bounds, "/_nicegui/3/static/x.js")[::2] == (200, PAGE)


def test_there_are_only_so_many_visitors() -> None:
    inner, asked = Inner(), []

    def make_room(most: int) -> bool:
        asked.append(most)
        return len(asked) > 1

    bounds = RequestBounds(inner, "/", make_room, BoundsConfig(visitors=3))
    assert ask(bounds, "/")[0] == 503
    assert ask(bounds, "/_nicegui/3/static/x.js")[0] == 200
    assert ask(bounds, "/")[0] == 200
    assert asked == [3, 3]


def test_of_many_pages_that_are_asked_for_at_once_the_newest_is_made_first() -> None:
    bounds = RequestBounds(Inner(), "/", lambda most: True, BoundsConfig(pages=100, pages_burst=2, pages_waiting=4))
    ended: list[tuple[int, int]] = []

    async def one(number: int) -> None:
        async def send(message: Any) -> None:
            if message["type"] == "http.response.start":
                ended.append((number, message["status"]))

        await bounds({"type": "http", "path": "/", "method": "GET", "headers": []}, send, send)

    async def run() -> None:
        async with asyncio.timeout(5.0):
            await asyncio.gather(*(one(number) for number in range(8)))

    asyncio.run(run())
    assert sorted(ended[:4]) == [(0, 200), (1, 200), (2, 503), (3, 503)]
    assert ended[4:] == [(7, 200), (6, 200), (5, 200), (4, 200)]


def test_every_script_of_the_page_is_signed_anew_each_time() -> None:
    bounds = RequestBounds(Inner(), "/", lambda most: True)
    words = set()
    for _ in range(3):
        status, headers, body = ask(bounds, "/")
        assert status == 200
        found = re.findall(rb'<script nonce="([\w-]{22})"', body)
        assert len(found) == 2
        assert len(set(found)) == 1
        word = found[0].decode()
        words.add(word)
        policy = headers["content-security-policy"]
        assert f"script-src 'self' 'nonce-{word}' 'unsafe-eval';" in policy
        assert policy.startswith("default-src 'none';")
        assert "unsafe-inline" not in policy.partition("style-src")[0]
        assert re.sub(rb' nonce="[^"]*"', b"", body) == PAGE
        assert headers["content-length"] == str(len(body))
        assert headers["cache-control"] == "no-store"
        assert headers["x-other"] == "stays"
    assert len(words) == 3


class Wire:
    """A socket in memory: what comes is given, what goes is kept, or waits."""

    def __init__(self, texts: list[str], *, stuck: bool = False) -> None:
        self.incoming = [{"type": "websocket.connect"}, *({"type": "websocket.receive", "text": t} for t in texts)]
        self.incoming.append({"type": "websocket.disconnect", "code": 1001})
        self.sent: list[Any] = []
        self.stuck, self.aborted = stuck, False

    async def receive(self) -> Any:
        return self.incoming.pop(0)

    async def send(self, message: Any) -> None:
        if self.stuck and message["type"] == "websocket.send":
            await asyncio.sleep(3600)
        self.sent.append(message)

    def abort(self) -> None:
        self.aborted = True

    def scope(self, path: str = SOCKET + "socket.io/") -> dict[str, Any]:
        return {"type": "websocket", "path": path, "headers": [], "state": {"socket": self}}


def test_one_who_says_too_much_is_closed() -> None:
    inner, wire = Inner(), Wire(["x"] * 10)
    bounds = RequestBounds(inner, "/", lambda most: True, BoundsConfig(rate=1, burst=5))
    asyncio.run(bounds(wire.scope(), wire.receive, wire.send))
    assert inner.seen == [SOCKET + "socket.io/", None, "x", "x", "x", "x", "x", 1008]
    assert [message.get("code") for message in wire.sent] == [None, 1008]


def test_one_who_does_not_read_is_cut_off() -> None:
    inner, wire = Inner(), Wire(["x"], stuck=True)
    inner.forever = True
    bounds = RequestBounds(inner, "/", lambda most: True, BoundsConfig(blocked=0.1))
    with pytest.raises(ConnectionResetError):
        asyncio.run(bounds(wire.scope(), wire.receive, wire.send))
    assert wire.aborted


@pytest.mark.parametrize("path", ["/ws2", "/_nicegui/3/static/x.js", "/"])
def test_sockets_are_taken_at_one_place_only(path: str) -> None:
    inner, wire = Inner(), Wire([])
    asyncio.run(RequestBounds(inner, "/", lambda most: True)(wire.scope(path), wire.receive, wire.send))
    assert inner.seen == []
    assert [message["type"] for message in wire.sent] == ["websocket.close"]


def test_a_socket_that_ended_makes_room() -> None:
    inner = Inner()
    bounds = RequestBounds(inner, "/", lambda most: True, BoundsConfig(visitors=1))
    for _ in range(3):
        wire = Wire([])
        asyncio.run(bounds(wire.scope(), wire.receive, wire.send))
        assert wire.sent[0]["type"] == "websocket.accept"


def test_of_too_many_sockets_the_oldest_gives_way() -> None:
    async def run() -> None:
        held = asyncio.Event()

        async def keep(scope: Any, receive: Any, send: Any) -> None:
            await send({"type": "websocket.accept"})
            await held.wait()

        bounds = RequestBounds(keep, "/", lambda most: True, BoundsConfig(visitors=2))
        wires = [Wire([]) for _ in range(3)]
        tasks = []
        for wire in wires:
            tasks.append(asyncio.create_task(bounds(wire.scope(), wire.receive, wire.send)))
            await asyncio.sleep(0)
        held.set()
        await asyncio.gather(*tasks)
        assert [wire.aborted for wire in wires] == [True, False, False]
        assert wires[2].sent[0]["type"] == "websocket.accept"

    asyncio.run(run())


def test_bounds_are_checked() -> None:
    with pytest.raises(InvalidValueError, match="visitors"):
        BoundsConfig(visitors=0)
