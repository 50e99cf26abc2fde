"""VAL-II: what a statement costs, and a long program from its text to a certified plan."""

from __future__ import annotations

import math
import statistics
import time

import numpy as np

from benchmarks.results import Bar, Cost, Part, Result
from interfaces.val2.check import check_text
from interfaces.val2.context import ProgramEnded, ProgramFailed
from interfaces.val2.controller import Controller
from interfaces.val2.motion import arm_for
from interfaces.val2.playing import rehearse
from interfaces.val2.source import parse_file
from interfaces.val2.syntax import Program
from robots import puma560
from vrs import Engine, ManualClock

MODEL = puma560.model()
TURNS = 40_000
MOVES = 1000
REPEATS = 5
LOOPS = {
    "FOR with a sum": (("FOR i = 1 TO {n}", "x = x+i*2", "END"), 2),
    "WHILE with IF and ELSE": (
        (
            "i = 0",
            "WHILE i < {n} DO",
            "IF i MOD 2 == 0 THEN",
            "x = x+1",
            "ELSE",
            "x = x-1",
            "END",
            "i = i+1",
            "END",
        ),
        5,
    ),
    "array elements": (("FOR i = 1 TO {n}", "a[i MOD 100] = a[i MOD 100]+SQRT(i)", "END"), 2),
    "a call with an argument": (("FOR i = 1 TO {n}", "CALL add(x)", "END"), 4),
}
"""Loops, and the statements that a turn of each carries out."""
ADD = ".PROGRAM add(n)\nn = n+1\n.END\n"
ZERO = "x = 0\nFOR i = 0 TO 99\na[i] = 0\nEND\n"


def part() -> Part:
    """Measure."""
    results = [_loop(name, *loop) for name, loop in LOOPS.items()]
    results += _long_program()
    return Part(
        "VAL-II",
        f"Loops of {TURNS} turns on a controller in virtual time, processor time over the statements that they "
        f"carry out, END not counted; the best of {REPEATS}. A program of {MOVES} random joint-interpolated moves "
        "with CP on, as `vrs check` takes it: read, checked, and rehearsed, each move planned and certified when "
        f"the one before it begins; the best of {REPEATS}, each with other numbers.",
        tuple(results),
    )


def _loop(name: str, lines: tuple[str, ...], statements: int) -> Result:
    body = "\n".join(lines).format(n=TURNS)
    source = parse_file(f".PROGRAM main()\n{ZERO}{body}\n.END\n{ADD}", "loop")
    seconds = min(_carried_out(source.programs) for _ in range(REPEATS))
    cost = 1e6 * seconds / (TURNS * statements)
    return Result(name, Cost(cost), bar=Bar(median=10.0), note=f"{1e6 / cost:,.0f} statements/s")


def _carried_out(programs: tuple[Program, ...]) -> float:
    """Processor time of a program [s]."""
    controller = Controller(arm_for(Engine(MODEL, clock=ManualClock(0.0))))
    for program in programs:
        controller.memory.programs[program.name] = program
    controller.execute("main", now=0.0)
    now, begun = 0.0, time.thread_time()
    while True:
        for event in controller.advance(now=now):
            if isinstance(event, ProgramFailed):
                raise event.error
            if isinstance(event, ProgramEnded):
                return time.thread_time() - begun
        now = max(now, controller.next_deadline())
        assert now < math.inf


def _long_program() -> list[Result]:
    spent = [_from_text_to_plan(seed) for seed in range(REPEATS)]
    names = ("read and checked", "planned", "all of it")
    best = [min(times) for times in zip(*spent, strict=True)]
    bars = (Bar(), Bar(), Bar(median=2.0))
    usual = [statistics.median(times) for times in zip(*spent, strict=True)]
    return [
        Result(f"{MOVES} moves: {name}", Cost(least), unit="s", bar=bar, note=f"median {middle:.3g} s")
        for name, least, bar, middle in zip(names, best, bars, usual, strict=True)
    ]


def _from_text_to_plan(seed: int) -> tuple[float, float, float]:
    """Processor time to read and check, to plan, and both [s]."""
    rng = np.random.default_rng(seed)
    places = rng.uniform((-250, 450, -150), (250, 620, 100), (MOVES, 3)).tolist()
    rows = [f"    MOVE TRANS({x:.3f},{y:.3f},{z:.3f},90,90,0)" for x, y, z in places]
    text = "\n".join([".PROGRAM main()", *rows, ".END", ""])
    begun = time.thread_time()
    source, _ = check_text(text, "long")
    assert source is not None
    read = time.thread_time()
    rehearsal = rehearse(source, MODEL, limit=math.inf)
    planned = time.thread_time()
    assert rehearsal.findings == ()
    return read - begun, planned - read, planned - begun
