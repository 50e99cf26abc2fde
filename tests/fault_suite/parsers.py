"""Parsers that are fed what nobody should send: only typed errors, in time, in bounded memory."""

from __future__ import annotations

import re
import resource
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from random import Random
from typing import Any

from benchmarks.results import Result
from interfaces.jobs import read_jobs, written_jobs
from interfaces.link.delays import read_trace
from interfaces.messages.jobs import JobList, MoveJob, Progress, WaitJob
from interfaces.middleware.network import DEFAULT_FILE, read_network
from interfaces.recording import open_recording
from interfaces.rsp.model import example, parse_model, write_model
from interfaces.runtime.plan import parse_plan
from interfaces.stream import Encoding, decode
from interfaces.val2.errors import ValError
from interfaces.val2.parser import parse_line
from interfaces.val2.source import parse_file
from robots import puma560
from robots.description.numbers import read_base, read_stated
from robots.description.reading import read
from robots.onboard.curve import read_curve
from robots.onboard.journey import Goal
from robots.rooms import read_room
from robots.things import read_scene
from tests.fault_suite.coverage import Coverage
from tests.fault_suite.effort import Effort, most
from tests.interfaces.recording import recorded, test_damage
from tests.interfaces.rsp import test_fuzz as rsp_fuzz
from tests.interfaces.stream import test_fuzz as wire_fuzz
from tests.robots.description.stranger import URDF
from tests.robots.description.test_reading import MJCF
from vrs.errors import VrsError

HOME = Path(__file__).resolve().parents[2]
QUICK = 1.0
"""A message takes so long at most [ms]."""
PATIENT = 2000.0
"""A file of up to 64 KiB takes so long at most [ms]."""
MEMORY = 128.0
"""The most that a parser may come to need beyond its sound inputs [MiB]."""
LARGEST = 65536
"""Longest input [bytes]."""
_NUMBER = re.compile(rb"-?\d+(\.\d+)?(e-?\d+)?", re.IGNORECASE)
_EDGES = (
    b"0", b"-1", b"1e999", b"-1e999", b"nan", b"inf", b"1e308", b"5e-324", b"1e-9", b"99999999999999999999", b"",
    b"2147483648", b"18446744073709551616", b"0x10", b"1_000", b".5", b"--1", b"\xe2\x88\x921",
)  # fmt: skip
_BYTES = (
    b"\0", b"\xff", b"\xef\xbb\xbf", b"\xc3\x28", b"\r", b"\n\n", b'"', b"'", b"%", b"&#0;", b"null", b"\\u0000",
    b"\xe2\x80\xa8", b"[" * 5000, b'{"a":' * 5000, b"<a>" * 300, b"(" * 300, b'<!DOCTYPE a [<!ENTITY b "c">]>',
)  # fmt: skip


@dataclass(frozen=True)
class Parser:
    """Something that takes bytes from outside."""

    parse: Callable[[bytes], object]
    """Raises typed errors alone."""
    corpus: Callable[[], list[bytes]]
    """What it takes."""
    modules: tuple[str, ...]
    """Its own, which are marked."""
    within: float = PATIENT
    """How long one input may take [ms]."""


@cache
def _folder() -> Path:
    return Path(tempfile.mkdtemp(prefix="faults-"))


def _file(read_it: Callable[[Path], object], name: str) -> Callable[[bytes], object]:
    """A parser of files, as one of bytes."""

    def parse(data: bytes) -> object:
        path = _folder() / name
        path.write_bytes(data)
        return read_it(path)

    return parse


def _text(read_it: Callable[[str], object]) -> Callable[[bytes], object]:
    return lambda data: read_it(data.decode("utf-8", "replace"))


def _files(pattern: str) -> list[bytes]:
    return [path.read_bytes() for path in sorted(HOME.glob(pattern))]


def _jobs() -> list[bytes]:
    jobs = JobList(
        (MoveJob(1, "here"), WaitJob(2, 1.0), MoveJob(3, Goal(1.0, 2.0, 0.5))), {"here": Goal(0, 0, None)}
    )
    return [written_jobs(jobs, Progress.of(jobs))]


def _recording() -> list[bytes]:
    messages, engine, _ = recorded.motion(1.0, step=0.05, every=0.4, drawn=1.0)
    path = recorded.write(_folder() / "made.mcap", [*messages, (1.0, recorded.history(engine, 3))], end=1.0)
    return [path.read_bytes(), path.read_bytes()[: path.stat().st_size // 2]]


def _looked_into(path: Path) -> None:
    with open_recording(path) as recording:
        recorded.everything(recording)
        recording.virtual([0.0, 0.3, 1.0])


def _is_line(line: bytes) -> bool:
    """Whether it's a step of a program, not one of the data beside it."""
    try:
        parse_line(line.decode())
    except ValError:
        return False
    return bool(line.strip())


STATED = b"""name = "mine"
tip = "fore"
[joints."shoulder"]
lower = -1.0
upper = 1.0
velocity = 2
acceleration = 5.0
[poses.nominal]
shoulder = 0.4
"""
SCENE = b"""floor = -0.5
[[things]]
name = "cube"
at = [0.1, 0.5, -0.4]
box = [0.04, 0.04, 0.04]
mass = 0.1
"""
PARSERS = {
    "plans": Parser(
        lambda data: parse_plan(data, "plan.jsonl", puma560.model()),
        lambda: [*_files("interfaces/runtime/default_plan.jsonl"), *_files("examples/**/*.jsonl")],
        ("interfaces.runtime.plan", "robots.things"),
    ),
    "traces": Parser(
        _file(lambda path: read_trace(path, longest=60.0), "trace.csv"),
        lambda: [b"t,delay_s\n0,0.1\n1,\n2,0.3\n", b'delay_s\n0.1\n""\n\n0.2\n'],
        ("interfaces.link.delays",),
    ),
    "floor plans": Parser(_text(read_room), lambda: _files("robots/mobile/rooms/*.room"), ("robots.rooms",)),
    "lists of jobs": Parser(lambda data: read_jobs(data, "jobs.json"), _jobs, ("interfaces.jobs.file",)),
    "URDF files": Parser(
        _file(read, "robot.urdf"), lambda: [URDF.encode()],
        ("robots.description.files", "robots.description.urdf", "robots.description.reading",
         "robots.description.rigid", "robots.description.geometry", "robots.description.beside"),
    ),
    "MJCF files": Parser(
        _file(read, "robot.xml"), lambda: [MJCF.encode()],
        ("robots.description.files", "robots.description.mjcf", "robots.description.reading"),
    ),
    "models in TOML": Parser(
        _file(lambda path: (read_base if b"wheel" in path.read_bytes() else read_stated)(path), "robot.toml"),
        lambda: [STATED, b'name = "cart"\nwheelbase = 0.4\nwheel = 0.1\nmass = 20.0\n'],
        ("robots.description.numbers",),
    ),
    "things to grasp": Parser(
        _file(read_scene, "scene.toml"), lambda: [SCENE, *_files("examples/val2/*.toml")], ("robots.things",),
    ),
    "paths": Parser(
        _text(read_curve), lambda: [b"path 1\n0 0\n1 1\n2 0 # c\n", b"path 1\ncurve quadratic\n0 0\n1 1\n2 2"],
        ("robots.onboard.curve",),
    ),
    "gain networks": Parser(read_network, lambda: [DEFAULT_FILE.read_bytes()], ("interfaces.middleware.network",)),
    "RSP models": Parser(parse_model, lambda: [write_model(example())], ("interfaces.rsp.model.xmi",)),
    "VAL-II files": Parser(
        _text(lambda text: parse_file(text, "p.v2")),
        lambda: [*_files("tests/interfaces/val2/programs/*.v2"), *_files("examples/val2/*.v2")],
        ("interfaces.val2.source", "interfaces.val2.parser", "interfaces.val2.grammar",
         "interfaces.val2.structure"),
    ),
    "VAL-II lines": Parser(
        _text(parse_line),
        lambda: [line for file in _files("tests/interfaces/val2/programs/*.v2") for line in file.splitlines()
                 if _is_line(line)],
        ("interfaces.val2.parser", "interfaces.val2.grammar"), QUICK,
    ),
    "recordings": Parser(
        _file(_looked_into, "run.mcap"), _recording,
        ("interfaces.recording.mcap_reading", "interfaces.recording.recording", "interfaces.recording.history",
         "interfaces.recording.track"),
    ),
}  # fmt: skip
"""Parsers of files and lines, by what they read."""


def mutated(random: Random, corpus: list[bytes]) -> bytes:
    """An input like one of those, or like two of them."""
    data = random.choice(corpus)
    for _ in range(random.choice((1, 1, 1, 2, 3, 6))):
        at, what = random.randrange(len(data) + 1), random.randrange(10)
        if what == 0 and data:
            at = min(at, len(data) - 1)
            data = data[:at] + bytes([data[at] ^ 1 << random.randrange(8)]) + data[at + 1 :]
        elif what == 1:
            data = data[:at]
        elif what == 2:
            data = data[:at] + data[at + random.choice((1, 1, 4, 40)) :]
        elif what == 3:
            data = data[:at] + random.choice(_BYTES) + data[at:]
        elif what in {4, 5, 6}:
            numbers = list(_NUMBER.finditer(data))
            if numbers:
                number = random.choice(numbers)
                data = data[: number.start()] + random.choice(_EDGES) + data[number.end() :]
        elif what == 7:
            span = data[at : at + random.choice((1, 10, 100))]
            data = data[:at] + span * random.choice((1, 2, 50)) + data[at:]
        else:
            lines, others = data.split(b"\n"), random.choice(corpus).split(b"\n")
            lines.insert(random.randrange(len(lines) + 1), random.choice(others))
            data = b"\n".join(lines)
    return data[:LARGEST]


@dataclass
class Found:
    """What became of the inputs."""

    inputs: int = 0
    taken: int = 0
    slowest: float = 0.0
    """[ms]."""
    untyped: str = ""
    """The first error that isn't a typed one, and its input."""


def fuzz(parser: Parser, random: Random, seconds: float, coverage: Coverage) -> Found:
    """Feed a parser for a time [s]; what reaches a new block, or is refused for a new reason, is varied further."""
    found, corpus, reasons = Found(), parser.corpus(), set[str]()
    end = time.monotonic() + seconds
    originals = list(corpus)
    while time.monotonic() < end and not found.untyped:
        data = originals[found.inputs] if found.inputs < len(originals) else mutated(random, corpus)
        before = len(coverage.reached) + len(reasons)
        took, reason = _timed(parser.parse, data)
        if took > parser.within:
            # Perhaps it loaded something, or somebody else had the processor's caches.
            took = min(took, *(_timed(parser.parse, data)[0] for _ in range(3)))
        found.inputs += 1
        found.slowest = max(found.slowest, took)
        if reason is None:
            found.taken += 1
        elif reason.startswith("!"):
            found.untyped = f"{reason[1:]} by {data[:200]!r}"
        else:
            reasons.add(re.sub(r"['\"].*['\"]|[\d.]+", "", reason)[:60])
        if len(coverage.reached) + len(reasons) > before and len(corpus) < 3000:
            corpus.append(data)
    return found


def _timed(parse: Callable[[bytes], object], data: bytes) -> tuple[float, str | None]:
    """How long one input takes [ms], and why it's refused: None if it isn't, `!` before what is no typed error."""
    begun = time.thread_time()
    try:
        parse(data)
    except VrsError as error:
        reason: str | None = str(error)
    except Exception as error:  # noqa: BLE001 - whatever it is, it's the finding
        reason = f"!{type(error).__name__}: {error}"
    else:
        reason = None
    return 1e3 * (time.thread_time() - begun), reason


def _peak() -> float:
    """The most memory that this process has needed so far [MiB]."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def parser_fuzzed(name: str, effort: Effort) -> tuple[Result, ...]:
    """A parser of PARSERS, for so long."""
    parser = PARSERS[name]
    for data in parser.corpus():
        parser.parse(data)
    before = _peak()
    with Coverage(*parser.modules) as coverage:
        found = fuzz(parser, Random(effort.seed), effort.seconds, coverage)
    return _results(found, coverage, parser.within, _peak() - before)


def _results(found: Found, coverage: Coverage, within: float, memory: float) -> tuple[Result, ...]:
    note = f"{found.taken:,} were taken; {len(coverage.reached)} of {coverage.blocks} blocks were reached"
    return (
        most("errors that aren't typed", bool(found.untyped), 0, tries=found.inputs, note=found.untyped or note),
        most("the slowest takes", found.slowest, within, "ms", tries=found.inputs),
        most("memory grows by", memory, MEMORY, "MiB", tries=found.inputs),
    )


def wire_fuzzed(effort: Effort) -> tuple[Result, ...]:
    """Frames of the wire are mutated

    By structure and by bytes, in both encodings, with the decoder's lines traced: typed errors only; what is taken
    is finite and comes back the same. Frames of its corpus are timed without the tracing.
    """
    import gc

    frames, slowest, problem, before = 0, 0.0, "", _peak()
    reached = set[Any]()
    for encoding in Encoding:
        fuzzer = wire_fuzz.fuzzer(encoding, effort.seed)
        end = time.monotonic() + effort.seconds / len(Encoding)
        while time.monotonic() < end and not problem:
            finding = fuzzer.run(500)
            problem = "" if finding is None else f"{finding.error} by {finding.frame[:200]!r}"
            frames += 500
        reached |= fuzzer.seen

        def parse(data: bytes, encoding: Encoding = encoding) -> object:
            return decode(data, encoding, allowed=wire_fuzz.EVERYTHING)

        gc.collect()
        for frame in fuzzer.corpus:
            slowest = max(slowest, min(_timed(parse, frame)[0] for _ in range(3)))
    return (
        most("errors that aren't typed, or values that aren't sound", bool(problem), 0, tries=frames,
             note=problem or f"{len(reached)} steps from line to line were seen"),
        most("the slowest takes", slowest, QUICK, "ms"),
        most("memory grows by", _peak() - before, MEMORY, "MiB", tries=frames),
    )  # fmt: skip


RSP = tuple(f"interfaces.rsp.{name}" for name in ("header", "handshake", "layout", "session", "robot", "local"))


def rsp_fuzzed(effort: Effort) -> tuple[Result, ...]:
    """Datagrams of RSP are mutated

    Random and mutated datagrams to both cores, sealed and in the clear: no exception leaves a core; sealed, nothing
    moves; in the clear, never beyond the limits.
    """
    datagrams, slowest, moved, before = 0, 0.0, 0, _peak()
    with Coverage(*RSP) as coverage:
        for sealed in (True, False):
            end, round_number = time.monotonic() + effort.seconds / 2, 0
            while time.monotonic() < end:
                pair, sent = rsp_fuzz.session(sealed=sealed)
                given = pair.robot.motion.given(rsp_fuzz.WHEEL)
                random = Random(f"{effort.seed} {round_number} {sealed}")
                longest = rsp_fuzz.feed(pair, sent, 2000, random, mutate_session=True)
                slowest, datagrams, round_number = max(slowest, longest), datagrams + 2000, round_number + 1
                values = [value for some in pair.robot.effectors(now=pair.now).values() for value in some]
                beyond = not all(-500 <= value <= 500 for value in values)
                moved += beyond or (sealed and pair.robot.motion.given(rsp_fuzz.WHEEL) != given)
    note = f"{len(coverage.reached)} of {coverage.blocks} blocks were reached"
    return (
        most("moves by them", moved, 0, tries=datagrams, note=note),
        most("the slowest takes", 1e3 * slowest, QUICK, "ms", tries=datagrams),
        most("memory grows by", _peak() - before, MEMORY, "MiB", tries=datagrams),
    )


def recordings_flipped(effort: Effort) -> tuple[Result, ...]:
    """Bits of a recording flip

    One bit at a time, in a complete file and in a cut one: a typed error, or a counted loss of a block; what is
    read is never wrong.
    """
    with tempfile.TemporaryDirectory() as folder:
        path = test_damage.whole(Path(folder))
        data, judge = path.read_bytes(), test_damage.Judge(path)
        random, found = Random(effort.seed), dict[str, int]()
        end = time.monotonic() + effort.seconds
        while time.monotonic() < end:
            at = random.randrange(len(data))
            cut = data if random.random() < 0.5 else data[: test_damage.last_block(data) + 100]
            at %= len(cut)
            path.write_bytes(cut[:at] + bytes([cut[at] ^ 1 << random.randrange(8)]) + cut[at + 1 :])
            outcome = judge.look(path)
            found[outcome] = found.get(outcome, 0) + 1
    note = ", ".join(f"{outcome} {count}" for outcome, count in sorted(found.items()))
    return (most("hidden", found.get("same", 0), 0, tries=sum(found.values()), note=note),)
