"""Files that a browser keeps, and asks whether they're still the same."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass

from starlette.requests import Request
from starlette.responses import Response


@dataclass(frozen=True, slots=True)
class KeptFile:
    """A file, and what its version is known by."""

    content: bytes
    tag: str

    @classmethod
    def of(cls, content: bytes) -> KeptFile:
        """A file of these bytes."""
        return cls(content, f'"{hashlib.sha256(content).hexdigest()[:32]}"')

    def answer(self, request: Request, kind: str, headers: Mapping[str, str]) -> Response:
        """What a browser gets that asks for it: the bytes, unless it has them.

        Args:
            request: What it asks.
            kind: Media type.
            headers: Of every answer.
        """
        given = {**headers, "ETag": self.tag}
        if request.headers.get("if-none-match") == self.tag:
            return Response(None, 304, given)
        return Response(self.content, 200, given, kind)
