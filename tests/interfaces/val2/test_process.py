"""Channels, pulses, TRACE, UPPER, paths of single motions, and words of VAL of 1979."""

from __future__ import annotations

import numpy as np
import pytest

from interfaces.val2.playing import Listeners, rehearse
from interfaces.val2.source import parse_file
from robots import puma560
from tests.interfaces.val2.sitting import Sitting
from tests.interfaces.val2.test_tasks import programs

MODEL = puma560.model()


def typed(**named: str) -> str:
    """What programs type, the first of which is the main one."""
    said: list[str] = []
    found = rehearse(parse_file(programs(**named), "t.v2"), MODEL, listeners=Listeners(said.append, said.append))
    assert found.findings == ()
    return "".join(said)


def test_a_program_waits_for_what_is_set_at_the_prompt_and_sets_what_is_read_there(sitting: Sitting) -> None:
    sitting.type("EDIT watch", "WAIT ADC(3) > 2", "DAC 1 = ADC(3) * 2", "IOPUT 2 = IOGET(2) + 1", "E")
    sitting.type("IOGET 2=6", "EXECUTE watch")
    sitting.pass_time(0.5)
    assert sitting.controller.running
    assert sitting.type("ADC 3=2.5", "ADC").endswith("ADC 3  = 2.5\n")
    sitting.pass_time(0.1)
    assert not sitting.controller.running
    assert sitting.type("DAC 1") == "DAC 1  = 5\n"
    assert sitting.type("IOPUT") == "IOPUT 2  = 7\n"
    assert sitting.type("ADC 33=1") == "*Illegal channel number* 33: 1 to 32\n"
    assert sitting.type("DO DAC 0 = 1").startswith("*Illegal channel number* 0: 1 to 32")


def test_a_pulse_turns_off_by_itself(sitting: Sitting) -> None:
    assert sitting.type("DO PULSE 5, 0.5", "LISTR SIG(5)") == "-1\n"
    sitting.pass_time(0.4)
    assert sitting.type("LISTR SIG(5)") == "-1\n"
    sitting.pass_time(0.2)
    assert sitting.type("LISTR SIG(5)") == "0\n"
    assert typed(main="PULSE 6; WAIT SIG(-6); TYPE TIME() >= 0.2, TIME() < 0.21") == " -1 -1\n"


def test_trace_tells_each_step(sitting: Sitting) -> None:
    said = typed(main="ENABLE TRACE; x = 1; CALL sub; DISABLE TRACE; y = 1", sub="z = 2")
    assert said == "main 2: x = 1main 3: CALL sub()sub 1: z = 2main 4: DISABLE TRACE"
    sitting.type("EDIT one", "x = 1", "E", "ENABLE TRACE")
    assert sitting.type("EXECUTE one") == "one 1: x = 1\n"
    sitting.pass_time(0.1)
    assert sitting.shown == "one 1: x = 1\none has ended (END)\n"


def test_upper_lets_small_letters_count_as_capital_ones() -> None:
    assert typed(main='TYPE "a" == "A", "b" > "A"; ENABLE UPPER; TYPE "a" == "A", "a" < "B"') == " 0 -1\n -1 -1\n"


@pytest.mark.parametrize(("step", "value"), [("SETI x = 7.9", 7.0), ("SETI x = -7.9", -7.0)])
def test_seti_assigns_the_integer_part(step: str, value: float) -> None:
    assert typed(main=f"{step}; TYPEI x") == f"{value:.0f}\n"


def test_a_variable_may_be_called_as_a_function_is() -> None:
    assert (
        typed(main="TYPE DX(base), hand; base = 3; hand = 4; time = 5; TYPE base, hand, time") == " 0 100\n 3 4 5\n"
    )


def test_return_passes_over_steps_of_the_one_that_called() -> None:
    assert typed(main="GOSUB sub; TYPE 1; TYPE 2; TYPE 3", sub="RETURN 2") == " 3\n"
    assert typed(main="GOSUB sub; TYPE 1", sub="RETURN 9") == ""


def test_identical_and_packed_texts() -> None:
    assert typed(main="SET p = TRANS(1); TYPE IDENTICAL(p, TRANS(1)), IDENTICAL(p, NULL)") == " -1 0\n"
    steps = 'PACK $a[0], 127, 5 = "abc"; PACK $a[0], 1, 2 = "xyz"; TYPE LEN($a[0]), $a[1], $UNPACK($a[0], 1, 2)'
    assert typed(main=steps) == " 128cxy\n"


PLACES = ["TRANS(-100, 500, 0, 90, 90, 0)", "TRANS(100, 550, 0, 90, 90, 0)", "TRANS(100, 400, 50, 90, 90, 0)"]


def reached(*steps: str) -> list[bool]:
    """Whether the arm is at each of two places on its way over them, to a third."""
    goals = [rehearse(parse_file(programs(main=f"MOVE {p}"), "p.v2"), MODEL).timeline.final() for p in PLACES[:2]]
    moves = [f"MOVE {place}" for place in PLACES]
    found = rehearse(parse_file(programs(main="; ".join([*steps, *moves])), "t.v2"), MODEL)
    assert found.findings == ()
    way = found.timeline.sample(np.arange(0.0, found.end, 0.002))
    return [bool(np.abs(way - goal).max(axis=1).min() < 1e-3) for goal in goals]


def test_cpoff_stops_at_the_next_end_alone_and_cpon_goes_round_it() -> None:
    assert reached() == reached("DISABLE CP", "CPON ALWAYS") == [False, False]
    assert reached("DISABLE CP") == reached("CPOFF ALWAYS") == [True, True]
    assert reached("CPOFF") == [True, False]
    assert reached("DISABLE CP", "CPON") == [False, True]


def test_single_keeps_joint_6_within_half_a_turn(sitting: Sitting) -> None:
    sitting.type("DO MOVE #PPOINT(0, -90, 180, 0, 60, 170)")
    sitting.pass_time(5.0)
    sitting.type("DO SET p = HERE:RZ(40)", "DO MOVE p")
    sitting.pass_time(5.0)
    wide = sitting.arm.here(now=sitting.now).joints.joints
    sitting.type("DO SINGLE", "DO MOVE p")
    sitting.pass_time(5.0)
    within = sitting.arm.here(now=sitting.now).joints.joints
    assert abs(wide[5]) > 180 > abs(within[5])
    np.testing.assert_allclose(wide[5] - within[5], 360.0 * np.sign(wide[5]), atol=1e-6)
