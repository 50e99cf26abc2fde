"""The station's page: NiceGUI on the server and loop that are there, its layout, and the panels in it.

Loads NiceGUI: import it where a station is served. NiceGUI is one for a process, and so is the station.
"""

from __future__ import annotations

import contextlib
import json
from collections.abc import AsyncIterator, Iterable, Mapping
from typing import Any, Final

from fastapi import FastAPI
from nicegui import Client, core, ui
from nicegui.element import Element
from starlette.routing import BaseRoute, Mount

from interfaces.station.bounds import Bounds
from interfaces.station.files import route
from interfaces.station.panels import PANELS, Panel, Place

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

    def __init__(
        self,
        robot: Mapping[str, Any],
        *,
        panels: Iterable[Panel] = PANELS,
    ) -> None:
        """Make the page; nobody sees it yet.

        Args:
            robot: What the panels' scripts are told of it: of an arm `chain.described`, of a mobile robot that it's
                `mobile`.
            panels: What the page has.
        """
        self._panels = tuple(panels)
        listed = [{"name": p.name, "title": p.title, "place": p.place, "icon": p.icon} for p in self._panels]
        self._config = json.dumps({"robot": robot, "panels": listed})
        self._app = FastAPI(docs_url=None, redoc_url=None, openapi_url=None)
        core.sio.eio.transports = ["websocket"]
        core.app.config.socket_io_js_transports = ["websocket"]
        ui.page("/", title=TITLE, language="en-US", reconnect_timeout=KEEP)(self._build)
        ui.run_with(
            self._app, title=TITLE, dark=None, tailwind=False, show_welcome_message=False,
            gzip_middleware_factory=None, binding_refresh_interval=None,
        )  # fmt: skip
        self._bounds = Bounds(self._app, "/", lambda: len(Client.instances))

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
        root = _element("div", "station", "station")
        root.props["data-config"] = self._config
        with root:
            places: dict[Place, Element] = {}
            with _element("div", "bar", "bar"):
                with Element("h1").classes("name"):
                    ui.label(TITLE)
                places[Place.HEADER] = _element("div", "bar-panels", "bar-panels")
            with _element("div", "work", "work"):
                places[Place.PANE] = _element("div", "pane-box", "pane-box")
                _element("div", "splitter", "splitter")
                with _element("div", "side", "side"):
                    _element("div", "tabs", "tabs")
                    places[Place.SIDE] = _element("div", "tab-panels", "tab-panels")
            places[Place.STRIP] = _element("div", "strip-box", "strip-box")
            places[Place.NOWHERE] = _element("div", "nowhere", "nowhere")
            for panel in self._panels:
                with places[panel.place], _element("div", f"card-{panel.name}", "card"):
                    _element("div", f"panel-{panel.name}", f"panel panel-{panel.name}")


def _element(tag: str, name: str, classes: str) -> Element:
    element = Element(tag).classes(classes)
    element.props["id"] = name
    return element
