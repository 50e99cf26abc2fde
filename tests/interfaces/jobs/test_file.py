"""Lists of jobs in files: what is written is read again, and what is damaged is kept."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from interfaces.jobs import JobFile, JobRunner, read_jobs, written_jobs
from interfaces.messages.jobs import (
    ArmJob,
    Job,
    JobList,
    JobProgress,
    JobStage,
    ListCommand,
    MessageJob,
    MoveJob,
    Progress,
    VoiceJob,
    WaitJob,
)
from robots.onboard.journey import Goal
from vrs.errors import FormatError

NUMBERS = st.floats(-1000, 1000)
GOALS = st.builds(Goal, NUMBERS, NUMBERS, st.none() | NUMBERS)
TEXTS = st.text(min_size=1, max_size=30).filter(str.strip)
JOBS: st.SearchStrategy[Job] = st.one_of(
    st.builds(MoveJob, st.just(1), GOALS | st.just("here")),
    st.builds(VoiceJob, st.just(1), TEXTS),
    st.builds(MessageJob, st.just(1), TEXTS),
    st.builds(WaitJob, st.just(1), st.none() | st.floats(0, 86400)),
    st.builds(ArmJob, st.just(1), TEXTS, st.text(max_size=100)),
)


@given(jobs=st.lists(JOBS, max_size=8), goal=GOALS, data=st.data())
def test_what_is_written_is_read_again_to_the_bit(jobs: list[Job], goal: Goal, data: st.DataObject) -> None:
    numbers = data.draw(st.permutations(range(1, len(jobs) + 1)))
    numbered = tuple(replace(job, number=number) for number, job in zip(numbers, jobs, strict=True))
    stages = data.draw(st.lists(st.sampled_from(JobStage), min_size=len(jobs), max_size=len(jobs)))
    listed = JobList(numbered, {"here": goal})
    progress = Progress(
        JobStage.PAUSED, tuple(JobProgress(n, s, "so") for n, s in zip(numbers, stages, strict=True)), "why"
    )
    assert read_jobs(written_jobs(listed, progress), "x") == (listed, progress)


def test_a_list_survives_a_restart(tmp_path: Path) -> None:
    file = JobFile(tmp_path / "deep" / "jobs.json")
    runner = JobRunner(JobList((MoveJob(1, "B"), WaitJob(2)), places={"B": Goal(1.0, 2.0, 0.5)}))
    runner.receive(ListCommand.RUN, now=0.0)
    file.save(runner.jobs, runner.progress)
    again = JobRunner()
    again.load(*JobFile(file.path).load(), now=0.0)
    assert again.jobs == runner.jobs
    assert again.progress.stage is JobStage.PAUSED
    assert [path.name for path in file.path.parent.iterdir()] == ["jobs.json"]
    assert '"do": "move"' in file.path.read_text()


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "is no list of jobs"),
        ('{"schema": "vrs.jobs", "version": 1, "list": {"jobs": [{"do": "mo', "is no list of jobs"),
        ('{"schema": "vrs.jobs", "version": 2}', "version 2; version 1 is read"),
        ('{"schema": "vrs.jobs", "version": 1, "list": {"jobs": [{"do": "fly", "number": 1}]}}', "fly"),
        ('{"schema": "vrs.jobs", "version": 1, "list": {"jobs": [{"do": "move", "number": 1, "to": "B"}]}}', "B"),
        ('{"schema": "vrs.jobs", "version": 1, "list": {"jobs": [{"do": "wait", "number": 0}]}}', "number"),
        ("[" * 100_000, "is no list of jobs"),
    ],
)
def test_what_is_damaged_says_so_and_is_kept(tmp_path: Path, text: str, says: str) -> None:
    path = tmp_path / "jobs.json"
    path.write_text(text)
    file = JobFile(path)
    with pytest.raises(FormatError, match=says):
        file.load()
    assert path.read_text() == text
    jobs = JobList((WaitJob(1, 1.0),))
    file.save(jobs, Progress.of(jobs))
    assert (tmp_path / "jobs.json.damaged").read_text() == text
    assert JobFile(path).load() == (jobs, Progress.of(jobs))


def test_there_neednt_be_a_file(tmp_path: Path) -> None:
    assert JobFile(tmp_path / "none.json").load() == (JobList(), Progress())


def test_a_file_that_cant_be_written_says_so(tmp_path: Path) -> None:
    (tmp_path / "plain").write_text("")
    with pytest.raises(FormatError, match="can't be written"):
        JobFile(tmp_path / "plain" / "jobs.json").save(JobList(), Progress())


def test_a_directory_in_its_place_is_left_alone(tmp_path: Path) -> None:
    file = JobFile(tmp_path)
    with pytest.raises(FormatError, match="can't be read"):
        file.load()
    with pytest.raises(FormatError, match="can't be written"):
        file.save(JobList(), Progress())
    assert tmp_path.is_dir()


def test_every_damaged_file_is_kept(tmp_path: Path) -> None:
    path = tmp_path / "jobs.json"
    for text in ("first", "second", "third"):
        path.write_text(text)
        file = JobFile(path)
        with pytest.raises(FormatError):
            file.load()
        file.save(JobList(), Progress())
    kept = [path.with_name(f"jobs.json.damaged{k}") for k in ("", "2", "3")]
    assert [one.read_text() for one in kept] == ["first", "second", "third"]


def test_a_reason_of_any_length_can_be_read_again() -> None:
    jobs, why = JobList((WaitJob(1),)), "x" * 10_000
    progress = Progress(JobStage.FAILED, (JobProgress(1, JobStage.FAILED, why),), why)
    _, found = read_jobs(written_jobs(jobs, progress), "x")
    assert found.stage is JobStage.FAILED
    assert 100 <= len(found.reason) == len(found.jobs[0].reason) < len(why)


def test_a_list_that_cant_be_written_leaves_the_one_before(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As where the disk is full: what is in the file's place is a whole list at any time."""
    file, jobs = JobFile(tmp_path / "jobs.json"), JobList((WaitJob(1, 1.0),))
    file.save(jobs, Progress.of(jobs))
    with file.path.open("rb") as reading:
        file.save(jobs, Progress.of(jobs))
        assert read_jobs(reading.read(), "x") == (jobs, Progress.of(jobs))
        assert os.fstat(reading.fileno()).st_ino != file.path.stat().st_ino

    def full(_: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.fsync", full)
    with pytest.raises(FormatError, match="can't be written: No space left"):
        file.save(JobList(), Progress())
    assert file.load() == (jobs, Progress.of(jobs))
    assert [path.name for path in tmp_path.iterdir()] == ["jobs.json"]
