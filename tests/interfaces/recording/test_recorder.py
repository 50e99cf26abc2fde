"""Recording beside a motion: disks fail, fill and hang, and nobody waits for them."""

from __future__ import annotations

import os
import resource
import subprocess
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from interfaces.messages import recording as m
from interfaces.recording import Recorder, RecordingError, RecordingWriter, open_recording
from interfaces.recording.mcap_file import Sink
from tests.interfaces.recording import recorded
from tests.interfaces.recording.disks import Disk, Failing, Hanging, Slow
from vrs import ManualClock
from vrs.errors import InvalidValueError


def until(true: Callable[[], object], seconds: float = 10.0) -> float:
    """Wait for something; how long it took [s]."""
    start = time.monotonic()
    while not true():
        assert time.monotonic() - start < seconds
        time.sleep(0.005)
    return time.monotonic() - start


def numbers(path: Path) -> list[float]:
    with open_recording(path) as recording:
        return [round(t / recorded.STEP) for t in recording.track("/real/joints").t.tolist()]


def test_a_disk_that_takes_little_at_a_time_gets_everything(tmp_path: Path) -> None:
    slow, usual = Slow(), Disk()
    for disk in (slow, usual):
        writer = RecordingWriter(disk, recorded.begin())
        for t, message in recorded.motion(2.0)[0]:
            writer.write(message, t=t)
        writer.finish(m.End(2.0))
    assert slow.calls > 2 * usual.calls
    assert slow.data == usual.data


def failing_at_each_write(path: Path, how: str) -> int:
    """At each write in turn: a typed error, and what was written before it is readable; how many writes it has."""
    messages = [(k * recorded.STEP, recorded.sample(k)) for k in range(90)]
    last = 0
    while True:
        last += 1
        disk, written, writer = Failing(last, how=how), 0.0, None
        try:
            writer = RecordingWriter(disk, recorded.begin())
            for t, message in messages:
                writer.write(message, t=t)
                written = writer.written
            writer.finish(m.End(1.5))
        except RecordingError:
            if writer is not None and not writer.finished:
                with pytest.raises(RecordingError, match="recording failed"):
                    writer.finish(m.End(2.0))
            assert disk.closed
        else:
            return last
        if written > 0.0:
            path.write_bytes(disk.data)
            known = numbers(path)
            assert known == list(range(len(known)))
            assert len(known) > written / recorded.STEP - 1e-6
            with open_recording(path) as recording:
                assert recording.damage.cut or recording.end is not None


@pytest.mark.parametrize("how", ["full", "broken", "zero", "none"])
def test_a_short_write_at_every_place(tmp_path: Path, how: str) -> None:
    assert failing_at_each_write(tmp_path / "run.mcap", how) > 10


@pytest.mark.parametrize(
    ("how", "said"), [(0, "takes no more after 4"), (None, "takes no more"), (OSError(5, ""), "Inp")]
)
def test_a_disk_that_failed_once_is_given_nothing_more(how: OSError | int | None, said: str) -> None:
    """There may be room again: what came then would stand behind a hole."""

    class Fickle(Disk):
        def take(self, data: bytes | memoryview) -> int | None:
            if self.calls != 2:
                return super().take(data)
            if isinstance(how, OSError):
                raise how
            return how

    disk = Fickle()
    sink = Sink(disk, "here")
    sink.write(b"some")
    with pytest.raises(RecordingError, match=said):
        sink.write(b"lost")
    with pytest.raises(RecordingError, match="it failed before"):
        sink.write(b"more")
    assert disk.data == b"some"


def test_a_writer_says_up_to_when_all_is_there() -> None:
    writer = RecordingWriter(Disk(), recorded.begin())
    for t in (0.2, 0.1):
        writer.write(m.RunEvent(t, "other", "late"), t=t)
    assert writer.written == 0.0
    writer.flush()
    assert writer.written == 0.2
    with pytest.raises(InvalidValueError, match="of up to 8388608 bytes"):
        writer.write(m.RunEvent(0.3, "other", "x" * 9 * 2**20), t=0.3)


@pytest.fixture
def clock() -> Iterator[ManualClock]:
    return ManualClock(0.0)


@pytest.mark.parametrize("last", [3, 4, 7])
def test_a_full_disk_ends_the_recording_alone(tmp_path: Path, last: int) -> None:
    disk = Failing(last, how="full")
    recorder = Recorder(disk, recorded.begin())
    number, path = 0, tmp_path / "run.mcap"

    def failed() -> bool:
        nonlocal number
        for _ in range(20):
            recorder.put(recorded.sample(number), t=number * recorded.STEP)
            number += 1
        return recorder.problem is not None

    assert until(failed) < 1.0
    until(lambda: disk.closed)
    assert "No space left" in str(recorder.problem)
    assert not recorder.put(recorded.sample(number), t=number * recorded.STEP)
    assert recorder.dropped["/real/joints"] > 0
    assert not recorder.close(m.End(1.0))
    path.write_bytes(disk.data)
    known = numbers(path)
    assert known == list(range(len(known)))
    assert len(known) >= recorder.acknowledged
    with open_recording(path) as recording:
        assert recording.damage.cut


def test_a_hanging_disk_stops_nobody_and_what_is_left_out_is_counted(tmp_path: Path, clock: ManualClock) -> None:
    disk, path = Hanging(), tmp_path / "run.mcap"
    recorder = Recorder(disk, recorded.begin(), room=20_000, clock=clock)
    taken = 0
    number = 0
    while not disk.hangs.is_set():
        taken += recorder.put(recorded.sample(number), t=number * recorded.STEP)
        number += 1
        time.sleep(0.001)
    for _ in range(2000):
        taken += recorder.put(recorded.sample(number), t=number * recorded.STEP)
        number += 1
    assert recorder.problem is None
    clock.advance(0.8)
    assert recorder.problem == "recording stalls: the disk has taken nothing for 0.8 s"
    dropped = recorder.dropped["/real/joints"]
    assert dropped == number - taken > 1000
    disk.free.set()
    until(lambda: recorder.problem is None)
    until(lambda: recorder.put(recorded.sample(number), t=number * recorded.STEP))
    dropped = recorder.dropped["/real/joints"]
    assert recorder.close(m.End(100.0))
    path.write_bytes(disk.data)
    with open_recording(path) as recording:
        assert not recording.damage
        assert recording.dropped == {"/real/joints": dropped}
        assert len(recording.track("/real/joints").t) == taken + 1


def test_much_at_once_is_no_stall(clock: ManualClock, monkeypatch: pytest.MonkeyPatch) -> None:
    class Steady(Disk):
        def take(self, data: bytes | memoryview) -> int | None:
            if self.calls > 2:
                clock.advance(0.5)
                told.append(recorder.problem)
            return super().take(data)

    told: list[str | None] = []
    monkeypatch.setattr("interfaces.recording.writer.LARGE", 1_000)
    recorder = Recorder(Steady(), recorded.begin(), clock=clock)
    for number in range(100):
        recorder.put(recorded.sample(number), t=number * recorded.STEP)
    until(lambda: recorder.acknowledged > 90)
    assert len(told) > 10
    assert set(told) == {None}
    assert recorder.close(m.End(2.0))


def test_blocks_span_as_long_as_is_asked(tmp_path: Path) -> None:
    disks = Disk(), Disk()
    for flush, disk in zip((0.05, 0.5), disks, strict=True):
        recorder = Recorder(disk, recorded.begin(), flush=flush)
        for number in range(120):
            recorder.put(recorded.sample(number), t=number * recorded.STEP)
        assert recorder.close(m.End(2.0))
    assert disks[0].calls > 30
    assert disks[1].calls < 20


def test_closing_doesnt_wait_for_ever(clock: ManualClock) -> None:
    disk = Hanging()
    recorder = Recorder(disk, recorded.begin(), clock=clock)
    recorder.put(recorded.sample(0), t=0.0)
    start = time.monotonic()
    assert not recorder.close(m.End(1.0), patience=0.2)
    assert time.monotonic() - start < 5.0
    assert "didn't take the end within 0.2 s" in str(recorder.problem)
    disk.free.set()
    until(lambda: disk.closed)


def test_what_is_acknowledged_is_in_the_file(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    recorder = Recorder(path, recorded.begin())
    for number in range(100):
        assert recorder.put(recorded.sample(number), t=number * recorded.STEP)
    until(lambda: recorder.acknowledged == 100)
    assert recorder.written == 99 * recorded.STEP
    assert numbers(path) == list(range(100))
    with open_recording(path) as recording:
        assert recording.damage.cut
        assert recording.poll() is False
        recorder.put(recorded.sample(100), t=100 * recorded.STEP)
        until(recording.poll)
        assert recording.span[1] == 100 * recorded.STEP
        assert recorder.close(m.End(2.0))
        assert recorder.acknowledged == 101
        until(recording.poll)
        assert not recording.damage
        assert recording.end == m.End(2.0)
        assert recording.poll() is False
    assert recorder.problem is None
    assert recorder.size == path.stat().st_size
    assert recorder.dropped == {}
    assert not recorder.put(recorded.sample(1), t=3.0)


def test_a_message_that_is_too_long_is_left_out(tmp_path: Path) -> None:
    recorder = Recorder(tmp_path / "run.mcap", recorded.begin(), room=2**30)
    assert not recorder.put(m.End(0.0, {"much": "x" * 9 * 2**20}), t=0.0)
    assert recorder.dropped == {"/session": 1}
    assert recorder.close(m.End(1.0))
    assert recorder.problem is None
    with open_recording(tmp_path / "run.mcap") as recording:
        assert recording.dropped == {"/session": 1}


def test_what_comes_last_needs_no_room(tmp_path: Path) -> None:
    events = [m.RunEvent(1.0, "other", f"{k} {'x' * 100}") for k in range(1000)]
    recorder = Recorder(tmp_path / "run.mcap", recorded.begin(), room=5_000)
    assert recorder.put(events[0], t=1.0)
    much = m.RunEvent(1.0, "other", "x" * 9 * 2**20)
    assert recorder.close(m.End(1.0), last=[*events[1:500], much, *events[500:]])
    with open_recording(tmp_path / "run.mcap") as recording:
        assert [event.text for event in recording.events] == [event.text for event in events]
        assert recording.dropped == {"/events": 1}
        assert not recording.damage


def test_closing_waits_as_long_as_the_disk_takes_something(monkeypatch: pytest.MonkeyPatch) -> None:
    class Tough(Disk):
        def take(self, data: bytes | memoryview) -> int | None:
            time.sleep(0.02)
            return super().take(data)

    monkeypatch.setattr("interfaces.recording.writer.LARGE", 2_000)
    recorder = Recorder(Tough(), recorded.begin())
    events = [m.RunEvent(1.0, "other", "x" * 1000)] * 40
    start = time.monotonic()
    assert recorder.close(m.End(1.0), patience=0.2, last=events)
    assert time.monotonic() - start > 0.3


def test_without_an_end_it_reads_as_cut(tmp_path: Path) -> None:
    recorder = Recorder(tmp_path / "run.mcap", recorded.begin())
    assert recorder.put(recorded.sample(7), t=7 * recorded.STEP)
    assert recorder.close(None)
    assert (recorder.problem, recorder.acknowledged) == (None, 1)
    assert numbers(tmp_path / "run.mcap") == [7]
    with open_recording(tmp_path / "run.mcap") as recording:
        assert recording.end is None
        assert recording.damage.cut


@pytest.mark.filterwarnings("ignore::pytest.PytestUnhandledThreadExceptionWarning")
def test_a_thread_that_ends_is_a_problem() -> None:
    class Odd(Disk):
        def take(self, data: bytes | memoryview) -> int | None:
            if self.calls > 2:
                raise MemoryError
            return super().take(data)

    recorder = Recorder(Odd(), recorded.begin())
    recorder.put(recorded.sample(0), t=0.0)
    assert not recorder.close(m.End(1.0))
    assert recorder.problem == "recording failed: its thread has ended"


@pytest.mark.parametrize("path", ["/dev/full", "/nowhere/run.mcap", "/"])
def test_where_nothing_can_be_written_nothing_begins(path: str) -> None:
    with pytest.raises(RecordingError, match="recording failed"):
        Recorder(Path(path), recorded.begin())


def fill(recorder: Recorder, seconds: float = 10.0) -> float:
    """Record until there's a problem; how long that took once the file had grown to its limit [s]."""
    number, grown = 0, time.monotonic()
    end = grown + seconds
    size = recorder.size
    while recorder.problem is None:
        assert time.monotonic() < end
        for _ in range(50):
            recorder.put(recorded.sample(number), t=number * recorded.STEP)
            number += 1
        if recorder.size != size:
            size, grown = recorder.size, time.monotonic()
        time.sleep(0.002)
    return time.monotonic() - grown


def check_prefix(path: Path, recorder: Recorder) -> None:
    assert not recorder.close(m.End(1.0))
    known = numbers(path)
    assert known == list(range(len(known)))
    assert len(known) >= recorder.acknowledged > 0
    with open_recording(path) as recording:
        assert "cut" in str(recording.damage)


def test_a_file_that_may_grow_no_more(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    recorder = Recorder(path, recorded.begin())
    resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, hard))
    try:
        assert fill(recorder) < 1.0
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert "File too large" in str(recorder.problem)
    check_prefix(path, recorder)


@pytest.mark.skipif(os.geteuid() != 0, reason="only root mounts")
def test_a_full_file_system(tmp_path: Path) -> None:
    mount = ["mount", "-t", "tmpfs", "-o", "size=128k", "tmpfs", str(tmp_path)]
    if subprocess.run(mount, check=False, capture_output=True).returncode:
        pytest.skip("mounting isn't allowed here")
    try:
        path = tmp_path / "run.mcap"
        recorder = Recorder(path, recorded.begin())
        assert fill(recorder) < 1.0
        assert "No space left" in str(recorder.problem)
        check_prefix(path, recorder)
    finally:
        subprocess.run(["umount", str(tmp_path)], check=True)


def test_t15_a_recording_is_its_owners(tmp_path):
    path, kept = tmp_path / "new.mcap", tmp_path / "kept.mcap"
    before = os.umask(0)
    try:
        Sink.create(path).close()
    finally:
        os.umask(before)
    assert path.stat().st_mode & 0o777 == 0o600
    kept.touch(0o640)
    Sink.create(kept).close()
    assert kept.stat().st_mode & 0o777 == 0o640
