"""What is said, as sound and as packets: bounded, cleaned, in order, and silence between."""

from __future__ import annotations

import asyncio
import io
import itertools
import math
import os
import shutil
import wave
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from interfaces.media import Aloud, Presenter, SpeechError
from interfaces.media.coding import LEAD, SILENCE, SOUND_PERIOD, VoicePlayout, encode_sound
from interfaces.media.presenter import MOST_WAITING
from interfaces.media.speech import LONGEST, cleaned, reading_time, samples_of, shortened, spoken
from vrs.clock import ManualClock, WallClock
from vrs.errors import FormatError, InvalidValueError

needs_program = pytest.mark.skipif(
    shutil.which("espeak-ng") is None and os.environ.get("CI") != "true", reason="no espeak-ng: install the program"
)


@given(st.text(max_size=320))
@settings(max_examples=50)
def test_a_text_is_printable_or_refused(text: str) -> None:
    try:
        words = cleaned(text)
    except InvalidValueError:
        return
    assert 1 <= len(words) <= LONGEST
    assert words == " ".join(words.split())
    assert words.isprintable()
    assert "[[" not in words
    assert cleaned(words) == words


@pytest.mark.parametrize("text", ["", " \n ", "a" * (LONGEST + 1), "\x00\x1b", "[[]]", "b" * 100_000])
def test_what_cannot_be_said_is_refused(text: str) -> None:
    with pytest.raises(InvalidValueError, match="1 to 300 characters"):
        cleaned(text)


@pytest.mark.parametrize(
    "data", [b"", b"RIFF", b"RIFF\xff\xff\xff\x7fWAVEfmt \x10\x00\x00\x00" + bytes(16), bytes(100)]
)
def test_sound_that_is_none_is_refused(data: bytes) -> None:
    with pytest.raises(FormatError):
        samples_of(data)


def sound(rate: int, channels: int = 1, width: int = 2) -> bytes:
    """A WAV file of 100 frames."""
    data = io.BytesIO()
    with wave.open(data, "wb") as file:
        file.setnchannels(channels)
        file.setsampwidth(width)
        file.setframerate(rate)
        file.writeframes(bytes(100 * channels * width))
    return data.getvalue()


def test_sound_is_of_one_channel_at_8_to_48_khz() -> None:
    for rate in (8000, 22_050, 48_000):
        samples, found = samples_of(sound(rate))
        assert (len(samples), found) == (100, rate)
    for wrong in (sound(7999), sound(48_001), sound(22_050, channels=2), sound(22_050, width=1)):
        with pytest.raises(FormatError, match="sound of"):
            samples_of(wrong)


def levels(packets: list[bytes]) -> list[float]:
    """Largest sample of each packet, decoded one after the other."""
    import av

    codec: Any = av.CodecContext.create("libopus", "r")
    codec.format, codec.layout, codec.sample_rate = "s16", "stereo", 48_000
    frames = [codec.decode(av.Packet(packet)) for packet in packets]
    return [float(np.abs(frame.to_ndarray().astype(float)).max()) for found in frames for frame in found]


@needs_program
def test_words_become_sound_as_long_as_they_take_and_options_are_words() -> None:
    async def said(text: str) -> tuple[np.ndarray[Any, np.dtype[np.int16]], int]:
        return await spoken(text)

    short, rate = asyncio.run(said("Hello!"))
    long, _ = asyncio.run(said("--version -f /etc/passwd, please put the book on my top side!"))
    assert np.abs(short).max() > 3000
    assert len(long) > 2 * len(short) > rate / 2
    packets = encode_sound(short, rate)
    assert len(packets) * SOUND_PERIOD == pytest.approx(len(short) / rate, abs=0.15)
    heard = levels([SILENCE] * 5 + list(packets) + [SILENCE] * 5)
    assert max(heard[:5]) == 0.0
    assert max(heard) > 3000
    assert max(heard[-2:]) < 100


def test_a_program_that_fails_or_hangs_says_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    program = tmp_path / "espeak-ng"
    monkeypatch.setattr("interfaces.media.speech.TIME", 0.3)
    for script, words in (("exit 3", "status 3"), ("exec sleep 60", "longer than"), ("echo no", "no sound")):
        program.write_text(f"#!/bin/sh\n{script}\n")
        program.chmod(0o755)
        monkeypatch.setattr("interfaces.media.speech.program", lambda: str(program))
        with pytest.raises(SpeechError, match=words):
            asyncio.run(spoken("Hello!"))
    monkeypatch.setattr("interfaces.media.speech.program", lambda: None)
    with pytest.raises(SpeechError, match="isn't installed"):
        asyncio.run(spoken("Hello!"))


@given(st.lists(st.tuples(st.floats(0.0, 3.0), st.integers(1, 80)), min_size=1, max_size=6))
def test_what_is_said_is_heard_whole_once_and_in_order(said: list[tuple[float, int]]) -> None:
    playout, now, number = VoicePlayout(), 100.0, itertools.count()
    expected, heard = [], []
    tick = 100.0

    def listen(until: float) -> None:
        nonlocal tick
        while tick < until:
            heard.append(playout.at(tick))
            tick += SOUND_PERIOD

    for wait, length in said:
        listen(now)
        packets = [str(next(number)).encode() for _ in range(length)]
        expected += packets
        begin, end = playout.say(packets, now=now)
        assert begin >= now + LEAD
        assert end == pytest.approx(begin + length * SOUND_PERIOD)
        now += wait
    listen(max(now, playout.end) + 1.0)
    found = [packet for packet in heard if packet != SILENCE]
    # Where a tick falls onto a packet's edge, rounding may repeat or leave out one.
    assert list(dict.fromkeys(found)) == [packet for packet in expected if packet in set(found)]
    assert len(set(expected) - set(found)) <= 2 * len(said)
    assert playout.at(playout.end + 0.001) == SILENCE
    assert playout.at(99.0) == SILENCE


def test_hush_ends_what_is_said() -> None:
    playout = VoicePlayout()
    begin, _ = playout.say([b"a"] * 100, now=1.0)
    assert playout.at(begin) == b"a"
    playout.hush()
    assert playout.at(begin) == SILENCE


@needs_program
def test_speak_lasts_as_long_as_its_words_and_one_waits_for_the_other() -> None:
    clock, playout, told = WallClock(), VoicePlayout(), []

    async def talk() -> list[float]:
        presenter = Presenter(clock, playout)
        presenter.changed = lambda: told.append(presenter.saying)
        began = clock.now()
        ends = []

        async def one(text: str) -> None:
            await presenter.speak(text)
            ends.append(clock.now() - began)
            assert clock.now() >= playout.end - 1e-3 or text == "Yes."

        await asyncio.gather(one("Yes."), one("No."))
        return ends

    first, second = asyncio.run(talk())
    assert 0.3 < first < second
    assert told == ["Yes.", "", "No.", ""]


def test_without_sound_words_stand_as_long_as_reading_takes_and_who_is_cancelled_falls_silent(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("interfaces.media.presenter.reading_time", lambda text: reading_time(text) / 100)

    async def talk() -> None:
        presenter = Presenter(WallClock(), VoicePlayout(), audible=False)
        assert "[media]" in presenter.problem
        await presenter.speak("Hello!")
        assert presenter.saying == ""
        task = asyncio.create_task(presenter.speak("x" * LONGEST))
        while not presenter.saying:
            await asyncio.sleep(0)
        others = [asyncio.create_task(presenter.speak("next")) for _ in range(MOST_WAITING - 1)]
        await asyncio.sleep(0)
        with pytest.raises(SpeechError, match="wait to be said"):
            await presenter.speak("one too many")
        for one in (*others, task):
            one.cancel()
        await asyncio.gather(task, *others, return_exceptions=True)
        assert presenter.saying == ""
        with pytest.raises(InvalidValueError):
            await presenter.speak("")

    asyncio.run(talk())


def test_what_a_robot_says_and_shows_elsewhere_is_said_and_shown_here(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("interfaces.media.presenter.reading_time", lambda text: 0.01 * len(text))
    monkeypatch.setattr("interfaces.media.presenter.GRACE", 0.05)

    async def follow() -> None:
        shown: list[str] = []
        presenter = Presenter(WallClock(), VoicePlayout(), screen=shown.append, audible=False)

        async def until(words: str) -> None:
            async with asyncio.timeout(10):
                while presenter.saying != words:
                    await asyncio.sleep(0)

        for _ in range(3):
            presenter.follow("Hello!", "")
        await until("Hello!")
        presenter.follow("", "The\x00 book, please")
        assert presenter.saying == "Hello!"
        await until("")
        for says in ("x" * 2000, "other words"):
            presenter.follow(says, "The\x00 book, please")
            await until(shortened(says))
        presenter.follow("", "")
        await until("")
        assert shown == ["The book, please", ""]

    asyncio.run(follow())


@needs_program
def test_a_loudspeaker_on_board_is_done_when_its_words_are(monkeypatch: pytest.MonkeyPatch) -> None:
    async def talk() -> tuple[float, float]:
        aloud = Aloud()
        assert not aloud.is_speaking(now=0.0)
        aloud.speak("Hello!", now=5.0)
        assert aloud.text == "Hello!"
        while aloud.is_speaking(now=60.0):
            await asyncio.sleep(0.005)
        aloud.speak("Hello!", now=5.0)
        assert aloud.is_speaking(now=1e6)
        while aloud.until == math.inf:
            await asyncio.sleep(0.005)
        samples, rate = await spoken("Hello!")
        assert aloud.is_speaking(now=4.9 + len(samples) / rate)
        assert not aloud.is_speaking(now=5.1 + len(samples) / rate)
        aloud.speak("Hello!", now=5.0)
        aloud.hush()
        assert not aloud.is_speaking(now=5.0)
        monkeypatch.setattr("interfaces.media.speech.program", lambda: None)
        aloud.speak("Hello!", now=0.0)
        while aloud.is_speaking(now=60.0):
            await asyncio.sleep(0.005)
        return reading_time("Hello!"), aloud.until

    expected, found = asyncio.run(talk())
    assert found == expected


def test_a_message_stands_until_it_is_cleared() -> None:
    async def show() -> None:
        shown: list[str] = []
        presenter = Presenter(ManualClock(), VoicePlayout(), screen=shown.append, audible=False)
        presenter.show("Please  put the book\non my top side!")
        assert presenter.message == "Please put the book on my top side!"
        with pytest.raises(InvalidValueError):
            presenter.show("")
        presenter.clear()
        assert shown == ["Please put the book on my top side!", ""]
        assert presenter.message == ""

    asyncio.run(show())
