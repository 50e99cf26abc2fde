"""Every benchmark: `python -m benchmarks NAME ...` prints some or all, `--write` writes RESULTS.md from all."""

from __future__ import annotations

import argparse
import importlib
import sys
import time
from pathlib import Path

from benchmarks import machine, page
from benchmarks.running import run

PARTS = (
    "sampling", "past", "commands", "edits", "straight", "hand", "memory", "kinematics", "twins", "physics", "wire",
    "val2", "recording", "mobile", "localization", "rsp", "middleware", "availability",
)  # fmt: skip
"""Benchmarks that give results."""
DETAILS = (
    "timeline", "planning", "lines", "steering", "viewers", "alike", "steady", "station", "camera", "recordings",
    "entered", "altering", "classroom", "inverse", "datagrams", "fleet", "cluster", "relays",
)  # fmt: skip
"""Benchmarks that print more about one thing."""


def main(words: list[str]) -> int:
    """Run what the command line asks for."""
    parser = argparse.ArgumentParser(prog="benchmarks", description=__doc__)
    names = [*PARTS, *DETAILS]
    parser.add_argument("name", nargs="*", help=f"{', '.join(PARTS)} (all by default), {', '.join(DETAILS)}")
    parser.add_argument("--write", action="store_true", help=f"write {page.PAGE}, its plots and {page.DATA}")
    parser.add_argument("--seconds", type=float, metavar="S", help="how long each run of recordings lasts (300)")
    asked = parser.parse_args(words)
    unknown = [name for name in asked.name if name not in names]
    if unknown:
        parser.error(f"unknown {', '.join(unknown)}; there are {', '.join(names)}")
    if asked.write and asked.name:
        parser.error("--write runs everything: name nothing")
    if asked.seconds is not None and "recordings" not in asked.name:
        parser.error("--seconds is of recordings")
    for name in asked.name:
        if name in DETAILS:
            options = () if asked.seconds is None or name != "recordings" else (asked.seconds,)
            importlib.import_module(f"benchmarks.{name}").main(*options)
    parts = [name for name in asked.name or PARTS if name in PARTS]
    facts, start = machine.facts(), time.monotonic()
    found = run(parts)
    if asked.write:
        print(page.write(found, facts, (time.monotonic() - start) / 60, Path(__file__).parent))
    return any(isinstance(part, str) for part in found.values())


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
