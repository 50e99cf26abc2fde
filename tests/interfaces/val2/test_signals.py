"""Signals, and cells that set them."""

from __future__ import annotations

import math
from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from interfaces.val2.context import SignalChanged
from interfaces.val2.errors import ValError
from interfaces.val2.parser import parse_expression
from interfaces.val2.signals import SOONEST, SignalRule, Signals
from interfaces.val2.source import parse_rule
from tests.interfaces.val2.rig import Rig, body, run

TRUE = parse_expression("TRUE")


def cell(*rules: str) -> str:
    """The `.SIGNALS` of a file."""
    return "\n".join([".SIGNALS", *rules, ".END", ""])


def turns(rig: Rig, number: int) -> list[tuple[float, bool]]:
    """When a signal turned, and how."""
    return [(round(t, 6), e.on) for t, e in rig.when(SignalChanged) if e.number == number]


def test_sig_of_several_is_true_if_all_are_so() -> None:
    rig = Rig()
    rig.controller.signals.force(1001)
    assert rig.value("SIG(1001)") == -1.0
    assert rig.value("SIG(1001,-1002)") == -1.0
    assert rig.value("SIG(1001,1002)") == 0.0
    assert rig.value("SIG(-1001,-1002)") == 0.0
    rig.controller.signals.force(-1001)
    assert rig.value("SIG(-1001)") == -1.0


def test_signal_turns_outputs_and_internal_signals() -> None:
    assert (
        run("SIGNAL 1, 512, 2001", "TYPE SIG(1,512,2001)", "SIGNAL -512", "TYPE SIG(1), SIG(512)") == " -1\n -1 0\n"
    )
    assert run("x = 3", "SIGNAL (x)", "SIGNAL (-x), 0", "TYPE SIG(3)") == " 0\n"
    assert run("SIGNAL 1, 2", "RESET", "TYPE SIG(1), SIG(2)") == " 0 0\n"


def test_bits_turn_a_group_of_signals() -> None:
    assert run("SIGNAL 1, 9", "BITS 2001, 4 = 10", "TYPE BITS(2001,4), SIG(2002,2004)") == " 10 -1\n"
    assert run("SIGNAL 1", "BITS 1, 8 = ^B1010", "TYPE BITS(1,9)", "BITS 2 = 0", "TYPE BITS(1,9)") == " 10\n 8\n"
    assert (
        run("n = 3", "BITS n, (n - 1) = n", "TYPE BITS(1,8)", "BITS 1, 32 = 2^32-1", "TYPE SIG(32)") == " 12\n -1\n"
    )


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("BITS 1, 3 = 8", "*Illegal value* 8: 0 to 7 for 3 signals"),
        ("BITS 1 = 5", "*Illegal value* 5: 0 to 1 for 1 signal; allowed too: BITS first, count = value"),
        ("BITS 1, 3 = 0.5", "*Illegal value* 0.5: 0 to 7 for 3 signals"),
        ("BITS 1, 3 = -1", "*Illegal value* -1: 0 to 7 for 3 signals"),
        ("BITS 1, 33 = 0", "*Illegal value* 33: 1 to 32 signals"),
        ("BITS 1, 0 = 0", "*Illegal value* 0: 1 to 32 signals"),
        ("BITS 505, 9 = 0", "*Illegal digital signal* 513; allowed: 1 to 512"),
        ("BITS 0, 2 = 0", "*Illegal digital signal* 0; allowed: 1 to 512"),
        ("BITS (-2), 2 = 0", "*Illegal digital signal* -2; allowed: 1 to 512"),
        ("BITS 1009, 2 = 0", "*Illegal digital signal* 1009; allowed: 1 to 512, 2001 to 2512"),
        ("x = BITS(505,9)", "*Illegal digital signal* 513; allowed: 1 to 512"),
    ],
)
def test_groups_that_arent_there(line: str, said: str) -> None:
    rig = Rig()
    with pytest.raises(ValError) as raised:
        rig.run(body("SIGNAL 1", line))
    assert str(raised.value).startswith(said)
    assert rig.value("SIG(1)") == -1.0


@pytest.mark.parametrize("number", [1001, -1001, 513, 1513, 2513, 0.5, 1e300])
def test_signals_that_cant_be_set(number: float) -> None:
    signals = Signals()
    with pytest.raises(ValError, match="Illegal digital signal"):
        signals.set([1, number])
    assert signals.changes() == []


def test_changes_are_told_once_and_in_order() -> None:
    rig = Rig()
    rig.run(body("SIGNAL 2", "SIGNAL 2", "SIGNAL 1, -2"))
    assert [(e.number, e.on) for _, e in rig.when(SignalChanged)] == [(2, True), (1, True), (2, False)]


def test_wait_goes_on_when_the_signal_comes() -> None:
    rig = Rig()
    rig.run(body("WAIT SIG(1001)", "TYPE 1"), until=2.0)
    assert rig.typed() == ""
    assert rig.controller.next_deadline() == math.inf
    rig.controller.signals.force(1001)
    rig.advance()
    assert rig.typed() == " 1\n"
    assert rig.now == pytest.approx(2.0, abs=1e-3)


def test_wait_of_a_bare_number_is_the_signals() -> None:
    rig = Rig()
    rig.run(body("WAIT 1001", "TYPE 1", "WAIT -1001", "TYPE 2"), until=1.0)
    assert rig.typed() == ""
    rig.controller.signals.force(1001)
    rig.advance(2.0)
    assert rig.typed() == " 1\n"
    rig.controller.signals.force(-1001)
    rig.advance()
    assert rig.typed() == " 1\n 2\n"


def test_a_conveyor() -> None:
    rig = Rig()
    rig.run(
        body("SIGNAL 1", "WAIT SIG(1001)", "SIGNAL -1", "TYPE TIMER(0)", "WAIT SIG(-1001)", "TYPE TIMER(0)")
        + cell("1001 = SIG(1) AFTER 2.5")
    )
    first, second = (float(t) for t in rig.typed().split())
    assert first == pytest.approx(2.5, abs=2e-3)
    assert second == pytest.approx(5.0, abs=4e-3)


def test_a_belt_that_stops_halfway_begins_anew() -> None:
    rig = Rig()
    rig.run(
        body("SIGNAL 1", "WAIT.EVENT , 1", "SIGNAL -1", "WAIT.EVENT , 1", "SIGNAL 1", "WAIT SIG(1001)")
        + cell("1001 = SIG(1) AFTER 1.5")
    )
    assert turns(rig, 1001) == [(pytest.approx(3.5, abs=3e-3), True)]


def test_pulses_and_times() -> None:
    rig = Rig()
    rig.now = 10.0
    rig.run(
        body("SIGNAL 1", "WAIT.EVENT , 8")
        + cell("1001 = SIG(1) AFTER 1 FOR 0.5", "1002 = TRUE AT 5", "1003 = ON AT 2", "1003 = OFF AT 3")
    )
    assert turns(rig, 1001) == [(pytest.approx(11.0, abs=2e-3), True), (pytest.approx(11.5, abs=2e-3), False)]
    assert turns(rig, 1002) == [(15.0, True)]
    assert turns(rig, 1003) == [(12.0, True), (13.0, False)]


def test_a_pulse_is_as_long_as_it_is_said_and_at_and_after_add_up() -> None:
    signals = Signals()
    rules = [SignalRule(1001, TRUE, lasting=0.5, at_time=2.0), SignalRule(1002, TRUE, after=1.5, at_time=2.0)]
    rules.append(SignalRule(1003, TRUE, lasting=0.0, at_time=7.0))
    signals.begin(rules, [lambda: True] * 3, now=10.0)
    found = []
    while (t := signals.next_deadline()) < math.inf:
        signals.advance(now=t)
        found += [(t, *change) for change in signals.changes()]
    assert found == [
        (12.0, 1001, True), (12.5, 1001, False), (13.5, 1002, True),
        (17.0, 1003, True), (17.0 + SOONEST, 1003, False),
    ]  # fmt: skip


def test_a_cell_begins_anew_at_every_execute() -> None:
    rig = Rig()
    text = body("WAIT SIG(1001)", "TYPE 1") + cell("1001 = ON AT 1", "1001 = OFF AT 1.1")
    rig.run(text)
    rig.advance(5.0)
    rig.run(text)
    assert [t for t, on in turns(rig, 1001) if on] == [1.0, 6.0]


def test_an_expression_that_has_no_value_is_false() -> None:
    rig = Rig()
    rig.run(body("WAIT.EVENT , 1", "n = 5", "WAIT SIG(1001)", "TYPE 1") + cell("1001 = n > 3"), until=5.0)
    assert rig.typed() == " 1\n"


def test_rules_in_a_circle_take_time() -> None:
    rig = Rig()
    rig.run(body("WAIT.EVENT , 0.1") + cell("1001 = SIG(-1001)"), until=0.1)
    times = [t for t, _ in turns(rig, 1001)]
    assert 50 < len(times) <= 101
    assert min(b - a for a, b in pairwise(times)) >= SOONEST - 1e-9


def test_a_cell_doesnt_set_outputs() -> None:
    rig = Rig()
    rig.load(body("TYPE 1"))
    rig.controller.cell = (parse_rule("1 = TRUE AT 1"),)
    with pytest.raises(ValError, match=r"\*Invalid signal rule\*"):
        rig.controller.execute("main", now=0.0)
    assert not rig.controller.running


@given(st.lists(st.tuples(st.floats(0.0, 2.0), st.booleans()), max_size=12), st.floats(0.01, 1.0))
@settings(max_examples=60, deadline=None)
def test_an_input_follows_what_has_held_for_its_delay(steps: list[tuple[float, bool]], after: float) -> None:
    """Whatever the input's edges are: one comes after each run of the output that is as long as the delay."""
    signals, now = Signals(), 0.0
    signals.begin([SignalRule(1001, TRUE, after)], [lambda: signals.on(1)], now=0.0)
    runs = [(0.0, False)]
    for pause, on in steps:
        target = now + pause
        while signals.next_deadline() <= target:
            now = signals.next_deadline()
            signals.advance(now=now)
        now = target
        signals.set([1 if on else -1])
        signals.advance(now=now)
        if runs[-1][1] != on:
            runs.append((now, on))
    signals.advance(now=now + 10.0)
    assert signals.on(1001) == runs[-1][1]
    expected = False
    ups = 0
    for (begin, on), end in zip(runs, [*(t for t, _ in runs[1:]), now + 10.0], strict=True):
        if begin + max(after, SOONEST) <= end and on != expected:
            expected = on
            ups += on
    assert sum(on for number, on in signals.changes() if number == 1001) == ups
