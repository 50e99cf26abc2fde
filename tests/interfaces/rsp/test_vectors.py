"""The golden vectors are what the code makes, and what a reader of a few lines reads that knows docs/rsp.md
alone."""

from __future__ import annotations

import hashlib
import hmac
import json
import struct
import xml.etree.ElementTree as ET
from typing import Any

import pytest

from tests.interfaces.rsp import make_vectors

VECTORS: dict[str, Any] = json.loads(make_vectors.PATH.read_text(encoding="utf-8"))
NAMES = ("version", "model", "encrypted", "type", "number", "stamp", "high", "low", "last", "buffers")
SIZES = {"i8": 1, "u8": 1, "i16": 2, "u16": 2, "i32": 4, "u32": 4, "f32": 4}


def test_the_file_is_what_the_script_makes() -> None:
    assert make_vectors.made() == VECTORS


def model() -> list[dict[str, str]]:
    """Elements of the model, read without pyecore."""
    xsi = "{http://www.w3.org/2001/XMLSchema-instance}type"
    root = ET.fromstring(VECTORS["model"])
    return [{**element.attrib, "kind": element.attrib[xsi].split(":")[1]} for element in root]


def read_body(body: bytes, down: bool) -> dict[str, bytes]:
    """Payloads by name, from the table of docs/rsp.md."""
    elements = model()
    by_name = {element["name"]: element for element in elements}
    size = (len(elements) + 7) // 8
    at, found = size, {}
    for k, element in enumerate(elements):
        if not body[k // 8] >> (7 - k % 8) & 1:
            continue
        kind, length = element["kind"], 0
        source = by_name[element["effector"]] if kind == "Monitor" else element
        values = SIZES.get(source.get("type", "i16"), 0) * int(source.get("count", "1"))
        if kind == "Effector":
            length = values
        elif kind == "Command":
            length = 2 + values
        elif kind in ("Sensor", "Monitor"):
            length = 0 if down else values
        elif kind == "Event":
            length = 0 if down else 2 + values
        elif kind in ("MemoryCommand", "MemoryEvent"):
            item = (kind == "MemoryCommand") == down
            length = 4 + int.from_bytes(body[at + 2 : at + 4], "big") if item else 2
        found[element["name"]] = body[at : at + length]
        at += length
    assert at == len(body)
    return found


def hkdf(secret: bytes, salt: bytes, info: bytes, length: int) -> bytes:
    key = hmac.digest(salt or bytes(32), secret, hashlib.sha256)
    out, block = b"", b""
    for k in range(1, 9):
        block = hmac.digest(key, block + info + bytes([k]), hashlib.sha256)
        out += block
    return out[:length]


def read(packets: list[dict[str, Any]], *, sealed: bool) -> list[tuple[str, str, dict[str, Any], Any]]:
    """(to, what was said, header, payloads or body) of each packet, opened where they're sealed."""
    from cryptography.hazmat.primitives.ciphers.aead import AESGCM

    found, keys, nonce = [], {}, b""
    secret = bytes.fromhex(VECTORS["secret"])
    for packet in packets:
        data = bytes.fromhex(packet["hex"])
        head = dict(zip(NAMES, struct.unpack("!BHBBHIHIHB", data[:20]), strict=True))
        body = data[20:]
        assert head["encrypted"] == sealed
        if sealed and head["type"] in (3, 4, 5, 6):
            mac = hmac.digest(hkdf(secret, b"", b"vrs rsp 1 handshake", 32), data[:-16], hashlib.sha256)
            assert data[-16:] == mac[:16]
            body = body[:-16]
        elif sealed:
            assert int.from_bytes(body[:8], "big") % 65_536 == head["number"]
            body = AESGCM(keys[packet["to"]]).decrypt(bytes(4) + body[:8], body[8:], data[:20])
        if head["type"] == 3:
            nonce = body[2:18]
        if head["type"] == 5:
            assert body[:16] == nonce
            session = head["high"] << 32 | head["low"]
            salt = hashlib.sha256(body).digest()
            both = hkdf(secret, salt, b"vrs rsp 1 session" + session.to_bytes(6, "big"), 64)
            keys = {"robot": both[:32], "local": both[32:]}
        payloads = read_body(body, head["type"] == 1) if head["type"] in (1, 2) else body
        found.append((packet["to"], packet["said"], head, payloads))
    return found


@pytest.mark.parametrize("sealed", [False, True], ids=["open", "sealed"])
def test_a_reader_of_the_docs_reads_them(sealed: bool) -> None:
    packets = VECTORS["sealed" if sealed else "open"]
    found = read(packets, sealed=sealed)
    assert [head["type"] for _, _, head, _ in found[:4]] == [3, 4, 3, 5]
    assert {head["version"] for _, _, head, _ in found} == {1}
    assert {head["model"] for _, _, head, _ in found} == {0x0102}
    assert [head["type"] for _, _, head, _ in found[-2:]] == [7, 8]
    down = [(head, payloads) for _, _, head, payloads in found if head["type"] == 1]
    up = [(head, payloads) for _, _, head, payloads in found if head["type"] == 2]
    assert [head["number"] for head, _ in down] == list(range(len(down)))
    assert down[0][0]["last"] == 65_535
    assert down[0][1] == {}
    said = {key: value for _, payloads in down for key, value in payloads.items()}
    assert said["left_wheel"] == b"\x00\x64"
    assert said["sensing"] == b""
    assert said["ir_fire"] == b"\x00\x00\x07"
    assert said["program"] == b"\x00\x00\x00\x03abc"
    assert said["log"] == b"\x00\x00"
    told = {key: value for _, payloads in up for key, value in payloads.items()}
    assert struct.unpack("!3i", told["position"]) == (1, -2, 3)
    assert told["left_wheel_state"] == b"\x00\x64"
    assert told["bumper"] == b"\x00\x00\x01"
    assert told["program"] == b"\x00\x00"
    assert told["log"] == b"\x00\x00\x00\x05hello"
    assert {head["buffers"] for head, _ in up} == {16}


def test_sealed_packets_are_24_bytes_longer() -> None:
    kinds = [
        [(packet["to"], len(packet["hex"]) // 2) for packet in VECTORS[name] if packet["hex"][8:10] in ("01", "02")]
        for name in ("open", "sealed")
    ]
    assert [(to, size + 24) for to, size in kinds[0]] == kinds[1]
