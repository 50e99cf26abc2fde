"""Where the arm is and what is recorded of it: WHERE, HERE, POINT, TEACH, TOOL, BASE, REWIND."""

from __future__ import annotations

import numpy as np
import pytest

from interfaces.val2.printer import print_expression
from interfaces.val2.syntax import Number, Variable
from interfaces.val2.values import PrecisionPoint, Transformation
from tests.interfaces.val2.bench import from_oat, to_oat

from .sitting import AWAY, LOOP, numbers


def test_where_at_ready(sitting):
    shown = numbers(sitting.type("DO READY", "WHERE"))
    np.testing.assert_allclose(shown[:6], [-20.3, 150.05, 863.6 + 56.25, 90, -90, 0], atol=0.01)
    np.testing.assert_allclose(shown[6:12], [0, -90, 90, 0, 0, 0], atol=0.01)
    assert "X/JT1" in sitting.shown
    assert "A/JT5" in sitting.shown


def test_do_gives_the_prompt_back_when_the_arm_stands(sitting):
    begun = sitting.now
    sitting.line(AWAY)
    assert sitting.monitor.prompt == ""
    sitting.until(lambda: sitting.monitor.prompt == ".")
    assert sitting.now - begun > 0.5
    x = numbers(sitting.type("WHERE"))[:6]
    np.testing.assert_allclose(x, [400, 0, 200, 90, 0, 0], atol=0.01)
    sitting.pass_time(1.0)
    assert numbers(sitting.type("WHERE"))[:6] == x


def test_where_1_repeats_until_a_line_comes(sitting):
    sitting.type(*LOOP)
    sitting.type("EDIT go", "READY", "MOVE TRANS(400,0,200,90,0,0)", "READY", "E", "EXECUTE go")
    sitting.shown = ""
    sitting.line("WHERE 1")
    sitting.pass_time(1.2)
    rows = len(sitting.shown.splitlines())
    assert rows >= 5
    sitting.line("")
    before = sitting.shown
    sitting.pass_time(2.0)
    assert "X/JT1" not in sitting.shown.removeprefix(before)


@pytest.mark.parametrize("oat", [(90, -90, 0), (90, 90, 35), (10, 20, 30), (-170, -45, 100), (0, 89.99999, -179)])
def test_here_store_and_load_give_every_pose_back(sitting, oat):
    goal = from_oat(350.0, 120.0, 310.0, *oat)
    sitting.controller.memory.set(Variable("goal"), goal)
    shown = sitting.type("DO MOVE goal", "HERE p", "", "HERE #p", "", "STORE keep")
    assert "keep.v2" in shown
    place = sitting.arm.here(now=sitting.now)
    np.testing.assert_allclose(place.tool.X, goal.X, atol=1e-6)
    sitting.type("ZERO", "Y", "LOAD keep")
    memory = sitting.controller.memory
    np.testing.assert_allclose(memory.get(Variable("p")).X, place.tool.X, atol=1e-9)
    np.testing.assert_allclose(memory.get(Variable("#p")).joints, place.joints.joints, atol=1e-12)


def test_here_takes_changes_until_there_are_none(sitting):
    shown = sitting.type("HERE p", ",,10", "1,,,,45", "")
    assert shown.count("X/JT1") == 1
    np.testing.assert_allclose(to_oat(sitting.controller.memory.get(Variable("p")))[:5], [1, 150.05, 10, 90, 45])


def test_changes_that_are_no_numbers_are_asked_again(sitting):
    shown = sitting.type("HERE #p", "1,2,3,4,5,6,7", "abc", ",1e400", "nan")
    assert shown.count("*Invalid argument*") == 4
    assert sitting.monitor.prompt == "Change? "
    sitting.type(",,91", "")
    assert sitting.controller.memory.get(Variable("#p")).joints[2] == 91.0


def test_here_in_a_compound_makes_the_last_part_relative(sitting):
    sitting.type("DO SET a = TRANS(100,0,0)", "DO SET b = RZ(30)", "HERE a:b:c", "")
    memory = sitting.controller.memory
    whole = memory.get(Variable("a")) @ memory.get(Variable("b")) @ memory.get(Variable("c"))
    np.testing.assert_allclose(whole.X, sitting.arm.here(now=sitting.now).tool.X, atol=1e-9)
    assert sitting.type("HERE nowhere:c").startswith("*Undefined")
    assert sitting.type("HERE a:#p").startswith("*")
    assert sitting.type("HERE $s").startswith("*Invalid argument*")


def test_what_was_not_accepted_is_not_kept(sitting):
    sitting.type("HERE p")
    sitting.monitor.interrupt(now=sitting.now)
    assert sitting.monitor.prompt == "."
    assert sitting.type("LISTL") == "No locations\n"


def test_point_defines_and_changes(sitting):
    sitting.type("POINT p", ",,,,0", "")
    assert to_oat(sitting.controller.memory.get(Variable("p"))) == pytest.approx((0, 0, 0, 90, 0, 0))
    sitting.type("POINT #j", "1,-90,90", "")
    assert sitting.controller.memory.get(Variable("#j")) == PrecisionPoint((1.0, -90.0, 90.0, 0.0, 0.0, 0.0))
    sitting.type("POINT q[2] = p:TRANS(0,0,5)", "")
    element = sitting.controller.memory.get(Variable("q", (Number(2.0),)))
    assert isinstance(element, Transformation)
    assert sitting.type("POINT p = 3").startswith("*Invalid argument*")
    assert sitting.type("POINT #j = p").startswith("*Invalid argument*")
    assert sitting.type("POINT").startswith("*Missing argument*")


def test_teach_records_and_lets_commands_in_between(sitting):
    sitting.type("TEACH p[1]", "", "DO DRIVE 1,10,100", "", "E")
    names = [print_expression(variable) for variable, _ in sitting.controller.memory.variables()]
    assert names == ["p[1]", "p[2]"]
    first, second = (value for _, value in sitting.controller.memory.variables())
    assert np.linalg.norm(first.X[:3, 3] - second.X[:3, 3]) > 20.0
    sitting.type("TEACH #q", "", "", "E")
    assert [variable.name for variable, _ in sitting.controller.memory.variables()][:2] == ["#q1", "#q2"]
    assert sitting.monitor.prompt == "."


def test_tool_and_base_are_shown_and_set(sitting):
    sitting.type("TOOL TRANS(0,0,100)")
    assert numbers(sitting.type("TOOL"))[:3] == [0, 0, 100]
    assert numbers(sitting.type("WHERE"))[2] == pytest.approx(1019.85, abs=0.01)
    sitting.type("TOOL NULL", "BASE 100,,50")
    where = numbers(sitting.type("WHERE"))
    assert where[:3] == pytest.approx([79.7, 150.05, 969.85], abs=0.01)
    assert numbers(sitting.type("BASE"))[:3] == [100, 0, 50]
    assert sitting.type("TOOL nowhere").startswith("*Undefined")


def test_rewind_shows_the_past_and_where_real_has_no_other_twin_here(sitting):
    sitting.type("DO READY", AWAY)
    then = sitting.joints()
    sitting.pass_time(1.0)
    sitting.type("DO DRIVE 1,30,100")
    shown = numbers(sitting.type(f"REWIND {sitting.now - 0.0}"))
    assert shown[8:14] == pytest.approx(sitting.joints(), abs=0.002)
    ago = sitting.now - 1.0
    t = next(
        t
        for t in np.arange(0.0, ago, 0.05)
        if np.allclose(sitting.arm.past(t, now=sitting.now).joints.joints, then)
    )
    assert numbers(sitting.type(f"REWIND {t}"))[8:14] == pytest.approx(then, abs=0.002)
    assert sitting.type("WHERE REAL").startswith("*No other twin*")


def test_rewinding_shows_the_hand_the_tool_and_the_base_of_then(sitting):
    seen = []
    for command in (
        "DO DELAY 0",
        "DO CLOSEI",
        "TOOL TRANS(0,0,100)",
        "BASE 100,0,0",
        "DO OPENI",
        "DO DRIVE 1,5,100",
    ):
        sitting.type(command)
        seen.append((sitting.now, numbers(sitting.type("WHERE"))))
        sitting.pass_time(1.0)
    for t, where in seen:
        assert numbers(sitting.type(f"REWIND {t:.6f}"))[2:] == where
    assert [where[-1] for _, where in seen] == [100.0, 0.0, 0.0, 0.0, 100.0, 100.0]
    assert numbers(sitting.type("REWIND 0"))[-1] == 100.0


def test_base_is_how_the_robot_has_been_moved(sitting):
    """VAL's example: after BASE 300,,-50,30 it has been shifted 300 mm in +X, 50 mm down, and turned by 30 deg."""
    sitting.type("DO READY", "DO LEFTY", AWAY)
    stood = sitting.joints()
    sitting.type("BASE 300,,-50,30")
    x, y, z, o, a, t = numbers(sitting.type("WHERE"))[:6]
    cos, sin = np.cos(np.radians(30)), np.sin(np.radians(30))
    assert (x, y, z) == pytest.approx((300 + 400 * cos, 400 * sin, 150), abs=0.01)
    assert (o, a, t) == pytest.approx((90 + 30, 0, 0), abs=0.01)
    assert sitting.joints() == stood
    sitting.type(f"DO MOVE TRANS({300 + 405 * cos - 10 * sin},{405 * sin + 10 * cos},145,120,0,0)")
    sitting.type("DO BASE")
    assert numbers(sitting.type("WHERE"))[:6] == pytest.approx([405, 10, 195, 90, 0, 0], abs=0.02)


def test_a_location_stays_where_it_is_when_the_robot_is_moved(sitting):
    sitting.type("DO READY", "DO LEFTY", AWAY, "DO SET part = HERE", "BASE 50")
    sitting.type("DO MOVE part")
    assert numbers(sitting.type("WHERE"))[0] == pytest.approx(400, abs=0.01)
    sitting.type("BASE NULL")
    assert numbers(sitting.type("WHERE"))[0] == pytest.approx(350, abs=0.01)
    sitting.type("BASE 0,0,0,90", "DO SET was = HERE", "DO DRAW 10,0,0")
    assert numbers(sitting.type("DO TYPE /F9.3, DX(HERE)-DX(was), DY(HERE)-DY(was)"))[:2] == pytest.approx(
        [10, 0], abs=0.01
    )
