"""A server's loop isn't stopped by long passes of the garbage collector while somebody has control."""

from __future__ import annotations

import subprocess
import sys

QUIET = """
import asyncio, gc, weakref
from interfaces.cli import options

class Cycle:
    def __init__(self):
        self.me = self

long = []
gc.callbacks.append(lambda phase, facts: long.append(phase) if facts["generation"] == 2 else None)
options.LEISURE = 0.01
if {quiet}:
    options.keep_quiet()
    long.clear()
old = [[{{}}] for _ in range(300_000)]
print(len(long) == 0)

async def main():
    held = True
    tidying = asyncio.create_task(options.collect_at_leisure(lambda: not held))
    one = Cycle()
    there = weakref.ref(one)
    del one
    young = [[{{}}] for _ in range(300_000)]
    await asyncio.sleep(0.1)
    print(len(long) == 0)
    held = False
    async with asyncio.timeout(20):
        while not long or there() is not None:
            await asyncio.sleep(0.01)
    tidying.cancel()

asyncio.run(main())
"""


def said(*, quiet: bool) -> list[str]:
    code = QUIET.format(quiet=quiet)
    return subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()


def test_old_objects_are_looked_at_when_nobody_has_control() -> None:
    assert said(quiet=True) == ["True", "True"]


def test_they_would_be_looked_at_in_between_without_that() -> None:
    assert said(quiet=False)[0] == "False"
