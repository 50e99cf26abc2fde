"""Both robots in MeshCat's viewer, for many viewers at once."""

from __future__ import annotations

from interfaces.stream.meshcat.committed import Committed
from interfaces.stream.meshcat.scene import TwinScene

__all__ = ["Committed", "TwinScene"]
