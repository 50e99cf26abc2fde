"""The laboratory of the mobile robot: operators, runs, tables."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from interfaces.cli.main import app
from interfaces.lab.driving.operators import STYLES, operator
from interfaces.lab.driving.output import COMPARED, summary
from interfaces.lab.driving.run import run
from interfaces.lab.driving.sweep import CAUSES, attributed, cases, grouped, measure, paired
from interfaces.lab.runner import pooled
from interfaces.runs.drive_run import DriveCase
from interfaces.teleop.architectures import Transport
from robots.ipr.parameters import IPR
from robots.mobile.chassis import MobileReality
from robots.mobile.robot import BareBody, place
from robots.onboard.driving import STAND, Drive, Posture
from vrs.errors import FormatError, InvalidValueError
from vrs.mobile import advanced

IDEAL = MobileReality.ideal(dt=1 / 60)


@pytest.mark.parametrize("style", list(STYLES))
@pytest.mark.parametrize("seed", range(3))
def test_styles_keep_headroom_and_touch_nothing(style: str, seed: int) -> None:
    who = operator(style, seed, 0.1)
    # What a map doesn't have is for the extended architecture.
    room = place(who.room).known() if who.room else None
    body = BareBody(IPR, who.start, room=room, reality=IDEAL, rng=0)
    posture, before, way = who.start, STAND, 0.0
    for k in range(1200):
        drive = who.drive(0.1 * k, posture, before)
        assert abs(drive.v) <= 0.35
        assert abs(drive.w) <= np.radians(30) + 1e-9
        assert abs(drive.v - before.v) <= 0.36 * 0.1 + 1e-9
        posture, before = Posture(*advanced(posture, drive.v, drive.w, 0.1)), drive
        body.follow(drive.v, drive.w)
        way += 0.1 * abs(drive.v)
    assert body.collisions == ()
    assert way > 12.0


def test_a_seed_drives_the_same_and_another_otherwise() -> None:
    def driven(seed: int) -> list[Drive]:
        who = operator("mixed", seed, 0.1)
        drives, posture = [STAND], who.start
        for k in range(100):
            drives.append(who.drive(0.1 * k, posture, drives[-1]))
            posture = Posture(*advanced(posture, drives[-1].v, drives[-1].w, 0.1))
        return drives

    assert driven(4) == driven(4)
    assert driven(4) != driven(8)


def test_recorded_inputs_are_driven_as_they_were(tmp_path: Path) -> None:
    file = tmp_path / "inputs.csv"
    # As a spreadsheet writes it, with a mark before its first column.
    file.write_text("t,v,w\n0,0,0\n0.5,0.05,0\n1.5,0,0.2\n2,0,0\n", encoding="utf-8-sig")
    drive = run(DriveCase(delay="none", robot="bare", operator=f"inputs:{file}", length=6.0, reality=IDEAL))
    x, y, theta = drive.virtual[-1]
    assert (x, y, theta) == pytest.approx((0.05, 0.0, 0.1), abs=1e-9)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "line 1"),
        ("t,v\n0,1\n", "line 1"),
        ("t,v,w\n0,0\n", "line 2"),
        ("t,v,w\n0,0,nan\n1,0,0\n", "line 2"),
        ("t,v,w\n0.5,0,0\n1,0,0\n", "line 2"),
        ("t,v,w\n0,0,0\n0,0,0\n", "line 3"),
        ("t,v,w\n0,0,0\n", "two rows"),
        ("t,v,w\n0,0,1e9\n1,0,0\n", "line 2"),
    ],
)
def test_inputs_that_are_none_are_refused_with_the_line(tmp_path: Path, text: str, said: str) -> None:
    file = tmp_path / "bad.csv"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(FormatError, match=said):
        operator(f"inputs:{file}", 0, 0.1)


@pytest.mark.parametrize("robot", ["bare", pytest.param("ipr@mujoco", marks=pytest.mark.needs("mujoco"))])
def test_a_run_is_the_same_to_the_last_bit(robot: str) -> None:
    case = DriveCase("timeline", Transport.DATAGRAMS, "mon@3.3", robot, "slalom", 3, 20.0)
    one, other = run(case), run(case)
    for name in ("t", "real", "measured", "drives", "offset", "estimated"):
        assert np.array_equal(getattr(one, name), getattr(other, name), equal_nan=True)
    assert one.compare() == other.compare()


@pytest.mark.needs("pybullet", "mujoco")
def test_the_worlds_agree_on_where_a_robot_drives() -> None:
    drives = [
        run(DriveCase("timeline", Transport.DATAGRAMS, "none", robot, "figure-eight", 1, 10.0))
        for robot in ("ipr@bullet", "ipr@mujoco", "ipr@bare", "bare")
    ]
    off = [float(np.hypot(*(one.real - drives[0].real)[:, :2].T).max()) for one in drives]
    assert 0.0 < off[1] < 5e-3
    assert np.array_equal(drives[2].real, drives[3].real)


def test_without_delay_and_with_the_model_itself_the_twins_agree() -> None:
    for architecture in ("I", "II", "III-capped", "timeline"):
        drive = run(
            DriveCase(architecture, Transport.STREAM, "none", "bare", "figure-eight", 0, 30.0, reality=IDEAL)
        )
        found = drive.compare()
        assert found.progress is not None
        assert found.progress > 0.99
        assert found.path_error_max is not None
        assert found.path_error_max < 0.03
        assert drive.limits_passed() == 0


def test_a_run_goes_on_for_the_largest_delay_and_five_seconds() -> None:
    drive = run(DriveCase("timeline", Transport.DATAGRAMS, "constant:3", "bare", "figure-eight", 0, 10.0))
    assert drive.t[-1] == pytest.approx(18.0, abs=0.1)


def test_who_is_done_before_the_end_ends_the_run() -> None:
    class Brief:
        """Drives ahead for a second."""

        start, room, finished = Posture(0.0, 0.0, 0.0), "", False

        def drive(self, t: float, _posture: Posture, _before: Drive) -> Drive:
            self.finished = t >= 1.0
            return Drive(0.1, 0.0)

    made = run(
        DriveCase("timeline", Transport.DATAGRAMS, "constant:0.2", "bare", length=20.0, reality=IDEAL), Brief()
    )
    assert 6.0 < made.t[-1] < 7.0


def test_a_robot_that_stops_by_itself_ends_the_run_with_the_reason(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "own_endless.py").write_text(
        "from robots.onboard.driving import Drive\n"
        "class Endless:\n"
        "    executed = 0\n"
        "    def __init__(self, constants, posture): pass\n"
        "    def receive(self, arcs, packet, *, now): pass\n"
        "    def control(self, posture, *, now, v_before): return Drive(float('nan'), 0.0)\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    case = DriveCase("own_endless:Endless", "datagrams", "none", "bare", "mixed", 1, 8.0)
    with pytest.raises(InvalidValueError, match=r"architecture must be one that drives on: .* no finite drive"):
        run(case)


def test_lost_packets_are_repeated_and_the_path_is_kept(tmp_path: Path) -> None:
    trace = tmp_path / "trace.csv"
    rng = np.random.default_rng(0)
    rows = ['""' if rng.random() < 0.3 else f"{rng.uniform(0.02, 0.6):.3f}" for _ in range(3000)]
    trace.write_text("delay_s\n" + "\n".join(rows) + "\n", encoding="utf-8")
    drive = run(DriveCase("timeline", Transport.DATAGRAMS, f"trace:{trace}", "bare", "docking", 1, 60.0))
    found = drive.compare()
    assert found.path_error_max is not None
    assert found.path_error_max < 0.03
    assert found.progress is not None
    assert found.progress > 0.97


def test_the_table_doesn_t_depend_on_the_workers() -> None:
    chosen = cases(["II", "timeline"], [Transport.STREAM], ["thu@3.3"], ["bare"], ["mixed"], range(2), 10.0)
    calls = [(measure, (case,)) for case in chosen]
    assert pooled(calls, workers=1) == pooled(calls, workers=2)


def test_a_paired_difference_has_a_verdict() -> None:
    row = measure(DriveCase("timeline", Transport.STREAM, "none", "bare", "figure-eight", 0, 10.0))

    def group(name: str, worst: list[float]) -> object:
        rows = [
            replace(row, group=(name, *row.group[1:]), seed=k, metrics=replace(row.metrics, path_error_max=x))
            for k, x in enumerate(worst)
        ]
        return grouped(rows)[0]

    def verdict(first: list[float], second: list[float]) -> str:
        found = paired(group("a", first), group("b", second), "path_error_max")  # type: ignore[arg-type]
        assert found is not None
        return found[1]

    low, high = [0.01, 0.012, 0.011, 0.013, 0.01], [0.03, 0.05, 0.04, 0.06, 0.05]
    assert verdict(low, high) == "below"
    assert verdict(low[:4], high[:4]) == "unclear"
    assert verdict(high, low) == "above"
    assert verdict(low, [x * 1.01 for x in low]) == "equal"
    assert verdict([0.01, 0.05], [0.04, 0.01]) == "unclear"


def test_a_summary_pairs_what_ran_under_the_same_network_and_has_the_worst_run() -> None:
    row = measure(DriveCase("timeline", Transport.STREAM, "none", "bare", "figure-eight", 0, 10.0))
    rows = [
        replace(
            row,
            group=(who, row.group[1], delay, *row.group[3:]),
            seed=k,
            metrics=replace(row.metrics, path_error_max=worst),
        )
        for who, delay in (("II", "mon"), ("III", "mon"), ("III", "wed"))
        for k, worst in enumerate((0.02, 0.09, 0.04))
    ]
    found = summary(rows, {})
    assert {(one["first"]["delay"], one["second"]["delay"]) for one in found["paired"]} == {("mon", "mon")}
    assert [one["metric"] for one in found["paired"]] == list(COMPARED)
    assert [group["largest"]["path_error_max"] for group in found["groups"]] == [0.09] * 3
    assert [group["median"]["path_error_max"]["value"] for group in found["groups"]] == [0.04] * 3
    stopped = [replace(one, metrics=replace(one.metrics, progress=0.5)) for one in rows]
    assert [one["metric"] for one in summary(stopped, {})["paired"]] == ["path_error_max", "time_difference_mean"]


def test_the_command_writes_its_table(tmp_path: Path) -> None:
    out = tmp_path / "out"
    asked = [
        "lab", "--out", str(out), "--architecture", "III", "--architecture", "timeline", "--delay", "domain",
        "--robot", "bare", "--runs", "2", "--length", "8", "--workers", "1", "--attribution",
    ]  # fmt: skip
    done = CliRunner().invoke(app, asked)
    assert done.exit_code == 0, done.output
    found = json.loads((out / "summary.json").read_text(encoding="utf-8"))
    assert [group["architecture"] for group in found["groups"]] == ["III", "timeline"]
    assert [found["figure"] for found in found["attribution"]] == ["path_error_mean", "time_difference_mean"] * 2
    for one in found["attribution"]:
        assert sum(one["parts"].values()) + one["residual"] == pytest.approx(one["total"], abs=1e-5)
    assert len((out / "runs.csv").read_text(encoding="utf-8").splitlines()) == 5
    assert (out / "paths.svg").read_text(encoding="utf-8").startswith("<?xml")


@pytest.mark.parametrize(
    "wrong",
    [
        ["--architecture", "IV"],
        ["--transport", "pigeon"],
        ["--delay", "x"],
        ["--robot", "r2"],
        ["--operator", "me"],
    ],
)
def test_a_wrong_name_is_one_error(tmp_path: Path, wrong: list[str]) -> None:
    done = CliRunner().invoke(app, ["lab", "--out", str(tmp_path), *wrong])
    assert isinstance(done.exception, (InvalidValueError, SystemExit))


def test_the_start_is_where_both_robots_begin() -> None:
    drive = run(DriveCase(robot="bare", operator="docking", delay="none", length=2.0))
    assert Posture(*drive.virtual[0]) == Posture(*drive.real[0]) == operator("docking", 0, 0.1).start


@pytest.mark.parametrize("architecture", ["II", "timeline"])
def test_causes_add_up_and_are_those_that_were_made(architecture: str) -> None:
    case = DriveCase(architecture, Transport.STREAM, "constant:1.5", "bare", "corridor", 0, 40.0)
    path, late = attributed(case)
    for found in (path, late):
        assert sum(value for _, value in found.parts) + found.residual == pytest.approx(found.total, rel=1e-9)
        assert tuple(cause for cause, _ in found.parts) == CAUSES
    of_path, of_time = dict(path.parts), dict(late.parts)
    assert of_time["delay"] == pytest.approx(1.5, abs=0.3)
    assert abs(of_time["model"]) + abs(of_time["localization"]) < 0.3
    if architecture == "II":
        # Nobody corrects what slip and wrong wheels do.
        assert of_path["model"] > 0.5 * path.total
        assert of_path["localization"] == pytest.approx(0.0, abs=1e-9)


def test_odometry_alone_drifts() -> None:
    case = DriveCase("timeline", Transport.DATAGRAMS, "none", "bare", "figure-eight", 0, 60.0)
    fused, alone = (run(replace(case, position=position)).compare() for position in ("fused", "odometry"))
    assert fused.path_error_max is not None
    assert alone.path_error_max is not None
    assert alone.path_error_max > 5 * fused.path_error_max
