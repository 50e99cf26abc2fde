"""The station's page: NiceGUI on the server and loop that are there, its layout, and the panels in it.

Loads NiceGUI: import it where a station is served. NiceGUI is one for a process, and so is the station.
"""

from __future__ import annotations

import contextlib
import json
from collections.abc import AsyncIterator, Iterable, Mapping, Sequence
from functools import lru_cache
from importlib import resources
from typing import Any, Final, get_args

from fastapi import FastAPI
from nicegui import Client, core, ui
from nicegui.element import Element
from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import BaseRoute, Mount, Route

from interfaces.station.bounds import RequestBounds
from interfaces.station.panels import Panel, PanelPlace
from interfaces.stream.server import HEADERS, KeptFile

_TYPES: Final = {"css": "text/css", "js": "text/javascript"}
_READER: Final = frozenset({"vrs.js", "protocol.js"})
"""What the protocol has for pages: its reader, and what checks its messages."""
_TERMINAL: Final = {"xterm.js": "index.js", "xterm.css": "xterm.css"}
"""What NiceGUI has of xterm.js, by the names under which it's served here."""


@lru_cache(maxsize=1)
def names() -> frozenset[str]:
    """What is served below `/station/`."""
    own = resources.files("interfaces.station").joinpath("static").iterdir()
    return frozenset({*_READER, *_TERMINAL, *(file.name for file in own if file.name.rpartition(".")[2] in _TYPES)})


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
        package = "interfaces.stream" if name in _READER else "interfaces.station"
        content = resources.files(package).joinpath(f"static/{name}").read_bytes()
    return KeptFile.of(content)


TITLE: Final = "VRS teleop"
KEEP: Final = 30.0
"""How long the server keeps a page whose connection was lost [s]."""
_HEAD: Final = """
<link rel="stylesheet" href="/station/station.css">
<script defer src="/view/meshcat.js"></script>
<script defer src="/view/scene.js"></script>
<script type="module" src="/station/station.js"></script>
"""


class Station:
    """The page `/` and all that belongs to it. Enter `running` in the loop that serves."""

    def __init__(self, robot: Mapping[str, Any], panels: Sequence[Panel]) -> None:
        """Make the page; nobody sees it yet.

        Args:
            robot: What the panels' scripts are told of it, see `chain.described`.
            panels: What the page has, see `panels_of`.
        """
        listed = [{"name": p.name, "title": p.title, "place": p.place, "icon": p.icon} for p in panels]
        self._boxes = _boxes(panels)
        self._config = json.dumps({"robot": robot, "panels": listed})
        self._app = FastAPI(docs_url=None, redoc_url=None, openapi_url=None)
        core.sio.eio.transports = ["websocket"]
        core.app.config.socket_io_js_transports = ["websocket"]
        ui.page("/", title=TITLE, language="en-US", reconnect_timeout=KEEP)(self._build)
        ui.run_with(
            self._app, title=TITLE, dark=None, tailwind=False, show_welcome_message=False,
            gzip_middleware_factory=None, binding_refresh_interval=None,
        )  # fmt: skip
        self._bounds = RequestBounds(self._app, "/", _make_room)

    @property
    def routes(self) -> list[BaseRoute]:
        """What it answers; to be put after all others, since it takes all that is left."""
        return [route(), Mount("", app=self._bounds)]

    @contextlib.asynccontextmanager
    async def running(self) -> AsyncIterator[Station]:
        """Let NiceGUI run."""
        async with self._app.router.lifespan_context(self._app):
            yield self

    def _build(self) -> None:
        ui.add_head_html(_HEAD)
        # One element of NiceGUI's, for a page of forty takes it as many milliseconds.
        root = Element("div").classes("station")
        root.props["id"] = "station"
        root.props["data-config"] = self._config
        root.props["innerHTML"] = self._boxes


def _boxes(panels: Iterable[Panel]) -> str:
    """The empty boxes that the panels' scripts fill."""
    cards: dict[PanelPlace, str] = dict.fromkeys(get_args(PanelPlace), "")
    for panel in panels:
        inner = _box(f"panel-{panel.name}", f"panel panel-{panel.name}")
        cards[panel.place] += _box(f"card-{panel.name}", "card", inner)
    side = _box("tabs", "tabs") + _box("tab-panels", "tab-panels", cards["side"])
    work = _box("pane-box", "pane-box", cards["pane"]) + _box("splitter", "splitter") + _box("side", "side", side)
    header = f'<h1 class="name"><div>{TITLE}</div></h1>' + _box("bar-panels", "bar-panels", cards["header"])
    return (
        _box("bar", "bar", header)
        + _box("work", "work", work)
        + _box("strip-box", "strip-box", cards["strip"])
        + _box("nowhere", "nowhere", cards["nowhere"])
    )


def _box(name: str, classes: str, inner: str = "") -> str:
    return f'<div id="{name}" class="{classes}">{inner}</div>'


def _make_room(most: int) -> bool:
    """Let go of pages without a socket, the oldest first, until there's room for one more; whether there is."""
    for client in list(Client.instances.values()):
        if len(Client.instances) < most:
            break
        if not client.has_socket_connection:
            client.delete()
    return len(Client.instances) < most
