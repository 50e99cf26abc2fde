"""What a recording says: the virtual robot computed, the real one on lines, nothing made up."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from interfaces.messages import recording as m
from interfaces.recording import RecordingWriter, open_recording
from interfaces.recording.mcap_reading import FileSource
from tests.interfaces.recording import recorded
from vrs.errors import FormatError, InvalidValueError, NonFiniteTimeError, VrsError


@pytest.fixture
def made(tmp_path: Path) -> tuple[Path, Any, list[Any]]:
    messages, engine, timelines = recorded.motion(6.0, every=0.5)
    return recorded.write(tmp_path / "run.mcap", messages, end=6.0), engine, timelines


def test_the_virtual_robot_is_computed_to_the_bit(made: tuple[Path, Any, list[Any]]) -> None:
    path, engine, timelines = made
    t = np.random.default_rng(0).uniform(-1, 12, 500)
    with open_recording(path) as recording:
        assert np.array_equal(recording.virtual(t), engine.joints(t))
        assert np.array_equal(recording.virtual(2.5), engine.joints(2.5))
        assert recording.timeline == engine.timeline
        assert [edit.timeline for edit in recording.edits] == timelines
        assert [edit.timeline.version for edit in recording.edits] == [one.version for one in timelines]
        assert [edit.number for edit in recording.edits] == list(range(len(timelines)))
        assert recording.certain == np.inf


def test_at_a_moment_what_comes_later_isnt_known(made: tuple[Path, Any, list[Any]]) -> None:
    path, _, timelines = made
    with open_recording(path) as recording:
        for edit, timeline in list(zip(recording.edits, timelines, strict=True))[1:]:
            assert recording.timeline_at(edit.at) == timeline
            assert recording.timeline_at(np.nextafter(edit.at, np.inf)) is edit.timeline
            if edit.number > 1:
                assert (
                    recording.timeline_at(np.nextafter(edit.at, -1.0)) is recording.edits[edit.number - 1].timeline
                )
        assert recording.timeline_at(-5.0) is recording.edits[0].timeline


def test_the_real_robot_lies_on_lines_between_samples(made: tuple[Path, Any, list[Any]]) -> None:
    path, _, _ = made
    t = np.random.default_rng(1).uniform(0, 6, 300)
    with open_recording(path) as recording:
        track = recording.track("/real/joints")
        truth = np.column_stack([np.interp(t, track.t, column) for column in track.q.T])
        np.testing.assert_allclose(recording.real(t), truth, rtol=0, atol=1e-14)
        np.testing.assert_allclose(recording.play(t), np.interp(t, track.t, track.play), rtol=0, atol=1e-14)
        assert np.array_equal(recording.real(track.t), track.q)
        assert np.array_equal(recording.real(2.0), recording.real([2.0])[0])
        assert recording.play(2.0).shape == ()
        outside = [-1.0, -1e-9, 6.0 + 1e-6, 1e6]
        assert np.isnan(recording.real(outside)).all()
        assert recording.real([]).shape == (0, 6)
        assert recording.span == (0.0, track.t[-1])
        for wrong in (np.nan, np.inf, [0.0, np.nan]):
            with pytest.raises(NonFiniteTimeError):
                recording.real(wrong)
            with pytest.raises(NonFiniteTimeError):
                recording.virtual(wrong)
        with pytest.raises(InvalidValueError):
            recording.track("/tf")


def test_no_line_is_drawn_over_a_gap(tmp_path: Path) -> None:
    samples = [(k * recorded.STEP, recorded.sample(k)) for k in range(240) if not 100 <= k < 130]
    with open_recording(recorded.write(tmp_path / "run.mcap", samples, end=4.0)) as recording:
        assert np.isnan(recording.real(np.linspace(100, 129, 50) * recorded.STEP)).all()
        assert not np.isnan(recording.real(np.array([99, 130]) * recorded.STEP)).any()


def test_a_seek_reads_a_few_blocks(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    samples = [(k * recorded.STEP, recorded.sample(k)) for k in range(60 * 60)]
    path = recorded.write(tmp_path / "run.mcap", samples, end=60.0)
    with open_recording(path) as recording:
        read, lengths = FileSource.read, []

        def counted(self: FileSource, offset: int, length: int) -> bytes:
            lengths.append(length)
            return read(self, offset, length)

        monkeypatch.setattr(FileSource, "read", counted)
        for t in (30.1, 30.2, 30.15, 31.0):
            assert np.isfinite(recording.real(t)).all()
        assert len(lengths) <= 16
        assert sum(lengths) < path.stat().st_size / 10


def test_a_file_that_grows(tmp_path: Path) -> None:
    messages, engine, timelines = recorded.motion(3.0, every=0.7)
    path = tmp_path / "run.mcap"
    writer = RecordingWriter(path, recorded.begin())
    with open_recording(path) as recording:
        spans = [recording.span[1]]
        for n, (t, message) in enumerate(messages):
            writer.write(message, t=t)
            if n % 97 == 0:
                recording.poll()
                spans.append(recording.span[1])
                assert recording.damage.cut
                assert spans[-1] <= t
                if recording.edits:
                    moments = np.linspace(0, spans[-1], 20)
                    assert np.array_equal(recording.virtual(moments), engine.joints(moments))
                    assert not np.isnan(recording.real(moments)).any()
        writer.finish(m.End(3.0))
        assert recording.poll()
        assert not recording.damage
        assert recording.end == m.End(3.0)
        assert [edit.timeline for edit in recording.edits] == timelines
        assert spans == sorted(spans)
        assert not recording.poll()


def test_a_cut_recording_is_sure_up_to_its_cut(tmp_path: Path) -> None:
    messages, engine, _ = recorded.motion(3.0, every=0.7)
    with open_recording(recorded.write(tmp_path / "run.mcap", messages)) as recording:
        last = recording.span[1]
        assert recording.damage.until == pytest.approx(last, abs=1e-9)
        assert np.array_equal(recording.virtual(last), engine.joints(last))
        assert np.isnan(recording.virtual(last + 1e-3)).all()
        assert recording.timeline_at(last).end > last


def test_receipts_packets_and_events(made: tuple[Path, Any, list[Any]]) -> None:
    path, engine, _ = made
    with open_recording(path) as recording:
        virtual, real = recording.receipts("virtual"), recording.receipts("real")
        assert [receipt.command_id for receipt in virtual] == [receipt.command_id for receipt in engine.receipts]
        assert [receipt.end for receipt in real] == [receipt.end for receipt in virtual]
        assert [packet.command_id for packet in recording.packets] == [entry.command_id for entry in virtual]
        assert all(packet.arrived == packet.sent + 0.2 for packet in recording.packets)
        assert [event.t for event in recording.events] == [entry.at for entry in recording.commands]
        messages = recording.messages()
        assert np.array_equal(messages[:, 1], messages[:, 0] + 0.2)
        assert len(recording.link) == 2 * len(messages)
        assert recording.session.title == "a test"
        assert recording.model.name == recorded.MODEL.name
        assert recording.end is not None
        assert recording.end.extras == {"offsets": [1.5, None]}


def test_the_newest_word_counts(tmp_path: Path) -> None:
    receipt = recorded.motion(0.1)[1].receipts[0]
    undone = type(receipt)(**{**{name: getattr(receipt, name) for name in receipt.__slots__}, "undone": True})
    messages = [
        (0.0, m.ReceiptEntry(0.0, "virtual", receipt.named())),
        (0.0, m.CommandPacket(1, 1, 0.0)),
        (1.0, m.ReceiptEntry(1.0, "virtual", undone.named())),
        (1.0, m.CommandPacket(1, 1, 0.0, 0.5, 1)),
    ]
    with open_recording(recorded.write(tmp_path / "run.mcap", messages, end=1.0)) as recording:
        assert [receipt.undone for receipt in recording.receipts("virtual")] == [True]
        assert [packet.arrived for packet in recording.packets] == [0.5]


def test_a_history_and_an_edit_of_it_written_by_hand_mean_what_the_format_says(tmp_path: Path) -> None:
    joint = np.arange(1.0, 7.0)

    def line(duration: float, q: float, rate: float, **fields: Any) -> m.SegmentEntry:
        return m.SegmentEntry(duration, [*(q * joint).tolist(), *(rate * joint).tolist()], **fields)

    whole: dict[str, Any] = {"edit": 3, "at": 0.25, "version": 7, "initial": [0.0] * 6, "start": 0.5, "total": 3}
    parts = (
        (line(1.0, 0.0, 0.3, command_id=4, start=0.5), line(1.0, 0.3, 0.2)),
        (line(1.0, 0.5, -0.1, command_id=5),),
    )
    edit = m.ChangeEntry(
        edit=4, base=3, at=0.75, version=9, first=1, dof=6,
        segments=(line(0.5, 0.3, 0.4, command_id=6, start=1.5),), tail=2, tail_start=2.0, end=3.0, command_id=6,
    )  # fmt: skip
    messages = [
        (0.25, m.HistoryEntry(index=0, segments=parts[0], **whole)),
        (0.25, m.HistoryEntry(index=2, segments=parts[1], **whole)),
        (0.75, edit),
    ]
    with open_recording(recorded.write(tmp_path / "run.mcap", messages, end=1.0)) as recording:
        before, after = recording.edits
    assert (before.number, before.at, before.timeline.version) == (3, 0.25, 7)
    assert (after.number, after.at, after.timeline.version, after.command_id) == (4, 0.75, 9, 6)
    t = np.array([0.4, 1.0, 1.5, 1.75, 2.5, 3.5])
    for timeline, expected in (
        (before.timeline, [0.0, 0.15, 0.3, 0.35, 0.5, 0.4]),
        (after.timeline, [0.0, 0.15, 0.3, 0.4, 0.45, 0.4]),
    ):
        np.testing.assert_allclose(timeline.sample(t), np.outer(expected, joint), rtol=0, atol=1e-12)
    assert [segment.command_id for segment in after.timeline.segments] == [4, 6, 5]


def test_a_robot_that_nobody_knows(tmp_path: Path) -> None:
    for fields in ({"robot": "../puma560"}, {"robot": "hal"}, {"q": [0.0] * 7}):
        with open_recording(recorded.write(tmp_path / "run.mcap", [], end=0.0, **fields)) as recording:
            assert recording.span == (0.0, 0.0)
            for look in (lambda r: r.model, lambda r: r.timeline):
                with pytest.raises(FormatError):
                    look(recording)


def test_a_closed_recording_says_so(made: tuple[Path, Any, list[Any]]) -> None:
    recording = open_recording(made[0])
    recording.close()
    recording.close()
    with pytest.raises(VrsError):
        recording.track("/real/joints")
