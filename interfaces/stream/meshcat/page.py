"""The page `/view`, and `/meshcat`, its WebSocket: a thin shell round a `TwinScene`."""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Sequence
from functools import lru_cache
from importlib import resources
from typing import Final

from starlette.requests import HTTPConnection, Request
from starlette.responses import Response
from starlette.routing import BaseRoute, Route, WebSocketRoute

from interfaces.clients.appearance import viewer_bundle
from interfaces.stream.kept_files import KeptFile
from interfaces.stream.meshcat.twins import TwinScene
from interfaces.stream.meshcat.viewers import Viewers

HEADERS: Final = {
    "Content-Security-Policy": (
        "default-src 'none'; script-src 'self'; style-src 'self' 'unsafe-inline'; img-src data: blob:; "
        "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'self'"
    ),
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cache-Control": "no-cache",
}
PARTS: Final = ("meshcat.js", "scene.js", "licences.txt")
"""What every page with a 3D view needs."""
_TYPES: Final = {".html": "text/html", ".css": "text/css", ".js": "text/javascript", ".txt": "text/plain"}


def routes(
    scene: TwinScene,
    *,
    admit: Callable[[HTTPConnection], bool] | None = None,
    authorize: Callable[[str | None], bool] | None = None,
) -> list[BaseRoute]:
    """Make the routes of the page, of its files and of the WebSocket.

    Args:
        scene: What all viewers see.
        admit: Whether a WebSocket may be opened, by its headers; None for this server's own pages, and programs.
        authorize: Whether a token lets a viewer in; None lets all in.
    """
    viewers = Viewers(scene, admit, authorize)
    return [*files("view", "interfaces.stream"), WebSocketRoute("/meshcat", viewers.serve)]


def files(page: str, package: str, scripts: Sequence[str] = ()) -> list[BaseRoute]:
    """The routes of a page: `/PAGE` is its HTML, and below it are its scripts, its style and `PARTS`.

    Args:
        page: Name of the page, and of its files in the package's `static`.
        package: Where those are.
        scripts: What more it needs of there.
    """
    own = dict.fromkeys((f"{page}.html", f"{page}.css", f"{page}.js", *scripts), package)
    known = own | dict.fromkeys(PARTS, "interfaces.stream")

    async def whole(request: Request) -> Response:
        return _answer(request, known, f"{page}.html")

    async def part(request: Request) -> Response:
        return _answer(request, known, request.path_params["name"])

    handlers: list[tuple[str, Callable[[Request], Awaitable[Response]]]]
    handlers = [(f"/{page}", whole), (f"/{page}/{{name}}", part)]
    return [Route(path, handler) for path, handler in handlers]


def _answer(request: Request, known: dict[str, str], name: str) -> Response:
    if name not in known:
        return Response("not here", 404, HEADERS, "text/plain")
    return _file(known[name], name).answer(request, _TYPES[name[name.rindex(".") :]], HEADERS)


@lru_cache(maxsize=16)
def _file(package: str, name: str) -> KeptFile:
    if name in ("meshcat.js", "licences.txt"):
        content = viewer_bundle()[name == "licences.txt"].encode()
    else:
        content = resources.files(package).joinpath(f"static/{name}").read_bytes()
    return KeptFile.of(content)
