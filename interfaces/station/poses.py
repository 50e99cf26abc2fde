"""Saved poses of an arm: kept in a file beside the recordings, seen by all pages, changed by operators."""

from __future__ import annotations

import asyncio
import re
from pathlib import Path
from typing import Annotated, Final

import msgspec
from msgspec import Meta
from starlette.requests import ClientDisconnect, Request
from starlette.responses import JSONResponse, Response
from starlette.routing import BaseRoute, Route

from interfaces.messages.control import Role
from interfaces.station.record import BURST, RATE, body, said
from interfaces.stream.access import Access
from interfaces.stream.limits import Bucket
from interfaces.stream.server import HEADERS, refusal
from interfaces.system import read_within, write_whole, written
from vrs.checks import finite_array
from vrs.clock import Clock
from vrs.errors import FormatError, InvalidValueError, VrsError
from vrs.model import RobotModel

MOST: Final = 100
"""Poses that are kept."""
LARGEST: Final = 4096
"""Bytes of a request."""
MAX_BYTES: Final = 256 * 1024

_Name = Annotated[str, Meta(min_length=1, max_length=24)]


class _PoseChange(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What a page asks for."""

    name: _Name
    q: list[float] | None = None
    """Joint values [rad; of prismatic joints m]; None deletes the pose."""


class Poses:
    """Tells poses, `GET /poses`, and keeps or deletes one, `POST /poses`; either answers with all of them."""

    def __init__(self, model: RobotModel, directory: Path, access: Access, clock: Clock) -> None:
        """Read what was kept.

        Args:
            model: The robot, for its joints and the names of its own poses.
            directory: Where the file is, by the robot's name; made with the first pose.
            access: Who may do what: viewers look, operators keep and delete.
            clock: Session time.

        Raises:
            FormatError: If the file can't be read, or holds something else.
        """
        self._model, self._access, self._clock = model, access, clock
        self._path = directory / f"poses-{re.sub(r'[^a-z0-9]+', '-', model.name.lower())}.json"
        self._asked = Bucket(RATE, BURST, clock.now())
        self._changing = asyncio.Lock()
        self._kept: dict[str, list[float]] = {}
        if self._path.exists():
            try:
                found = msgspec.json.decode(read_within(self._path, MAX_BYTES), type=dict[_Name, list[float]])
                self._kept = {name: self._checked(q) for name, q in found.items()}
            except (msgspec.DecodeError, RecursionError, InvalidValueError) as error:
                raise FormatError(str(self._path), f"holds no poses: {error}") from None

    @property
    def routes(self) -> list[BaseRoute]:
        """What it answers."""
        return [Route("/poses", self._answer, methods=["GET", "POST"])]

    async def _answer(self, request: Request) -> Response:
        changes = request.method == "POST"
        try:
            if refused := refusal(request, self._access, Role.OPERATOR if changes else Role.VIEWER):
                return said(403, refused)
            if changes:
                if not self._asked.take(self._clock.now()):
                    return said(429, "too many requests: try again in a moment")
                change = msgspec.json.decode(await body(request, LARGEST), type=_PoseChange)
                async with self._changing:
                    await self._change(change)
            return JSONResponse({"poses": self._kept}, 200, HEADERS)
        except ClientDisconnect:
            return said(408, "the request didn't come to its end in time")
        except (VrsError, msgspec.DecodeError, RecursionError) as error:
            return said(400, str(error))

    async def _change(self, change: _PoseChange) -> None:
        kept = dict(self._kept)
        if change.q is None:
            kept.pop(change.name, None)
        elif change.name in kept or change.name in self._model.poses:
            raise InvalidValueError("name", change.name, "one that no pose has: delete that one first")
        elif len(kept) >= MOST:
            raise InvalidValueError("poses", len(kept) + 1, f"up to {MOST}: delete one first")
        else:
            kept[change.name] = self._checked(change.q)
        await asyncio.to_thread(self._write, msgspec.json.encode(kept))
        self._kept = kept

    def _checked(self, q: list[float]) -> list[float]:
        dof = self._model.limits.dof
        found: list[float] = finite_array("q", q, (dof,), f"{dof} finite joint values").tolist()
        return found

    def _write(self, data: bytes) -> None:
        with written(self._path):
            self._path.parent.mkdir(parents=True, exist_ok=True)
            write_whole(self._path, data)
