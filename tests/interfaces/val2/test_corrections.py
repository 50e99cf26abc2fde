"""`vrs run --corrections FILE.csv`: ALTER by an external computer, without one."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from interfaces.cli import main
from interfaces.link import delay_profile
from interfaces.val2.corrections import COLUMNS, Corrections, read_corrections
from interfaces.val2.motion.places import Frames
from interfaces.val2.playing import Listeners
from interfaces.val2.source import parse_file
from interfaces.val2.twins import play
from robots import load
from robots.robot import exact_arm
from vrs.errors import FormatError
from vrs.model import RobotModel
from vrs.planning.altering import DELAY

from .bench import MODEL

PERIOD = 0.028
HEADER = ",".join(("t_s", *COLUMNS))
LINE = """.PROGRAM main()
    MOVE TRANS(100, 450, 150, 90, 90, 0)
    BREAK
    {alter}
    SPEED 100 MMPS
    MOVES TRANS(-100, 450, 150, 90, 90, 0)
    BREAK
    NOALTER
.END
"""


def sine(begin: float, *, since_alter: bool, seconds: float = 1.7, cumulative: bool = False) -> Corrections:
    """5 mm at 1 Hz along Z, each 28 ms."""
    heights = [5.0 * math.sin(2.0 * math.pi * PERIOD * k) for k in range(int(seconds / PERIOD))]
    given = np.diff([0.0, *heights]) if cumulative else heights
    rows = tuple((begin + PERIOD * k, 0.0, 0.0, z, 0.0, 0.0, 0.0) for k, z in enumerate(given))
    return Corrections(rows, since_alter)


def run(corrections: Corrections | None, mode: int = 2, delay: str = "none", *, alter: str = ""):
    told: list[str] = []
    played = play(
        parse_file(LINE.format(alter=alter or f"ALTER (1) {mode}"), "a.v2"), load("puma560"), delay_profile(delay),
        exact_arm, seed=1, listeners=Listeners(warned=told.append), corrections=corrections,
    )  # fmt: skip
    assert played.error is None, played.error
    return played.run, told


def heights(model: RobotModel, q: np.ndarray) -> np.ndarray:
    return (model.forward(q) @ Frames(model).tip())[:, 2, 3] * 1000.0


@pytest.mark.parametrize(
    ("since_alter", "mode", "delay"), [(False, 2, "none"), (True, 2, "none"), (True, 3, "mon"), (False, 3, "none")]
)
def test_the_path_is_the_line_and_the_corrections(since_alter: bool, mode: int, delay: str) -> None:
    plain, _ = run(None, mode)
    begun = plain.receipts_virtual[1].execute_at
    assert begun is not None
    altered = plain.receipts_virtual[0].end
    assert altered is not None
    begin = 0.2 if since_alter else altered + 0.2
    found, told = run(sine(begin, since_alter=since_alter, cumulative=bool(mode & 1)), mode, delay)
    assert told == []
    t = found.t[(found.t < plain.receipts_virtual[1].end) & (found.t < plain.t[-1])]
    lifted = heights(MODEL, found.q_virtual[: len(t)]) - heights(MODEL, plain.q_virtual[: len(t)])
    given = t - altered - 0.2 - DELAY
    wanted = np.where(given > 0.0, 5.0 * np.sin(2.0 * np.pi * given), 0.0)
    within = given < 1.65
    assert np.abs(lifted - wanted)[within].max() < 0.1
    assert np.abs(wanted).max() > 4.9
    # The real arm follows the very same timeline.
    both = ~np.isnan(found.q_real).any(axis=1)
    assert np.abs(found.q_real - found.q_matched)[both].max() < 1e-6


def test_times_since_alter_begin_anew_with_each_alter() -> None:
    twice = "ALTER (1) 2\n MOVES TRANS(0, 450, 150, 90, 90, 0)\n BREAK\n NOALTER\n ALTER (3) 2"
    found, told = run(sine(0.05, since_alter=True, seconds=0.6), alter=twice)
    assert told == []
    rises = heights(MODEL, found.q_virtual)
    for receipt in found.receipts_virtual[1:3]:
        during = (found.t >= receipt.execute_at) & (found.t < receipt.end)
        assert rises[during].max() - rises[during].min() > 4.5


def test_what_comes_while_nothing_is_altered_is_told_in_one_line() -> None:
    found, told = run(sine(0.0, since_alter=False, seconds=0.3))
    assert told == ["10 corrections came while no program said ALTER"]
    assert found.receipts_virtual[1].stands


def test_what_the_limits_leave_no_room_for_is_told_and_the_path_goes_on() -> None:
    far = Corrections(((0.5, 0.0, 0.0, 900.0, 0.0, 0.0, 0.0),), since_alter=True)
    found, told = run(far)
    (line,) = told
    assert line.startswith("correction of 0.5 s: ")
    assert np.abs(MODEL.forward(found.q_virtual[-1])[0, 3] - 0.1) < 1e-6


def test_many_problems_are_told_in_two_lines() -> None:
    rows = tuple((0.3 + 0.1 * k, 0.0, 0.0, 900.0 + k, 0.0, 0.0, 0.0) for k in range(8))
    _, told = run(Corrections(rows, since_alter=True))
    assert told[0].startswith("correction of 0.3 s: ")
    assert told[1:] == ["7 more weren't followed, or not in time"]


def written(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "c.csv"
    path.write_text(text)
    return path


def test_a_file_says_by_its_header_what_its_times_are(tmp_path: Path) -> None:
    text = f"\ufeff{HEADER}\r\n0,1,2,3,4,5,6\r\n\r\n0.028, -1,0,0,0,0,1e-3\r\n"
    assert read_corrections(written(tmp_path, text)) == Corrections(
        ((0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0), (0.028, -1.0, 0.0, 0.0, 0.0, 0.0, 0.001)), since_alter=False
    )
    assert read_corrections(written(tmp_path, text.replace("t_s", "alter_s"))).since_alter


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "line 1 must be t_s,x_mm"),
        ("t,x,y,z,rx,ry,rz\n0,0,0,0,0,0,0\n", "or alter_s,x_mm,.*given: 't,x,y"),
        (HEADER, "must have a row"),
        (f"{HEADER}\n0,0,0,0,0,0\n", "line 2: must be a time and six numbers; given: '0,0,0,0,0,0'"),
        (f"{HEADER}\n0,0,0,0,0,0,0\n0.1,0,x,0,0,0,0\n", "line 3: must be a time and six numbers"),
        (f"{HEADER}\n0,0,0,nan,0,0,0\n", "line 2: must be a time and six numbers"),
        (f"{HEADER}\n-1,0,0,0,0,0,0\n", "line 2: a time must be 0 s or more"),
        (f"{HEADER}\n0.1,0,0,0,0,0,0\n0.1,0,0,0,0,0,0\n", "line 3: .*later than the one before; given: 0.1"),
        ("\0" * 100, "line 1 must be"),
    ],
)
def test_a_bad_file_is_one_clear_error(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], text: str, says: str
) -> None:
    path = written(tmp_path, text)
    with pytest.raises(FormatError, match=says):
        read_corrections(path)
    program = tmp_path / "a.v2"
    program.write_text(LINE.format(alter="ALTER (1) 2"))
    with pytest.raises(SystemExit) as ended:
        main(["run", str(program), "--corrections", str(path), "--out", str(tmp_path / "out")])
    assert ended.value.code == 2
    assert len(capsys.readouterr().err.strip().splitlines()) == 1
    assert not (tmp_path / "out").exists()


def test_a_file_that_isnt_there(tmp_path: Path) -> None:
    with pytest.raises(FormatError, match="can't be read"):
        read_corrections(tmp_path / "none.csv")


def test_the_example(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    example = Path(__file__).parents[3] / "examples" / "val2" / "12_corrections.v2"
    with pytest.raises(SystemExit) as ended:
        main(["run", str(example), "--corrections", str(example.with_suffix(".csv")), "--out", str(tmp_path)])
    assert ended.value.code == 0
    assert capsys.readouterr().out == "from -5.00 to  5.00 mm off the line\n"
