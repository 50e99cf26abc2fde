"""The page of a fleet: all of its robots in one picture, and a list in which those in trouble stand first."""

from __future__ import annotations

import asyncio
import contextlib
import json
from collections.abc import AsyncIterator, Sequence
from importlib import resources
from typing import Final

import numpy as np
from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import BaseRoute, Route, WebSocketRoute

from interfaces.runtime.live.operator import LiveOperator
from interfaces.station.page import station_files
from interfaces.station.replay_page import BEGIN
from interfaces.stream.meshcat.newest import ROOT, Newest, Nodes
from interfaces.stream.meshcat.page import HEADERS, Authorize, Viewers, files
from interfaces.stream.meshcat.room import LOOKED_FROM, grid_at
from interfaces.stream.server import KeptFile
from interfaces.teleop.operator import HaltCause
from robots.rooms import Posture, Room
from vrs.clock import Clock

TOLD: Final = 0.2
"""Time between two looks at the robots [s]."""
_AROUND: Final = 2.0
"""What is to be seen around robots without a room [m]."""
_QUIET: Final = frozenset({HaltCause.NOT_MET, HaltCause.FREE, HaltCause.BY_ITSELF, HaltCause.STOPPED})
"""Why a robot doesn't follow that's no trouble."""


class FleetPage:
    """The page `/` of a server of a fleet."""

    def __init__(
        self,
        room: Room,
        starts: Sequence[Posture],
        sites: Sequence[LiveOperator],
        pages: Sequence[str],
        clock: Clock,
        authorize: Authorize,
    ) -> None:
        """Make the page.

        Args:
            room: Where the robots are.
            starts: Where each begins, or its base stands.
            sites: The operator's site of each.
            pages: Where the page of each is.
            clock: Session time.
            authorize: See `Viewers`.
        """
        self._sites, self._pages, self._clock = sites, pages, clock
        self.scene = Nodes()
        """What is to be seen of all."""
        enclosed = bool(room.things)
        if enclosed:
            low, high = (0.0, 0.0), (room.length, room.width)
        else:
            low = min(x for x, *_ in starts) - _AROUND, min(y for _, y, _ in starts) - _AROUND
            high = max(x for x, *_ in starts) + _AROUND, max(y for _, y, _ in starts) + _AROUND
        self.scene.put_property(ROOT, "box", [[*low, 0.0], [*high, 0.8]])
        for name, value in LOOKED_FROM.items():
            self.scene.put_property(ROOT, name, value)
        self.scene.put_property("/Axes", "visible", False)
        self.scene.put_property("/Grid", "visible", not enclosed)
        self.scene.put_transform("/Grid", grid_at(np.array(low), np.array(high)))
        self.board = Newest(BEGIN)
        """What pages are told of each robot: JSON by its name."""
        static = resources.files("interfaces.station").joinpath("static")
        self._page = KeptFile.of(static.joinpath("fleet.html").read_bytes())
        self.routes: list[BaseRoute] = [
            Route("/", self._show),
            *files("view", "interfaces.stream"),
            station_files(),
            WebSocketRoute("/fleet/board", Viewers(self.board, authorize).serve),
            WebSocketRoute("/fleet/scene", Viewers(self.scene, authorize).serve),
        ]
        """What it answers."""
        self._tell()

    async def _show(self, request: Request) -> Response:
        return self._page.answer(request, "text/html", HEADERS)

    @contextlib.asynccontextmanager
    async def running(self) -> AsyncIterator[FleetPage]:
        """Tell the pages how the robots are meanwhile."""

        async def telling() -> None:
            while True:
                await asyncio.sleep(TOLD)
                self._tell()

        task = asyncio.create_task(telling())
        try:
            yield self
        finally:
            task.cancel()
            await asyncio.wait([task])

    def _tell(self) -> None:
        for site, page in zip(self._sites, self._pages, strict=True):
            name = site.config.which.name
            self.board.put(name, json.dumps({"kind": "robot", "page": page, **self._facts(site)}).encode())
        self.board.wake()

    def _facts(self, site: LiveOperator) -> dict[str, object]:
        """What is told of a robot."""
        which, operator, holder = site.config.which, site.operator, site.hub.leasing.holder
        connected, cause = site.robot.connected, operator.cause
        starting = cause is HaltCause.NOT_MET and not connected
        trouble = "" if connected or starting else site.robot.problem or "no connection to the robot"
        if site.twins.halted and cause not in _QUIET:
            trouble = site.twins.halted
        if holder is not None:
            doing = f"{holder.name} has control"
        elif cause is HaltCause.BY_ITSELF:
            doing = HaltCause.BY_ITSELF.value
        else:
            doing = HaltCause.FREE.value
        return {
            "name": which.name, "model": which.model.name, "base": which.is_base, "trouble": trouble,
            "starting": starting, "held": holder is not None, "doing": doing,
            "rests": operator.robot.rests(now=self._clock.now()),
        }  # fmt: skip
