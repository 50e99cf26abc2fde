"""What's wrong with a recording: writing that failed, and what is missing from a file."""

from __future__ import annotations

from dataclasses import dataclass

from vrs.errors import VrsError


class RecordingError(VrsError):
    """What was to be recorded can't be written any more: a full disk, a file taken away, a wrong order of calls."""

    def __init__(self, where: str, problem: str) -> None:
        self.where, self.problem = where, problem
        super().__init__(f"recording failed: {where}: {problem}")


@dataclass(frozen=True, slots=True)
class Damage:
    """What is missing; false where nothing is."""

    cut: bool = False
    """Whether the recording wasn't closed in order: nothing is known from its last moment on."""
    until: float = 0.0
    """The last moment that's known [s]."""
    blocks: int = 0
    """Blocks of up to a quarter of a second that were destroyed, as far as they could be counted."""
    spans: tuple[tuple[float, float], ...] = ()
    """When that was [s]: between these times messages may be missing; far in the future where nothing follows."""
    marred: bool = False
    """Whether a checksum or the index is wrong although nothing is missing."""

    def __bool__(self) -> bool:
        return self.cut or self.blocks > 0

    def __str__(self) -> str:
        said = []
        if self.cut:
            said.append(f"cut: nothing is known after {self.until:.3f} s")
        if self.blocks:
            some = ", ".join(f"{first:.3f} to {last:.3f} s" for first, last in self.spans[:3])
            more = f" and {len(self.spans) - 3} more" if len(self.spans) > 3 else ""
            said.append(f"{self.blocks} block{'s' * (self.blocks > 1)} lost ({some}{more})")
        if self.marred and not said:
            said.append("a checksum or the index is wrong, but nothing is missing")
        return "; ".join(said) or "none"
