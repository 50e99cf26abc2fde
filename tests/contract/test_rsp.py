"""RSP: a plain client over UDP, from docs/rsp.md alone; the bytes of what it's told."""

from __future__ import annotations

import json
import socket
import struct
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, Final

import pytest

from tests.contract.doors import VRS, directory, run, served

HEADER: Final = struct.Struct(">BHBBHI6sHB")
"""Version, model, encryption, type, number, stamp, session, last received, clear or free."""
DOWN, UP, OPEN, CHALLENGE, OPENED, REFUSED, END, ENDED = range(1, 9)
NONCE: Final = bytes(range(16))
NOBODY: Final = bytes(6)
SECONDS: Final = 20.0


@dataclass(frozen=True, slots=True)
class Packet:
    """A packet of the robot's."""

    kind: int
    number: int
    session: bytes
    last: int
    free: int
    body: bytes


class Client:
    """A socket that numbers what it sends."""

    def __init__(self, address: tuple[str, int], model: int) -> None:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.settimeout(0.1)
        self._socket.connect(address)
        self._model, self._number, self.last = model, 0, 0xFFFF

    def close(self) -> None:
        self._socket.close()

    def send(self, kind: int, body: bytes = b"", session: bytes = NOBODY) -> None:
        now = int(time.monotonic() * 1000) % 2**32
        head = HEADER.pack(1, self._model, 0, kind, self._number % 65536, now, session, self.last, 0)
        self._socket.send(head + body)
        self._number += 1

    def receive(self) -> Packet | None:
        """The next packet, or None after a while."""
        try:
            data = self._socket.recv(65536)
        except TimeoutError:
            return None
        version, model, encryption, kind, number, _, session, last, free = HEADER.unpack_from(data)
        assert (version, model, encryption) == (1, self._model, 0)
        return Packet(kind, number, session, last, free, data[HEADER.size :])

    def until(self, kind: int, send: Callable[[], None]) -> Packet:
        """Send again and again until a packet of a kind comes."""
        end = time.monotonic() + SECONDS
        while time.monotonic() < end:
            send()
            packet = self.receive()
            if packet is not None and packet.kind == kind:
                return packet
        raise TimeoutError(f"no packet of type {kind} in {SECONDS} s")

    def open(self) -> bytes:
        """Open a session, and name it."""
        challenge = self.until(CHALLENGE, lambda: self.send(OPEN, bytes([0, 0]) + NONCE + bytes(16)))
        assert (challenge.session, len(challenge.body), challenge.body[:16]) == (NOBODY, 32, NONCE)
        cookie = challenge.body[16:]
        opened = self.until(OPENED, lambda: self.send(OPEN, bytes([0, 0]) + NONCE + cookie))
        assert (len(opened.body), opened.body[:16]) == (32, NONCE)
        assert opened.session != NOBODY
        return opened.session


@pytest.fixture(scope="module")
def robot(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[tuple[str, int], dict[str, Any]]]:
    """Where a thin client listens that is behind the example's model, and that model."""
    place = directory(tmp_path_factory.mktemp("rsp"))
    assert run(VRS, "rsp", "model", "new", "rover.xmi", cwd=place).status == 0
    model = json.loads(run(VRS, "rsp", "model", "show", "rover.xmi", "--json", cwd=place).out)
    with served("robot", "--rsp", "127.0.0.1:0", "--model", "rover.xmi", "--until-eof", cwd=place) as serving:
        host, port = serving.address.rsplit(":", 1)
        yield (host, int(port)), model


@pytest.fixture
def client(robot: tuple[tuple[str, int], dict[str, Any]]) -> Iterator[Client]:
    address, model = robot
    made = Client(address, model["id"])
    yield made
    made.close()


def test_a_session_from_its_opening_to_its_end(client: Client, robot: Any) -> None:
    model = robot[1]
    elements, size = model["elements"], model["map_bytes"]
    asked = [index for index, element in enumerate(elements) if element["kind"] in ("Sensor", "Monitor", "Event")]
    bits = sum(1 << (8 * size - 1 - index) for index in asked)
    session = client.open()
    told: set[int] = set()

    def down() -> None:
        client.send(DOWN, bits.to_bytes(size, "big"), session)

    end = time.monotonic() + SECONDS
    sensor = next(index for index in asked if elements[index]["kind"] == "Sensor")
    while sensor not in told and time.monotonic() < end:
        up = client.until(UP, down)
        client.last = up.number
        here = [index for index in range(len(elements)) if up.body[index // 8] & 0x80 >> index % 8]
        assert set(here) <= set(asked)
        assert len(up.body) == size + sum(elements[index]["up_bytes"] for index in here)
        assert (up.session, up.free) == (session, model["buffers"])
        told |= set(here)
    assert sensor in told
    other = Client(robot[0], model["id"])
    try:
        challenge = other.until(CHALLENGE, lambda: other.send(OPEN, bytes([0, 0]) + NONCE + bytes(16)))

        def ask() -> None:
            down()
            other.send(OPEN, bytes([0, 0]) + NONCE + challenge.body[16:])

        refused = other.until(REFUSED, ask)
        assert refused.body == NONCE + bytes([1])
    finally:
        other.close()
    ended = client.until(ENDED, lambda: client.send(END, b"", session))
    assert (ended.session, ended.body) == (session, b"")


def test_rubbish_is_answered_by_nothing(client: Client) -> None:
    client.send(DOWN, b"\xff\xff", b"nobody")
    client.send(99, b"")
    client.send(OPEN, b"short")
    assert client.receive() is None
