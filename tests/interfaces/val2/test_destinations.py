"""Where programs from textbooks' descriptions lead the arm, beside an evaluation that shares nothing with ours."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from benchmarks.destinations import (
    NAME,
    START,
    TURN,
    WAY,
    Destination,
    Joints,
    Text,
    compared,
    evaluated,
    flange,
    frame,
    numbers_of,
    reachable,
    solutions,
    stood,
    wrapped,
)
from interfaces.val2.playing import Listeners, rehearse
from interfaces.val2.source import joined, parse_file
from robots import puma560

MODEL = puma560.model()
TEXTBOOK = Path(__file__).parents[3] / "examples" / "val2" / "textbook"
LAST = {
    "01_depalletizing": (96, "24 parts\n"),
    "02_machine_tending": (27, "3 parts are turned\n"),
    "03_peg_in_hole": (7, "in at  13.5 mm\n"),
    "04_moved_fixture": (21, "from there off by  0.000 mm\n"),
    "05_belt_places": (31, "the stack is 125.0 mm high\n"),
    "06_welding_seam": (18, "4 stitches on 229.1 mm\n"),
    "07_spiral_search": (26, "place 11: -4.86  4.86 mm off\n"),
    "08_two_robots": (25, "3 parts are handed over\n"),
    "09_sorting": (55, "bins hold 4 4 1\n"),
    "10_tool_change": (45, "the rack is full again\n"),
}
"""How many motions each has, and how what it TYPEs ends."""


def text_of(name: str) -> str:
    return (TEXTBOOK / f"{name}.v2").read_text(encoding="utf-8")


def ours(text: str, program: str) -> tuple[list[Joints], str]:
    """Where our arm stood, and what was typed."""
    typed: list[str] = []
    source = joined([parse_file(text, "text"), parse_file(wrapped(program), "wrapped")], NAME)
    rehearsal = rehearse(source, MODEL, listeners=Listeners(typed.append))
    assert rehearsal.findings == ()
    return stood(rehearsal.timeline), "".join(typed)


def theirs(text: str, program: str, there: list[Joints]) -> list[Destination]:
    """Where the evaluation says that it's to go."""
    return evaluated(Text(f"{text}\n{wrapped(program)}", vplus=False), there)


def first(text: str) -> str:
    """The name of a text's first program."""
    return next(iter(Text(text, vplus=False).routines))


def off(read: str, meant: str) -> tuple[int, int, float, float]:
    """How many motions a text has that we read, and one that the evaluation reads; by how much they differ."""
    there, _ = ours(read, first(read))
    wanted = theirs(meant, first(meant), there)
    return len(there), len(wanted), *compared(wanted, there)


def test_there_are_ten() -> None:
    assert sorted(LAST) == sorted(path.stem for path in TEXTBOOK.glob("*.v2"))
    assert len(LAST) == 10


@pytest.mark.parametrize("name", LAST)
def test_every_destination_is_where_the_evaluation_says(name: str) -> None:
    motions, last = LAST[name]
    text = text_of(name)
    there, typed = ours(text, first(text))
    wanted = theirs(text, first(text), there)
    way, turn = compared(wanted, there)
    assert typed.endswith(last)
    assert (len(there), len(wanted)) == (motions, motions)
    assert way < WAY
    assert turn < TURN


FAULTS = {
    "a sign in SHIFT": ("05_belt_places", "SHIFT(first BY n*pitch", "SHIFT(first BY -n*pitch"),
    "a sign in the instruction SHIFT": ("05_belt_places", "BY 0,15", "BY 0,-15"),
    "O for T": ("05_belt_places", "-260 90 90 -30", "-260 -30 90 90"),
    "A for O": ("04_moved_fixture", "60 80 10", "80 60 10"),
    "turned before it's moved": ("04_moved_fixture", "TRANS(30,-20,0):RZ(45)", "RZ(45):TRANS(30,-20,0)"),
    "another base": ("04_moved_fixture", "INVERSE(base1):taught2", "INVERSE(base2):taught2"),
    "the other axis": ("01_depalletizing", "RX(180)", "RY(180)"),
    "a hundredth": ("02_machine_tending", "store -350", "store -350.011"),
    "a hundredth of a degree": (
        "06_welding_seam",
        "end.point 100 530 -60 90 50 0",
        "end.point 100 530.02 -60 90 50 0",
    ),
    "a tool's turn": ("10_tool_change", "RY(15)", "RY(15.011)"),
    "a base's sign": ("04_moved_fixture", "BASE 40,-20,15,5", "BASE -40,20,-15,-5"),
    "one round less": ("09_sorting", "part = 1 TO 9", "part = 1 TO 8"),
    "by value": ("09_sorting", "count = count+1", "AUTO count\ncount = 1"),
}
"""A program, what stands there, and what an interpreter would do that has it wrong."""


@pytest.mark.parametrize("fault", FAULTS)
def test_the_evaluation_sees_a_fault(fault: str) -> None:
    name, right, wrong = FAULTS[fault]
    text = text_of(name)
    assert right in text
    there, wanted, way, turn = off(text.replace(right, wrong), text)
    assert there != wanted or way > WAY or turn > TURN


def test_the_evaluations_arm_is_where_the_papers_have_it() -> None:
    # READY: the arm straight up, the hand as the world (docs/conventions.md, Corke's lengths).
    up = flange((0, -90, 90, 0, 0, 0))
    assert np.allclose(up.t, [-20.32, 150.05, 863.6 + 56.25], atol=0.05)
    assert np.allclose(up.R, np.eye(3), atol=1e-12)
    assert np.allclose(numbers_of(up, vplus=False)[3:], [90, -90, 0])
    # O = A = T = 0: the hand points along -Y, its fingers lie along X.
    rest = frame([0, 0, 0, 0, 0, 0], vplus=False)
    assert np.allclose(rest.R[:, 2], [0, -1, 0])
    assert np.allclose(rest.R[:, 1], [1, 0, 0])


def test_the_evaluation_knows_where_the_arm_cant_go() -> None:
    assert any(np.allclose(q, START, atol=1e-6) for q in solutions(flange(START)))
    there = frame([0, 450, -200, 90, 90, 0], vplus=False)
    far = frame([0, 900, -200, 90, 90, 0], vplus=False)
    behind = frame([0, -450, -200, 90, 90, 0], vplus=False)
    assert [bool(solutions(X)) for X in (there, far, behind)] == [True, False, True]
    # Both ends of a way may be within reach, and the way between them not: it leads through the waist.
    way = Destination(0, behind, None, straight=True, stopped=False)
    assert not reachable(solutions(there)[0], way)
