"""Getting ahead of other processes: a robot's body, and its site."""

from __future__ import annotations

import os
import resource
import signal
from contextlib import suppress
from pathlib import Path

NICE = -10
"""Niceness to ask for where there's no real-time priority."""
OWN_TIME = 0.5
"""Processor time without a rest [s] after which it gives up its real-time priority, to leave the machine usable."""


def hasten(priority: int) -> bool:
    """Get ahead of other processes, as far as that's allowed; returns whether with real-time priority.

    Niceness alone doesn't do: with one task a session group, Linux weighs it inside the group only.

    Args:
        priority: Among real-time processes, from 1; the higher one goes first.
    """
    try:
        signal.signal(signal.SIGXCPU, lambda *_: os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0)))
        _, hard = resource.getrlimit(resource.RLIMIT_RTTIME)
        resource.setrlimit(resource.RLIMIT_RTTIME, (round(OWN_TIME * 1e6), hard))
        os.sched_setscheduler(0, os.SCHED_RR | os.SCHED_RESET_ON_FORK, os.sched_param(priority))
    except (OSError, ValueError):
        with suppress(OSError):
            os.nice(NICE)
            Path("/proc/self/autogroup").write_text(str(NICE), encoding="ascii")
        return False
    return True
