"""Compact frames: the error of each frame, lost messages, hostile bytes, and a reader written from the document."""

from __future__ import annotations

import contextlib
import json
import os
import re
import time
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from interfaces import Viewer
from interfaces.engine_server.broadcast import KEY_PERIOD, Broadcaster
from interfaces.messages import Broadcast, Compact, Follow, Frame, FrameStatus, Scene, ViewForm
from interfaces.messages.compact import (
    LAST_NUMBER,
    STEPS,
    TICKS,
    CompactDecoder,
    CompactEncoder,
    CompactFrame,
    packed,
)
from interfaces.stream import Encoding, decode, encode
from tests.interfaces.joined import HOME, MODEL, Joined, bad, constant, to
from tests.interfaces.stream.make_vectors import PATH
from vrs import Engine, ManualClock, SteerCommand
from vrs.errors import InvalidValueError
from vrs.model import frozen_array

RUNS = int(os.environ.get("VRS_FUZZ_RUNS", "20000"))
"""Mutated messages."""
DOCUMENT = Path(__file__).parents[3] / "docs" / "protocol.md"
NEAR = 0.5 / STEPS
"""How far a joint may be off [rad]: below the 1e-5 that the document states."""
VECTORS: list[dict[str, Any]] = json.loads(PATH.read_text(encoding="utf-8"))["compact"]


def frame(number: int, q: Any, *, t: float = 1.0, predicted: bool = False) -> Frame:
    status = FrameStatus.PREDICTED if predicted else FrameStatus.CONFIRMED
    return Frame(number, t, t - 0.5, frozen_array(q), status)


@st.composite
def motions(draw: st.DrawFn) -> list[Frame]:
    """Frames that stand, glide and jump, at times that aren't quite regular."""
    dof = draw(st.integers(1, 64))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    first, t = draw(st.integers(1, 10**9)), draw(st.floats(-9e8, 9e8))
    q, qd = rng.uniform(-3, 3, dof), np.zeros(dof)
    found = []
    for k in range(draw(st.integers(1, 40))):
        what = rng.random()
        if what < 0.1:
            q = rng.uniform(-1, 1, dof) * 10.0 ** rng.uniform(-6, 9)
        elif what < 0.3:
            qd = rng.normal(0, 1, dof)
        elif what < 0.4:
            qd = np.zeros(dof)
        q = np.clip(q + 0.02 * qd, -1e9, 1e9)
        t += 0.02 + (rng.normal(0, 0.002) if what < 0.5 else 0.0)
        found.append(frame(first + k, q, t=t, predicted=bool(rng.random() < 0.5)))
    return found


def check(broadcast: Broadcast, sent: Frame) -> None:
    got = broadcast.frame
    assert np.abs(got.q - sent.q).max() <= NEAR <= 1e-5
    assert abs(got.t - sent.t) <= 0.5 / TICKS + 1e-7
    assert abs(got.made_at - sent.made_at) <= 0.5 / TICKS + 2e-7
    assert (got.number, got.status, got.falsified_by) == (sent.number, sent.status, None)
    assert not got.q.flags.writeable


@settings(max_examples=150, deadline=None)
@given(motions(), st.data())
def test_every_frame_is_near_whatever_is_lost(sent: list[Frame], data: st.DataObject) -> None:
    encoder, reader = CompactEncoder(50.0), CompactDecoder()
    made = [encoder.add(one) for one in sent]
    by_number = {one.number: one for one in sent}
    at, broken = 0, True
    while at < len(made):
        size = data.draw(st.integers(1, 16))
        several = made[at : at + size]
        cut = next((k for k, one in enumerate(several) if k and one.delta is None), len(several))
        several = several[:cut]
        at += len(several)
        key = several[0].delta is None or broken or data.draw(st.booleans())
        message = Compact(packed(several, 0, key=key))
        if data.draw(st.integers(0, 4)) == 0:
            broken = data.draw(st.booleans())
            continue
        for encoding in Encoding:
            assert decode(encode(message, encoding), encoding, allowed=Compact) == message
        found = reader.receive(message)
        if key:
            assert [one.frame.number for one in found] == [one.number for one in several]
        for one in found:
            check(one, by_number[one.frame.number])
        broken = reader.lacking
        # Once more, it's known.
        assert reader.receive(message) == ()
        assert reader.lacking is broken


def test_what_stands_costs_next_to_nothing_and_what_moves_evenly_little_more() -> None:
    encoder = CompactEncoder(50.0)
    made = [encoder.add(frame(k, [0.5] * 6, t=0.02 * k)) for k in range(1, 10)]
    assert {one.delta for one in made[1:]} == {"2"}
    encoder = CompactEncoder(50.0)
    made = [encoder.add(frame(k, [k * k / 1024, 1.0], t=0.02 * k)) for k in range(1, 10)]
    assert {one.delta for one in made[3:]} == {"2"}


@pytest.mark.parametrize("q", [[], [0.0] * 65, [np.nan], [0.0, np.inf], [-1.1e9]])
def test_joints_that_cant_cross_are_refused(q: list[float]) -> None:
    with pytest.raises(InvalidValueError, match="1 to 64 joints within ±1e9 rad"):
        CompactEncoder(50.0).add(frame(1, q))
    for t in (np.nan, -np.inf, 1.1e9):
        with pytest.raises(InvalidValueError, match="within ±1e9 s"):
            CompactEncoder(50.0).add(frame(1, [0.0], t=t))


def test_the_largest_joints_at_the_largest_jumps_cross() -> None:
    encoder, reader = CompactEncoder(1000.0), CompactDecoder()
    for k in range(1, 100):
        end = 1e9 if k % 2 else -1e9
        one = Frame(k, end, end, frozen_array([end] * 64), FrameStatus.CONFIRMED)
        (found,) = reader.receive(Compact(packed([encoder.add(one)], 0, key=k == 1)))
        assert found.frame.q.tolist() == one.q.tolist()
        assert found.frame.t == one.t


def test_a_reader_without_the_frame_before_waits_for_a_key_frame() -> None:
    encoder = CompactEncoder(50.0)
    made = [encoder.add(frame(k, [0.1 * k], t=0.02 * k)) for k in range(1, 9)]
    reader = CompactDecoder()
    assert reader.receive(Compact(packed(made[1:3], 0, key=False))) == ()
    assert reader.lacking
    assert len(reader.receive(Compact(packed(made[2:4], 0, key=True)))) == 2
    assert not reader.lacking
    assert reader.receive(Compact(packed(made[5:6], 0, key=False))) == ()
    assert reader.lacking
    # What it would have needed comes too late to be of use, as it didn't keep what was after it.
    assert reader.receive(Compact(packed(made[2:3], 0, key=True))) == ()
    (found,) = reader.receive(Compact(packed(made[7:], 0, key=True)))
    check(found, frame(8, [0.8], t=0.16))
    # A key frame of which it has a part brings the rest.
    other = CompactDecoder()
    other.receive(Compact(packed(made[:3], 0, key=True)))
    assert [b.frame.number for b in other.receive(Compact(packed(made[1:5], 0, key=True)))] == [4, 5]


class TestTheServersSide:
    """A broadcaster's viewers of compact frames."""

    def broadcaster(self, rate: float = 50.0, lead: float = 0.0) -> tuple[Broadcaster, ManualClock]:
        clock = ManualClock(0.0)
        engine = Engine(MODEL, q=HOME, clock=clock)
        engine.execute(to(1, speed=0.2))
        return Broadcaster(engine, rate=rate, lead=lead), clock

    def run(self, source: Broadcaster, clock: ManualClock, beats: int) -> list[Broadcast]:
        found = []
        for _ in range(beats):
            found += source.advance(now=clock.now())
            clock.set(clock.now() + 1 / source.rate)
        return found

    @pytest.mark.parametrize(("delay", "size"), [(0.0, 1), (0.019, 1), (0.02, 2), (0.05, 3), (0.1, 6)])
    def test_frames_wait_for_others_no_longer_than_was_asked(self, delay: float, size: int) -> None:
        source, clock = self.broadcaster()
        slot, reader = source.join_compact(delay), CompactDecoder()
        counts = []
        for _ in range(61):
            self.run(source, clock, 1)
            message = slot.take()
            if message is not None:
                counts.append(len(reader.receive(message)))
                assert reader.number == source.number
        # The first frame doesn't wait.
        assert counts == [1] + [size] * (60 // size)

    def test_a_key_frame_comes_now_and_then_and_on_demand(self) -> None:
        source, clock = self.broadcaster()
        slot = source.join_compact()
        keys = []

        def step() -> None:
            self.run(source, clock, 1)
            message = slot.take()
            assert message is not None
            if CompactDecoder().receive(message):
                keys.append(source.number)

        for _ in range(600):
            step()
        assert keys == [1, 1 + 50 * KEY_PERIOD, 1 + 100 * KEY_PERIOD]
        slot.begin_again()
        step()
        assert keys[-1] == 601

    def test_a_slow_reader_gets_the_newest_frame_and_can_read_it(self) -> None:
        source, clock = self.broadcaster()
        slots, readers = [source.join_compact(d) for d in (0.0, 0.1)], [CompactDecoder() for _ in range(2)]
        for beats in (1, 6, 30, 3, 1, 100, 7):
            (*_, newest) = self.run(source, clock, beats)
            for slot, reader in zip(slots, readers, strict=True):
                message = slot.take()
                found = () if message is None else reader.receive(message)
                if found and found[-1].frame.number == source.number:
                    check(found[-1], newest.frame)
                assert not reader.lacking
        assert slots[0].missed == 148 - 7
        assert readers[0].number == source.number == 148

    def test_another_lead_begins_with_a_key_frame(self) -> None:
        source, clock = self.broadcaster()
        slot, reader = source.join_compact(), CompactDecoder()
        for lead in (0.0, 0.3, 0.3, -0.1):
            source.lead = lead
            (sent,) = self.run(source, clock, 1)
            (found,) = reader.receive(slot.take())
            check(found, sent.frame)

    def test_who_leaves_is_forgotten_and_others_share_the_frames(self) -> None:
        source, clock = self.broadcaster()
        slots = [source.join_compact() for _ in range(3)]
        self.run(source, clock, 5)
        source.leave(slots[0])
        self.run(source, clock, 5)
        assert slots[0].take() is not None
        assert slots[1].take() == slots[2].take()
        assert source.viewers == 2

    def test_verdicts_are_those_of_plain_frames(self) -> None:
        source, clock = self.broadcaster(lead=0.5)
        plain, slot, reader = source.join(), source.join_compact(0.1), CompactDecoder()
        told: dict[int, int | None] = {}
        rng, lost = np.random.default_rng(2), 0
        for k in range(3000):
            if rng.random() < 0.05:
                source.journal.execute(to(k))
            self.run(source, clock, 1)
            newest = plain.take()
            message = slot.take()
            if message is None or newest is None:
                continue
            if rng.random() < 0.02:
                lost += 1
                continue
            if reader.lacking or not (found := reader.receive(message)):
                slot.begin_again()
                found = reader.receive(message)
                if not found:
                    continue
            verdicts = found[-1].verdicts
            for first, last, by in verdicts.falsified:
                told |= dict.fromkeys(range(first, last + 1), by)
            assert verdicts.through == newest.verdicts.through
            assert verdicts.since == newest.verdicts.since
            for first, last, by in newest.verdicts.falsified:
                for number in range(max(first, verdicts.since), last + 1):
                    assert told[number] == by
            told = {number: by for number, by in told.items() if number >= newest.verdicts.since}
        assert lost > 5
        assert newest.verdicts.since > 1
        assert len(told) > 100


@pytest.mark.parametrize("delay", [0.0, 0.1])
def test_a_viewer_shows_what_one_of_plain_frames_shows_and_as_much_later_as_they_wait(delay: float) -> None:
    joined = Joined()
    joined.site.broadcast(50)
    plain, viewer = (
        joined.add(Viewer(joined.remote(constant(0.1), constant(0.1)), form=form, delay=wait))
        for form, wait in ((ViewForm.FRAMES, 0.0), (ViewForm.COMPACT, delay))
    )
    joined.engine.execute(to(1, speed=0.05))
    joined.run(5.0)
    theirs, ours = ([one for one in v.history if one.shown_at > 1.0] for v in (plain, viewer))
    if not delay:
        assert [one.shown_at for one in ours] == [one.shown_at for one in theirs]
        assert [one.t for one in ours] == pytest.approx([one.t for one in theirs], abs=1e-6)
    assert len(ours) >= len(theirs) > 180
    assert np.diff([one.t for one in ours]).max() < 0.0401
    assert [one.age for one in ours] == pytest.approx(np.full(len(ours), 0.11 + delay), abs=0.0101)
    for one in ours:
        assert np.abs(one.q - joined.engine.joints(one.t)).max() <= NEAR


@pytest.mark.parametrize("delay", [0.0, 0.1])
@pytest.mark.parametrize("loss", [0.02, 0.3])
def test_a_viewer_across_a_link_that_loses_and_reorders_recovers(delay: float, loss: float) -> None:
    joined = Joined()
    joined.site.broadcast(50, lead=0.2)
    conditions = bad(loss, 0.1, 0.02, 0.01)
    viewer = joined.add(Viewer(joined.remote(conditions, conditions), form=ViewForm.COMPACT, delay=delay))
    for k in range(40):
        joined.engine.execute(SteerCommand(rates=np.full(6, 0.1 * (-1) ** k), issued_at=joined.now))
        joined.run(0.25)
    joined.run(8.0)
    assert len(viewer.history) > 20
    assert viewer.history[-1].age < 1.5
    false = 0
    for one in viewer.history:
        true = np.abs(one.q - joined.engine.joints(one.t)).max() <= 1e-5
        if one.status is FrameStatus.FALSIFIED:
            false += 1
        elif one.status is FrameStatus.CONFIRMED:
            assert true
    assert false > 5


class FromTheDocument:
    """A reader written from the words of docs/protocol.md, *Compact frames*."""

    def __init__(self) -> None:
        self.number: int | None = None

    def read(self, message: bytes) -> list[tuple[int, float, float, list[float], bool]] | None:
        """What a message shows; None where a frame is missing."""
        digits = [half for byte in message for half in (byte // 16, byte % 16)]

        def integer() -> int:
            total, weight = 0, 1
            while True:
                digit = digits.pop(0)
                total += digit % 8 * weight
                weight *= 8
                if digit < 8:
                    return total

        def signed() -> int:
            n = integer()
            return -(n + 1) // 2 if n % 2 else n // 2

        first, form, _behind = integer(), integer(), integer()
        if form % 2 == 0 and self.number != first - 1:
            self.number = None
            return None
        shown = []
        for k in range(form // 2 + 1):
            flags = integer()
            if k == 0 and form % 2:
                n = integer()
                self.T, self.P, self.A = signed(), integer(), signed()
                self.x, self.v, self.a = ([signed() for _ in range(n)] for _ in range(3))
            else:
                self.T += self.P + (signed() if flags & 1 else 0)
                if not flags & 2:
                    self.a = [a + signed() for a in self.a]
                self.v = [v + a for v, a in zip(self.v, self.a, strict=True)]
                self.x = [x + v for x, v in zip(self.x, self.v, strict=True)]
            joints = [x / 65536 for x in self.x]
            shown.append((first + k, self.T / 1e6, (self.T - self.A) / 1e6, joints, bool(flags & 4)))
        assert digits in ([], [0])
        self.number = first + form // 2
        return shown


def test_the_example_of_the_document_is_the_first_vector() -> None:
    text = DOCUMENT.read_text(encoding="utf-8")
    _, _, section = text.partition("### Compact frames\n")
    section, _, _ = section.partition("\n### ")
    assert json.loads(VECTORS[0]["json"])["q"] in section
    message = decode(VECTORS[0]["json"].encode(), Encoding.JSON, allowed=Compact)
    assert encode(message, Encoding.MSGPACK).hex() in re.sub(r"\s", "", section)
    table = section.partition("| digits | integers | |\n|---|---|---|\n")[2].partition("\n\n")[0]
    digits = ("".join(re.findall("`([0-9a-f]+)`", row.split("|")[1])) for row in table.splitlines())
    assert "".join(digits) == VECTORS[0]["hex"]


def test_a_reader_from_the_document_reads_the_vectors() -> None:
    reader = FromTheDocument()
    for vector in VECTORS:
        found = reader.read(bytes.fromhex(vector["hex"]))
        expected = [
            (f["number"], f["t"], f["made_at"], f["q"], f["status"] == "predicted") for f in vector["frames"]
        ]
        assert found == (None if vector["lacking"] else expected)


@settings(max_examples=50, deadline=None)
@given(motions(), st.integers(1, 16))
def test_a_reader_from_the_document_reads_any_motion(sent: list[Frame], size: int) -> None:
    encoder, reader = CompactEncoder(50.0), FromTheDocument()
    made = [encoder.add(one) for one in sent]
    for k in range(0, len(made), size):
        several = made[k : k + size]
        found = reader.read(packed(several, 0, key=several[0].delta is None))
        for (number, t, _, q, predicted), one in zip(found or (), sent[k : k + size], strict=True):
            assert (number, predicted) == (one.number, one.status is FrameStatus.PREDICTED)
            assert np.abs(np.array(q) - one.q).max() <= NEAR
            assert abs(t - one.t) <= 1e-6


def corpus() -> list[bytes]:
    """Messages of all kinds."""
    found = [bytes.fromhex(vector["hex"]) for vector in VECTORS]
    rng = np.random.default_rng(8)
    for dof, last in ((1, 20), (6, 20), (64, 0)):
        encoder = CompactEncoder(50.0)
        made: list[CompactFrame] = []
        for k in range(1, 40):
            q = rng.uniform(-1, 1, dof) * 10.0 ** rng.uniform(-5, 9)
            made.append(encoder.add(frame(k, q, t=0.02 * k + rng.normal(0, 0.001))))
        found += [packed(made[k : k + 4], k, key=key) for k in (0, 1, 20) if k <= last for key in {k == 0, True}]
    return found


def test_no_bytes_bring_anything_but_frames_or_an_error_that_says_why() -> None:
    random, whole = Random(3), corpus()
    reader, read, refused = CompactDecoder(), 0, list[str]()
    begun = time.process_time()
    for run in range(RUNS):
        data = bytearray(random.choice(whole))
        for _ in range(random.choice((0, 1, 1, 2, 4))):
            at = random.randrange(len(data))
            what = random.randrange(4)
            if what == 0:
                data[at] = random.choice((0, 0x08, 0x77, 0x80, 0x88, 0xFF, random.randrange(256)))
            elif what == 1:
                data[at:at] = random.choice((b"\xff" * 9, b"\xff" * 20, b"\0", random.randbytes(3)))
            elif what == 2 and len(data) > 3:
                del data[at : at + random.randrange(1, 4)]
            else:
                data[at] ^= 1 << random.randrange(8)
        if run % 3 == 0:
            reader = CompactDecoder()
        try:
            found = reader.receive(Compact(bytes(data)))
        except InvalidValueError as error:
            refused.append(str(error))
            assert reader.lacking
            continue
        read += bool(found)
        assert len(found) <= 16
        for one in found:
            got = one.frame
            assert 1 <= got.number <= LAST_NUMBER
            assert 1 <= len(got.q) <= 64
            assert np.abs(got.q).max() <= 1e9
            assert max(abs(got.t), abs(got.made_at)) <= 1e9
    assert time.process_time() - begun < 500e-6 * RUNS
    assert read > RUNS / 50
    assert len(refused) > RUNS / 20
    assert all(" must be " in text and len(text) < 2000 for text in refused)


def test_an_integer_has_eighteen_digits_at_most() -> None:
    # A number of 18 digits, a key frame of one joint: the digits that are 0 cost, and mean nothing.
    for digits, fits in ((17, True), (18, False), (30, False)):
        text = "9" + "8" * (digits - 1) + "0" + "10" + "01040" + "000"
        message = Compact(bytes.fromhex(text + "0" * (len(text) % 2)))
        if fits:
            (found,) = CompactDecoder().receive(message)
            assert (found.frame.number, found.frame.q.tolist()) == (1, [0.0])
        else:
            with pytest.raises(InvalidValueError, match="integers of at most 18 digits"):
                CompactDecoder().receive(message)


def test_the_longest_message_takes_no_time() -> None:
    for data in (b"\xff" * 32768, b"\0" * 32768, b"\x70" * 32768, packed_largest()):
        begun = time.process_time()
        with contextlib.suppress(InvalidValueError):
            CompactDecoder().receive(Compact(data))
        assert time.process_time() - begun < 0.2


def packed_largest() -> bytes:
    """The most that a server sends at once."""
    encoder, found = CompactEncoder(1000.0), []
    for k in range(16):
        q = [(-1) ** k * 1e9] * 64
        found.append(encoder.add(Frame(2**53 - 16 + k, 0.0, 0.0, frozen_array(q), FrameStatus.PREDICTED)))
    data = packed(found, 2**53 - 2, key=True)
    assert len(CompactDecoder().receive(Compact(data))) == 16
    assert len(data) <= 32768
    return data


def test_a_server_is_asked_again_and_sends_a_key_frame() -> None:
    joined = Joined()
    joined.site.broadcast(50)
    servlet, reader = joined.site.servlet(), CompactDecoder()
    follow = Follow(1, ViewForm.COMPACT, 50.0)
    servlet.receive(follow, now=0.0)
    lacked = 0
    for k in range(60):
        joined.run(0.02)
        replies = servlet.advance(now=joined.engine.now())
        assert all(isinstance(reply, Scene | Compact) for reply in replies)
        for reply in replies:
            if isinstance(reply, Compact) and k not in (20, 40):
                reader.receive(reply)
        if k and reader.lacking:
            lacked += 1
            servlet.receive(follow, now=joined.engine.now())
    assert lacked == 2
    assert not reader.lacking
