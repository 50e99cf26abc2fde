"""The command that runs the proxy: what it may be told, and how it ends."""

from __future__ import annotations

import json
import os
import signal
import socket
import subprocess
import sys

import pytest

from interfaces.cli.main import exit_status
from interfaces.link.proxy import Address, parse_address
from vrs.errors import InvalidValueError

LIMIT = 20.0
"""Longest wait for anything [s]."""


def test_addresses():
    assert parse_address("--to", "80") == Address("127.0.0.1", 80)
    assert parse_address("--to", "robot.example:80") == Address("robot.example", 80)
    assert str(parse_address("--to", "[::1]:80")) == "[::1]:80"
    for text in (
        "",
        ":",
        ":80",
        "host:",
        "host",
        "a:b:80",
        "::1:80",
        "host:99999",
        "-1",
        "1.5",
        "h ost:80",
        "８０",
    ):
        with pytest.raises(InvalidValueError, match="--to must be PORT, HOST:PORT"):
            parse_address("--to", text)


def command(*arguments):
    return subprocess.Popen(
        [sys.executable, "-c", "from interfaces.cli import main; main()", "link", *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=dict(os.environ),
    )


@pytest.mark.parametrize(("number", "as_json"), [(signal.SIGINT, True), (signal.SIGTERM, False)])
def test_the_command_passes_both_transports_and_ends_cleanly(number, as_json):
    with socket.create_server(("127.0.0.1", 0)) as server, socket.socket(type=socket.SOCK_DGRAM) as udp_server:
        port = server.getsockname()[1]
        udp_server.bind(("127.0.0.1", port))
        process = command(
            "--listen", "0", "--to", f"localhost:{port}", "--delay", "constant:0.02", "--delay-back", "none",
            "--seed", "7", *(["--json"] if as_json else []),
        )  # fmt: skip
        try:
            line = process.stderr.readline()
            assert line.startswith("vrs: link listens on 127.0.0.1:"), line
            address = ("127.0.0.1", int(line.split("127.0.0.1:")[1].split()[0]))
            server.settimeout(LIMIT)
            udp_server.settimeout(LIMIT)
            with socket.create_connection(address, LIMIT) as client:
                client.sendall(b"tcp")
                accepted, _ = server.accept()
                with accepted:
                    accepted.settimeout(LIMIT)
                    assert accepted.recv(3) == b"tcp"
            with socket.socket(type=socket.SOCK_DGRAM) as client:
                client.sendto(b"udp", address)
                assert udp_server.recv(9) == b"udp"
            process.send_signal(number)
            out, err = process.communicate(timeout=LIMIT)
        finally:
            process.kill()
            process.wait()
    assert (process.returncode, err) == (0, "")
    if as_json:
        value = json.loads(out)
        assert (value["schema"], value["seed"], value["listen"]) == ("vrs-link/1", 7, f"127.0.0.1:{address[1]}")
        assert value["udp"]["forward"]["sent"] == value["udp"]["forward"]["arrived"] == 1
        assert value["tcp"]["forward"]["delay_min"] == pytest.approx(0.02)
    else:
        assert "udp forward  1 sent, 1 arrived, 0 lost" in out


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"--listen": "soon"}, "--listen must be PORT"), ({"--to": "nobody"}, "--to must be PORT"),
        ({"--to": "0"}, "other than 0"), ({"--delay": "thu@x"}, "@TAU"), ({"--loss": "2"}, "burst:P,N"),
        ({"--duplicate": "2"}, "--duplicate"), ({"--duplicate": "nan"}, "duplicate"), ({"--queue": "0"}, "--queue"),
        ({"--bandwidth": "0"}, "--bandwidth"), ({"--transport": "pigeon"}, "--transport"),
        ({"--delay": "trace:/missing"}, "can't be read"), ({"--seed": "-1"}, "--seed"),
        ({"--listen": "9"}, "another address"),
        ({"--clients": "0"}, "--clients"), ({"--idle": "nan"}, "idle"), ({"--reorder-by": "-1"}, "--reorder-by"),
        ({"--to": "nowhere.invalid:1"}, "can be resolved"), ({"--listen": "nowhere.invalid:1"}, "can be resolved"),
    ],
)  # fmt: skip
def test_bad_input_is_one_line_and_exit_2(capsys, changes, said):
    options = {"--listen": "0", "--to": "9", "--delay": "none"} | changes
    assert exit_status(["link", *(part for option in options.items() for part in option)]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.count("\n") == 1
    assert captured.err.startswith("vrs: ")
    assert said in captured.err


def test_a_taken_port_is_one_line_and_exit_2(capsys):
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = str(taken.getsockname()[1])
        assert exit_status(["link", "--listen", port, "--to", "9", "--delay", "none"]) == 2
    assert "--listen must be an address that this machine can listen on (Address already in use)" in (
        capsys.readouterr().err
    )
