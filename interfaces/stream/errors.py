"""The one error of the wire."""

from __future__ import annotations

from interfaces.stream.control import ProblemCode
from vrs.errors import FormatError


class ProtocolError(FormatError):
    """Bytes that are no message, or none that may come here: the sender's fault, and nothing has changed."""

    def __init__(self, code: ProblemCode, text: str) -> None:
        self.code, self.text = code, text
        super().__init__("message", f"{text} ({code})")
