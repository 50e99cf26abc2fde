"""Records at 60 Hz by the wall clock and says what is acknowledged, in processes that are killed.

A line of standard input names a file; a child records into it. Its process id is the line that comes back, followed
by a line for each message: how many are acknowledged, how many were put, and the time of the newest [s].
"""

from __future__ import annotations

import os
import sys
import time
from pathlib import Path

from interfaces.recording import Recorder
from tests.interfaces.recording import recorded


def say(*words: object) -> None:
    os.write(1, (" ".join(map(str, words)) + "\n").encode())


def record(path: Path) -> None:
    recorder = Recorder(path, recorded.begin())
    say(os.getpid())
    start, k = time.monotonic(), 0
    while time.monotonic() < start + 30.0:
        time.sleep(max(0.0, start + k * recorded.STEP - time.monotonic()))
        recorder.put(recorded.sample(k), t=k * recorded.STEP)
        k += 1
        say(recorder.acknowledged, k, (k - 1) * recorded.STEP)


def main() -> None:
    for line in sys.stdin:
        child = os.fork()
        if not child:
            record(Path(line.strip()))
            os._exit(0)
        os.waitpid(child, 0)
        say("dead")


if __name__ == "__main__":
    main()
