"""What this program calls itself: in recordings, to other programs and to people."""

from __future__ import annotations

from importlib import metadata


def software() -> str:
    """Name and version of this program."""
    return f"vrs-teleop {metadata.version('vrs-teleop')}"
