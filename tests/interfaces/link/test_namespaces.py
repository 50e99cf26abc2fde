"""The proxy between two network namespaces joined by a veth pair, as between two machines."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import uuid
from contextlib import ExitStack

import pytest

LIMIT = 30.0
"""Longest wait for anything [s]."""
ROBOT = "10.213.57.2"
"""The robot's address; it exists in the namespaces alone."""

SERVER = """
import socket, sys
tcp = socket.create_server((sys.argv[1], 0))
udp = socket.socket(type=socket.SOCK_DGRAM)
udp.bind(tcp.getsockname())
for sock in (tcp, udp):
    sock.settimeout(30)
print(tcp.getsockname()[1], flush=True)
connection, (host, _) = tcp.accept()
connection.settimeout(30)
while data := connection.recv(65536):
    connection.sendall(data)
connection.close()
data, address = udp.recvfrom(65535)
udp.sendto(data + host.encode(), address)
"""
CLIENT = """
import json, socket, sys, time
address = ("127.0.0.1", int(sys.argv[1]))
tcp = socket.create_connection(address, 30)
began = time.monotonic()
tcp.sendall(b"x" * 50_000)
tcp.shutdown(socket.SHUT_WR)
got = 0
while data := tcp.recv(65536):
    got += len(data)
stream = time.monotonic() - began
udp = socket.socket(type=socket.SOCK_DGRAM)
udp.settimeout(30)
began = time.monotonic()
udp.sendto(b"from ", address)
answer = udp.recv(100).decode()
print(json.dumps({"got": got, "stream": stream, "answer": answer, "datagram": time.monotonic() - began}))
"""


def ip(*arguments):
    return subprocess.run(["ip", *arguments], capture_output=True, text=True, timeout=LIMIT, check=False)


@pytest.fixture
def namespaces():
    """Two namespaces with a cable between them; whatever happens, nothing of it stays."""
    if shutil.which("ip") is None or not hasattr(os, "geteuid") or os.geteuid() != 0:
        pytest.skip("network namespaces need root and the program ip")
    tag = uuid.uuid4().hex[:6]
    operator, robot = f"vrs-o-{tag}", f"vrs-r-{tag}"
    with ExitStack() as undo:
        for name in (operator, robot):
            made = ip("netns", "add", name)
            if made.returncode != 0:
                pytest.skip(f"network namespaces can't be made here: {made.stderr.strip()}")
            undo.callback(ip, "netns", "del", name)
        steps = (
            (
                "link",
                "add",
                f"vo{tag}",
                "netns",
                operator,
                "type",
                "veth",
                "peer",
                "name",
                f"vr{tag}",
                "netns",
                robot,
            ),
            ("-n", operator, "addr", "add", "10.213.57.1/30", "dev", f"vo{tag}"),
            ("-n", robot, "addr", "add", f"{ROBOT}/30", "dev", f"vr{tag}"),
            ("-n", operator, "link", "set", f"vo{tag}", "up"),
            ("-n", robot, "link", "set", f"vr{tag}", "up"),
            ("-n", operator, "link", "set", "lo", "up"),
        )
        for step in steps:
            done = ip(*step)
            if done.returncode != 0:
                pytest.skip(f"namespaces can't be joined here: {done.stderr.strip()}")
        yield operator, robot
    assert tag not in ip("netns", "list").stdout


def start(namespace, *command):
    return subprocess.Popen(
        ["ip", "netns", "exec", namespace, sys.executable, "-c", *command],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def test_tcp_and_udp_between_two_namespaces(namespaces):
    operator, robot = namespaces
    with ExitStack() as undo:

        def run(*command):
            process = undo.enter_context(start(*command))
            undo.callback(process.kill)
            return process

        server = run(robot, SERVER, ROBOT)
        port = server.stdout.readline().strip()
        proxy = run(
            operator, "from interfaces.cli import main; main()", "link",
            "--listen", "0", "--to", f"{ROBOT}:{port}", "--delay", "constant:0.05",
        )  # fmt: skip
        line = proxy.stderr.readline()
        assert "listens on 127.0.0.1:" in line
        client = run(operator, CLIENT, line.split("127.0.0.1:")[1].split()[0])
        out, err = client.communicate(timeout=LIMIT)
        assert client.returncode == 0, err
        seen = json.loads(out)
        assert seen["got"] == 50_000
        assert seen["stream"] >= 0.1
        assert seen["answer"] == "from 10.213.57.1"
        assert seen["datagram"] >= 0.1
        proxy.terminate()
        out, err = proxy.communicate(timeout=LIMIT)
        assert proxy.returncode == 0, err
        assert "tcp forward" in out
        assert server.wait(timeout=LIMIT) == 0
