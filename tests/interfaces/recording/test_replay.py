"""`vrs replay` as a user runs it: instants, rates, loops, two files, files that are cut."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
import time
import urllib.request
from contextlib import redirect_stderr, redirect_stdout
from io import StringIO
from typing import NamedTuple

import numpy as np
import pytest

from interfaces.cli.main import exit_status
from interfaces.cli.replay import PlaybackStart, begin_shown
from interfaces.recording.playback import Mode, Playback
from interfaces.recording.recording import open_recording
from tests.interfaces.recording.made import make

VRS = [sys.executable, "-m", "interfaces.cli", "replay"]
LONG = bool(os.environ.get("VRS_LONG"))
SECONDS, OFF = (20.0, 0.005) if LONG else (1.5, 0.05)
"""How long the rate is measured [s], and by what share it may be off: a short look sees less."""


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    path = tmp_path_factory.mktemp("made") / "run.mcap"
    return path, make(path, 12.0)


class Done(NamedTuple):
    returncode: int
    stdout: str
    stderr: str


def vrs(*arguments):
    """The command in this process."""
    with redirect_stdout(StringIO()) as out, redirect_stderr(StringIO()) as err:
        code = exit_status(["replay", *map(str, arguments)])
    return Done(code, out.getvalue(), err.getvalue())


def frames(text):
    return [json.loads(line) for line in text.splitlines()]


def test_an_instant(made):
    done = vrs(made[0], "--headless", "--json", "--at", 1.75)
    assert done.returncode == 0, done.stderr
    (frame,) = frames(done.stdout)
    assert frame["t"] == 1.75
    assert np.abs(np.array(frame["q_virtual"]) - made[1].engine.joints(1.75)).max() <= 1e-9
    assert frame["behind"] == pytest.approx(0.35)
    text = vrs(made[0], "--headless", "--at", 1.75).stdout
    assert text.count("\n") == 1
    assert text.split()[:2] == ["1.750", "s"]


@pytest.mark.parametrize(
    ("at", "rate", "span", "mode", "later"),
    [
        (None, None, None, Mode.PLAYING, 1.0),
        (3.0, None, None, Mode.PAUSED, 3.0),
        (3.0, 2.0, None, Mode.PLAYING, 5.0),
        (None, -1.0, None, Mode.PLAYING, 11.0),
        (3.0, None, (2.0, 3.5), Mode.PLAYING, 2.5),
        (None, None, (2.0, 3.5), Mode.PLAYING, 3.0),
    ],
)
def test_a_page_begins_as_asked_and_an_instant_alone_stands(made, at, rate, span, mode, later):
    with open_recording(made[0]) as recording:
        playback = Playback([recording])
        if at is not None:
            playback.seek(at, now=0.0)
        begin_shown(playback, PlaybackStart(at, rate, span), now=10.0)
        assert playback.mode is mode
        assert playback.place(now=11.0) == pytest.approx(later)


@pytest.mark.parametrize(("at", "modes"), [(None, {Mode.LIVE, Mode.CATCHING_UP}), (3.0, {Mode.PAUSED})])
def test_a_page_of_what_is_being_written_is_live_unless_asked_otherwise(made, tmp_path, at, modes):
    path = tmp_path / "growing.mcap"
    data = made[0].read_bytes()
    path.write_bytes(data[: len(data) // 2])
    with open_recording(path) as recording:
        playback = Playback([recording])
        path.write_bytes(data[: 3 * len(data) // 4])
        playback.advance(now=1.0)
        assert playback.growing
        if at is not None:
            playback.seek(at, now=0.0)
        begin_shown(playback, PlaybackStart(at), now=1.0)
        assert playback.mode in modes


def test_to_the_end_and_back_to_the_start(made):
    there = frames(vrs(made[0], "--headless", "--json", "--rate", 8, "--frames", 20).stdout)
    assert (there[0]["t"], there[-1]["t"]) == (0.0, 12.0)
    back = frames(vrs(made[0], "--headless", "--json", "--rate", -8, "--at", 4).stdout)
    assert (back[0]["t"], back[-1]["t"]) == (4.0, 0.0)
    kinds = [mark["kind"] for frame in there for mark in frame["marks"]]
    assert {"command", "postponed", "rejected", "falsified", "stopped", "link", "other"} <= set(kinds)
    for frame in there + back:
        assert np.abs(np.array(frame["q_virtual"]) - made[1].engine.joints(frame["t"])).max() <= 1e-9


def test_the_rate_is_kept_by_the_clock_and_every_frame_is_g(made):
    """Lines are read as they come, of all rates at once; what comes late is late in t as well, or isn't there."""
    rates = (-4.0, -1.0, 0.25, 1.0, 4.0)
    found = {}

    def watch(rate):
        process = subprocess.Popen(
            [*VRS, str(made[0]), "--headless", "--json", f"--rate={rate}", "--loop", "0.5:11.5", "--frames", "50"],
            stdout=subprocess.PIPE, text=True,
        )  # fmt: skip
        lines = []
        with process:
            for line in process.stdout:
                lines.append((time.monotonic(), json.loads(line)))
                if lines[-1][0] - lines[0][0] >= SECONDS:
                    process.send_signal(signal.SIGINT)
                    break
            process.stdout.read()
        found[rate] = lines, process.returncode

    threads = [threading.Thread(target=watch, args=(rate,)) for rate in rates]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(SECONDS + 30)
    for rate in rates:
        lines, code = found[rate]
        assert code == 0
        wall = np.array([at for at, _ in lines])
        t = np.unwrap([frame["t"] for _, frame in lines], period=11.0)
        # Lines can only be late: the earliest of both halves show the pace.
        late = wall - wall[0] - (t - t[0]) / rate
        half = len(late) // 2
        drift = late[half:].min() - late[:half].min()
        assert abs(drift) <= OFF * (wall[-1] - wall[0]) / 2, f"rate {rate}: off by {drift} s"
        at = np.array([frame["at"] for _, frame in lines])
        assert np.abs(t - t[0] - rate * (at - at[0])).max() < 1e-6
        assert np.median(late) < 0.1
        for _, frame in lines:
            assert np.abs(np.array(frame["q_virtual"]) - made[1].engine.joints(frame["t"])).max() <= 1e-9
        if LONG:
            print(f"rate {rate}: {len(lines)} frames, {drift / (wall[-1] - wall[0]) * 2:.2%} off")  # noqa: T201


def test_two_recordings(made, tmp_path):
    other = make(tmp_path / "other.mcap", 5.0)
    both = [made[0], tmp_path / "other.mcap"]
    (frame,) = frames(vrs(*both, "--headless", "--json", "--at", 3.3).stdout)
    assert np.abs(np.array(frame["other"]["q_virtual"]) - other.engine.joints(3.3)).max() <= 1e-9
    done = vrs(*both, "--headless", "--rate", 8, "--frames", 4)
    assert {line[0] for line in done.stdout.splitlines()} == {"A", "B"}


def test_a_cut_file_plays_and_says_so(made, tmp_path):
    path = tmp_path / "cut.mcap"
    path.write_bytes(made[0].read_bytes()[:30_000])
    done = vrs(path, "--headless", "--json", "--rate", 8)
    assert done.returncode == 0
    assert done.stderr.count("\n") == 1
    assert "cut" in done.stderr
    assert len(frames(done.stdout)) > 5


def test_commands_are_run_again(made):
    done = vrs(made[0], "--commands", "--json")
    assert done.returncode == 0, done.stderr
    facts = json.loads(done.stdout)
    assert facts["identical"] is True
    assert facts["commands"] >= 17
    assert "identical" in vrs(made[0], "--commands").stdout


def test_another_timeline_is_found_out(tmp_path, made):
    """The recorded edits of one plan beside the commands of another."""
    path = tmp_path / "other.mcap"
    site = made[1].__class__(path, length=6.0)
    site.run(0.1)
    honest = site.engine.execute
    site.engine.execute = lambda command: honest(
        type(command)(command.target, speed=0.5, execute_at=command.execute_at)
    )
    site.run(1.5)
    site.end()
    done = vrs(path, "--commands")
    assert done.returncode == 1
    assert "not identical: command 1" in done.stdout


@pytest.mark.parametrize(
    "arguments",
    [
        ["--rate", "0"],
        ["--rate", "8.5"],
        ["--rate", "nan"],
        ["--loop", "3:2"],
        ["--loop", "3"],
        ["--headless", "--loop", "50:60"],
        ["--headless", "--frames", "0"],
        ["--headless", "--at", "nan"],
        ["--json"],
        ["--align", "moon"],
        ["--host", "0.0.0.0"],
        ["--align", "began"],
    ],
)
def test_bad_input_is_one_line_and_2(made, arguments):
    extra = [str(made[0])] if arguments == ["--align", "began"] else []
    done = vrs(made[0], *extra, *arguments)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.count("\n") == 1


def test_what_is_no_recording_is_refused(tmp_path):
    (tmp_path / "no.mcap").write_bytes(b"no recording" * 100)
    for name in ("no.mcap", "missing.mcap"):
        done = vrs(tmp_path / name, "--headless")
        assert (done.returncode, done.stderr.count("\n")) == (2, 1)


def test_it_serves_until_it_is_told_to_end(made):
    with subprocess.Popen([*VRS, str(made[0]), "--port", "0"], stdout=subprocess.PIPE, text=True) as process:
        line = process.stdout.readline()
        url = line.split()[-1]
        with urllib.request.urlopen(url, timeout=10) as answer:
            assert b"Play-back" in answer.read()
        process.send_signal(signal.SIGINT)
        assert process.wait(10) == 0
