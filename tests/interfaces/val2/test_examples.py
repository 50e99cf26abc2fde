"""The programs of `examples/val2`, each on both twins across the default link."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from interfaces.link import delay_profile
from interfaces.val2.playing import Listeners, rehearse
from interfaces.val2.source import parse_file
from interfaces.val2.twins import play
from robots import load
from vrs import Status

robot = load("puma560")
model = robot.arm
PROGRAMS = sorted((Path(__file__).parents[3] / "examples" / "val2").glob("*.v2"))
LAST = {
    "01_pick_and_place": "4 parts are on the tray\n",
    "02_compound_frames": "moved hole at    -9.5   521.8  -150.0\n",
    "03_conveyor": "s\n",
    "04_recursion": "3 moves\n",
    "05_circle": "off by 0.000 mm\n",
    "06_letters": "wrote VAL\n",
    "07_reacti_stop": "1 stop; at b within  0.00 mm\n",
    "08_palletising": "4 boxes\n",
    "09_speeds": "s\n",
    "10_alter": "it rose by  5.00 mm, and ended  0.00 mm from b\n",
    "11_tasks": "parts so far\n",
    "12_corrections": "from  0.00 to  0.00 mm off the line\n",
    "13_grasp": "There's nothing in the hand\n",
}
"""How what they TYPE ends."""


def source(path):
    return parse_file(path.read_text(encoding="utf-8"), path.name)


def test_every_example_is_known():
    assert [path.stem for path in PROGRAMS] == sorted(LAST)
    assert len(PROGRAMS) >= 8


@pytest.mark.parametrize("path", PROGRAMS, ids=lambda path: path.stem)
def test_on_the_twins(path):
    typed, told = [], []
    played = play(
        source(path), robot, delay_profile("thu"),
        seed=6, listeners=Listeners(typed.append, told.append),
    )  # fmt: skip
    run = played.run
    assert played.error is None
    assert told == []
    assert "".join(typed).endswith(LAST[path.stem])
    assert {receipt.status for receipt in run.receipts_virtual} == {Status.ACCEPTED}
    assert {receipt.status for receipt in run.receipts_real} == {Status.ACCEPTED}
    assert [event.kind for event in run.events if event.kind in ("unfinished", "diverged", "halted")] == []
    assert run.corrections == ()
    # What the real arm was asked for is what the virtual one did, at the same place of the timeline.
    assert np.abs(run.q_reference - run.q_matched).max() < 1e-9
    assert np.degrees(np.abs(run.q_real - run.q_matched).max()) < 2.0
    assert np.abs(np.diff(run.q_real, axis=0)).max() > 1e-3


@pytest.mark.parametrize("path", PROGRAMS, ids=lambda path: path.stem)
def test_a_rehearsal_finds_nothing(path):
    typed = []
    rehearsal = rehearse(source(path), model, listeners=Listeners(typed.append))
    assert rehearsal.findings == ()
    assert "".join(typed).endswith(LAST[path.stem])
