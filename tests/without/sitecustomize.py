"""Hides modules named in VRS_WITHOUT from this process, as if they weren't installed.

`tests/conftest.py` puts this folder first on PYTHONPATH, so that processes which tests start hide them too.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from importlib.machinery import ModuleSpec, PathFinder
from types import ModuleType
from typing import Any

HIDDEN = frozenset(os.environ.get("VRS_WITHOUT", "").split(",")) - {""}
_find_spec = PathFinder.find_spec


def _unless_hidden(
    _finder: type[PathFinder], name: str, path: Sequence[str] | None = None, target: ModuleType | None = None
) -> ModuleSpec | None:
    return None if name.partition(".")[0] in HIDDEN else _find_spec(name, path, target)


if HIDDEN:
    finder: Any = PathFinder
    finder.find_spec = classmethod(_unless_hidden)
