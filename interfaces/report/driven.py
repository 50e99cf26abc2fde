"""The figures of a mobile robot's run, as they're shown to people."""

from __future__ import annotations

from typing import Final

FIGURES: Final = (
    ("path_error_mean", "path error, mean", 1e2, "cm"),
    ("path_error_p95", "path error, 95 %", 1e2, "cm"),
    ("path_error_max", "path error, max", 1e2, "cm"),
    ("time_difference_mean", "time difference, mean", 1.0, "s"),
    ("time_difference_sd", "time difference, sd", 1.0, "s"),
    ("time_difference_max", "time difference, max", 1.0, "s"),
    ("time_difference_bound", "time difference, bound", 1.0, "s"),
    ("speed_error", "speed error", 1e2, "cm/s"),
    ("progress", "progress", 1e2, "%"),
    ("collisions", "collisions", 1.0, ""),
    ("limits_passed", "limits passed", 1.0, ""),
    ("sent_bytes", "bytes sent", 1.0, ""),
    ("longest_delay", "longest delay", 1.0, "s"),
)
"""Name in a summary, name for people, factor and unit (none: a count)."""


def shown(value: float | None, scale: float, unit: str) -> str:
    """A value in its unit; without one it's a count."""
    if value is None:
        return "undefined"
    return f"{scale * value:z.3f}" if unit else f"{value:z.0f}"
