"""Builds the container's image and looks at it from the host: who gets in, whether both arms move, how it ends.

It needs docker or podman, and some five minutes: `.venv/bin/python .ci/container.py`.
"""

from __future__ import annotations

import hashlib
import shutil
import ssl
import subprocess
import sys
import time
import uuid
from pathlib import Path
from urllib.request import urlopen

import numpy as np

from interfaces import connect
from robots import puma560
from vrs import JointTarget, MotionCommand

HOME = Path(__file__).resolve().parents[1]

ADDRESS = "127.0.0.1:8600"
"""Where the host finds it."""

STARTED = 60.0
"""How long the server may take to answer [s]."""

ARRIVED = 30.0
"""How long the real arm may take for its move [s]."""


def main() -> int:
    """Build, serve, look; the first thing that doesn't hold ends it."""
    engine = shutil.which("docker") or shutil.which("podman")
    if engine is None:
        sys.exit("docker or podman is needed")

    def run(*words: str) -> str:
        return subprocess.run([engine, *words], check=True, text=True, stdout=subprocess.PIPE).stdout.strip()

    subprocess.run([engine, "build", "--tag", "vrs-teleop", str(HOME)], check=True)
    volume = f"vrs-check-{uuid.uuid4().hex[:8]}"
    container = run("run", "--detach", "--publish", f"{ADDRESS}:8600", "--volume", f"{volume}:/data", "vrs-teleop")
    try:
        _wait_until_served()
        kept = run("exec", container, "cat", "/data/tokens.tls.pem")
        der = ssl.PEM_cert_to_DER_cert(kept[kept.index("-----BEGIN CERTIFICATE-----") :])
        address = f"wss://{ADDRESS}#sha256={hashlib.sha256(der).hexdigest()}"
        _held(_refused(address), "without a token nobody gets in")
        tokens = dict(line.split() for line in run("exec", container, "cat", "/data/tokens").splitlines())
        _held(_moves(address, tokens["operator"]), "with the operator's, both arms move")
        _held(run("exec", container, "id", "-u") != "0", "it doesn't run as root")
        begin = time.monotonic()
        run("kill", "--signal", "TERM", container)
        _held(run("wait", container) == "0", f"told to end, it does: after {time.monotonic() - begin:.1f} s")
    finally:
        run("rm", "--force", container)
        run("volume", "rm", volume)
    return 0


def _held(held: bool, what: str) -> None:
    print(f"{'yes' if held else 'no'}: {what}", flush=True)
    if not held:
        sys.exit(1)


def _wait_until_served() -> None:
    end, context = time.monotonic() + STARTED, ssl._create_unverified_context()  # noqa: S323 - known later
    while True:
        try:
            urlopen(f"https://{ADDRESS}/", timeout=5, context=context).close()
            return
        except OSError:
            if time.monotonic() > end:
                raise
            time.sleep(0.5)


def _refused(address: str) -> bool:
    try:
        connect(address).close()
    except ConnectionError as error:
        return "token" in str(error)
    return False


def _moves(address: str, token: str) -> bool:
    goal = puma560.model().poses["ready"]
    with connect(address, token=token) as robot:
        robot.acquire()
        robot.wait(lambda r: r.state is not None and r.state.connected and not r.state.halted, STARTED)
        receipt = robot.designer.issue(MotionCommand(JointTarget(goal)), wait=5.0).receipt
        assert receipt is not None
        assert receipt.q is not None
        assert np.allclose(receipt.q, goal)
        return robot.wait(lambda r: r.state is not None and bool(np.allclose(r.state.q, goal, atol=0.01)), ARRIVED)


if __name__ == "__main__":
    sys.exit(main())
