"""Parts of one's own, named `module:name`."""

from __future__ import annotations

from pathlib import Path

import pytest
from typer.testing import CliRunner

from interfaces.cli.main import app
from interfaces.lab.driving.operators import operator
from interfaces.lab.driving.run import run
from interfaces.runs.drive_run import DriveCase
from interfaces.system import is_own
from interfaces.teleop.architectures import Constants, controller
from robots.onboard.driving import STAND, Posture
from vrs.errors import FormatError, InvalidValueError

MODULE = """
from robots.onboard.driving import STAND, Drive, Posture

class Still:
    executed = 0
    def __init__(self, constants, posture): pass
    def receive(self, arcs, packet, *, now): pass
    def control(self, posture, *, now, v_before): return STAND

class Ahead:
    start, room = Posture(0.0, 0.0, 0.0), ""
    def __init__(self, rng, period): self.speed = float(rng.uniform(0.1, 0.2))
    def drive(self, t, posture, before): return Drive(min(self.speed, before.v + 0.02), 0.0)

def nothing(*given): return None
ANSWER = 42
"""


@pytest.fixture
def module(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    name = f"own_{tmp_path.name}"
    (tmp_path / f"{name}.py").write_text(MODULE)
    monkeypatch.chdir(tmp_path)
    return name


@pytest.mark.parametrize("text", ["a:b", "a.b:c", "20_own:Name"])
def test_a_module_and_a_name_are_ones_own(text: str) -> None:
    assert is_own(text)


@pytest.mark.parametrize(
    "text", ["", "III", "III-capped", ":b", "a:", "a..b:c", "inputs:file.csv", "trace:x/y.csv", "a:b:c"]
)
def test_all_else_isnt(text: str) -> None:
    assert not is_own(text)


def test_parts_of_ones_own_are_run_and_kept_apart_by_their_names(module: str) -> None:
    drive = run(DriveCase(f"{module}:Still", "datagrams", "none", "bare", f"{module}:Ahead", 3, 5.0))  # type: ignore[arg-type]
    assert drive.virtual[-1, 0] > 0.2
    assert abs(drive.real).max() < 1e-9
    assert drive.case.group[0] == f"{module}:Still"


def test_a_seed_is_its_operator(module: str) -> None:
    first, again, other = (operator(f"{module}:Ahead", seed, 0.1) for seed in (1, 1, 2))
    drives = [who.drive(0.0, Posture(0, 0, 0), STAND._replace(v=1.0)) for who in (first, again, other)]
    assert drives[0] == drives[1] != drives[2]


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("no_such_module:Still", "No module named"),
        ("{}:Stil", r"must be a function or class there \(Ahead, Still, nothing\); given: 'Stil'"),
        ("{}:ANSWER", "must be a function or class there"),
        ("math:sin", r"must be a function or class that takes \(constants, posture\); given: 'sin'"),
        ("{}:nothing", "must be something with receive, control, executed; given: 'NoneType'"),
    ],
)
def test_what_isnt_one_is_said(module: str, name: str, said: str) -> None:
    with pytest.raises((InvalidValueError, FormatError), match=said):
        controller(name.format(module), Posture(0.0, 0.0, 0.0), Constants())


def test_a_module_that_fails_is_named_with_its_reason(module: str, tmp_path: Path) -> None:
    (tmp_path / f"{module}_bad.py").write_text("1 / 0")
    with pytest.raises(FormatError, match="ZeroDivisionError: division by zero"):
        operator(f"{module}_bad:Ahead", 0, 0.1)


def test_the_command_line_runs_them(module: str, tmp_path: Path) -> None:
    given = [
        "lab",
        "--architecture",
        f"{module}:Still",
        "--operator",
        f"{module}:Ahead",
        "--robot",
        "bare",
        "--runs",
        "1",
    ]
    done = CliRunner().invoke(app, [*given, "--length", "3", "--workers", "1", "--out", str(tmp_path / "o")])
    assert done.exit_code == 0, done.output
    assert f"{module}:Still" in (tmp_path / "o" / "runs.csv").read_text()
