"""The station's own scripts and style: what is in `static/`, and the reader of the stream."""

from __future__ import annotations

from functools import lru_cache
from importlib import resources
from typing import Final

from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import Route

from interfaces.stream.server import HEADERS, KeptFile

_TYPES: Final = {"css": "text/css", "js": "text/javascript"}
_READER: Final = "vrs.js"
_TERMINAL: Final = {"xterm.js": "index.js", "xterm.css": "xterm.css"}
"""What NiceGUI has of xterm.js, by the names under which it's served here."""


@lru_cache(maxsize=1)
def names() -> frozenset[str]:
    """What is served below `/station/`."""
    own = resources.files("interfaces.station").joinpath("static").iterdir()
    return frozenset({_READER, *_TERMINAL, *(file.name for file in own if file.name.rpartition(".")[2] in _TYPES)})


def route() -> Route:
    """The route of the files."""
    return Route("/station/{name}", _answer)


async def _answer(request: Request) -> Response:
    name = request.path_params["name"]
    if name not in names():
        return Response("not here", 404, HEADERS, "text/plain")
    return _file(name).answer(request, _TYPES[name.rpartition(".")[2]], HEADERS)


@lru_cache(maxsize=64)
def _file(name: str) -> KeptFile:
    if name in _TERMINAL:
        content = resources.files("nicegui").joinpath(f"elements/xterm/dist/{_TERMINAL[name]}").read_bytes()
    else:
        package = "interfaces.stream" if name == _READER else "interfaces.station"
        content = resources.files(package).joinpath(f"static/{name}").read_bytes()
    return KeptFile.of(content)
