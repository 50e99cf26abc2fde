"""Files that are cut, flipped, or made by an enemy: typed errors or counted losses, and nothing wrong is read."""

from __future__ import annotations

import os
import struct
import zlib
from collections.abc import Callable
from pathlib import Path
from random import Random
from typing import Any

import msgspec
import numpy as np
import pytest
import zstandard

from interfaces.messages import recording as m
from interfaces.messages.fields import plain
from interfaces.recording import open_recording
from interfaces.recording.history import Chain
from interfaces.recording.mcap_reading import HEAD, MAGIC, MARK, MARK_AT, NUMBERS, head_of
from interfaces.recording.track import DECODERS
from tests.interfaces.recording import recorded
from tests.interfaces.stream.same import same as alike
from vrs.errors import FormatError

EVERY = int(os.environ.get("VRS_FLIPS", "61"))
"""One byte of so many is flipped; 1 for all."""
SECONDS = 1.5


def whole(folder: Path) -> Path:
    """Write a small recording."""
    messages, engine, _ = recorded.motion(SECONDS, step=0.05, every=0.4, drawn=1.0)
    messages.append((SECONDS, recorded.history(engine, 4)))
    return recorded.write(folder / "run.mcap", messages, end=SECONDS)


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return whole(tmp_path_factory.mktemp("damage"))


def last_block(data: bytes) -> int:
    """Where the last block begins."""
    at = data.rindex(MARK) - MARK_AT
    while head_of(data[at : at + HEAD]) is None:
        at = data.rindex(MARK, 0, at + MARK_AT) - MARK_AT
    return at


class Judge:
    """Compares what a damaged file says with what the whole one says."""

    def __init__(self, path: Path) -> None:
        self.t = np.linspace(-0.1, SECONDS + 0.1, 60)
        with open_recording(path) as recording:
            assert str(recording.damage) == "none"
            self.whole = recorded.everything(recording)
            self.virtual, self.real = recording.virtual(self.t), recording.real(self.t)
            self.session, self.end = recording.session, recording.end

    def look(self, path: Path) -> str:
        """What becomes of a file: `refused`, `damaged`, `marred` or `same`.

        Raises:
            AssertionError: If it says what isn't so, or hides that something is missing.
        """
        try:
            with open_recording(path) as recording:
                return self._compare(recording)
        except FormatError:
            return "refused"

    def _compare(self, recording: Any) -> str:
        found = recorded.everything(recording)
        assert recording.session == self.session
        assert recording.end in (self.end, None)
        for name, some in found.items():
            assert recorded.is_part(some, self.whole[name]), name
        try:
            virtual = recording.virtual(self.t)
        except FormatError:
            virtual = np.full_like(self.virtual, np.nan)
        real, damage = recording.real(self.t), recording.damage
        for values, truth in ((virtual, self.virtual), (real, self.real)):
            known = ~np.isnan(values)
            assert (values[known] == truth[known]).all()
        same = alike(found, self.whole) and recording.end == self.end
        same = same and np.array_equal(real, self.real, equal_nan=True)
        assert damage or same
        if not damage:
            assert np.array_equal(virtual, self.virtual)
        return "damaged" if damage else "marred" if damage.marred else "same"


def flips(path: Path, judge: Judge, data: bytes) -> dict[str, int]:
    """Flip one bit at a time, here and there or everywhere; how often what came of it."""
    rng = np.random.default_rng(5)
    path.write_bytes(data)
    found: dict[str, int] = {}
    with path.open("r+b", buffering=0) as file:
        for at in range(int(rng.integers(EVERY)), len(data), EVERY):
            file.seek(at)
            file.write(bytes([data[at] ^ (1 << int(rng.integers(8)))]))
            outcome = judge.look(path)
            found[outcome] = found.get(outcome, 0) + 1
            file.seek(at)
            file.write(data[at : at + 1])
    return found


def test_a_flipped_bit_in_a_complete_file(small: Path, tmp_path: Path) -> None:
    found = flips(tmp_path / "flipped.mcap", Judge(small), small.read_bytes())
    assert set(found) <= {"refused", "damaged", "marred"}
    assert found["damaged"] > 10
    assert found["marred"] > 10


def test_a_flipped_bit_in_a_cut_file(small: Path, tmp_path: Path) -> None:
    data = small.read_bytes()
    found = flips(tmp_path / "flipped.mcap", Judge(small), data[: last_block(data) + 100])
    assert set(found) <= {"refused", "damaged"}
    assert found["refused"] > 10
    assert found["damaged"] > 10


def test_a_file_cut_anywhere(small: Path, tmp_path: Path) -> None:
    data, judge, path = small.read_bytes(), Judge(small), tmp_path / "cut.mcap"
    end = last_block(data)
    outcomes = []
    for length in range(0, len(data), EVERY):
        path.write_bytes(data[:length])
        outcomes.append((length, judge.look(path)))
    refused = [length for length, outcome in outcomes if outcome == "refused"]
    assert max(refused) < data.index(MARK, data.index(MARK) + 1)
    assert all(outcome == "damaged" for length, outcome in outcomes if max(refused) < length < end)
    assert outcomes[-1][1] == "marred"


def test_a_lost_block_is_counted_and_its_time_told(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    messages, engine, _ = recorded.motion(5.0, every=10.0)
    recorded.write(path, [*messages, (5.0, recorded.history(engine, 1))], end=5.0)
    data = bytearray(path.read_bytes())
    at = -1
    for _ in range(10):
        at = data.index(MARK, at + 1)
    data[at + 40] ^= 4
    for name, content in (("complete", data), ("cut", data[: last_block(bytes(data))])):
        path.write_bytes(content)
        with open_recording(path) as recording:
            damage = recording.damage
            assert damage.blocks == 1
            assert damage.cut == (name == "cut")
            ((first, last),) = damage.spans
            lost = np.isnan(recording.real(np.arange(0.0, 4.5, 0.01))).any(1)
            times = np.arange(0.0, 4.5, 0.01)[lost]
            assert 0.2 < times[-1] - times[0] < 0.3
            assert first - 0.02 < times[0]
            assert times[-1] < last + 0.3
            assert "1 block lost" in str(damage)
            t = np.linspace(0, 4.5, 50)
            assert np.array_equal(recording.virtual(t), engine.joints(t))


def test_an_edit_that_is_lost_isnt_guessed(tmp_path: Path) -> None:
    messages, engine, _ = recorded.motion(4.0)
    (number,) = [
        n
        for n, (_, message) in enumerate(messages)
        if getattr(message, "edit", 0) == 3 and hasattr(message, "base")
    ]
    path = recorded.write(tmp_path / "run.mcap", messages[:number] + messages[number + 1 :], end=4.0)
    t = np.linspace(0, 4, 81)
    with open_recording(path) as recording:
        assert recording.certain == recording.edits[-1].at == pytest.approx(1.0)
        known = ~np.isnan(recording.virtual(t)).any(1)
        assert np.array_equal(recording.virtual(t)[known], engine.joints(t)[known])
        assert known.sum() == 21
        assert not known[-1]
        assert len(recording.edits) == 3
    whole = [*messages[:number], *messages[number + 1 :], (4.0, recorded.history(engine, 5))]
    with open_recording(recorded.write(path, whole, end=4.0)) as recording:
        assert np.array_equal(recording.virtual(t), engine.joints(t))


def chunk(content: bytes, *, size: int | None = None, packed: bytes | None = None) -> bytes:
    packed = zstandard.compress(content) if packed is None else packed
    size = len(content) if size is None else size
    body = struct.pack("<QQQI8sQ", 0, 0, size, zlib.crc32(content), MARK, len(packed)) + packed
    return struct.pack("<BQ", 6, len(body)) + body


def message(channel: int, data: bytes) -> bytes:
    return struct.pack("<BQHIQQ", 5, 22 + len(data), channel, 0, 0, 0) + data


def opening(small: Path) -> bytes:
    """The first block of a good file, and what stands before it."""
    data = small.read_bytes()
    start = data.index(MARK) - MARK_AT
    return data[: start + 9 + struct.unpack_from("<Q", data, start + 1)[0]]


def bomb() -> bytes:
    """A frame that unpacks to much, and says nothing of it."""
    return zstandard.ZstdCompressor(write_content_size=False).compress(bytes(100 * 2**20))


HOSTILE: dict[str, Callable[[bytes], bytes]] = {
    "nothing": lambda _: b"",
    "magic alone": lambda _: MAGIC,
    "text": lambda _: b"no recording" * 100,
    "a huge record": lambda start: start + struct.pack("<BQ", 6, 2**63) + MARK * 100,
    "a huge block": lambda start: start + chunk(b"", size=2**40),
    "a bomb that is told": lambda start: start + chunk(b"", packed=zstandard.compress(bytes(100 * 2**20))),
    "a bomb that is not": lambda start: start + chunk(b"", size=2**20, packed=bomb()),
    "many bombs": lambda start: start + chunk(bytes(15 * 2**20)) * 100,
    "a deep message": lambda start: start + chunk(message(2, b"[" * 10**6)),
    "no JSON": lambda start: start + chunk(message(2, b"\xff\xfe")),
    "an unknown kind": lambda start: start + chunk(message(2, b'{"kind":"magic"}')),
    "infinity": lambda start: start + chunk(message(5, b'{"t":1e999,"play":0,"q":[0,0,0,0,0,0]}')),
    "five joints": lambda start: start + chunk(message(5, b'{"t":1,"play":0,"q":[0,0,0,0,0]}')),
    "a record over the end": lambda start: start + chunk(struct.pack("<BQ", 5, 2**62)),
    "a short message": lambda start: start + chunk(struct.pack("<BQHI", 5, 3, 1, 1) + bytes(40)),
    "half a record": lambda start: start + chunk(b"\x05\x00"),
    "a channel of nothing": lambda start: start + chunk(struct.pack("<BQ", 4, 2) + b"\x00\x00" + bytes(40)),
    "an edit that fits nothing": lambda start: start + chunk(message(
        3, b'{"kind":"change","edit":1,"base":0,"at":0,"version":1,"first":99,"dof":6,"tail_start":0,"end":1}'
    )),
    "coefficients of no joints": lambda start: start + chunk(message(
        3,
        b'{"kind":"change","edit":1,"base":0,"at":0,"version":1,"first":0,"dof":6,"tail_start":1,"end":1,'
        b'"segments":[{"duration":1,"coefficients":[1,2]}]}',
    )),
    "segments that jump": lambda start: start + chunk(message(
        3,
        b'{"kind":"change","edit":1,"base":0,"at":0,"version":1,"first":0,"dof":6,"tail_start":1,"end":7,'
        b'"segments":[{"duration":1,"coefficients":[9,9,9,9,9,9]}]}',
    )),
}  # fmt: skip


HARMLESS = ("a huge record", "a huge block", "a bomb that is told", "a bomb that is not")
"""Passed over as blocks that are destroyed."""


@pytest.mark.parametrize("name", HOSTILE)
def test_an_enemys_file_brings_typed_errors_alone(small: Path, tmp_path: Path, name: str) -> None:
    path = tmp_path / "hostile.mcap"
    path.write_bytes(HOSTILE[name](opening(small)))
    errors = []
    try:
        with open_recording(path) as recording:
            assert recording.damage
            for look in (recorded.everything, lambda r: r.edits, lambda r: r.span, lambda r: r.virtual(1.0)):
                try:
                    look(recording)
                except FormatError as error:
                    errors.append(error)
    except FormatError as error:
        errors.append(error)
    assert all(len(str(error)) < 500 for error in errors)
    assert errors or name in HARMLESS


def indexed(entries: bytes) -> Callable[[bytes], bytes]:
    """A file with an index whose checksum holds."""

    def made(start: bytes) -> bytes:
        data = start + struct.pack("<BQI", 15, 4, 0)
        footer = struct.pack("<BQQQ", 2, 20, len(data), 0)
        return data + entries + footer + struct.pack("<I", zlib.crc32(entries + footer)) + MAGIC

    return made


def place(offset: int, length: int, size: int, channels: int = 0) -> bytes:
    body = struct.pack("<QQQQI", 0, 0, offset, length, channels) + struct.pack("<QI4sQQ", 0, 4, b"zstd", 1, size)
    return struct.pack("<BQ", 8, len(body)) + body


INDEXES = {
    "nothing": b"",
    "a block past the end": place(10**6, 10, 10),
    "a block of everything": place(0, 2**63, 10),
    "blocks that overlap": place(60, 50, 10) * 2,
    "a huge block": place(60, 50, 2**60),
    "blocks that unpack to too much": b"".join(place(60 + 60 * k, 60, 2**24) for k in range(20)),
    "channels over the end": place(60, 50, 10, 2**31),
    "a record over the end": struct.pack("<BQ", 8, 2**62),
    "half a record": b"\x08",
    "a channel of nothing": struct.pack("<BQ", 4, 3) + b"abc",
    "a channel over the end": struct.pack("<BQHHI", 4, 8, 1, 1, 2**31),
}


@pytest.mark.parametrize("name", INDEXES)
def test_an_enemys_index_brings_typed_errors_alone(small: Path, tmp_path: Path, name: str) -> None:
    path = tmp_path / "hostile.mcap"
    path.write_bytes(indexed(INDEXES[name])(opening(small)))
    with pytest.raises(FormatError):
        open_recording(path)


@pytest.mark.parametrize("name", ["missing", "folder", "fifo", "/dev/zero"])
def test_what_is_no_file_is_refused_at_once(tmp_path: Path, name: str) -> None:
    path = tmp_path / name
    if name == "folder":
        path.mkdir()
    elif name == "fifo":
        os.mkfifo(path)
    with pytest.raises(FormatError):
        open_recording(path)


def test_random_bytes_after_a_good_beginning(small: Path, tmp_path: Path) -> None:
    rng, judge, path = np.random.default_rng(1), Judge(small), tmp_path / "random.mcap"
    data = small.read_bytes()
    for _ in range(60):
        cut = int(rng.integers(HEAD, len(data)))
        patch = rng.bytes(int(rng.integers(1, 2000)))
        path.write_bytes(data[:cut] + patch + data[cut + int(rng.integers(0, 2000)) :])
        judge.look(path)


def test_edits_that_an_enemy_changed_bring_typed_errors_alone() -> None:
    rng, found = Random(1), set()
    kinds = (m.HistoryEntry, m.ChangeEntry)
    messages = [message for _, message in recorded.motion(2.0, every=0.4)[0] if isinstance(message, kinds)]
    values = (0, 1, -1, 2, 5, 99, 2**62, 1e9, -1e9, 1e-300, 0.5, None, 6, 64)
    for _ in range(300):
        entries: list[dict[str, Any]] = [
            msgspec.to_builtins(message.as_written(), enc_hook=plain) for message in messages
        ]
        entry = rng.choice(entries)
        if entry.get("segments") and rng.random() < 0.5:
            entry = entry["segments"][rng.randrange(len(entry["segments"]))]
        entry[rng.choice([name for name in entry if name not in ("kind", "segments")])] = rng.choice(values)
        chain = Chain("a file")
        try:
            for given in entries:
                chain.add(DECODERS[NUMBERS["/timeline"]].decode(msgspec.json.encode(given)))
            for edit in chain.edits:
                edit.timeline.sample([0.0, 1.0, 1e9])
            found.add("read")
        except FormatError:
            found.add("refused")
        except msgspec.MsgspecError:
            found.add("unreadable")
    assert found == {"read", "refused", "unreadable"}
