"""Finished calls are kept whole, found again by arguments and version, and nothing in a file is run."""

from __future__ import annotations

import hashlib
import os
import signal
import subprocess
import sys
import time
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as some
from hypothesis.extra.numpy import arrays

from interfaces.cli.main import exit_status
from interfaces.lab import PAPERS, PaperPart, Study, finished
from interfaces.lab.claims import Results, Verdict
from interfaces.lab.control import study as control
from interfaces.lab.finished import FinishedRows, Machine, machine, packed, unpacked
from interfaces.lab.goals import study as goals
from interfaces.lab.localization import study as rooms
from interfaces.lab.output import to_json
from interfaces.lab.runner import pooled, reproductions
from interfaces.lab.statistics import Estimate
from interfaces.runs.drive_run import DriveCase
from vrs.errors import FormatError, InvalidValueError

HOUSE = Path(__file__).resolve().parents[3]
numbers = some.floats() | some.integers(-(2**63), 2**63 - 1) | some.floats().map(np.float64) | some.booleans()
parts = (
    some.none() | numbers | some.text() | some.binary() | some.sampled_from(Verdict) | some.just(Path("a"))
    | arrays(some.sampled_from([np.float64, np.int32, np.bool_]), (2, 3))
    | some.builds(Estimate, some.floats(), some.floats(), some.floats())
    | some.builds(Results, a=numbers) | some.builds(DriveCase, seed=some.integers(0, 9))
)  # fmt: skip
values = some.recursive(
    parts,
    lambda inner: (
        some.lists(inner) | some.tuples(inner, inner) | some.dictionaries(some.text() | some.floats(), inner)
    ),
    max_leaves=8,
)


def alike(one: Any, other: Any) -> bool:
    """Of the same types, to the last bit."""
    if type(one) is not type(other):
        return False
    if isinstance(one, np.ndarray):
        same = one.dtype == other.dtype and one.shape == other.shape and np.isfortran(one) == np.isfortran(other)
        return same and one.tobytes() == other.tobytes()
    if isinstance(one, float):
        return np.float64(one).tobytes() == np.float64(other).tobytes()
    if isinstance(one, (list, tuple)):
        return len(one) == len(other) and all(map(alike, one, other))
    if isinstance(one, dict):
        return alike(list(one.items()), list(other.items()))
    return alike(vars(one), vars(other)) if isinstance(one, Results) else bool(one == other)


@given(values)
def test_what_is_kept_is_what_was(value: Any) -> None:
    crossed = msgspec.msgpack.decode(msgspec.msgpack.encode(packed(value)))
    assert alike(unpacked(crossed), value)


def test_the_order_of_an_arrays_memory_is_kept() -> None:
    value = np.asfortranarray(np.arange(6.0).reshape(2, 3))
    assert alike(unpacked(packed(value)), value)


@pytest.mark.parametrize(
    "value",
    [
        {"fields": ["os:environ"]},
        {"fields": ["subprocess:Popen", ["args", "true"]]},
        {"fields": ["interfaces.system:Path"]},
        {"fields": ["interfaces.cli.__main__:main"]},
        {"tuple": ["interfaces.lab.claims:Results", 1]},
        {"enum": ["interfaces.lab.claims:Verdict", "no such"]},
        {"enum": ["interfaces.lab.runner:pooled", "a"]},
        {"array": ["O", [1], "C", b"12345678"]},
        {"array": ["<f8", [2], "C", b"12345678"]},
        {"call": ["os:system", "true"]},
        {"fields": 3},
        {"a": 1, "b": 2},
    ],
)
def test_a_strangers_file_runs_nothing(value: Any) -> None:
    with pytest.raises(FormatError):
        unpacked(value)


def test_what_cant_be_kept_says_so() -> None:
    for value in (object(), print, {1, 2}, np.array([None]), pytest):
        with pytest.raises(TypeError):
            packed(value)


def note(folder: Path, k: int, text: str = "") -> tuple[int, str]:
    """Leave a file for each time that it's called."""
    (folder / f"{k}-{time.monotonic_ns()}").touch()
    return k, text


def notes(folder: Path) -> list[int]:
    return sorted(int(path.name.split("-")[0]) for path in folder.iterdir())


@pytest.fixture
def noted(tmp_path: Path) -> Path:
    (tmp_path / "notes").mkdir()
    return tmp_path / "notes"


def made(noted: Path, kept: Path, *ks: int, text: str = "", resume: bool = True) -> list[tuple[int, str]]:
    rows = FinishedRows(kept, resume=resume)
    return pooled([(partial(note, noted), (k, text)) for k in ks], finished=rows)


def test_a_finished_call_costs_nothing(noted: Path, tmp_path: Path) -> None:
    kept = tmp_path / "finished"
    assert made(noted, kept, 1, 2) == [(1, ""), (2, "")]
    assert made(noted, kept, 3, 2, 1) == [(3, ""), (2, ""), (1, "")]
    assert notes(noted) == [1, 2, 3]
    told: list[int] = []
    rows = FinishedRows(kept, resume=True)
    calls = [(partial(note, noted), (k, "")) for k in (2, 4, 1)]
    assert rows.ready(calls) == 2
    pooled(calls, finished=rows, progress=told.append)
    assert told == [1]
    assert [place for _, place, _ in sorted(rows.machines)] == [0, 1, 2]
    # Not asked to resume, it makes all of them.
    made(noted, kept, 1, resume=False)
    assert notes(noted) == [1, 1, 2, 3, 4]


def test_another_version_and_other_arguments_are_other_calls(
    noted: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    kept = tmp_path / "finished"
    made(noted, kept, 1)
    made(noted, kept, 1, text="other")
    monkeypatch.setattr(finished, "versions", lambda: {finished.SOURCES: "changed"})
    made(noted, kept, 1)
    assert notes(noted) == [1, 1, 1]


def test_what_a_name_stands_for_counts(noted: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    kept = tmp_path / "finished"
    monkeypatch.chdir(tmp_path)
    for text, file in (("trace:d.csv", "d.csv"), ("my_own:drive", "my_own.py"), ("arm.urdf#tip", "arm.urdf")):
        Path(file).write_text("one")
        made(noted, kept, 1, text=text)
        made(noted, kept, 1, text=text)
        Path(file).write_text("other")
        made(noted, kept, 1, text=text)
    assert notes(noted) == [1] * 6


def test_a_damaged_row_is_made_again(noted: Path, tmp_path: Path) -> None:
    kept = tmp_path / "finished"
    made(noted, kept, 1)
    (path,) = kept.iterdir()
    whole = path.read_bytes()
    assert path.stat().st_mode & 0o777 == 0o666 & ~umask()
    for place in range(len(whole)):
        path.write_bytes(whole[:place] + bytes([whole[place] ^ 1]) + whole[place + 1 :])
        assert FinishedRows(kept, resume=True).find(partial(note, noted), (1, "")) is None
    body = msgspec.msgpack.encode((Machine("a", "b"), {"fields": ["subprocess:Popen", ["args", "true"]]}))
    path.write_bytes(hashlib.sha256(body).digest()[:16] + body)
    assert FinishedRows(kept, resume=True).find(partial(note, noted), (1, "")) is None
    path.write_bytes(whole)
    assert FinishedRows(kept, resume=True).find(partial(note, noted), (1, "")) is not None


def umask() -> int:
    found = os.umask(0)
    os.umask(found)
    return found


def test_a_call_whose_file_is_gone_is_made_again(tmp_path: Path) -> None:
    rows, file = FinishedRows(tmp_path / "finished", resume=True), tmp_path / "run.mcap"
    for _ in range(2):
        pooled([(write, (file,))], finished=rows)
        assert rows.find(write, (file,)) is not None
        file.unlink()
        assert rows.find(write, (file,)) is None


def write(file: Path) -> str:
    file.write_text("x")
    return "written"


def test_a_disk_that_takes_nothing_costs_the_rows_alone(noted: Path, tmp_path: Path) -> None:
    kept = tmp_path / "finished"
    kept.write_text("a file where the folder would be")
    rows = FinishedRows(kept, resume=True)
    assert pooled([(partial(note, noted), (1, ""))], finished=rows) == [(1, "")]
    assert "finished runs aren't kept any more" in rows.problem


def test_only_rows_are_removed(noted: Path, tmp_path: Path) -> None:
    kept = tmp_path / "finished"
    made(noted, kept, 1, 2)
    (kept / "mine.row").touch()
    FinishedRows(kept, resume=True).clear()
    assert [path.name for path in kept.iterdir()] == ["mine.row"]
    (kept / "mine.row").unlink()
    made(noted, kept, 1, 2)
    FinishedRows(kept, resume=True).clear()
    assert not kept.exists()


def test_the_machine_is_told() -> None:
    where = machine()
    assert where.platform.split()[0] in {"Linux", "Darwin", "Windows"}
    assert any(each.isdigit() for each in where.blas)


def fail_at(k: int) -> int:
    if k == 3:
        raise InvalidValueError("k", k, "another")
    return k


def test_what_was_finished_before_a_failure_is_kept(tmp_path: Path) -> None:
    rows = FinishedRows(tmp_path / "finished", resume=True)
    calls = [(fail_at, (k,)) for k in range(5)]
    with pytest.raises(InvalidValueError):
        pooled(calls, finished=rows)
    assert rows.ready(calls) == 3


def test_a_sweep_that_is_ended_goes_on(tmp_path: Path) -> None:
    """By SIGKILL, whose rows are whole, then by Ctrl-C, which says how to go on."""
    one, other = tmp_path / "one", tmp_path / "other"
    asked = ["lab", "--robot", "bare", "--runs", "8", "--length", "3", "--operator", "slalom", "--workers", "1"]
    for number, least in ((signal.SIGKILL, 2), (signal.SIGINT, 4)):
        process = subprocess.Popen(
            [sys.executable, "-m", "interfaces.cli", *asked, "--out", str(other), "--resume"],
            env=os.environ | {"PYTHONPATH": str(HOUSE)}, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL,
            text=True,
        )  # fmt: skip
        deadline = time.monotonic() + 120
        while len(list(other.glob("finished/*.row"))) < least:
            assert process.poll() is None
            assert time.monotonic() < deadline
            time.sleep(0.01)
        process.send_signal(number)
        _, said = process.communicate(timeout=60)
    assert process.returncode == 130, said
    assert "the same command with --resume goes on" in said
    before = {path: path.stat().st_mtime_ns for path in other.glob("finished/*.row")}
    assert exit_status([*asked, "--out", str(other), "--resume"]) == 0
    assert {path: path.stat().st_mtime_ns for path in before} == before
    assert exit_status([*asked, "--out", str(one)]) == 0
    for name in ("runs.csv", "summary.json", "paths.svg", "errors.svg"):
        assert (one / name).read_bytes() == (other / name).read_bytes()


STUDIES = (*PAPERS.values(), rooms.study_of(2, 1), goals.study_of(2), control.study_of(("tracker",)))


@pytest.mark.slow
@pytest.mark.parametrize("part", [part for paper in STUDIES for part in paper.parts], ids=lambda part: part.title)
def test_what_any_part_of_a_study_finds_can_be_kept(part: PaperPart) -> None:
    found = part.work(Study(0, 2, 3.0), part.cases[0])
    crossed = msgspec.msgpack.encode(packed(found))
    again = unpacked(msgspec.msgpack.decode(crossed))
    assert msgspec.msgpack.encode(packed(again)) == crossed


def test_a_reproduction_goes_on(tmp_path: Path) -> None:
    paper, told = PAPERS["doulgeri"], list[str]()
    small = replace(paper, parts=tuple(part for part in paper.parts if "causality" in part.title))
    rows = FinishedRows(tmp_path / "finished", resume=True)
    asked, progress = [(small, Study(0, 2, 3.0))], lambda part: told.append(part.title)
    found = [one for _ in range(2) for one in reproductions(asked, finished=rows, progress=progress)]
    assert told == ["Section II-C: causality"]
    assert to_json(found[0]) == to_json(found[1])
