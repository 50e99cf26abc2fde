"""`vrs console`: completion, colours, piped keys, a pipe, a pseudo-terminal, and all of it with both robots."""

from __future__ import annotations

import asyncio
import contextlib
import fcntl
import os
import pty
import re
import select
import signal
import struct
import subprocess
import sys
import termios
import time

import numpy as np
import pytest
from prompt_toolkit.input import create_pipe_input
from prompt_toolkit.output import DummyOutput

from interfaces.val2.controller import Controller
from interfaces.val2.monitor.commands import hint, suggestions
from interfaces.val2.monitor.control import Control, SharedController
from interfaces.val2.monitor.files import Files
from interfaces.val2.monitor.monitor import TerminalMonitor
from interfaces.val2.monitor.terminal import Keyboard, LineLexer, Terminal, style
from interfaces.val2.motion import arm_for
from interfaces.val2.syntax import Variable
from robots import puma560
from vrs.clock import ManualClock, WallClock
from vrs.engine import Engine

from .sitting import Sitting

MODEL = puma560.model()
WAIT = 120.0
"""Longest that anything may take on a busy machine [s]."""
ENVIRONMENT = {"PYTHONPATH": os.pathsep.join(sys.path), "TERM": "xterm-256color", "PROMPT_TOOLKIT_NO_CPR": "1"}
CONSOLE = [sys.executable, "-m", "interfaces.cli", "console"]
_ESCAPES = re.compile(r"\x1b\[[0-9;?]*[A-Za-z]|\x1b[()][A-Z0-9]|\x1b[=>]|\x1b\][^\x07]*\x07")


# Completion, help, colours.


@pytest.fixture
def sitting(tmp_path):
    sitting = Sitting(tmp_path)
    sitting.type(
        "EDIT palletise", "DELAY 1", "E", "DO SET part = NULL", "DO pitch[1] = 5", "DO SET #safe = #PPOINT()"
    )
    return sitting


@pytest.mark.parametrize(
    ("text", "wanted", "unwanted"),
    [
        ("", "WHERE", "MOVE"),
        ("wh", "where", "load"),
        ("do mo", "moves", "where"),
        ("DO ", "DEPART", "WHERE"),
        ("do move pa", "part", "palletise"),
        ("do move tr", "trans", "part"),
        ("do x = p", "pitch", "palletise"),
        ("ex p", "palletise", "part"),
        ("EN ", "CP", "MOVE"),
        ("param ", "HAND.TIME", "CP"),
        ("here #s", "#safe", "part"),
        ("listr ", "pitch", "part"),
        ("where ", "REAL", "CP"),
        ("help ap", "appros", "palletise"),
        ("at 3 do rea", "ready", "where"),
        ("do speed 3 ", "ALWAYS", "THEN"),
    ],
)
def test_what_may_follow(sitting, text, wanted, unwanted):
    _, found = suggestions(text, sitting.monitor.state)
    words = [one.word for one in found]
    assert wanted in words
    assert unwanted.lower() not in map(str.lower, words)


def test_nothing_follows_in_a_text_or_a_comment_and_files_are_known(sitting):
    assert suggestions('do type "mo', sitting.monitor.state)[1] == []
    assert suggestions("do ready ; mo", sitting.monitor.state)[1] == []
    sitting.type("STORE shelf")
    assert [one.word for one in suggestions("load s", sitting.monitor.state)[1]] == ["shelf"]


def test_lines_of_a_program_are_completed_as_such(sitting):
    words = [one.word for one in suggestions("10 wh", sitting.monitor.state, program=True)[1]]
    assert words == ["while"]
    assert "palletise" in [one.word for one in suggestions("call ", sitting.monitor.state, program=True)[1]]


def test_there_is_a_hint_on_every_word():
    assert hint("wh").startswith("WHERE")
    assert hint("do appro p").startswith("APPRO")
    assert hint("do x = sqrt").startswith("SQRT")
    assert hint("appro", program=True).startswith("APPRO")
    assert hint("enable cp").startswith("ENABLE CP")
    assert hint("") == ""
    assert hint("nonsense") == ""


def test_a_line_is_coloured_and_stays_the_same(sitting):
    lexer = LineLexer(sitting.monitor)
    for text in ("", "  do move part ; there", "nonsense [", 'ex p(1, "a")', "WHERE", "l", "do", " ", "\u00e9"):
        assert "".join(piece for _, piece, *_ in lexer.pieces(text)) == text
    classes = [kind for kind, *_ in lexer.pieces('do type "a", 3')]
    assert classes[0] == "class:command"
    assert {"class:pygments.literal.string.double", "class:pygments.literal.number"} <= set(classes)
    assert style()
    sitting.type("EDIT p")
    assert lexer.pieces("MOVE p")[0][0] == "class:pygments.keyword"
    sitting.type("Q", "HERE p")
    assert lexer.pieces("1,2") == [("", "1,2")]


# Piped keys, in this process.


class Keys:
    """A terminal at an arm of its own, and what was written to it."""

    def __init__(self, tmp_path, source):
        self.engine = Engine(MODEL, q=MODEL.poses["ready"], clock=ManualClock(0.0))
        arm = arm_for(self.engine)
        self.controller = Controller(arm, parameters=arm.parameters)
        self.clock = WallClock()
        self.monitor = TerminalMonitor(SharedController(self.controller, Control()), Files(tmp_path), "a test")
        self.source, self.said = source, []
        say = self.monitor.output

        def noted():
            said = say()
            self.said += said
            return said

        self.monitor.output = noted
        self.terminal = Terminal(self.monitor, self.clock, source=source, sink=DummyOutput())

    def press(self, text):
        self.source.send_text(text)

    async def until(self, there):
        async with asyncio.timeout(WAIT):
            while not there():
                await asyncio.sleep(0.01)

    @property
    def shown(self):
        return "".join(piece.text for piece in self.said)


def with_keys(tmp_path, scenario):
    async def run(source):
        keys = Keys(tmp_path, source)
        running = asyncio.create_task(keys.terminal.run())
        try:
            await scenario(keys)
            keys.press("\x04")
            async with asyncio.timeout(WAIT):
                await running
        finally:
            running.cancel()
            await asyncio.gather(running, return_exceptions=True)

    with create_pipe_input() as source:
        asyncio.run(run(source))


def test_keys_edit_prompt_history_and_the_end(tmp_path):
    async def scenario(keys):
        for line in ("edit ask", 'prompt "n? ", n', "type n * 2", "e", "execute ask"):
            keys.press(f"{line}\r")
        await keys.until(lambda: keys.monitor.prompt == "n? ")
        keys.press("21\r")
        await keys.until(lambda: " 42\n" in keys.shown)
        await keys.until(lambda: keys.monitor.prompt == ".")
        keys.said.clear()
        keys.press("listr n\r")
        await keys.until(lambda: "n = 21" in keys.shown)
        keys.said.clear()
        keys.press("\x1b[A\r")
        await keys.until(lambda: "n = 21" in keys.shown)

    with_keys(tmp_path, scenario)


def test_ctrl_c_in_motion_is_abort_and_brakes_within_the_limits(tmp_path):
    async def scenario(keys):
        keys.press("do move trans(400,0,200,90,0,0)\r")
        await keys.until(lambda: np.abs(keys.engine.timeline.sample(keys.clock.now(), derivative=1)).max() > 0.2)
        t = keys.clock.now()
        keys.press("\x03")
        await keys.until(lambda: "(ABORT)" in keys.shown)
        await keys.until(lambda: keys.controller.arm.settled(now=keys.clock.now()))
        times = np.linspace(t, keys.engine.timeline.end, 2000)
        limits, timeline = MODEL.limits, keys.engine.timeline
        assert (np.abs(timeline.sample(times, derivative=2)) <= limits.qdd_max * (1 + 1e-9)).all()
        assert (np.abs(timeline.sample(times, derivative=1)) <= limits.qd_max * (1 + 1e-9)).all()
        assert np.abs(timeline.sample(times[-1], derivative=1)).max() < 1e-9
        where = keys.controller.arm.here(now=keys.clock.now()).tool.X[:3, 3]
        assert np.linalg.norm(where - [400, 0, 200]) > 10
        keys.press("do ready\r")
        await keys.until(lambda: keys.monitor.prompt == ".")

    with_keys(tmp_path, scenario)


def test_ctrl_c_clears_a_line_and_tab_completes_one(tmp_path):
    async def scenario(keys):
        keys.press("nonsense\x03")
        keys.press("do x = 3\r")
        await keys.until(lambda: [*keys.controller.memory.variables()] == [(Variable("x"), 3.0)])
        keys.press("calib\t\r")
        await keys.until(lambda: keys.monitor.prompt.startswith("Are you sure"))
        keys.press("\x03")
        await keys.until(lambda: keys.monitor.prompt == ".")
        assert "*Invalid" not in keys.shown

    with_keys(tmp_path, scenario)


def test_a_key_pressed_while_something_is_written_is_not_lost():
    master, slave = pty.openpty()
    with os.fdopen(master, "wb", buffering=0) as keys, os.fdopen(slave) as terminal:
        keyboard = Keyboard(terminal)
        with keyboard.raw_mode():
            with keyboard.cooked_mode():
                keys.write(b"\x04")
                assert select.select([terminal], [], [], WAIT)[0]
            os.set_blocking(slave, False)
            assert os.read(slave, 10) == b"\x04"


# Processes.


def piped(text, *arguments, timeout=WAIT):
    return subprocess.run(
        [*CONSOLE, *arguments], input=text, capture_output=True, text=True, timeout=timeout, check=False,
        env=os.environ | ENVIRONMENT,
    )  # fmt: skip


def test_a_pipe_is_a_transcript(tmp_path):
    program = 'edit a\nprompt "n? ", n\ntype "twice", 2 * n\ne\n'
    text = f"{program}execute a\n4\nlistr n\ndo ready\nwhere\nfoo\nstore a"
    done = piped(text, "--alone", "--files", str(tmp_path))
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    lines = done.stdout.splitlines()
    assert ".execute a" in lines
    assert "n? 4" in lines
    assert "twice 8" in lines
    assert any(line.startswith("*Invalid command* FOO") for line in lines)
    where = lines[lines.index(".where") + 2]
    assert [float(x) for x in where.split()] == pytest.approx([-20.3, 150.05, 919.85, 90, -90, 0], abs=0.01)
    assert (tmp_path / "a.v2").exists()


@pytest.mark.parametrize(
    "arguments",
    [("--alone", "--connect", "ws://127.0.0.1:1"), ("--files", "/nowhere/at/all"), ("--token-file", "x"),
     ("--delay", "nonsense"), ("--connect", "ws://127.0.0.1:1")],
)  # fmt: skip
def test_bad_input_is_one_line_and_exit_code_2(arguments):
    done = piped("", *arguments)
    assert done.returncode == 2
    assert len(done.stderr.splitlines()) == 1
    assert done.stdout == ""


class Session:
    """A program on a pseudo-terminal of 80 columns."""

    def __init__(self, tmp_path, *arguments):
        master, slave = pty.openpty()
        fcntl.ioctl(slave, termios.TIOCSWINSZ, struct.pack("HHHH", 24, 80, 0, 0))
        self.process = subprocess.Popen(
            [*CONSOLE, "--files", str(tmp_path), *arguments], stdin=slave, stdout=slave, stderr=slave,
            start_new_session=True, env=os.environ | ENVIRONMENT | {"XDG_STATE_HOME": str(tmp_path / "state")},
        )  # fmt: skip
        os.close(slave)
        os.set_blocking(master, False)
        self.master, self.heard = master, ""

    def until(self, pattern):
        """Read until something is shown; all that was since the last time."""
        end = time.monotonic() + WAIT
        while not re.search(pattern, self.heard):
            assert time.monotonic() < end, f"{pattern!r} not in {self.heard!r}"
            try:
                data = os.read(self.master, 65536)
            except BlockingIOError:
                time.sleep(0.02)
                continue
            except OSError:
                data = b""
            assert data, f"ended after {self.heard!r}"
            self.heard += _ESCAPES.sub("", data.decode(errors="replace"))
        heard, self.heard = self.heard, ""
        return heard

    def press(self, text):
        os.write(self.master, text.encode())

    def wait(self):
        """Its exit code; what it says meanwhile is read."""
        end = time.monotonic() + WAIT
        while self.process.poll() is None and time.monotonic() < end:
            with contextlib.suppress(OSError):
                os.read(self.master, 65536)
            time.sleep(0.02)
        return self.process.poll()

    def close(self):
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGKILL)
        self.process.wait()
        os.close(self.master)


@pytest.fixture
def session(tmp_path):
    with contextlib.ExitStack() as stack:

        def begin(*arguments):
            begun = Session(tmp_path, *arguments)
            stack.callback(begun.close)
            return begun

        yield begin


def test_a_terminal_alone(session, tmp_path):
    console = session("--alone")
    console.until(r"HELP lists the commands")
    console.press("do ready\rwhere\r")
    console.until(r"919\.85 +90\.000 +-90\.000 +0\.000")
    console.press("edit loop\rwhile true do\rdelay 0.1\rend\re\rexecute loop\r")
    console.until(r"\*")
    console.press("\x03")
    console.until(r"loop stands before step \d \(ABORT\)")
    console.press("\x04")
    assert console.wait() == 0
    assert "execute loop" in (tmp_path / "state" / "vrs-teleop" / "console").read_text()


def test_files_that_programs_write_are_listed_renamed_and_deleted_by_where_they_are(session, tmp_path):
    (tmp_path / "ask.v2").write_text(
        'READ (4) $name\nATTACH (5) "DISK"\nFOPENW (5) "names.txt"\nWRITE (5) $name\nFCLOSE (5)\n'
        "WRITE (4) $ERROR(IOSTAT(4))\n"
    )
    (tmp_path.parent / "outside.v2").write_text("READY\n")
    console = session("--alone")
    console.until(r"HELP lists the commands")
    console.press("load ask\rex ask\rfred\r")
    console.until(r"\*Success\*\s[^\n]*\n?[^\n]*ask has ended")
    assert (tmp_path / "names.txt").read_text() == "fred\n"
    console.press("flist\r")
    console.until(r"ask +names\.txt")
    console.press("frename who.txt=names.txt\rfrename =who.txt\r")
    console.until(r"\*Missing argument\* a file's name")
    console.press("fdelete who.txt\ry\rfdelete ../outside\r")
    console.until(rf"Delete {re.escape(str(tmp_path.parent / 'outside.v2'))} \(Y/N\)")
    console.press("n\rfdelete who.txt\r")
    console.until(r"\*Nonexistent file\* who\.txt")
    assert {path.name for path in tmp_path.iterdir()} == {"ask.v2", "state"}
    assert (tmp_path.parent / "outside.v2").exists()


def test_a_terminal_with_both_robots(session):
    console = session()
    console.until(r"http://127\.0\.0\.1:\d+/view")
    console.until(r"HELP lists the commands")
    console.press("do ready\rwhere\r")
    console.until(r"919\.85 +90\.000 +-90\.000 +0\.000")
    console.press("do delay 1\rwhere real\r")
    shown = console.until(r"HAND(\s+-?\d+\.\d+){13}\s")
    joints = [float(text) for text in re.findall(r"-?\d+\.\d+", shown)][-7:-1]
    np.testing.assert_allclose(joints, [0, -90, 90, 0, 0, 0], atol=1.0)
    console.press("quit\r")
    assert console.wait() == 0
