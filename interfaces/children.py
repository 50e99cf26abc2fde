"""Child processes that run our own modules."""

from __future__ import annotations

import os
import sys


def module_process(module: str, *arguments: str) -> tuple[list[str], dict[str, str]]:
    """Command line and environment of a process that runs a module, and imports what this one would.

    Args:
        module: Its dotted name.
        arguments: What it's given.
    """
    path = os.pathsep.join(entry or os.getcwd() for entry in sys.path)
    return [sys.executable, "-P", "-m", module, *arguments], os.environ | {"PYTHONPATH": path}
