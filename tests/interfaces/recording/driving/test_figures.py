"""Figures of a mobile run from its recording alone: the row of runs.csv, of whole and of broken files."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np
import pytest

from interfaces.cli.main import exit_status
from interfaces.lab.driving.run import measure_recorded, name_of
from interfaces.recording import open_recording
from interfaces.recording.figures import figures, summary
from interfaces.recording.playback import Playback
from interfaces.report.html import render_recording as render
from interfaces.runs.drive_run import COLUMNS, METRICS, DriveCase, facts_of, row_of
from interfaces.station.shelf import checked_name
from interfaces.teleop.architectures import Transport
from tests.interfaces.recording.driving.runs import SLALOM, WANDER, recorded
from tests.interfaces.recording.made import make
from vrs.comparison import compare_paths
from vrs.errors import FormatError


@pytest.mark.parametrize("case", [SLALOM, WANDER], ids=lambda case: case.operator)
def test_a_recording_gives_the_row_of_its_run(case: DriveCase) -> None:
    drive, path = recorded(case)
    with open_recording(path) as recording:
        found = summary(recording)
    assert {name: found[name] for name in COLUMNS} == facts_of(row_of(drive))
    assert "missing" not in found
    oracle = compare_paths(drive.t, drive.virtual[:, :2], drive.real[:, :2])
    for name in METRICS:
        assert found[name] == pytest.approx(getattr(oracle, name), rel=1e-5)


def test_the_laboratory_keeps_recordings_and_nothing_else_changes(tmp_path: Path, capsys) -> None:
    arguments = ["lab", "--robot", "bare", "--architecture", "I", "--delay", "constant:0.3", "--runs", "2"]
    arguments += ["--length", "4", "--operator", "slalom", "--out"]
    plain, kept = tmp_path / "plain", tmp_path / "kept"
    assert exit_status([*arguments, str(plain), "--workers", "1"]) == 0
    assert exit_status([*arguments, str(kept), "--workers", "2", "--record"]) == 0
    for file in plain.iterdir():
        assert (kept / file.name).read_bytes() == file.read_bytes()
    rows = list(csv.DictReader((kept / "runs.csv").read_text(encoding="utf-8").splitlines()))
    files = sorted((kept / "runs").iterdir())
    assert [file.name for file in files] == [f"I-datagrams-constant_0.3-bare-slalom-{seed}.mcap" for seed in (0, 1)]
    for file, row in zip(files, rows, strict=True):
        # The same bytes from a worker and from this process.
        case = DriveCase("I", Transport.DATAGRAMS, "constant:0.3", "bare", "slalom", int(row["seed"]), 4.0)
        _, drive, problem = measure_recorded(case, False, tmp_path / "again.mcap")
        assert (drive, problem) == (None, "")
        assert (tmp_path / "again.mcap").read_bytes() == file.read_bytes()
        capsys.readouterr()
        assert exit_status(["compare", str(file), "--json"]) == 0
        found = json.loads(capsys.readouterr().out)
        for name, cell in row.items():
            if name in METRICS or name in {"seed", "sent_bytes", "longest_delay", "collisions", "limits_passed"}:
                assert found[name] == (float(cell) if cell else None)
            else:
                assert found[name] == cell


def test_two_are_set_side_by_side(capsys) -> None:
    first, second = recorded(SLALOM)[1], recorded(WANDER)[1]
    assert exit_status(["compare", str(first), str(second), "--json"]) == 0
    value = json.loads(capsys.readouterr().out)
    for name in METRICS:
        change = value["second"][name] - value["first"][name]
        assert value["differences"][name] == pytest.approx(change, abs=1e-9)
    assert exit_status(["compare", str(first), str(second)]) == 0
    assert "Side by side" in capsys.readouterr().out


@pytest.mark.parametrize("command", [["compare"], ["replay", "--headless", "--at", "1"]])
def test_robots_of_two_kinds_arent_compared(command: list[str], tmp_path: Path, capsys) -> None:
    make(tmp_path / "arm.mcap", 2.0)
    assert exit_status([*command, str(recorded(SLALOM)[1]), str(tmp_path / "arm.mcap")]) == 2
    said = capsys.readouterr()
    assert (said.out, said.err.count("\n")) == ("", 1)
    assert "of one kind of robot" in said.err


@pytest.mark.parametrize("share", [0.3, 0.6, 0.8])
def test_a_cut_file_gives_figures_until_there(share: float, tmp_path: Path, capsys) -> None:
    drive, path = recorded(SLALOM)
    data = path.read_bytes()
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(data[: int(share * len(data))])
    assert exit_status(["compare", str(cut), "--json"]) == 0
    said = capsys.readouterr()
    found = json.loads(said.out)
    assert all(line.startswith("vrs: cut.mcap: missing: ") for line in said.err.splitlines())
    assert "cut" in found["missing"][0]
    rows = round(found["duration_s"] / 0.05) + 1
    assert 1 < rows < len(drive.t)
    oracle = compare_paths(drive.t[:rows], drive.virtual[:rows, :2], drive.real[:rows, :2])
    assert found["path_error_max"] == pytest.approx(oracle.path_error_max, rel=1e-5)


def test_a_destroyed_block_is_left_out_and_told(tmp_path: Path) -> None:
    drive, path = recorded(WANDER)
    data = bytearray(path.read_bytes())
    # Inside of a block: between them lie indexes, which can be done without.
    data[len(data) * 9 // 20] ^= 0x10
    (tmp_path / "torn.mcap").write_bytes(data)
    with open_recording(tmp_path / "torn.mcap") as recording:
        found = figures(recording)
        assert "damaged" in found.missing[0]
        assert len(found.run.t) == len(drive.t)
        seen = np.isfinite(found.run.real).all(axis=1)
        assert 0 < np.count_nonzero(~seen) < 20
        np.testing.assert_array_equal(found.run.real[seen], drive.real[seen])
        value = summary(recording)
        assert value["gap_s"] == pytest.approx(0.05 * (np.count_nonzero(~seen) + 1), abs=1e-9)
        assert value["path_error_max"] <= drive.compare().path_error_max + 1e-9
        html, _ = render(recording)
        assert "not measured" in html
        shown = Playback([recording])
        for t in np.linspace(0.0, drive.t[-1], 100):
            frame = shown.moment(float(t)).frames[0]
            assert frame.error is None or np.isfinite(frame.error)
        np.testing.assert_allclose(found.run.virtual, drive.virtual, atol=1e-9)


def test_flipped_bits_never_give_wrong_figures(tmp_path: Path) -> None:
    drive, path = recorded(SLALOM)
    data, whole = path.read_bytes(), facts_of(row_of(drive))
    rng = np.random.default_rng(0)
    file = tmp_path / "flipped.mcap"
    for place in rng.integers(0, len(data), 25).tolist():
        flipped = bytearray(data)
        flipped[place] ^= 1 << int(rng.integers(8))
        file.write_bytes(flipped)
        try:
            with open_recording(file) as recording:
                found = summary(recording)
        except FormatError:
            continue
        if "missing" not in found:
            assert {name: found[name] for name in COLUMNS} == whole


@pytest.mark.parametrize(
    ("architecture", "delay", "operator", "name"),
    [
        ("III-capped", "thu@3.3", "figure-eight", "III-capped-stream-thu_3.3-micro-figure-eight-7"),
        ("I", "constant:0.5", "slalom", "I-stream-constant_0.5-micro-slalom-7"),
        ("I", "trace:/a/b c/week.csv", "mixed", "I-stream-trace_week_656233f9-micro-mixed-7"),
    ],
)
def test_a_name_says_what_it_is_and_is_one(architecture: str, delay: str, operator: str, name: str) -> None:
    assert name_of(DriveCase(architecture, Transport.STREAM, delay, "micro", operator, 7)) == name
    checked_name(f"{name}.mcap")


def test_names_of_other_cases_are_others_and_all_are_plain() -> None:
    delays = [
        "mon",
        "mon@3.3",
        "trace:a/b.csv",
        "trace:a_b.csv",
        "trace:b.csv",
        "trace:ä/b.csv",
        "trace:" + "x" * 300,
    ]
    operators = ["mixed", "inputs:../up.csv", "inputs:up.csv", "inputs:" + "y" * 99]
    cases = [
        DriveCase(architecture, transport, delay, "micro", operator, seed)
        for architecture in ("I", "timeline")
        for transport in Transport
        for delay in delays
        for operator in operators
        for seed in (0, 4_294_967_295)
    ]
    names = [name_of(case) for case in cases]
    assert len({name.lower() for name in names}) == len(cases)
    for name in names:
        checked_name(f"{name}.mcap")
