"""An operator who commands a robot, and kills or stops the operator's site in the midst of it, or itself."""

from __future__ import annotations

import os
import signal
import sys
import time

from interfaces import connect
from interfaces.messages.control import Lease
from robots.puma560.parameters import POSES
from vrs import Insertion, JointTarget, MotionCommand

TARGETS = ((0.0, 0.8, -2.4, 0.0, 0.6, 0.0), (0.5, 0.6, -2.0, 0.3, 0.4, 0.6), POSES["ready"], POSES["nominal"])


def main(url: str, pid: int, wait: float, number: int) -> None:
    """Command moves, and send a process a signal after a time [s]: this one, where the process is 0.

    To one that is stopped by that more commands are sent.
    """
    with connect(url) as client:
        assert isinstance(client.acquire(), Lease)
        assert client.wait(lambda r: r.state is not None and not r.state.halted and r.state.connected, 20.0)
        for q in TARGETS * 3:
            client.designer.issue(MotionCommand(JointTarget(q), insertion=Insertion.APPEND), wait=5.0)
        time.sleep(wait)
        if not pid:
            _say()
        os.kill(pid or os.getpid(), number)
        if pid:
            _say()
        for q in TARGETS if number == signal.SIGSTOP else ():
            client.designer.issue(MotionCommand(JointTarget(q)))
            time.sleep(0.3)


def _say() -> None:
    """That the signal is sent, and when by the machine's monotonic counter [s]."""
    sys.stdout.write(f"sent {time.monotonic()!r}\n")
    sys.stdout.flush()


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]), float(sys.argv[3]), int(sys.argv[4]))
