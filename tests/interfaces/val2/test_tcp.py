"""Terminals over TCP: bytes to lines, telnet, who is in control, slow and vanished readers, a whole server."""

from __future__ import annotations

import asyncio
import contextlib
import os
import re
import signal
import socket
import subprocess
import sys
import time

import pytest

from interfaces.messages.control import Role
from interfaces.stream import sockets
from interfaces.stream.access import Access, Admission
from interfaces.val2.controller import Controller
from interfaces.val2.monitor.control import Control, SharedController
from interfaces.val2.monitor.files import Files
from interfaces.val2.monitor.monitor import LONGEST, OVERLONG
from interfaces.val2.monitor.state import OutputText, Style
from interfaces.val2.monitor.teletype import INTERRUPT, Input, Output
from interfaces.val2.motion import arm_for
from interfaces.val2.rooms import TerminalRoom
from interfaces.val2.tcp import MOST, TOKEN_TRIES, UNREAD, TcpTerminalServer
from robots import puma560
from tests.memory import values_held
from vrs.clock import ManualClock, WallClock
from vrs.engine import Engine

MODEL = puma560.model()
WAIT = 60.0
"""Longest that an answer may take on a busy machine [s]."""


# Bytes and lines.


@pytest.mark.parametrize("size", [1, 3, 1000])
def test_every_end_of_line_ends_one_line_however_it_comes(size):
    data = b"a\rb\nc\r\nd\r\0e\n\nf\r\rg\n"
    reader = Input()
    found = [line for k in range(0, len(data), size) for line in reader.feed(data[k : k + size])]
    assert found == ["a", "b", "c", "d", "e", "", "f", "", "g"]
    assert reader.feed(b"rest") == []
    assert reader.end() == ["rest"]


@pytest.mark.parametrize("size", [1, 2, 1000])
def test_telnet_negotiation_is_passed_over(size):
    options = b"\xff\xfb\x01w\xff\xfd\x03h\xff\xfa\x18\x00xterm\r\n\xff\xf0e\xff\xfa\x18\xff\xffzz\n\xff\xf0"
    data = options + b"\xff\xf1re\r\n\xff\xf4no\x03x\r\n"
    reader = Input()
    found = [line for k in range(0, len(data), size) for line in reader.feed(data[k : k + size])]
    assert found == ["where", INTERRUPT, INTERRUPT, "x"]


def test_a_line_without_an_end_takes_no_room_and_is_an_error():
    reader = Input()
    for _ in range(1000):
        assert reader.feed(b"x" * 1000) == []
    assert values_held(reader) <= 4 * LONGEST + 100
    assert reader.feed(b"\nwhere\n") == [OVERLONG, "where"]


def test_backspaces_erase_and_bytes_that_are_no_text_do_no_harm():
    assert Input().feed(b"wha\x7f\x08\x08where\x00\n") == ["where"]
    assert Input().feed(b"\x80\xfe\n") == ["\ufffd\ufffd"]


def test_the_prompt_is_given_once_and_again_behind_what_is_said():
    output = Output("\r\n")
    assert output.give([OutputText("hello\n", Style.NOTE)], ".") == "hello\r\n."
    assert output.give([], ".") == ""
    output.took()
    assert output.give([OutputText("a\nb\n", Style.ANSWER)], ".") == "a\r\nb\r\n."
    output.took()
    assert output.give([], "*") == "*"
    assert output.give([OutputText("tick\n", Style.TYPED)], "*") == "\r\ntick\r\n"
    assert output.give([OutputText("tick\n", Style.TYPED)], "*") == "tick\r\n"
    assert output.give([], ".") == "."
    output.took()
    assert output.give([OutputText("n =", Style.TYPED)], "how many? ") == "n =how many? "


# A door on an arm in this process.


CLIENTS = []
"""To be closed in the end."""


class Tokens(Access):
    """What tokens open."""

    def admit(self, role, token):
        return Admission("" if token == "secret" or (token == "look" and role is Role.VIEWER) else "no")


class Client:
    """A terminal."""

    def __init__(self, reader, writer):
        self.reader, self.writer = reader, writer
        self.heard = ""

    @classmethod
    async def at(cls, door, until="\\.$", token="secret", **options):
        client = cls(*await asyncio.open_connection("127.0.0.1", door.port, **options))
        CLIENTS.append(client)
        if token:
            client.writer.write(f"{token}\r\n".encode())
        if until:
            await client.until(until)
        return client

    async def until(self, pattern):
        """Read until something was heard; what was."""
        async with asyncio.timeout(WAIT):
            while not re.search(pattern, self.heard):
                data = await self.reader.read(65536)
                assert data, f"closed after {self.heard!r}"
                self.heard += data.decode()
        heard, self.heard = self.heard, ""
        return heard

    async def say(self, text, until="\\.$"):
        self.writer.write(text.encode() if isinstance(text, str) else text)
        return await self.until(until)


@contextlib.asynccontextmanager
async def door_here(tmp_path):
    engine = Engine(MODEL, q=MODEL.poses["ready"], clock=ManualClock(0.0))
    arm, clock = arm_for(engine), WallClock()
    controller = Controller(arm, parameters=arm.parameters)
    shared = SharedController(controller, Control())

    door = TcpTerminalServer(TerminalRoom(shared, clock, Files(tmp_path), "a test"), Tokens())
    async with door.listening(sockets.bind("127.0.0.1", 0)):
        door.controller, door.engine = controller, engine
        yield door


def live(scenario):
    async def closed():
        try:
            await asyncio.wait_for(scenario, 120.0)
        finally:
            while CLIENTS:
                writer = CLIENTS.pop().writer
                writer.close()
                with contextlib.suppress(OSError):
                    await writer.wait_closed()

    asyncio.run(closed())


def test_a_dialogue_with_edit_and_prompt(tmp_path):
    async def scenario():
        async with door_here(tmp_path) as door:
            client = await Client.at(door)
            assert "919.85" in await client.say("where\r\n")
            assert await client.say("edit ask\r", "1\\.\\? $") == ".PROGRAM ask()\r\n1.? "
            await client.say('prompt "n? ", n\rtype n * 2\re\r')
            await client.say("execute ask\r", "n\\? $")
            assert "\r\n 42\r\n" in "\r\n" + await client.say("21\r", "ended[^.]*\\.$")
            await client.say("do drive 1,10,100\n")
            assert " 10.000" in await client.say("where\n")

    live(scenario())


def test_one_is_in_control_and_others_look_until_it_has_gone(tmp_path):
    async def scenario():
        async with door_here(tmp_path) as door:
            first, second = await Client.at(door), await Client.at(door)
            await first.say("edit loop\nwhile true do\ndelay 0.1\nend\ne\nexecute loop\n", "\\*$")
            assert "*No control*" in await second.say("do ready\n", "control[^*]*\\*$")
            assert "loop, step" in await second.say("status\n", "time[^*]*\\*$")
            first.writer.close()
            await second.until("\\.$")
            assert not door.controller.running
            assert "*" not in await second.say("do drive 1,5,100\n")

    live(scenario())


def test_ctrl_c_aborts_and_a_client_that_vanished_is_noticed_after_its_end_of_input(tmp_path):
    async def scenario():
        async with door_here(tmp_path) as door:
            client = await Client.at(door)
            await client.say("edit loop\nwhile true do\ndelay 0.1\nend\ne\nexecute loop\n", "\\*$")
            assert "(ABORT)" in await client.say(b"\x03")
            await client.say("execute loop\n", "\\*$")
            client.writer.write_eof()
            await asyncio.sleep(0.3)
            assert door.controller.running
            client.writer.transport.abort()
            async with asyncio.timeout(WAIT):
                while door.controller.running:
                    await asyncio.sleep(0.02)

    live(scenario())


def test_the_end_of_input_lets_what_was_typed_be_done(tmp_path):
    async def scenario():
        async with door_here(tmp_path) as door:
            client = await Client.at(door)
            client.writer.write(b"do drive 1,10,100\nwhere\ndo x = 3\nlistr")
            client.writer.write_eof()
            async with asyncio.timeout(WAIT):
                heard = (await client.reader.read()).decode()
            assert " 10.000" in heard
            assert "x = 3" in heard

    live(scenario())


def test_who_reads_nothing_loses_output_and_holds_up_nobody(tmp_path):
    async def scenario():
        async with door_here(tmp_path) as door:
            client = await Client.at(door, "", limit=1)
            reader, writer = client.reader, client.writer
            writer.write(b'edit flood\nwhile true do\ntype "0123456789012345678901234567890123456789"\nend\ne\n')
            writer.write(b"execute flood\n")
            async with asyncio.timeout(WAIT):
                while not door.terminals:
                    await asyncio.sleep(0.01)
            (connection,) = door.terminals
            async with asyncio.timeout(WAIT):
                while not connection.lost:
                    await asyncio.sleep(0.02)
            assert connection.unread <= UNREAD
            begun = time.monotonic()
            second = await Client.at(door, "")
            assert "919.85" in await second.say("where\n", "919.85")
            assert time.monotonic() - begun < WAIT / 2
            heard = b""
            async with asyncio.timeout(WAIT):
                while b"*Output lost*" not in heard:
                    heard = heard[-100:] + await reader.read(65536)

    live(scenario())


def test_too_long_a_line_too_many_lines_and_too_many_terminals_are_errors(tmp_path):
    async def scenario():
        async with door_here(tmp_path) as door:
            client = await Client.at(door)
            assert "*Line too long*" in await client.say(b"x" * 100_000 + b"\n")
            assert "919.85" in await client.say("where\n")
            await client.say("do drive 1,90,10\n" + "do x = 1\n" * 500 + "do y = 2\n", "Too many lines waiting")
            await client.say("abort\n")
            others = [await Client.at(door) for _ in range(MOST - 1)]
            assert "*Too many terminals*" in await (await Client.at(door, "")).until("most")
            assert len(others) == MOST - 1

    live(scenario())


def test_tokens_open_what_they_open(tmp_path):
    async def scenario():
        async with door_here(tmp_path) as door:
            client = await Client.at(door, "Token: $", "")
            assert "*Invalid token*" in await client.say("where\n", "Token: $")
            await client.say("secret\n")
            assert "*" not in await client.say("do drive 1,5,100\n")
            looker = await Client.at(door, "Token: $", "")
            assert "only looks" in await looker.say("look\n")
            client.writer.close()
            assert "*No control*" in await looker.say("do ready\n")
            wrong = await Client.at(door, "Token: $", "")
            wrong.writer.write(b"guess\n" * TOKEN_TRIES)
            async with asyncio.timeout(WAIT):
                heard = (await wrong.reader.read()).decode()
            assert heard.count("*Invalid token*") == TOKEN_TRIES

    live(scenario())


GET = b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n"
POST = b"POST / HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: 28\r\n\r\n"
FOREIGN = {
    "get": GET,
    "post": POST,
    "any method": b"BREW coffee HTCPCP/1.0\r\n",
    "lower case": b"propfind /x http/1.1\r\n",
    "a whole url": b"GET http://127.0.0.1/ HTTP/1.1\r\n",
    "connect": b"CONNECT 127.0.0.1:80 HTTP/1.1\r\n",
    "http 2": b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n",
    "old": b"GET /\r\n",
    "after empty lines": b"\r\n\n\r\n" + GET,
    "spaces first": b"  " + GET,
    "a header": b"Host: 127.0.0.1\r\n",
    "a header without a space": b"X-Requested-With:x\r\n",
    "after a wrong token": b"guess\r\n" + POST,
    "no end of line": b"GET / HTTP/1.1",
    "tls": b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03",
}


@pytest.mark.parametrize("size", [1, 1000])
@pytest.mark.parametrize("kind", FOREIGN)
def test_t06_what_is_http_or_tls_is_hung_up_on_and_moves_nothing(tmp_path, kind, size):
    """Whatever it says next: the lines of its body, even the right token."""

    async def scenario():
        async with door_here(tmp_path) as door:
            before = door.engine.timeline
            client = await Client.at(door, "Token: $", "")
            for k in range(0, len(FOREIGN[kind]), size):
                client.writer.write(FOREIGN[kind][k : k + size])
                await asyncio.sleep(0)
            with contextlib.suppress(OSError):
                async with asyncio.timeout(WAIT):
                    assert b"." not in await client.reader.read()
            late = await Client.at(door, "Token: $", "")
            late.writer.write(FOREIGN[kind] + b"\r\nsecret\r\nSPEED 50\r\nDO DRIVE 1, 60, 100\r\n")
            with contextlib.suppress(OSError):
                async with asyncio.timeout(WAIT):
                    await late.reader.read()
            await (await Client.at(door)).say("where\n")
            assert door.engine.timeline is before

    live(scenario())


def test_a_program_may_send_its_token_and_all_that_it_wants_at_once(tmp_path):
    async def scenario():
        async with door_here(tmp_path) as door:
            client = await Client.at(door, "", "")
            client.writer.write(b"\r\nsecret\r\nedit a\r\ntype /c1, 7\r\ne\r\nexecute a\r\ndo x = 3\r\nlistr")
            client.writer.write_eof()
            async with asyncio.timeout(WAIT):
                heard = (await client.reader.read()).decode()
            assert "x = 3" in heard
            assert " 7\r\n" in heard

    live(scenario())


def test_idle_connections_keep_nobody_out_and_end(tmp_path, monkeypatch):
    from interfaces.val2 import tcp

    monkeypatch.setattr(tcp, "TOKEN_TIMEOUT", 0.5)
    monkeypatch.setattr(tcp, "MOST_UNAUTHENTICATED", 20)

    async def scenario():
        async with door_here(tmp_path) as door:
            idle = [await Client.at(door, "Token: $", "") for _ in range(30)]
            assert "919.85" in await (await Client.at(door)).say("where\n")
            async with asyncio.timeout(WAIT):
                for client in idle:
                    with contextlib.suppress(OSError):
                        client.writer.write(b"\r\n")
                        assert await client.reader.read() == b""
            assert len(door.terminals) == 1
            assert door.unauthenticated == 0

    live(scenario())


# A whole server.


def test_a_port_that_is_taken_is_one_line_and_exit_code_2():
    with socket.create_server(("127.0.0.1", 0)) as taken:
        done = subprocess.run(
            [sys.executable, "-m", "interfaces.cli", "serve", "--port", "0",
             "--val-port", str(taken.getsockname()[1])],
            capture_output=True, text=True, timeout=WAIT, check=False,
            env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)},
        )  # fmt: skip
    assert done.returncode == 2
    assert len(done.stderr.splitlines()) == 1


def test_a_server_with_a_port_for_val(tmp_path):
    process = subprocess.Popen(
        [sys.executable, "-m", "interfaces.cli", "serve", "--port", "0", "--val-port", "0", "--body", "exact",
         "--link-loss", "hold",
         "--val-files", str(tmp_path), "--until-eof"],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True,
        env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)},
    )  # fmt: skip
    try:
        said = [process.stdout.readline() for _ in range(4)]
        found = re.search(r"VAL-II on 127\.0\.0\.1 port (\d+)", said[2])
        assert found, said
        token = said[3].split()[-1]
        with socket.create_connection(("127.0.0.1", int(found[1])), timeout=WAIT) as client:
            client.settimeout(WAIT)

            def say(text):
                client.sendall(text.encode())
                heard = ""
                while not heard.endswith("."):
                    data = client.recv(65536)
                    assert data, heard
                    heard += data.decode()
                return heard

            assert client.recv(64) == b"Token: "
            assert "VAL-II" in say(f"{token}\r\n")
            assert "*" not in say("do ready\r\n")
            heard = say("where\r\n")
            for text in ("-20.30", "150.05", "919.85", "90.000", "-90.000"):
                assert text in heard, heard
            assert "-20.30" in heard
            assert "X/JT1" in say("where real\r\n")
            say("edit go\r\nmove trans(400,0,200,90,0,0)\r\nready\r\ne\r\n")
            say("store go\r\n")
            assert (tmp_path / "go.v2").read_text().startswith(".PROGRAM go")
        process.stdin.close()
        assert process.wait(timeout=WAIT) == 0
    finally:
        if process.poll() is None:
            process.send_signal(signal.SIGKILL)
            process.wait()
        process.stdout.close()
