"""A small fuzzer: mutates messages by structure and by bytes, and keeps what reaches new code."""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Callable
from dataclasses import dataclass, field, fields, is_dataclass, replace
from random import Random
from types import FrameType
from typing import Any

import msgspec
import numpy as np

from interfaces.messages import Pulse
from interfaces.messages.control import ProtocolError
from interfaces.stream import Encoding, decode, encode
from tests.interfaces.stream.drawn import edges
from tests.interfaces.stream.same import same
from vrs.commands import Grip, MotionCommand

TRACED = ("/interfaces/stream/", "/interfaces/messages/", "<planted>")
MARKS: tuple[Any, ...] = (
    *edges(), None, True, False, 0.0, -0.0, 1e300, -1e300, math.inf, -math.inf, math.nan, "nan", "\0",
    b"", b"\0" * 8, b"\xff" * 48, [], [[]], [0.0] * 6, [None], {}, {"type": "move"}, {"type": "pose", "X": []},
)  # fmt: skip
"""Values that are at the edge of something: of fields' ranges, and of what values there are."""


@dataclass(frozen=True)
class Finding:
    """A frame on which the decoder misbehaved."""

    frame: bytes
    error: str
    runs: int


@dataclass
class Fuzzer:
    """Feeds the decoder, in one encoding."""

    encoding: Encoding
    allowed: Any
    corpus: list[bytes]
    random: Random
    seen: set[tuple[str, int, int]] = field(default_factory=set)
    accepted: int = 0
    kept: int = 0

    def run(self, runs: int, target: Callable[..., Any] = decode) -> Finding | None:
        """Try so many frames; the first on which the decoder misbehaves."""
        for frame in self.corpus:
            self._try(frame, target)
        for number in range(1, runs + 1):
            frame = self.mutated()
            before = len(self.seen)
            error = self._try(frame, target)
            if error:
                return Finding(frame, error, number)
            if len(self.seen) > before and len(self.corpus) < 2000:
                self.corpus.append(frame)
                self.kept += 1
        return None

    def _try(self, frame: bytes, target: Callable[..., Any]) -> str:
        last = ("", 0)

        def line(code: FrameType, event: str, _: object) -> Any:
            nonlocal last
            place = code.f_code.co_filename, code.f_lineno
            if event == "line":
                self.seen.add((place[0], last[1] if last[0] == place[0] else 0, place[1]))
            last = place
            return line

        def call(code: FrameType, event: str, _: object) -> Any:
            return line if any(part in code.f_code.co_filename for part in TRACED) else None

        usual = sys.gettrace()
        sys.settrace(call)
        try:
            value = target(frame, self.encoding, allowed=self.allowed)
        except ProtocolError as error:
            return "" if error.text else "an error without a text"
        except BaseException as error:  # noqa: BLE001 - whatever it is, it's the finding
            return f"{type(error).__name__}: {error}"
        finally:
            sys.settrace(usual)
        self.accepted += 1
        return self._judge(value, target)

    def _judge(self, value: Any, target: Callable[..., Any]) -> str:
        """What's wrong with a value that was accepted."""
        if not sound(value):
            return f"accepted what isn't finite, or too large: {value!r}"
        again = target(encode(value, self.encoding), self.encoding, allowed=self.allowed, largest=1 << 20)
        return "" if same(again, value) else f"{value!r} comes back as {again!r}"

    def mutated(self) -> bytes:
        """A frame like those in the corpus; the newest are the likeliest."""
        random = self.random
        newest = self.kept and random.random() < 0.5
        frame = random.choice(self.corpus[-min(self.kept, 16) :] if newest else self.corpus)
        for _ in range(random.choice((1, 1, 1, 2, 4))):
            frame = self._shaken(frame) if random.random() < 0.3 else self._rebuilt(frame)
        return frame

    def _shaken(self, frame: bytes) -> bytes:
        random = self.random
        data = bytearray(frame or b"\0")
        at = random.randrange(len(data))
        what = random.randrange(5)
        if what == 0:
            data[at] ^= 1 << random.randrange(8)
        elif what == 1:
            data[at] = random.choice((0, 0x7F, 0x80, 0xC0, 0xC6, 0xCB, 0xDD, 0xDF, 0xFF, 0x22, 0x5B, 0x7B))
        elif what == 2:
            del data[at:]
        elif what == 3:
            del data[at : at + random.randrange(1, 9)]
        else:
            data[at:at] = random.randbytes(random.randrange(1, 9))
        return bytes(data)

    def _rebuilt(self, frame: bytes) -> bytes:
        try:
            root = self._read(frame)
            places = list(_places(root))
            holder, key = self.random.choice(places)
            self._change(holder, key)
            return self._write(root)
        except (msgspec.MsgspecError, ValueError, TypeError, IndexError, RecursionError, OverflowError):
            return self._shaken(frame)

    def _change(self, holder: Any, key: Any) -> None:
        random, old = self.random, holder[key]
        what = random.randrange(6)
        if what == 0:
            del holder[key]
        elif what == 1 and isinstance(old, int):
            holder[key] = old + random.randint(-3, 3)
        elif what == 1 and isinstance(holder, list):
            holder[key:key] = [old] * random.choice((1, 2, 5, 70))
        elif what == 2 and isinstance(old, bytes):
            holder[key] = (old * 99)[: 8 * random.randrange(0, 130) + random.choice((0, 0, 0, 4))]
        elif what == 3 and isinstance(old, bytes) and old:
            at = 8 * random.randrange(len(old) // 8 + 1)
            number = np.float64(random.choice((math.nan, math.inf, 1e300, 0.0)))
            holder[key] = old[:at] + number.tobytes() + old[at + 8 :]
        elif what == 4:
            other = self._read(random.choice(self.corpus))
            container, place = random.choice(list(_places(other)))
            holder[key] = container[place]
        else:
            holder[key] = random.choice(MARKS)

    def _read(self, frame: bytes) -> Any:
        return msgspec.msgpack.decode(frame) if self.encoding is Encoding.MSGPACK else json.loads(frame)

    def _write(self, root: Any) -> bytes:
        if self.encoding is Encoding.MSGPACK:
            return msgspec.msgpack.encode(root)
        return json.dumps(root).encode()


def _places(root: Any) -> Any:
    """Every place in nested lists and maps, as a container and a key."""
    entries = root.items() if isinstance(root, dict) else enumerate(root) if isinstance(root, list) else ()
    for key, value in list(entries):
        yield root, key
        yield from _places(value)


def sound(value: Any) -> bool:
    """Whether all that a value holds is finite, and whole numbers have 64 bits at most."""
    if isinstance(value, np.ndarray):
        bounded = value.size <= 64 * 32 and len(value) <= (64 if value.ndim == 1 else 32)
        return bool(np.isfinite(value).all()) and bounded and not value.flags.writeable
    if isinstance(value, float):
        return math.isfinite(value)
    if isinstance(value, int):
        return -(2**63) <= value < 2**64
    if isinstance(value, list | tuple):
        return all(map(sound, value))
    if isinstance(value, MotionCommand) and value.deviation == math.inf:
        return sound(replace(value, deviation=0.0))
    if isinstance(value, Grip) and value.opening == math.inf:
        return sound(replace(value, opening=0.0))
    if isinstance(value, msgspec.Struct):
        names = set(value.__struct_fields__) - ({"past"} if isinstance(value, Pulse) else set())
        return all(sound(getattr(value, name)) for name in names)
    if is_dataclass(value):
        return all(sound(getattr(value, f.name)) for f in fields(value))
    return True
