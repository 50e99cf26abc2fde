"""Random and mutated datagrams: no exception leaves a core, nothing moves, memory stays flat."""

from __future__ import annotations

import os
import time
import tracemalloc
from random import Random

import pytest

from interfaces.rsp import handshake, header
from interfaces.rsp.model import example
from interfaces.rsp.session import DropReason
from tests.interfaces.rsp.joined import ADDRESS, Network, Pair
from tests.interfaces.rsp.test_security import WHEEL

RUNS = int(os.environ.get("VRS_SOAK_DATAGRAMS", "8000"))
"""Datagrams for each core."""
MODEL = example()


def mutated(random: Random, data: bytes) -> bytes:
    """A datagram like another one, or not."""
    what = random.randrange(8)
    if what == 0:
        return random.randbytes(random.choice((0, 1, 19, 20, 21, 44, 100, 1500)))
    made = bytearray(data)
    for _ in range(random.choice((1, 1, 2, 5))):
        at = random.randrange(len(made))
        if what < 4:
            made[at] = random.choice((0, 1, 0x7F, 0x80, 0xFF, random.randrange(256)))
        elif what == 4 and len(made) > 21:
            del made[at:]
            break
        elif what == 5:
            made[at:at] = random.randbytes(random.randrange(1, 9))
        elif what == 6:
            made += bytes(random.randrange(1, 2000))
        else:
            # A right header, and anything behind it.
            made[20:] = random.randbytes(random.randrange(0, 60))
    return bytes(made)


def session(*, sealed: bool) -> tuple[Pair, list[tuple[str, bytes]]]:
    """A session, and what was sent in it."""
    pair = Pair(MODEL, Network(Random(1)), sealed=sealed)
    sent: list[tuple[str, bytes]] = []
    usual = pair.network.send
    pair.network.send = lambda to, data, now: (sent.append((to, data)), usual(to, data, now))[1]
    pair.opened()
    pair.local.request(MODEL.index("sensing"), True)
    pair.local.write(WHEEL, b"\0\x64")
    pair.local.command(MODEL.index("ir_fire"), b"\1")
    pair.local.store(MODEL.index("program"), b"program", deadline=9.0)
    pair.robot.store(MODEL.index("log"), b"log", deadline=9.0)
    pair.run(0.5)
    pair.robot.effectors(now=pair.now)
    pair.network.send = usual
    return pair, sent


def feed(pair: Pair, sent: list[tuple[str, bytes]], runs: int, random: Random, *, mutate_session: bool) -> float:
    """Let both cores have so many datagrams; returns the longest time that one took [s]."""
    longest = 0.0
    robot_number = pair.robot.session.to_bytes(6, "big")
    for k in range(runs):
        to, data = random.choice(sent)
        data = mutated(random, data)
        if mutate_session and len(data) >= 18 and random.random() < 0.7:
            data = data[:12] + robot_number + data[18:]
        begin = time.process_time()
        pair.robot.receive(data, random.choice((ADDRESS, b"stranger")), now=pair.now)
        pair.local.receive(data, now=pair.now)
        longest = max(longest, time.process_time() - begin)
        if k % 16 == 0:
            # Not so long that the watchdog lets the wheels rest.
            pair.now += 16 * 0.3 / RUNS
            for answer, _ in pair.robot.to_send(now=pair.now):
                pair.local.receive(answer, now=pair.now)
            pair.local.to_send(now=pair.now)
            pair.local.take()
            pair.robot.take()
        del to
    return longest


def test_sealed_nothing_moves_whatever_comes() -> None:
    pair, sent = session(sealed=True)
    before, number = pair.robot.motion.given(WHEEL), pair.robot.session
    feed(pair, sent, RUNS, Random(3), mutate_session=True)
    pair.robot.effectors(now=pair.now)
    assert pair.robot.motion.given(WHEEL) == before
    assert pair.robot.session == number
    dropped = pair.robot.dropped
    # A mutation may change nothing: then it's a packet.
    assert sum(dropped.values()) >= 0.99 * RUNS
    for reason in (
        DropReason.MALFORMED,
        DropReason.SESSION,
        DropReason.AUTHENTICATION,
        DropReason.DOWNGRADE,
        DropReason.MODEL,
        DropReason.UNEXPECTED,
    ):
        assert dropped[reason] > 0, reason


def test_in_the_clear_nothing_but_packets_leaves_a_trace() -> None:
    pair, sent = session(sealed=False)
    feed(pair, sent, RUNS, Random(4), mutate_session=True)
    changed = pair.robot.effectors(now=pair.now)
    # In the clear a guessed session may move; never beyond the limits, and never by what isn't finite.
    assert all(-500 <= value <= 500 for values in changed.values() for value in values)


@pytest.mark.parametrize("sealed", [False, True])
def test_memory_stays_flat(sealed: bool) -> None:
    pair, sent = session(sealed=sealed)
    random = Random(5)
    feed(pair, sent, RUNS // 4, random, mutate_session=True)
    tracemalloc.start()
    try:
        feed(pair, sent, RUNS // 4, random, mutate_session=True)
        first, _ = tracemalloc.get_traced_memory()
        feed(pair, sent, RUNS // 2, random, mutate_session=True)
        second, _ = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert second - first < 200_000


@pytest.mark.parametrize(
    ("module", "function", "sound"),
    [
        (header, "decode", "if not SIZE <= len(data) <= LONGEST:"),
        (handshake, "decode_answer", "if len(body) != _ANSWER.size:"),
    ],
)
def test_a_planted_fault_is_found(module, function: str, sound: str, monkeypatch: pytest.MonkeyPatch) -> None:
    import inspect
    import textwrap

    usual = getattr(module, function)
    source = textwrap.dedent(inspect.getsource(usual))
    assert source.count(sound) == 1
    space = dict(vars(inspect.getmodule(usual)))
    exec(compile(source.replace(sound, "if False:"), "<planted>", "exec", dont_inherit=True, flags=1 << 24), space)
    pair, sent = session(sealed=False)
    if function == "decode_answer":
        pair = Pair(MODEL, Network(Random(1)), seed=9)
        pair.local.open(now=0.0)
        sent = [item for item in sent if header.decode(item[1]).type in (4, 5)]
    monkeypatch.setattr(module, function, space[function])
    with pytest.raises(Exception, match=r"unpack|argument|buffer"):
        _fed(pair, sent)


def _fed(pair: Pair, sent: list[tuple[str, bytes]]) -> None:
    random = Random(2)
    for _ in range(3000):
        pair.local.receive(mutated(random, random.choice(sent)[1]), now=0.0)
