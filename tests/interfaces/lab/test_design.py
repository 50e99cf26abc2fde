"""A design sweep: its plan, its table, who wins where, and the page."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import pytest

from interfaces.cli.main import exit_status
from interfaces.lab.driving.design import delays_of, planned, span, surface, write_table
from interfaces.lab.driving.output import summary
from interfaces.lab.finished import KeptRow, Machine
from interfaces.report.surface import render_sweep
from interfaces.runs.drive_run import METRICS, Row
from vrs.comparison import PathComparison
from vrs.errors import InvalidValueError

HERE = Machine("Linux <x86>", "blas 1")
SETTINGS = {
    "architectures": ["I", "III", "timeline"], "transports": ["stream"], "delays": ["mon", "thu@20"],
    "robots": ["bare"], "operators": ["<slalom>"], "runs": 6, "seed": 0, "length_s": 8.0, "position": "fused",
}  # fmt: skip


def row(architecture: str, delay: str, seed: int, value: float, progress: float = 1.0) -> Row:
    metrics = PathComparison(**(dict.fromkeys(METRICS, value) | {"progress": progress}))
    return Row((architecture, "stream", delay, "bare", "<slalom>"), seed, metrics, 0, 0, 100 + seed, 0.5)


def rows() -> list[Row]:
    """Under mon timeline is better than the others; under thu@20 two can't be told apart, and I never arrives."""
    found = []
    for seed in range(6):
        noise = 0.01 * (seed % 3)
        found += [row(name, "mon", seed, value + noise) for name, value in (("I", 3), ("III", 2), ("timeline", 1))]
        found += [row("III", "thu@20", seed, 1 + noise), row("timeline", "thu@20", seed, 1.02 + noise)]
        found.append(row("I", "thu@20", seed, 9.0, progress=0.5))
    return found


@pytest.fixture
def found() -> dict[str, Any]:
    return summary(rows(), SETTINGS)


def test_who_wins_where(found: dict[str, Any]) -> None:
    places = {place.key[0]: place for place in surface(found, "path_error_mean")}
    assert list(places) == ["mon", "thu@20"]
    assert places["mon"].winner == "timeline"
    assert [one.name for one in places["mon"].contenders] == ["timeline", "III", "I"]
    assert places["mon"].contenders[0].median is not None
    assert places["mon"].contenders[0].median.value == pytest.approx(1.01)
    assert places["thu@20"].winner == ""
    leads = {one.name for one in places["thu@20"].contenders if one.leads}
    assert {"III", "timeline"} <= leads


def test_few_seeds_have_no_winner() -> None:
    few = summary([each for each in rows() if each.seed < 4], SETTINGS)
    assert {place.winner for place in surface(few, "path_error_mean")} == {""}


def test_the_page_says_so_and_escapes_names(found: dict[str, Any]) -> None:
    text = render_sweep(found)
    assert text == render_sweep(json.loads(json.dumps(found)))
    assert "&lt;slalom&gt;" in text
    assert "<slalom>" not in text
    assert "<script" not in text
    assert re.search(r'<b class="c3">timeline</b> 101 <small>100 to 102</small>', text)
    assert "no winner" in text


def test_a_row_a_run_with_its_machine(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    kept = [KeptRow(each, HERE) for each in rows()]
    parquet = pytest.importorskip("pyarrow.parquet")
    table = parquet.read_table(write_table(kept, tmp_path))
    assert table.num_rows == 36
    first, last = table.slice(0, 1).to_pylist()[0], table.slice(35, 1).to_pylist()[0]
    assert (first["architecture"], first["delay"], first["correlation_s"]) == ("I", "mon", 2.0)
    assert (last["delay"], last["correlation_s"], last["sent_bytes"]) == ("thu@20", 20.0, 105)
    assert (first["platform"], first["blas"]) == HERE
    assert first["path_error_mean"] == 3.0
    monkeypatch.setitem(__import__("sys").modules, "pyarrow", None)
    path = write_table(kept, tmp_path)
    assert path.name == "runs.csv"
    assert path.read_text().splitlines()[0] == ",".join(table.column_names)
    assert len(path.read_text().splitlines()) == 37


def test_correlation_times_are_of_delays_that_have_one() -> None:
    asked = ["thu", "none", "mon@7", "constant:0.2", "gamma:0.2,0.1"]
    assert delays_of(asked, [0.2, 20.0]) == [
        "thu@0.2", "thu@20", "none", "mon@7", "constant:0.2", "gamma:0.2,0.1@0.2", "gamma:0.2,0.1@20",
    ]  # fmt: skip
    assert delays_of(asked, []) == asked
    with pytest.raises(InvalidValueError):
        delays_of(["tuesday"], [1.0])


def test_what_it_costs_is_said() -> None:
    assert planned(SETTINGS, 36, 6, 120.0, 2) == [
        "3 architectures × 1 transport × 2 delays × 1 robot × 1 operator × 6 seeds = 36 runs, 6 of them finished",
        "one took 120.00 s here: about 60.0 min on one worker, 30.0 min on 2",
    ]
    assert [span(each) for each in (1, 119, 121, 7201, 200_000)] == [
        "1.0 s",
        "119.0 s",
        "2.0 min",
        "2.0 h",
        "2.3 days",
    ]


def test_the_command(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    asked = ["lab", "sweep", "--robot", "bare", "--operator", "slalom", "--delay", "thu", "--delay", "none"]
    asked += ["--correlation", "0.2", "--runs", "1", "--length", "2", "--workers", "1", "--out", str(tmp_path)]
    assert exit_status([*asked, "--plan"]) == 0
    said = capfd.readouterr().err
    assert "2 architectures × 1 transport × 2 delays × 1 robot × 1 operator × 1 seed = 4 runs" in said
    assert [path.name for path in tmp_path.iterdir()] == []
    assert exit_status(asked) == 0
    assert {path.name for path in tmp_path.iterdir()} >= {"summary.json", "sweep.html"}
    assert {group["delay"] for group in json.loads((tmp_path / "summary.json").read_text())["groups"]} == {
        "thu@0.2",
        "none",
    }
    for more, why in ((["--record"], "--record"), (["--starts", "3"], "--starts")):
        assert exit_status([*asked, *more]) == 2
        assert why in capfd.readouterr().err
    assert exit_status(["lab", "--plan", "--out", str(tmp_path)]) == 2
