"""The station's page: one file, made once of what the robot is and of the panels it has, and the files it needs."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Mapping, Sequence
from functools import cache
from importlib import resources
from typing import Any, Final

from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import BaseRoute, Route

from interfaces.station.panels import Panel
from interfaces.stream.server import HEADERS, KeptFile

_TYPES: Final = {"css": "text/css", "js": "text/javascript"}
_READER: Final = frozenset({"vrs.js", "protocol.js"})
"""What the protocol has for pages: its reader, and what checks its messages."""


@cache
def names() -> frozenset[str]:
    """What is served below `/station/`."""
    own = resources.files("interfaces.station").joinpath("static").iterdir()
    return frozenset({*_READER, *(file.name for file in own if file.name.rpartition(".")[2] in _TYPES)})


async def _answer(request: Request) -> Response:
    name = request.path_params["name"]
    if name not in names():
        return Response("not here", 404, HEADERS, "text/plain")
    file = await asyncio.to_thread(_file, name)
    return file.answer(request, _TYPES[name.rpartition(".")[2]], HEADERS)


@cache
def _file(name: str) -> KeptFile:
    package = "interfaces.stream" if name in _READER else "interfaces.station"
    return KeptFile.of(resources.files(package).joinpath(f"static/{name}").read_bytes())


def station_files() -> Route:
    """The route of the scripts and styles that pages are made of."""
    return Route("/station/{name}", _answer)


class Station:
    """The page `/` of a robot, and the files below `/station/`."""

    def __init__(
        self,
        robot: Mapping[str, Any],
        panels: Sequence[Panel],
        robots: Sequence[tuple[str, str, bool]] = (),
        *,
        codes: bool = False,
        relays: str = "",
    ) -> None:
        """Make the page.

        Args:
            robot: What the panels' scripts are told of it, see `chain.described`.
            panels: What the page has, see `panels_of`.
            robots: Where the server has several, of each its name, where its page is, and whether that's this one.
            codes: Whether the server tells codes by which a class comes in.
            relays: Of a relay's page: where the robot is served, and control is to be had.
        """
        self._page = KeptFile.of(_page(robot, panels, robots, codes=codes, relays=relays).encode())

    @property
    def routes(self) -> list[BaseRoute]:
        """What it answers."""
        return [Route("/", self._show), station_files()]

    async def _show(self, request: Request) -> Response:
        return self._page.answer(request, "text/html", HEADERS)


def _page(
    robot: Mapping[str, Any],
    panels: Sequence[Panel],
    robots: Sequence[tuple[str, str, bool]],
    *,
    codes: bool,
    relays: str,
) -> str:
    """Its HTML: one element, which the scripts fill, and what those are told."""
    from jinja2 import Environment, PackageLoader, StrictUndefined

    templates = Environment(
        loader=PackageLoader("interfaces.station"), undefined=StrictUndefined, trim_blocks=True, autoescape=True
    )
    listed = [{"name": p.name, "title": p.title, "place": p.place, "icon": p.icon} for p in panels]
    config = json.dumps({"robot": robot, "panels": listed, "robots": robots, "codes": codes, "relays": relays})
    return templates.get_template("index.html").render(config=config)
