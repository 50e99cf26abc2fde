"""Plan files for pages: what one holds, as commands that the page then gives; and what is planned, as one."""

from __future__ import annotations

import asyncio
from typing import Final

import msgspec
from starlette.requests import ClientDisconnect, Request
from starlette.responses import JSONResponse, Response
from starlette.routing import BaseRoute, Route

from interfaces.engine_server.journal import Journal
from interfaces.messages.control import Role
from interfaces.messages.fields import plain
from interfaces.runtime.plan import MAX_BYTES, parse_plan, written_plan
from interfaces.station.record import BURST, RATE, body, said
from interfaces.stream.access import Access
from interfaces.stream.limits import Bucket
from interfaces.stream.server import HEADERS, refusal
from vrs.clock import Clock
from vrs.errors import FormatError, VrsError

MOST: Final = 500
"""Moves that a page gives one after the other."""


class Plans:
    """Reads and writes plan files for pages, or says what is wrong.

    `POST /plan?name=NAME` answers with the commands of a file, `GET /plan` with a file of what is planned.
    """

    def __init__(self, journal: Journal, access: Access, clock: Clock) -> None:
        """Wait for files.

        Args:
            journal: Of the engine whose plan it is.
            access: Who may ask: nothing moves by it, but it takes time.
            clock: Session time.
        """
        self._journal, self._access, self._clock = journal, access, clock
        self._asked = Bucket(RATE, BURST, clock.now())

    @property
    def routes(self) -> list[BaseRoute]:
        """What it answers."""
        return [Route("/plan", self._answer, methods=["GET", "POST"])]

    async def _answer(self, request: Request) -> Response:
        reads = request.method == "POST"
        try:
            if refused := refusal(request, self._access, Role.OPERATOR if reads else Role.VIEWER):
                return said(403, refused)
            if not self._asked.take(self._clock.now()):
                return said(429, "too many requests: try again in a moment")
            if not reads:
                return JSONResponse({"plan": self._written()}, 200, HEADERS)
            name = request.query_params.get("name", "plan")[:100]
            found = await asyncio.to_thread(self._read, await body(request, MAX_BYTES), name)
            return Response(found, 200, HEADERS, "application/json")
        except ClientDisconnect:
            return said(408, "the request didn't come to its end in time")
        except VrsError as error:
            return said(400, str(error))

    def _written(self) -> str:
        engine, labels = self._journal.engine, {name.command_id: name.label for name in self._journal.names}
        return written_plan(engine, f"Planned at {engine.now():.1f} s", labels).decode()

    def _read(self, data: bytes, name: str) -> bytes:
        plan = parse_plan(data, name, self._journal.engine.model)
        if plan.payloads:
            raise FormatError(plan.payloads[0].where, "a payload can't be taken or released here: moves alone")
        if len(plan.motions) > MOST:
            raise FormatError(name, f"holds {len(plan.motions)} moves: the page takes up to {MOST}")
        commands = [motion.command for motion in plan.motions]
        return msgspec.json.encode({"title": plan.title, "commands": commands}, enc_hook=plain)
