"""Python imports this at its start where this folder is in PYTHONPATH: notes which of our functions are entered.

`benchmarks.entered` sets VRS_ENTERED to a folder with a file `phase` of one byte. While that's 0 nothing is noted.
Else each run of ours that begins in the phase is a line of JSON in a file of this process once it returns: the
phase, and the functions that the run entered. A run's first function is one that no other of ours in the same
phase has called: what an event loop calls, or the turn of a loop that was there before.
"""

from __future__ import annotations

import json
import mmap
import os
import sys
import threading
from pathlib import Path
from types import CodeType, FrameType
from typing import Any

_HOME = Path(__file__).resolve().parents[2]
_OURS = tuple(f"{_HOME / name}{os.sep}" for name in ("vrs", "robots", "interfaces"))
_FUNCTION = 3
"""Flags of a function's code, which neither a module's nor a class's has."""


def _process() -> str:
    """What this process is called: the module that it runs, the command, and its number."""
    words = sys.orig_argv
    named = words[words.index("-m") + 1 :][:2] if "-m" in words else words[:1]
    return f"{'-'.join(word.rpartition('.')[2] for word in named)}-{os.getpid()}"


class _Notes:
    """What the threads of this process enter."""

    def __init__(self, folder: Path) -> None:
        with (folder / "phase").open("rb") as file:
            self._phase = mmap.mmap(file.fileno(), 1, access=mmap.ACCESS_READ)
        self._file = (folder / f"{_process()}.jsonl").open("w", encoding="utf-8", buffering=1)
        self._names: dict[CodeType, str] = {}
        self._noted: set[tuple[int, frozenset[str]]] = set()
        self._here = threading.local()

    def _name(self, code: CodeType) -> str:
        name = ""
        if code.co_filename.startswith(_OURS) and code.co_flags & _FUNCTION == _FUNCTION:
            name = f"{Path(code.co_filename).relative_to(_HOME)}:{code.co_qualname}"
        self._names[code] = name
        return name

    def __call__(self, frame: FrameType, event: str, _: Any) -> None:
        if event not in {"call", "return"}:
            return
        code = frame.f_code
        name = self._names.get(code)
        if name is None:
            name = self._name(code)
        if not name:
            return
        try:
            stack = self._here.stack
        except AttributeError:
            stack = self._here.stack = []
        if event == "call":
            phase = self._phase[0]
            if stack and stack[-1][0] == phase:
                entered = stack[-1][1]
                stack.append((phase, entered, False))
            else:
                entered = set()
                stack.append((phase, entered, True))
            entered.add(name)
        elif stack:
            phase, entered, first = stack.pop()
            if first and phase and (run := (phase, frozenset(entered))) not in self._noted:
                self._noted.add(run)
                self._file.write(json.dumps([phase, sorted(entered)]) + "\n")


if "VRS_ENTERED" in os.environ:
    _notes = _Notes(Path(os.environ["VRS_ENTERED"]))
    threading.setprofile(_notes)
    sys.setprofile(_notes)
