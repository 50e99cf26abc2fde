"""ALTER during a motion: the path is the planned one and the corrections, after their delay, within the limits."""

from __future__ import annotations

import math

import numpy as np
import pytest

from interfaces.cli import main
from interfaces.link import delay_profile
from interfaces.messages.control import Corrected, PathCorrection, ProblemCode
from interfaces.messages.fields import Epoch
from interfaces.recording.recording import open_recording
from interfaces.recording.rerun import rerun
from interfaces.val2.errors import ValError
from interfaces.val2.monitor.files import Files
from interfaces.val2.motion import Arm
from interfaces.val2.motion.places import Frames
from interfaces.val2.motion.remote import RemoteRobot
from interfaces.val2.playing import Listeners
from interfaces.val2.rooms import TerminalRoom
from interfaces.val2.source import parse_file
from interfaces.val2.twins import play
from interfaces.val2.values import Transformation
from robots import load
from robots.robot import exact_arm
from tests.interfaces.joined import constant
from tests.vrs.test_altering import check_limits
from vrs import Alter
from vrs.planning.altering import DELAY, FADE

from .bench import DOWN, MODEL, Bench, from_oat
from .shared import Clock, Pair
from .sitting import Sitting
from .test_remote import Line

PERIOD = 0.028
BEGIN, END = from_oat(100, 450, 150, *DOWN), from_oat(-100, 450, 150, *DOWN)


def moving(mode, *, speed=100.0, tool=None):
    """An arm on a straight line at a speed [mm/s], its path altered; and one on the same line without ALTER."""
    benches = []
    for _ in range(2):
        bench = Bench()
        if tool is not None:
            bench.arm.set_tool(tool)
        bench.move(BEGIN)
        bench.settle()
        bench.arm.set_alter(mode, now=bench.now)
        bench.arm.set_speed(speed, turn=None, unit="MMPS", always=False)
        bench.move(END, straight=True)
        benches.append(bench)
    return benches


def tips(bench, t):
    X = MODEL.forward(bench.engine.timeline.sample(t)) @ Frames(MODEL, bench.arm.tool()).tip()
    return X[:, :3, 3] * [-1000, -1000, 1000]


def turned(bench, t):
    return MODEL.forward(bench.engine.timeline.sample(t))[:, :3, :3]


def stream(bench, values, seconds, *, cumulative):
    """Correct each 28 ms by a function of the time since the first; when that was."""
    begun, before = bench.now, np.zeros(6)
    for k in range(int(seconds / PERIOD)):
        now = np.asarray(values(k * PERIOD), float)
        bench.arm.alter(tuple(now - before if cumulative else now), now=bench.now)
        before = now
        bench.sleep(PERIOD)
    return begun


@pytest.mark.parametrize("mode", [0, 1, 2, 3])
def test_five_millimetres_at_one_hertz_on_a_line(mode):
    bench, plain = moving(mode)
    bench.sleep(0.2)
    begun = stream(bench, lambda t: [0, 0, 5 * math.sin(2 * math.pi * t), 0, 0, 0], 1.7, cumulative=bool(mode & 1))
    t = np.arange(begun - 0.1, bench.now, 1e-3)
    wanted = tips(plain, t)
    height = 5 * np.sin(2 * np.pi * np.clip(t - begun - DELAY, 0, None))
    wanted[:, 2] += height if mode & 2 else -height
    assert np.abs(tips(bench, t) - wanted).max() < 0.1
    assert np.abs(tips(bench, t) - tips(plain, t)).max() == pytest.approx(5.0, abs=0.05)
    assert np.abs(turned(bench, t) - turned(plain, t)).max() < 1e-5
    bench.settle()
    check_limits(bench.engine.timeline)


@pytest.mark.parametrize("seed", range(8))
def test_other_directions_speeds_tools_and_turns(seed):
    rng = np.random.default_rng(seed)
    mode = int(rng.integers(4))
    tool = Transformation(from_oat(*rng.uniform(-30, 30, 2), 100, 90, -90, 20).X) if seed % 2 else None
    bench, plain = moving(mode, speed=float(rng.uniform(40, 120)), tool=tool)
    bench.sleep(0.2)
    way, frequency = rng.normal(size=6) * [2, 2, 2, 0, 0, 0], rng.uniform(0.3, 1.5)
    begun = stream(bench, lambda t: way * math.sin(2 * math.pi * frequency * t), 1.2, cumulative=bool(mode & 1))
    t = np.arange(begun + 0.1, bench.now, 1e-3)
    shares = np.sin(2 * np.pi * frequency * (t - begun - DELAY))
    if mode & 2:
        added = np.outer(shares, way[:3])
    else:
        R = plain.arm.here(now=plain.now).tool.X[:3, :3]
        added = np.outer(shares, R @ way[:3])
    assert np.abs(tips(bench, t) - tips(plain, t) - added).max() < 0.1
    check_limits(bench.engine.timeline)


def test_turns_are_about_the_tip_that_is_planned():
    tool = Transformation(from_oat(0, 0, 120, 90, -90, 0).X)
    bench, plain = moving(2, tool=tool)
    bench.sleep(0.2)
    begun = stream(bench, lambda t: [0, 0, 0, 0, 0, 4 * math.sin(2 * math.pi * 0.5 * t)], 1.5, cumulative=False)
    t = np.arange(begun + 0.1, bench.now, 1e-3)
    assert np.abs(tips(bench, t) - tips(plain, t)).max() < 0.05
    angles = np.radians(4 * np.sin(2 * np.pi * 0.5 * (t - begun - DELAY)))
    R = turned(bench, t) @ turned(plain, t).transpose(0, 2, 1)
    assert np.abs(np.arctan2(R[:, 1, 0], R[:, 0, 0]) - angles).max() < 1e-4


def test_what_adds_up_stays_and_what_does_not_goes_back():
    for mode in (2, 3):
        bench, plain = moving(mode)
        bench.sleep(0.2)
        for _ in range(10):
            bench.arm.alter((0, 0, 0.5 if mode & 1 else 5.0, 0, 0, 0), now=bench.now)
            bench.sleep(PERIOD)
        last = bench.now
        # Somebody looks after the arm, as the controller does.
        while bench.now < last + 1.0:
            bench.arm.renew(now=bench.now)
            bench.sleep(min(bench.arm.renewal() - bench.now, 0.1) if bench.arm.renewal() > bench.now else 0.01)
        t = np.arange(last + DELAY + FADE + 0.05, bench.now, 1e-3)
        lifted = (tips(bench, t) - tips(plain, t))[:, 2]
        assert np.abs(lifted - (5.0 if mode & 1 else 0.0)).max() < 0.05
        check_limits(bench.engine.timeline)


PROGRAM = """.PROGRAM main()
    MOVE TRANS(100, 450, 150, 90, 90, 0)
    BREAK
    {begin}
    SPEED 100 MMPS
    MOVES TRANS(-100, 450, 150, 90, 90, 0)
    TIMER 1 = 0
    old = 0
    WHILE STATE(2) == 1 DO
        z = {amplitude}*SIN(360*TIMER(1))
        {correct}
        old = z
    END
    {end}
    SET p = HERE
    TYPE /F12.6, DX(p), DY(p), DZ(p)
    MOVES TRANS(-100, 450, 120, 90, 90, 0)
    BREAK
    TYPE /F12.6, DX(HERE), DY(HERE), DZ(HERE)
.END
"""
WAYS = {
    2: ("ALTER (1) 2", "ALTOUT 0, 0, z", "NOALTER"),
    3: ("ALTER (1) 3", "ALTOUT 0, 0, z - old", "NOALTER"),
    1: ("ALTON (1) 1", "ALTER () 0, 0, old - z", "ALTOFF"),
}


def played(mode, amplitude, delay="none"):
    begin, correct, end = WAYS[mode]
    typed = []
    text = PROGRAM.format(begin=begin, correct=correct, end=end, amplitude=amplitude)
    run = play(parse_file(text, "a.v2"), load("puma560"), delay_profile(delay), exact_arm, seed=1,
               listeners=Listeners(typed.append))  # fmt: skip
    assert run.error is None, run.error
    return run.run, [float(word) for word in "".join(typed).split()]


@pytest.mark.parametrize(("mode", "delay"), [(2, "none"), (3, "mon"), (1, "constant:0.2")])
def test_a_program_alters_its_own_motion_on_both_twins(mode, delay):
    plain, _ = played(mode, 0)
    run, typed = played(mode, 5, delay)
    begun, ends = run.receipts_virtual[1].execute_at, run.receipts_virtual[1].end
    t = run.t[(run.t < ends) & (run.t < plain.t[-1])]
    tip = Frames(MODEL).tip()
    lifted = [(MODEL.forward(one.q_virtual[: len(t)]) @ tip)[:, 2, 3] * 1000 for one in (run, plain)]
    wanted = np.where(t > begun + DELAY, 5 * np.sin(2 * np.pi * (t - begun - DELAY)), 0.0)
    assert np.abs(lifted[0] - lifted[1] - wanted).max() < 0.1
    assert np.abs(wanted).max() > 4.9
    # The real arm follows the very same timeline.
    both = ~np.isnan(run.q_real).any(axis=1)
    assert np.abs(run.q_real - run.q_matched)[both].max() < 1e-6
    assert not run.corrections
    # NOALTER leaves the arm where it is, and the next motion goes to its own place.
    assert typed[:2] == pytest.approx([-100, 450], abs=1e-4)
    stays = abs(typed[2] - 150) > 1
    assert stays is bool(mode & 1)
    assert typed[3:] == pytest.approx([-100, 450, 120], abs=1e-4)


def test_a_recording_of_it_opens_plays_and_makes_the_same_again(tmp_path):
    (tmp_path / "a.v2").write_text(
        PROGRAM.format(begin=WAYS[3][0], correct=WAYS[3][1], end=WAYS[3][2], amplitude=5)
    )
    with pytest.raises(SystemExit) as exited:
        main(["run", str(tmp_path / "a.v2"), "--delay", "mon", "--out", str(tmp_path), "--seed", "1"])
    assert not exited.value.code
    with open_recording(tmp_path / "run.mcap") as recording:
        again = rerun(recording)
        assert (again.difference, again.missing) == ("", "")
        assert again.identical
        commands = [entry.command for entry in recording.commands]
        assert sum(isinstance(command, Alter) for command in commands) > 60
        check_limits(recording.edits[-1].timeline)


def test_a_motion_that_follows_is_altered_too():
    bench, plain = moving(3)
    for one in (bench, plain):
        one.arm.move(from_oat(-100, 550, 150, *DOWN), straight=True, now=one.now)
    begun = bench.now
    for _ in range(20):
        bench.arm.alter((0, 0, 0.2, 0, 0, 0), now=bench.now)
        bench.sleep(PERIOD)
    while bench.now < begun + 4.5:
        bench.arm.renew(now=bench.now)
        bench.arm.ready(now=bench.now)
        bench.sleep(0.01)
    t = np.arange(begun + 20 * PERIOD + 0.3, bench.now, 1e-3)
    assert np.abs(tips(bench, t) - tips(plain, t) - [0, 0, 4]).max() < 0.05
    check_limits(bench.engine.timeline)
    # An end of ALTER keeps that, and counts from there.
    bench.until(bench.arm.settled)
    bench.arm.set_alter(None, now=bench.now)
    bench.settle()
    bench.move(from_oat(-100, 500, 150, *DOWN), straight=True)
    bench.settle()
    assert np.abs(bench.here().tool.X - from_oat(-100, 500, 150, *DOWN).X).max() < 1e-6


def test_a_stop_on_the_way_ends_it_smoothly():
    bench, _ = moving(2)
    bench.sleep(0.2)
    stream(bench, lambda t: [0, 0, 5 * math.sin(2 * math.pi * t), 0, 0, 0], 0.6, cumulative=False)
    bench.arm.brake(now=bench.now)
    stopped = bench.settle()
    assert bench.now < stopped + 0.5
    check_limits(bench.engine.timeline)
    bench.arm.retry(now=bench.now)
    bench.settle()
    assert np.abs(bench.here().tool.X - END.X).max() < 1e-6


@pytest.mark.parametrize("mode", [2, 3])
def test_a_stop_by_somebody_else_interrupts_the_motion_and_nothing_moves_after_it(mode):
    bench, _ = moving(mode)
    bench.sleep(0.2)
    stream(bench, lambda t: [0, 0, 5 * t, 0, 0, 0], 0.6, cumulative=bool(mode & 1))
    bench.engine.stop()
    with pytest.raises(ValError, match=r"\*Motion interrupted\* the arm was stopped"):
        bench.until(bench.arm.settled)
    bench.sleep(1.0)
    stands = bench.engine.timeline
    bench.arm.renew(now=bench.now)
    bench.arm.ready(now=bench.now)
    assert bench.engine.timeline is stands
    assert bench.now > stands.end
    check_limits(stands)


def test_what_cannot_be_followed_is_said():
    bench, _ = moving(2)
    bench.sleep(0.2)
    assert bench.arm.alter((0, 0, 80, 0, 0, 0), now=bench.now)
    bench.sleep(PERIOD)
    with pytest.raises(ValError, match=r"\*Path can't be altered so\*"):
        bench.arm.alter((0, 5000, 0, 0, 0, 0), now=bench.now)
    bench.settle()
    check_limits(bench.engine.timeline)


SLOW = """.PROGRAM slow()
    LEFTY
    MOVE TRANS(100, 450, 150, 90, 90, 0)
    BREAK
    ALTER (1) 3
    SPEED 40 MMPS
    MOVES TRANS(-100, 450, 150, 90, 90, 0)
    NOALTER
.END
"""


def test_at_the_console_beside_a_program(tmp_path):
    (tmp_path / "slow.v2").write_text(SLOW)
    sitting = Sitting(tmp_path)
    sitting.type("LOAD slow", "EX slow")
    there = lambda: sitting.arm.here(now=sitting.now).tool.X  # noqa: E731
    sitting.until(lambda: sitting.arm.altering(1, now=sitting.now) and there()[0, 3] < 20)
    sitting.type("DO ALTOUT 0,0,2")
    sitting.pass_time(0.5)
    assert there()[:3, 3] == pytest.approx([-20, 450, 152], abs=25)
    assert there()[2, 3] == pytest.approx(152, abs=0.02)
    assert "slow has ended" in sitting.finish()
    assert there()[:3, 3] == pytest.approx([-100, 450, 152], abs=1e-3)
    assert "*Path isn't altered*" in sitting.type("DO ALTOUT 0,0,2")


@pytest.mark.parametrize("link", [constant(0.0), constant(0.1)])
def test_an_arm_elsewhere_is_corrected_too(link):
    line = Line(link)
    arm = Arm(RemoteRobot(line, MODEL))
    arm.move(BEGIN, straight=False, now=line.now)
    line.until(arm.settled)
    arm.set_alter(2, now=line.now)
    arm.set_speed(100, turn=None, unit="MMPS", always=False)
    arm.move(END, straight=True, now=line.now)
    line.until(arm.ready)
    for _ in range(20):
        arm.alter((0, 0, 3, 0, 0, 0), now=line.now)
        line.joined.run(PERIOD)
    X = MODEL.forward(line.joined.engine.timeline.sample(line.now)) @ Frames(MODEL).tip()
    assert 1000 * X[2, 3] == pytest.approx(153, abs=0.1)
    line.until(arm.settled)
    assert np.abs(arm.here(now=line.now).tool.X - END.X).max() < 1e-3


class External:
    """A page that streams corrections to a program at its terminal."""

    def __init__(self, directory, mode, speed=100):
        (directory / "main.v2").write_text(EXTERNAL.format(mode=mode, speed=speed))
        self.pair = Pair(directory)
        joined = self.pair.joined
        joined.hub.alterer = TerminalRoom(self.pair.shared, Clock(joined), Files(directory), "a test")
        self.core = self.pair.page.core
        self.pair.type("LOAD main")
        self.pair.monitor.line("EX main", now=joined.now)
        self.waits_for(lambda: self.pair.controller.status().step == 6)
        self.begun = joined.now

    def waits_for(self, there):
        for _ in range(1000):
            if there():
                return
            self.pair.run(0.01)
        raise AssertionError(self.pair.said)

    def wish(self, offset, *, channel=1, at=None):
        joined, core = self.pair.joined, self.core
        at = joined.now if at is None else at
        return core.wish(
            lambda number: PathCorrection(number, channel, np.asarray(offset, float), Epoch(core.epoch or 1), at),
            now=joined.now + joined.ahead[core], leased=True,
        )  # fmt: skip

    def answer(self, number):
        self.waits_for(lambda: self.core.answer(number) is not None)
        return self.core.answer(number)

    def lifted(self, t):
        """How far the tip is above the planned line [mm]."""
        X = MODEL.forward(self.pair.engine.timeline.sample(t)) @ Frames(MODEL).tip()
        return 1000 * X[:, 2, 3] - 150


EXTERNAL = """.PROGRAM main()
    MOVE TRANS(100, 450, 150, 90, 90, 0)
    BREAK
    ALTER (1) {mode}
    SPEED {speed} MMPS
    MOVES TRANS(-100, 450, 150, 90, 90, 0)
    NOALTER
    TYPE DZ(HERE)
.END
"""


@pytest.mark.parametrize("mode", [0, 1, 2, 3])
@pytest.mark.parametrize("disturbed", [False, True])
def test_a_client_of_the_server_corrects_the_path(tmp_path, mode, disturbed):
    outside, rng = External(tmp_path, mode), np.random.default_rng(mode)
    outside.pair.run(0.2)
    begun, before, numbers = outside.pair.joined.now, 0.0, []
    coming = []
    for k in range(60):
        given = begun + k * PERIOD
        jitter = 0.01 + rng.uniform(-0.01, 0.01) if disturbed else 0.0
        if not (disturbed and k % 9 == 5 and not mode & 1):
            coming.append((given + jitter, given))
    for comes, given in coming:
        outside.pair.run(max(comes - outside.pair.joined.now, 0.0))
        height = 5e-3 * math.sin(2 * math.pi * (given - begun))
        part = (height - before if mode & 1 else height) * (1 if mode & 2 else -1)
        numbers.append(outside.wish([0, 0, part, 0, 0, 0], at=given))
        before = height
    t = np.arange(begun + 0.3, outside.pair.joined.now, 1e-3)
    wanted = 5 * np.sin(2 * np.pi * (t - begun - DELAY))
    assert np.abs(outside.lifted(t) - wanted).max() < 0.1
    assert all(outside.answer(number) == Corrected(number) for number in numbers)
    outside.waits_for(lambda: "main has ended" in outside.pair.said)
    stays = 5 * math.sin(2 * math.pi * (coming[-1][1] - begun)) if mode & 1 else 0.0
    assert outside.lifted(np.array([outside.pair.joined.now]))[0] == pytest.approx(stays, abs=0.01)
    check_limits(outside.pair.engine.timeline)


def test_corrections_are_taken_from_who_commands_while_a_program_asks_for_them(tmp_path):
    outside = External(tmp_path, 2)
    stranger = outside.pair.joined.client()
    outside.pair.run(0.2)
    assert outside.answer(outside.wish([0, 0, 1e-3, 0, 0, 0])).late == ""
    wrong = outside.answer(outside.wish([0, 0, 1e-3, 0, 0, 0], channel=2))
    assert (wrong.code, wrong.text) == (
        ProblemCode.OUT_OF_RANGE, "*Path isn't altered* no program has ALTER on for channel 2",
    )  # fmt: skip
    old = outside.answer(outside.wish([0, 0, 1e-3, 0, 0, 0], at=outside.pair.joined.now - 0.3))
    assert old.code is ProblemCode.OUT_OF_RANGE
    late = outside.answer(outside.wish([0, 0, 0.08, 0, 0, 0]))
    assert "in time" in late.late
    far = outside.answer(outside.wish([0, 9.0, 0, 0, 0, 0]))
    assert far.code is ProblemCode.OUT_OF_RANGE
    outside.core = stranger
    assert outside.answer(outside.wish([0, 0, 1e-3, 0, 0, 0])).code is ProblemCode.STALE_EPOCH
    outside.core = outside.pair.page.core
    outside.waits_for(lambda: "main has ended" in outside.pair.said)
    over = outside.answer(outside.wish([0, 0, 1e-3, 0, 0, 0]))
    assert over.text == "*Path isn't altered* no program has ALTER on for channel 1"
    outside.pair.joined.hub.alterer = None
    assert outside.answer(outside.wish([0, 0, 1e-3, 0, 0, 0])).code is ProblemCode.NOT_ALLOWED
    check_limits(outside.pair.engine.timeline)
