"""CUBO's service: who comes near is seen, photographed and told a story, by what the robot's devices say alone."""

from __future__ import annotations

import io
import math
import shutil
import wave
from pathlib import Path
from random import Random

import numpy as np
import pytest
from PIL import Image

from interfaces.cli.main import exit_status
from interfaces.rsp.host import RspHost
from interfaces.rsp.local import LocalCore
from interfaces.rsp.middleware import Middleware
from interfaces.rsp.model import read_model
from interfaces.rsp.robot import RobotCore
from interfaces.rsp.story import Hearing, StoryTeller, Visitors, playable
from robots.cubo.body import MOVES, CuboBody
from robots.cubo.parameters import MODEL_FILE
from robots.mobile.microphone import TOLD_RATE
from robots.rooms import Room, read_room
from tests.interfaces.rsp.test_live import robot
from vrs.clock import ManualClock

MODEL = read_model(MODEL_FILE.with_name("story.xmi"))
ROOM = read_room(
    "room 1\nsize 6 6\nstart 3 3 0\nwall 2.5 2.6  3.5 2.6\nsound 3 5 level=70 pitch=1000\n"
    "person 0.2  0,5.5,3  6,5.5,3  9,3.6,3  14,3.6,3  17,5.5,3  21,5.5,3  24,3.6,3  30,3.6,3\n"
)
"""A wall 0.4 m to its right from the beginning; somebody who comes before it from 8 s to 15 s, and from 23 s on."""
SOUND_RATE = 48_800
TIMES = np.arange(2 * SOUND_RATE) / SOUND_RATE
STORY = (12_000 * np.sin(2 * np.pi * 300 * TIMES) * (1 + np.sin(2 * np.pi * 2 * TIMES)) / 2).astype("<i2")


class Told:
    """A session in memory, with a way that loses some packets, and what came of it."""

    def __init__(self, room: Room, seconds: float, *, loss: float = 0.0) -> None:
        rng, clock = Random(3), ManualClock()
        core = LocalCore(MODEL, rng.randbytes)
        core.open(now=0.0)
        middleware = Middleware(core, clock)
        self.teller = StoryTeller(middleware, STORY.tobytes(), SOUND_RATE)
        self.came: list[tuple[float, float, float]] = []
        self.lips: list[tuple[float, float]] = []
        answers: list[bytes] = []
        with CuboBody(room=room) as body:
            host = RspHost(RobotCore(MODEL, rng.randbytes), body, frozenset(MOVES))
            while clock.now() < seconds:
                now = clock.advance(0.01)
                for data in middleware.advance(answers, now=now):
                    if rng.random() >= loss:
                        host.core.receive(data, b"local", now=now)
                host.advance(now=now)
                answers = [data for data, _ in host.core.to_send(now=now) if rng.random() >= loss]
                if (who := self.teller.turn(now=now)) is not None:
                    self.came.append((now, *who))
                self.lips.append((now, body.shown.get("lip", (0.0,))[0]))
            self.played = body.played
        self.heard = np.concatenate(self.teller.heard)


@pytest.fixture(scope="module")
def told() -> Told:
    return Told(ROOM, 26.0)


def test_whoever_comes_is_told_it_once_and_whoever_comes_back_again(told: Told) -> None:
    (first, distance, bearing), (second, *_) = told.came
    # 0.6 m from the robot's outline, whose front is some 0.09 m before its middle; and half a second to be sure.
    assert 8.0 < first < 9.5
    assert 23.0 < second < 24.5
    assert distance == pytest.approx(0.3, abs=0.32)
    assert abs(bearing) < 0.5
    assert told.teller.told == 2
    assert told.played == 2 * len(STORY) * 2


def test_its_camera_takes_a_picture_of_who_came_and_its_lip_moves_while_it_tells(told: Told) -> None:
    assert len(told.teller.pictures) == 2
    for data in told.teller.pictures:
        picture = np.asarray(Image.open(io.BytesIO(data)).convert("RGB")).astype(float)
        assert picture.shape == (120, 160, 3)
        cloth = picture[..., 2] > 1.3 * picture[..., 0]
        assert cloth[:, 60:100].mean() > 0.3
        assert cloth[:, :20].mean() < 0.1
    first = told.came[0][0]
    still = [level for t, level in told.lips if t < first]
    moving = [level for t, level in told.lips if first + 0.2 < t < first + 1.9]
    assert max(still) == 0.0
    assert max(moving) > 200.0
    assert min(moving) < 50.0


def test_its_microphone_hears_the_room_and_its_own_story(told: Told) -> None:
    def share(piece: np.ndarray, pitch: float) -> float:
        """How much of a piece is a tone [samples, root mean square]."""
        wave_of = np.exp(-2j * np.pi * pitch * np.arange(len(piece)) / TOLD_RATE)
        return abs((piece * wave_of).mean()) * math.sqrt(2)

    def at(begin: float, end: float) -> np.ndarray:
        return told.heard[round(begin * TOLD_RATE) : round(end * TOLD_RATE)].astype(float)

    first = told.came[0][0]
    quiet, loud = at(2.0, 6.0), at(first + 0.2, first + 1.8)
    assert len(told.heard) / TOLD_RATE == pytest.approx(26.0, abs=0.3)
    level = 20 * math.log10(math.sqrt((quiet**2).mean()) / 32767 * math.sqrt(2)) + 85.0
    assert level == pytest.approx(70 - 20 * math.log10(2.0), abs=0.3)
    assert share(loud, 300.0) > 100 * share(quiet, 300.0)
    assert share(loud, 300.0) == pytest.approx(0.25 * 12_000 / 2 / math.sqrt(2), rel=0.15)


def test_where_packets_are_lost_nobody_is_told_it_twice_and_the_microphone_keeps_its_time() -> None:
    lossy = Told(ROOM, 12.0, loss=0.15)
    assert [round(t) for t, *_ in lossy.came] == [9]
    assert len(lossy.teller.pictures) == 1
    assert len(lossy.heard) / TOLD_RATE == pytest.approx(12.0, abs=0.5)


def test_a_wall_is_nobody_and_a_robot_that_turns_towards_one_looks_anew() -> None:
    visitors, wall = Visitors(), [0.8, 0.35, 0.8]
    for k in range(100):
        lost = [0.8, 0.8, 0.8] if k % 17 == 0 else wall
        assert visitors.look(lost, (0.0, 0.0, 0.0), now=0.05 * k) is None
    turned = [0.35, 0.8, 0.8]
    for k in range(100, 160):
        assert visitors.look(turned, (0.0, 0.0, 0.5), now=0.05 * k) is None
    found = [visitors.look([0.35, 0.8, 0.5], (0.0, 0.0, 0.5), now=0.05 * k) for k in range(160, 200)]
    assert [sensor for sensor in found if sensor is not None] == [2]
    assert visitors.here


def test_what_is_told_twice_is_heard_once_and_what_is_lost_is_silence() -> None:
    hearing, sound = Hearing(), np.arange(1, 2001)
    found = [
        hearing.take([count % 32_768, *sound[count - 320 : count]]) for count in (320, 480, 480, 640, 1200, 1360)
    ]
    assert [len(piece) for piece in found] == [320, 160, 0, 160, 560, 160]
    heard = np.concatenate(found)
    assert (heard == np.where((sound > 640) & (sound <= 880), 0, sound)[:1360]).all()


def test_a_story_of_any_rate_lasts_as_long_on_the_speaker() -> None:
    samples = (1000 * np.sin(2 * np.pi * 100 * np.arange(22_050) / 22_050)).astype(np.int16)
    played = np.frombuffer(playable(samples, 22_050, SOUND_RATE), dtype="<i2")
    assert len(played) == SOUND_RATE
    assert np.abs(np.fft.rfft(played)).argmax() == 100


@pytest.mark.parametrize("speaks", [True, pytest.param(False, marks=pytest.mark.slow)])
def test_the_command_tells_it_and_says_so_where_nothing_speaks(
    tmp_path: Path, speaks: bool, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    if speaks and shutil.which("espeak-ng") is None:
        pytest.skip("no espeak-ng: install the program")
    if not speaks:
        monkeypatch.setattr("interfaces.media.speech.program", lambda: None)
    room, text = tmp_path / "visit.room", tmp_path / "story.txt"
    room.write_text("room 1\nsize 6 6\nstart 3 3 0\nperson 0.2  0,5.5,3  4,5.5,3  5,3.6,3\n")
    text.write_text("Once upon a time.\n")
    words = ["story", "--text", str(text), "--out", str(tmp_path / "out"), "--visits", "1"]
    with robot("--model", "story", "--room", str(room)) as address:
        assert exit_status(["rsp", *words, address]) == 0
    said = capsys.readouterr()
    assert "somebody is 0." in said.out
    assert "Once upon a time." in said.out
    assert ("espeak-ng isn't installed: the story is only written" in said.err) is not speaks
    assert (tmp_path / "out" / "visit-1.jpg").read_bytes()[:2] == b"\xff\xd8"
    with wave.open(str(tmp_path / "out" / "heard.wav")) as file:
        assert file.getframerate() == TOLD_RATE
        heard = np.frombuffer(file.readframes(10**6), dtype="<i2")
    assert bool(np.abs(heard).max(initial=0) > 1000) is speaks
