"""MeshCat's geometry and command classes without its door, which loads ZMQ, tornado and a deprecated event loop."""

from __future__ import annotations

import importlib
import sys
from functools import lru_cache
from importlib.util import find_spec
from types import ModuleType
from typing import Any

from vrs.errors import FormatError

ALIAS = "_meshcat_without_its_door"
"""Name under which the package is known here; `import meshcat` stays what it is."""


@lru_cache(maxsize=8)
def module(name: str) -> Any:
    """Load a module of MeshCat: `geometry`, `commands` or `path`.

    Raises:
        FormatError: If MeshCat isn't installed.
    """
    spec = find_spec("meshcat")
    if spec is None or spec.submodule_search_locations is None:
        raise FormatError("meshcat", "not installed; the 3D view is its viewer")
    if ALIAS not in sys.modules:
        package = ModuleType(ALIAS)
        package.__path__ = list(spec.submodule_search_locations)
        sys.modules[ALIAS] = package
    return importlib.import_module(f"{ALIAS}.{name}")
