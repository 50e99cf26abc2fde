"""Mobile robots' recordings that make no sense: one clear error, whatever is in them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from msgspec.structs import replace

from interfaces.cli.main import exit_status
from interfaces.messages.recording import ArcEntry, ArcHistory, Begin, DriveFacts, End, RealPosture
from interfaces.recording import RecordingWriter, open_recording
from interfaces.recording.playback import Playback
from vrs.errors import FormatError

FACTS = DriveFacts(
    body="bare",
    architecture="timeline",
    transport="datagrams",
    operator="slalom",
    length=10.0,
    period=0.1,
    position="fused",
)
BEGIN = Begin(
    t=0.0, robot="ipr", driver="laboratory", title="made", seed=1, delay="mon", offset="none", service="datagram",
    link_loss="hold", step=0.05, q=[0.0, 0.0, 0.0], lateness="postpone", software="test", drive=FACTS,
)  # fmt: skip
SAMPLES = [RealPosture(0.05 * k, 0.1 * k, 0.0, 0.0, v=0.2, w=0.0) for k in range(40)]
HISTORY = ArcHistory(edit=0, at=0.0, version=0, initial=[0.0, 0.0, 0.0], start=0.0, total=0, index=0)


def made(path: Path, begin: Begin, *messages: Any) -> Path:
    writer = RecordingWriter(path, begin)
    for message in messages:
        writer.write(message, t=getattr(message, "t", 0.0))
    writer.finish(End(2.0))
    return path


def begin(**facts: Any) -> Begin:
    return replace(BEGIN, drive=replace(FACTS, **facts))


FAR = replace(HISTORY, version=9, total=1, segments=(ArcEntry(2000.0, [0.0, 0.0, 0.0], 1e3, 0.0, 1),))


@pytest.mark.parametrize(
    ("start", "messages"),
    [
        (replace(BEGIN, robot="none"), [HISTORY, *SAMPLES]),
        (replace(BEGIN, q=[0.0] * 6), [HISTORY, *SAMPLES]),
        (replace(BEGIN, lateness="?"), [HISTORY, *SAMPLES]),
        (begin(length=1e9), [HISTORY, *SAMPLES]),
        (begin(position="dice"), [HISTORY, *SAMPLES]),
        (BEGIN, [HISTORY]),
        (BEGIN, [HISTORY, SAMPLES[0]]),
        (replace(BEGIN, step=1e-320), [HISTORY, *SAMPLES]),
        (BEGIN, [HISTORY, *(replace(sample, t=1e6 * sample.t) for sample in SAMPLES)]),
        (BEGIN, [replace(FAR, segments=(ArcEntry(1.0, [9.0, 0.0, 0.0], 0.1, 0.0),)), *SAMPLES]),
        (BEGIN, [FAR, *[replace(s, t=1e3 * s.t) for s in SAMPLES]]),
    ],
)  # fmt: skip
def test_figures_of_nonsense_are_one_line(start: Begin, messages: list[Any], tmp_path: Path, capsys) -> None:
    path = made(tmp_path / "made.mcap", start, *messages)
    assert exit_status(["compare", str(path)]) == 2
    said = capsys.readouterr().err.splitlines()
    assert said[-1].startswith("vrs: ")


def test_figures_of_sense_are_given(tmp_path: Path) -> None:
    path = made(tmp_path / "made.mcap", BEGIN, HISTORY, *SAMPLES)
    assert exit_status(["compare", str(path), "--json"]) == 0


def test_samples_far_off_the_world_are_none(tmp_path: Path) -> None:
    path = made(tmp_path / "made.mcap", BEGIN, HISTORY, replace(SAMPLES[0], x=1e300))
    with open_recording(path) as recording, pytest.raises(FormatError, match="/real/posture"):
        recording.real(0.0)


def test_a_path_that_is_too_long_is_played_without_a_match(tmp_path: Path) -> None:
    path = made(tmp_path / "made.mcap", BEGIN, FAR, *[replace(sample, t=1e3 * sample.t) for sample in SAMPLES])
    with open_recording(path) as recording:
        (frame,) = Playback([recording]).moment(100.0).frames
        assert frame.q_virtual == pytest.approx([1e5, 0.0, 0.0])
        assert (frame.play, frame.error) == (None, None)
