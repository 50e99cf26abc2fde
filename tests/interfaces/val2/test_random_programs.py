"""Random programs: whatever they do, it's typed, told, or a VAL error, and time passes."""

from __future__ import annotations

import math
import random

import pytest

from interfaces.val2.context import ProgramFailed
from interfaces.val2.errors import ValError
from interfaces.val2.parser import parse_line
from tests.interfaces.val2.rig import FakeArm, Rig

REALS = (
    "x", "y", "a[1]", "a[x]", "2", "-1", "0.5", "TIMER(1)", "SIG(1,-1001)", "LEN($s)", "DX(p)", "RANDOM",
    "u", "1E300",
)  # fmt: skip
FRAMES = (
    "p", "q", "TRANS(x,,y)", "HERE", "DEST", "NULL", "p:q", "INVERSE(p)", "SHIFT(q BY x)", "RZ(y)", "a",
)  # fmt: skip
LINES = (
    "x = {r}", "y = {r} {o} {r}", "a[{r}] = {r}", '$s = $s + "ab"', "SET p = {f}", "SET q = {f}:{f}",
    "SET #j = #PPOINT({r})", "TYPE {r}, /F6.2, {r}, $s", "MOVE {f}", "MOVES {f}", "MOVE #j",
    "APPRO {f}, {r}", "DEPART {r}", "DRIVE {r}, {r}, 50", "DELAY {r}", "BREAK", "BRAKE", "OPENI", "CLOSE",
    "SIGNAL {r}", "SIGNAL 1, -2", "SIGNAL -1", "WAIT SIG(1001)", "WAIT {r}", "WAIT TIMER(1) > {r}",
    "TIMER 1 = {r}", "REACT 1, sub ALWAYS", "REACTI 1001, sub", "REACT -2", "IGNORE 1", "CALL sub(x, {r})",
    "CALL sub(a[], $s)", "CALL main()", "CALL nowhere()", "RETURN", "STOP", "HALT", "PAUSE", "GOTO 10",
    "IF {r} {c} {r} GOTO 20", "HERE p", "HERE p:q", "DECOMPOSE a[1] = {f}", 'PROMPT "?", x, y',
    "SPEED 50 ALWAYS", "TOOL {f}", "DISABLE CP", "ATTACH", "WAIT.EVENT , {r}", "WAIT", "GRASP {r}, 10",
    "EXIT", "AUTO u", "LEFTY", "$s = $MID($s,{r},{r})", "y = VAL($s) / {r}",
)  # fmt: skip
BLOCKS = (
    ("IF {r} {c} {r} THEN", "END"),
    ("WHILE {r} {c} {r} DO", "END"),
    ("FOR x = {r} TO {r}", "END"),
    ("DO", "UNTIL {r}"),
    ("FOR a[1] = 1 TO 3 STEP {r}", "END"),
    ("CASE {r} OF\nVALUE {r}, {r}:", "END"),
)
COMPARISONS = ("==", "<>", "<", ">=")
OPERATORS = ("+", "*", "/", "MOD", "^", "AND")


def filled(rng: random.Random, line: str) -> str:
    while "{" in line:
        for key, words in (("{r}", REALS), ("{f}", FRAMES), ("{c}", COMPARISONS), ("{o}", OPERATORS)):
            line = line.replace(key, rng.choice(words), 1)
    return line


def some(rng: random.Random, depth: int) -> list[str]:
    lines = []
    for _ in range(rng.randrange(1, 7)):
        if depth and rng.random() < 0.3:
            head, tail = rng.choice(BLOCKS)
            lines += [filled(rng, head), *some(rng, depth - 1), filled(rng, tail)]
        else:
            lines.append(filled(rng, rng.choice(LINES)))
    return lines


def program(rng: random.Random) -> str:
    main, sub = some(rng, 3), some(rng, 1)
    start = ["x = 1", "y = 2", '$s = "12"', "SET p = TRANS(1,2,3)", "SET q = p"]
    text = [".PROGRAM main()", *start, " 10 TYPE 10", *main, " 20 TYPE 20", ".END"]
    text += [
        ".PROGRAM sub(u, w)",
        "10 ;",
        *sub,
        "20 ;",
        ".END",
        ".SIGNALS",
        "1001 = SIG(1) AFTER 0.05 FOR 0.05",
        ".END",
    ]
    return "\n".join(text)


@pytest.mark.parametrize("seed", range(40))
def test_random_programs(seed: int) -> None:
    rng = random.Random(seed)
    rig = Rig(FakeArm(duration=0.07, latency=rng.choice((0.0, 0.02))))
    try:
        rig.load(program(rng))
        rig.controller.execute("main", cycles=rng.choice((1, 3, -1)), now=0.0)
    except ValError:
        return
    for turn in range(4):
        rig.advance(turn * 0.1 + 0.1)
        assert rig.now <= turn * 0.1 + 0.1 + 1e-9
        act = rng.randrange(8)
        try:
            match act:
                case 0:
                    rig.controller.abort(now=rig.now)
                case 1:
                    rig.controller.proceed(now=rig.now)
                case 2:
                    rig.controller.retry(now=rig.now)
                case 3:
                    rig.controller.proceed(single=True, now=rig.now)
                case 4:
                    rig.controller.answer(rng.choice(("1,2", "x", "")), now=rig.now)
                case 5:
                    rig.controller.signals.force(rng.choice((1001, -1001, 1)))
                case 6:
                    rig.controller.do(parse_line(filled(rng, rng.choice(LINES))), now=rig.now)
        except ValError:
            continue
    for _, value in rig.controller.memory.variables():
        assert not isinstance(value, float) or math.isfinite(value)
    for _, event in rig.when(ProgramFailed):
        assert event.error.what
        assert event.error.program == "" or event.error.step is not None
