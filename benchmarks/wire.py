"""Bytes of the stream of segments beside frames and meshcat's transforms, and what a message costs."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from statistics import median
from typing import Any

import msgspec
import numpy as np
import umsgpack

from benchmarks.moves import MODEL
from benchmarks.results import Bar, Cost, Part, Result
from interfaces import messages as m
from interfaces.clients.ports import RemotePort
from interfaces.clients.viewer_sources import SegmentSource
from interfaces.engine_server.broadcast import CompactSlot
from interfaces.engine_server.site import Site
from interfaces.messages.compact import CompactDecoder, CompactEncoder
from interfaces.messages.requests import LONGEST_DELAY
from interfaces.stream import Encoding, decode, encode
from vrs import Engine, JointTarget, ManualClock, MotionCommand, PolynomialSegment
from vrs.model import Array

SECONDS = 120
RATE = 60
HOME = MODEL.poses["nominal"]
SAME = 1e-9


def part() -> Part:
    """Measure."""
    streams = {encoding: _session(encoding) for encoding in Encoding}
    segments, moving, error, site = streams[Encoding.MSGPACK]
    t = np.arange(0.0, SECONDS, 1 / RATE)
    q = site.engine.timeline.sample(t)
    frames = [
        m.Frame(k + 1, x, x, row, m.FrameStatus.PREDICTED) for k, (x, row) in enumerate(zip(t, q, strict=True))
    ]
    ours = _rate(encode(m.Broadcast.showing(f, m.Verdicts(1, f.number - 1)), Encoding.MSGPACK) for f in frames)
    bare = _rate(msgspec.msgpack.encode({"t": x, "q": row}) for x, row in zip(t.tolist(), q.tolist(), strict=True))
    transforms = _rate(umsgpack.packb(_set(i, X)) for row in q for i, X in enumerate(MODEL.links(row)))
    note = f"moving {moving:.0%} of the time; joints off by {error:.0e} rad"
    peers = {"meshcat's transforms": (transforms, 0.015), "our frames": (ours, 0.25), "bare frames": (bare, 0.25)}
    return Part(
        "Wire",
        f"A follower of segments for {SECONDS} s: a parabolic move a second, `change` and `pulse` in msgpack, and "
        f"{RATE} frames a second: meshcat's `set_transform` of seven links by its own packer, our frames, and maps "
        "of nothing but time and joints. The copy is compared with the engine at every frame. The same "
        "frames compact: quantised and predicted. Then the time to write and read a message, without a socket.",
        (
            *(
                Result(
                    f"segments beside {name}",
                    Cost(segments),
                    unit="B/s",
                    bar=Bar(ratio=1 / share),
                    peer=name,
                    theirs=Cost(theirs),
                    ratio=theirs / segments if error <= SAME and moving >= 0.8 else None,
                    note=note,
                )
                for name, (theirs, share) in peers.items()
            ),
            Result("segments in JSON", Cost(streams[Encoding.JSON][0]), unit="B/s"),
            *_compact(frames),
            *_costs(frames[-1]),
        ),
    )


def _session(encoding: Encoding) -> tuple[float, float, float, Site]:
    """A session: bytes a second, share of the time that the arm moves, error of the copy [rad], the site."""
    site, port = Site(Engine(MODEL, q=HOME, clock=ManualClock(0.0))), RemotePort()
    servlet, mirror = site.servlet(), SegmentSource(port, resend=1.0)
    mirror.advance(now=0.0)
    rng, size, moving, error, q = np.random.default_rng(0), 0, 0.0, 0.0, HOME
    for k in range(SECONDS * RATE):
        t = site.time(k / RATE)
        if k % RATE == 0:
            target = _target(q, rng)
            receipt = site.journal.execute(MotionCommand(JointTarget(target), execute_at=t))
            assert receipt is not None
            assert receipt.end is not None
            moving, q = moving + receipt.end - t, target
        for request in port.advance(now=t):
            servlet.receive(request, now=t)
        for reply in servlet.advance(now=t):
            data = encode(reply, encoding)
            size += len(data)
            mirror.receive(decode(data, encoding, allowed=m.Scene | m.History | m.Change | m.Pulse), now=t)
        if mirror.timeline is not None:
            off = np.abs(mirror.timeline.sample(t) - site.engine.timeline.sample(t)).max()
            error = max(error, float(off))
    return size / SECONDS, moving / SECONDS, error, site


def _target(q: Array, rng: np.random.Generator) -> Array:
    """A target near home that a parabolic move from q takes some 0.9 s for."""
    low, high, way = 0.0, 2.0, rng.uniform(-1.0, 1.0, MODEL.limits.dof)
    for _ in range(20):
        middle = 0.5 * (low + high)
        target = np.clip(HOME + middle * way, MODEL.limits.q_min, MODEL.limits.q_max)
        receipt = Engine(MODEL, q=q, clock=None).execute(MotionCommand(JointTarget(target)))
        assert receipt.end is not None
        assert receipt.execute_at is not None
        low, high = (middle, high) if receipt.end - receipt.execute_at < 0.9 else (low, middle)
    return target


def _set(link: int, X: Array) -> dict[str, Any]:
    """As `meshcat.commands.SetTransform` has it."""
    return {"type": "set_transform", "path": f"/meshcat/virtual/{link}", "matrix": X.T.ravel().tolist()}


def _rate(frames: Any) -> float:
    return sum(map(len, frames)) / SECONDS


def _compact(frames: list[m.Frame]) -> list[Result]:
    """The frames in compact form: bytes a second, and what one costs in a message of its own."""
    results = []
    for delay in (0.0, LONGEST_DELAY):
        sent = list(_written(frames, delay))
        size = sum(map(len, sent)) / SECONDS
        results.append(Result(f"compact frames that wait {1e3 * delay:g} ms at most", Cost(size), unit="B/s"))
    writer, sent, reader = _written(frames, 0.0), iter(list(_written(frames, 0.0))), CompactDecoder()

    def read() -> None:
        reader.receive(decode(next(sent), Encoding.MSGPACK, allowed=m.Compact))

    results.append(Result("write a compact frame, msgpack", _time(lambda: next(writer))))
    results.append(Result("read a compact frame, msgpack", _time(read)))
    return results


def _written(frames: list[m.Frame], delay: float) -> Iterator[bytes]:
    """The messages that a viewer of compact frames gets."""
    slot = CompactSlot(CompactEncoder(RATE), RATE, delay)
    for frame in frames:
        slot.put(m.Broadcast.showing(frame, m.Verdicts(1, frame.number)))
        message = slot.take()
        if message is not None:
            yield encode(message, Encoding.MSGPACK)


def _costs(frame: m.Frame) -> list[Result]:
    rng = np.random.default_rng(1)
    pieces = [PolynomialSegment(0.25 * k, 0.25, rng.normal(size=(4, 6)), 7) for k in range(64)]
    found = {
        "a frame": (m.Broadcast.showing(frame, m.Verdicts(1, 5)), Bar(median=5.0)),
        "an order": (m.Order(1, MotionCommand(JointTarget(HOME)), 1), Bar()),
        "an edit of four segments": (m.Change(2, 0, 1.0, 7, segments=tuple(pieces[:4])), Bar()),
        "a history of 64 segments": (m.History(1, 0, segments=tuple(pieces)), Bar()),
    }
    results = []
    for name, (message, bar) in found.items():
        for encoding in Encoding:
            data = encode(message, encoding)
            form, allowed = encoding.value.rpartition(".")[2], type(message)
            results += [
                Result(f"write {name}, {form}", _time(lambda: encode(message, encoding)), bar=bar),  # noqa: B023
                Result(f"read {name}, {form}", _time(lambda: decode(data, encoding, allowed=allowed))),  # noqa: B023
            ]
    return results


def _time(call: Callable[[], object]) -> Cost:
    """Median and p99 of blocks of 20 calls, a call, in processor time."""
    spent = []
    for _ in range(200):
        begin = time.thread_time()
        for _ in range(20):
            call()
        spent.append((time.thread_time() - begin) / 20 * 1e6)
    return Cost(median(spent), float(np.percentile(spent, 99)))
