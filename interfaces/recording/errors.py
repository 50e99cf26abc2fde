"""The one error of writing a recording; reading raises `vrs.errors.FormatError`."""

from __future__ import annotations

from vrs.errors import VrsError


class RecordingError(VrsError):
    """What was to be recorded can't be written any more: a full disk, a file taken away, a wrong order of calls."""

    def __init__(self, where: str, problem: str) -> None:
        self.where, self.problem = where, problem
        super().__init__(f"recording failed: {where}: {problem}")
