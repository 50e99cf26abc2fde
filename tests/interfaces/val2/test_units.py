"""Files of programs: one directory, and what IOSTAT says of the rest."""

from __future__ import annotations

from pathlib import Path

import pytest

from interfaces.val2.playing import Listeners, rehearse
from interfaces.val2.source import parse_file
from interfaces.val2.units import ENDED, LARGEST, NOT_READY, Units
from robots import puma560
from tests.interfaces.val2.test_check import exit_code
from tests.interfaces.val2.test_tasks import programs

PROGRAM = (Path(__file__).parent / "programs" / "files.v2").read_text()


def typed(text: str, files: Path | None) -> tuple[list[str], list[str]]:
    """What a program types and of what it's warned, in a rehearsal."""
    said: list[str] = []
    warned: list[str] = []
    found = rehearse(
        parse_file(text, "t.v2"), puma560.model(), listeners=Listeners(said.append, warned.append), files=files
    )
    assert found.findings == ()
    return said, warned


def test_a_program_writes_a_file_and_reads_it_again(tmp_path: Path) -> None:
    said, warned = typed(PROGRAM, tmp_path)
    assert said == [
        "*Device not ready*\n",
        "part  7 3 4.5 -504\n",
        "3, 4.5|log     .txt       1                          |\n",
        "*Device not ready*\n",
        "*Invalid file specification*\n",
        " -7 2.5\n",
        "done\n",
    ]
    assert warned == [
        "ATTACH of a serial line: what comes is read from serial1.in, which isn't in --files DIR",
    ]
    assert [*tmp_path.iterdir()] == []


def test_without_a_directory_that_is_said_in_one_line() -> None:
    said, warned = typed(PROGRAM, None)
    assert said[1] == "*Not attached to logical unit*\n"
    assert warned[1:] == ["ATTACH of files: no directory is given; --files DIR says where programs read and write"]


def test_a_run_keeps_what_was_written_and_a_check_does_not(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    files, path = tmp_path / "files", tmp_path / "t.v2"
    files.mkdir()
    path.write_text(
        programs(main='ATTACH (5) "DISK"; FOPENW (5) "a.txt"; WRITE (5) "x", /S; WRITE (5) 2; FCLOSE (5)')
    )
    assert exit_code("check", str(path), "--files", str(files)) == 0
    assert [*files.iterdir()] == []
    assert exit_code("run", str(path), "--files", str(files), "--out", str(tmp_path / "out")) == 0
    assert (files / "a.txt").read_text() == "x 2\n"
    assert exit_code("run", str(path), "--files", str(path)) == 2
    assert "files" in capsys.readouterr().err


def test_iostat_says_why_something_couldnt_be_done(tmp_path: Path) -> None:
    (tmp_path / "there.txt").write_text("one\r\n2 3\n")
    (tmp_path.parent / "outside.txt").write_text("secret\n")
    (tmp_path / "link.txt").symlink_to(tmp_path.parent / "outside.txt")
    units = Units(tmp_path)
    assert units.attach(None, "DISK") == 5
    for keyword, name, status in (
        ("FOPENR", "nowhere.txt", -501), ("FOPENW", "there.txt", -500), ("FOPENR", "../outside.txt", -517),
        ("FOPENR", "link.txt", -501), ("FOPENR", "there.txt", 1),
    ):  # fmt: skip
        units.open(keyword, 5, name)
        assert units.status(5) == status, name
    assert (units.read(5), units.read(5), units.read(5)) == ("one", "2 3", None)
    assert units.status(5) == -504
    units.write(5, "x")
    assert units.status(5) == -513
    units.detach(5)
    units.open("FOPENR", 5, "there.txt")
    assert units.status(5) == -516
    assert units.status(6) == -516


def test_a_directory_is_read_like_a_file_and_a_file_from_any_line(tmp_path: Path) -> None:
    for name, size in (("b.txt", 513), ("A.v2", 0), ("verylongname.lc", 5)):
        (tmp_path / name).write_text("x" * size)
    (tmp_path / "folder").mkdir()
    units = Units(tmp_path)
    units.attach(5, "DISK")
    for pattern in ("", "*.*", "C:\\*"):
        units.open("FOPEND", 5, pattern)
        assert [units.read(5) for _ in range(4)] == [
            f"A       .v2        0{'':26}",
            f"b       .txt       2{'':26}",
            f"verylongname.lc        1{'':26}",
            None,
        ]
    units.open("FOPEND", 5, "*.TXT")
    assert (units.read(5) or "").split() == ["b", ".txt", "2"]
    units.write(5, "x")
    assert units.status(5) == -513
    (tmp_path / "b.txt").write_text("one\ntwo\nthree\n")
    units.open("FOPENR", 5, "b.txt")
    for line, status, then in ((3, 1, "three"), (1, 1, "one"), (4, -504, "two")):
        units.seek(5, line)
        assert units.status(5) == status
        assert units.read(5) == then
    units.seek(6, 1)
    assert units.status(6) == -513


def test_a_line_that_isnt_what_was_wanted_leaves_variables_alone(tmp_path: Path) -> None:
    (tmp_path / "a.txt").write_text("word\n")
    steps = 'x = 7; ATTACH (lun, 4) "DISK"; FOPENR (lun) "a.txt"; READ (lun) x; TYPE x, IOSTAT(lun)'
    assert typed(programs(main=steps), tmp_path)[0] == [" 7 -517\n"]


def test_a_serial_line_is_a_file_for_what_comes_and_one_for_what_goes(tmp_path: Path) -> None:
    (tmp_path / "serial1.in").write_text("3, 4\nx")
    units = Units(tmp_path)
    assert units.attach(None, "serial:1") == 11
    units.write(11, "Ready\n")
    assert units.read(11) == "3, 4"
    units.write(11, "ok")
    assert (tmp_path / "serial1.out").read_text() == "Ready\nok"
    assert [units.character(11), units.character(11)] == [ord("x"), -504]
    steps = 'ATTACH (s, 4) "SERIAL:1"; READ (s) a, b; WRITE (s) a + b; TYPE a, b; READ (s) c; TYPE IOSTAT(s)'
    assert typed(programs(main=steps), tmp_path)[0] == [" 3 4\n", " -517\n"]


def test_the_terminal_is_unit_4() -> None:
    said: list[str] = []
    listeners = Listeners(said.append, asked=lambda question: "5, Ada")
    text = programs(main="READ (4) n, $name; WRITE (4) $name, n")
    assert rehearse(parse_file(text, "t.v2"), puma560.model(), listeners=listeners).findings == ()
    assert said == ["Ada 5\n"]


def test_what_is_too_long_for_a_serial_line_is_refused_and_not_read_back(tmp_path: Path) -> None:
    (tmp_path / "serial1.in").write_text("only this\n")
    units = Units(tmp_path)
    unit = units.attach(None, "SERIAL:1")
    units.write(unit, "x" * LARGEST)
    units.write(unit, "y")
    assert units.status(unit) == NOT_READY
    assert (units.read(unit), units.read(unit)) == ("only this", None)
    assert units.status(unit) == ENDED
    assert (tmp_path / "serial1.out").stat().st_size == LARGEST
