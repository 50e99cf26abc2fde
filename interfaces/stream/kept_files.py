"""What a browser is served: headers of pages, and files that it keeps and asks whether they're still the same."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

from starlette.requests import Request
from starlette.responses import Response

POLICY: Final = (
    "default-src 'none'; script-src 'self'{scripts}; style-src 'self' 'unsafe-inline'; img-src 'self' data: blob:; "
    "font-src 'self'; connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
"""Nothing from elsewhere, and no script in the page but those that the server put there."""
HEADERS: Final = {
    "Content-Security-Policy": POLICY.format(scripts=""),
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cache-Control": "no-cache",
}


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
