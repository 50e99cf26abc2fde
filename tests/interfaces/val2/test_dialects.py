"""Angles of VAL-II and of V+: what a file says, what is printed, and files that look like the other dialect's."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from interfaces.val2.check import check_files, check_text
from interfaces.val2.playing import Listeners, rehearse
from interfaces.val2.source import parse_file, parse_program, print_file
from interfaces.val2.values import VAL2, VPLUS
from robots import puma560
from tests.interfaces.val2.bench import from_oat, to_oat
from tests.interfaces.val2.sitting import Sitting
from tests.interfaces.val2.test_check import exit_code

PROGRAM = Path(__file__).parent / "programs" / "angles.v2"
PLACE = from_oat(300, 400, -50, 100, 60, 5)
SHOWN = "   300.00   400.00   -50.00   10.000  150.000    5.000\n"


def turn(axis: int, degrees: float) -> np.ndarray:
    """A turn about an axis, as every textbook has it."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    i, j = [(1, 2), (2, 0), (0, 1)][axis]
    R = np.eye(3)
    R[[i, j, i, j], [i, j, j, i]] = c, c, -s, s
    return R


@pytest.mark.parametrize("angles", [(0, 0, 0), (10, 20, 30), (-170, 95, 140), (0, 180, 25), (90, 90, -90)])
def test_yaw_pitch_roll_are_turns_about_z_y_and_z_again(angles: tuple[float, float, float]) -> None:
    expected = turn(2, angles[0]) @ turn(1, angles[1]) @ turn(2, angles[2])
    pose = VPLUS.transformation(1, 2, 3, *angles)
    np.testing.assert_allclose(pose.X[:3, :3], expected, atol=1e-12)
    again = VPLUS.transformation(*VPLUS.numbers(pose))
    np.testing.assert_allclose(again.X, pose.X, atol=1e-12)
    yaw, pitch, roll = VPLUS.numbers(pose)[3:]
    np.testing.assert_allclose(to_oat(pose)[3:], (180 - (90 - yaw) % 360, pitch - 90, roll), atol=1e-9)


def test_a_program_of_each_dialect_goes_to_the_same_place() -> None:
    typed: list[str] = []
    source = parse_file(PROGRAM.read_text(), "angles.v2")
    assert [program.dialect for program in source.programs] == [VAL2, VPLUS, VPLUS]
    found = rehearse(source, puma560.model(), listeners=Listeners(typed.append))
    assert found.findings == ()
    assert typed == ["   0.0 180.0  -5.0\n", "  90.0  90.0  -5.0\n"]


def test_what_is_printed_says_in_which_dialect_it_is() -> None:
    source = parse_file(PROGRAM.read_text(), "angles.v2")
    text = print_file(source)
    assert text.count(";VPLUS\n") == 1
    assert ";VAL2\n.LOCATIONS\n" in text
    again = parse_file(text, "angles.v2")
    assert again.programs == source.programs
    for one, other in zip(source.of("locations"), again.of("locations"), strict=True):
        np.testing.assert_allclose(one.value.X, other.value.X, atol=1e-9)


@pytest.mark.parametrize(
    "lines",
    [(";vplus", ".PROGRAM a()", ".END"), (".PROGRAM a()", " ; VPLUS ", ".END"),
     (".PROGRAM a()", "PARAMETER VPLUS = 1", ".END")],
)  # fmt: skip
def test_a_directive_or_a_parameter_says_that_a_program_is_v_plus(lines: tuple[str, ...]) -> None:
    assert parse_program("\n".join(lines)).dialect is VPLUS


def test_the_prompt_speaks_v_plus_once_the_parameter_says_so(sitting: Sitting) -> None:
    sitting.type("DO SET p = TRANS(300, 400, -50, 100, 60, 5)", "PARAMETER VPLUS = 1")
    assert sitting.type("LISTL p").endswith(f"p              {SHOWN}")
    assert "Z/JT3    y/JT4    p/JT5    r/JT6" in sitting.type("WHERE")
    sitting.type("DO SET q = TRANS(300, 400, -50, 10, 150, 5)", "POINT r", "300, 400, -50, 10, 150, 5", "")
    for name in "qr":
        assert sitting.type(f"LISTL {name}").endswith(f"{name}              {SHOWN}")
    sitting.type("EDIT here", "DECOMPOSE a[1] = p", "E", "EXECUTE here")
    assert "a[4] = 10\na[5] = 150\n" in sitting.type("LISTR a").replace(".0000000000000", "").replace("  ", " ")
    sitting.type("STORE both", "ZERO", "Y", "PARAMETER VPLUS = 0", "LOAD both")
    assert sitting.files.directory.joinpath("both.v2").read_text().startswith(";VPLUS\n")
    np.testing.assert_allclose(sitting.controller.memory.get(parse_variable("q")).X, PLACE.X, atol=1e-6)


def parse_variable(name: str):
    from interfaces.val2.syntax import Variable

    return Variable(name)


STRANGE = "*Angles of another dialect* "


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (".PROGRAM a()\n  MOVE TRANS(0, 500, 0, 0, 180, 0)\n.END\n", "180: A is -90 to 90 deg; a line ;VPLUS"),
        (".PROGRAM a()\n.END\n.LOCATIONS\np 0 500 0 0 180 0\n.END\n", "180: A is -90 to 90 deg; a line ;VPLUS"),
        (";VPLUS\n.PROGRAM a()\n  MOVE TRANS(0, 500, 0, 0, -90, 0)\n.END\n", "-90: pitch is 0 to 180 deg; a line"),
        (".PROGRAM a()\n  AUTO x\n  MOVE TRANS(0, 500, 0, 0, 90, 0)\n.END\n", "read as O, A, T, and AUTO is V+'s"),
    ],
)
def test_what_looks_like_the_other_dialect_is_a_warning(text: str, said: str) -> None:
    (found,) = (one for one in check_text(text, "a.v2")[1] if one.error.what == "Angles of another dialect")
    assert found.severity == "warning"
    assert str(found.error).startswith(STRANGE + said)


@pytest.mark.parametrize(
    "text",
    [
        ".PROGRAM a()\n  AUTO x\n  MOVE TRANS(0, 500, 0)\n.END\n",
        ";VAL2\n.PROGRAM a()\n  AUTO x\n  MOVE TRANS(0, 500, 0, 0, 90, 0)\n.END\n",
        ";VPLUS\n.PROGRAM a()\n  AUTO x\n  MOVE TRANS(0, 500, 0, 0, 180, 0)\n.END\n",
    ],
)
def test_what_says_which_dialect_it_is_or_has_no_angles_is_left_alone(text: str) -> None:
    assert check_text(text, "a.v2")[1] == []


def test_the_option_is_for_what_a_file_leaves_open(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "a.v2"
    path.write_text(".PROGRAM a()\n  AUTO x\n  MOVE TRANS(0, 500, 0, 0, 180, 0)\n.END\n")
    ((source, found),) = check_files([(path.read_text(), "a.v2")], VPLUS)
    assert source is not None
    assert (source.programs[0].dialect, found) == (VPLUS, [])
    assert exit_code("check", str(path), "--dialect", "vplus") == 0
    assert capsys.readouterr().out == "no errors, no warnings.\n"
    assert exit_code("check", str(path), "--dialect", "val3") == 2
    assert "dialect" in (said := capsys.readouterr().err)
    assert "val2 or vplus" in said
