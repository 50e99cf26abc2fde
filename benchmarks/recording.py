"""Recording: what it costs while both twins move, how large an hour is, how soon it's open and read anywhere."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from statistics import median

import numpy as np

from benchmarks.recorded import RATE, Teller, Tick, begin, record, ticks
from benchmarks.results import Bar, Cost, Part, Result
from benchmarks.timing import seconds
from interfaces.messages import recording as m
from interfaces.recording import Recorder, Recording, open_recording
from interfaces.recording.channels import Message

HOUR = 3600.0
LIVE = 20.0
"""How long is recorded by the wall clock [s]."""
SEEKS = 200


def part() -> Part:
    """Measure."""
    with tempfile.TemporaryDirectory() as folder:
        return Part(
            "Recording",
            f"Both twins at {RATE} Hz: joints of both, what the real one was asked for, poses, links, packets, a "
            "command every 3 s whose move takes 2 s; every digit of the real robot is noise. The share of a core "
            f"is the process's time over {LIVE:g} s of wall time, the writing thread included, less that of the "
            "same loop without a recorder. The hour is written in virtual time, then opened in this process, from "
            "the page cache: seconds are processor time.",
            (*_live(Path(folder)), *_hour(Path(folder))),
        )


def _live(folder: Path) -> list[Result]:
    given = list(ticks(LIVE))
    recorder = Recorder(folder / "live.mcap", begin())
    took: list[float] = []

    def put(message: Message, t: float) -> None:
        start = time.perf_counter()
        recorder.put(message, t=t)
        took.append(1e6 * (time.perf_counter() - start))

    loop = _share(given, None)
    share = _share(given, put) - loop
    recorder.close(m.End(LIVE))
    assert not recorder.dropped
    assert recorder.problem is None
    return [
        Result("recording by the wall clock", Cost(100 * share), unit="% of a core", bar=Bar(median=5.0)),
        Result("to put one message", Cost(median(took), float(np.percentile(took, 99))), unit="µs"),
    ]


def _share(given: list[Tick], put: Callable[[Message, float], None] | None) -> float:
    """Processor time over wall time of a loop that runs at the twins' rate."""
    teller, start, spent = Teller(), time.monotonic(), time.process_time()
    for tick in given:
        time.sleep(max(0.0, start + tick.t - time.monotonic()))
        if put is not None:
            for message in teller.messages(tick):
                put(message, tick.t)
    return (time.process_time() - spent) / (time.monotonic() - start)


def _hour(folder: Path) -> list[Result]:
    path, cut = folder / "hour.mcap", folder / "cut.mcap"
    size = record(path, HOUR)
    cut.write_bytes(path.read_bytes()[: size * 9 // 10])
    rng = np.random.default_rng(0)
    places = rng.uniform(0, HOUR, SEEKS).tolist()
    bar = Bar(median=0.5, p99=0.5)
    with open_recording(path) as recording:
        assert not recording.damage
        seeks = [seconds(lambda t=t: recording.real(t)) for t in places]  # type: ignore[misc]
        computed = seconds(lambda: recording.virtual(places[0]))
        again = [seconds(lambda t=t: recording.virtual(t)) for t in places]  # type: ignore[misc]
        commands = seconds(lambda: recording.commands)
        whole = seconds(lambda: recording.track("/real/joints"))
        edits = len(recording.edits)
    return [
        Result("an hour", Cost(size / 1e6), unit="MB", bar=Bar(median=60.0)),
        Result("open it", _openings(path), unit="s", bar=bar),
        Result("open it and read both robots at a moment", _openings(path, _both), unit="s"),
        Result("seek in it: the real robot anywhere", _cost(seeks), unit="s", bar=bar),
        Result(
            "the virtual robot, first",
            Cost(computed),
            unit="s",
            bar=Bar(median=0.5),
            note=f"puts {edits} edits together",
        ),
        Result("the virtual robot anywhere, then", _cost(again), unit="s", bar=bar),
        Result("all commands and receipts", Cost(commands), unit="s"),
        Result("all samples of the real robot", Cost(whole), unit="s"),
        Result("open 0.9 of it, cut", _openings(cut, times=3), unit="s"),
    ]


def _both(recording: Recording) -> None:
    recording.real(1234.5)
    recording.virtual(1234.5)


def _openings(path: Path, look: Callable[[Recording], None] | None = None, times: int = 7) -> Cost:
    def opened() -> None:
        with open_recording(path) as recording:
            if look is not None:
                look(recording)

    return _cost([seconds(opened) for _ in range(times)])


def _cost(times: list[float]) -> Cost:
    return Cost(median(times), float(np.percentile(times, 99)))
