"""How a class is shown its codes: links with them, QR codes of those, in a terminal and over HTTP."""

from __future__ import annotations

import io
from typing import Final

import segno
from starlette.requests import Request
from starlette.responses import JSONResponse, Response
from starlette.routing import BaseRoute, Route

from interfaces.messages.control import Role
from interfaces.stream.access import Access
from interfaces.stream.invitations import INVITED, Invitation, Invitations
from interfaces.stream.server import HEADERS, may_see, refusal
from vrs.clock import Clock

PATH: Final = "/class"
"""Where the codes are told, as JSON; below it, as `/class/viewer.svg`, their QR codes."""
_PRIVATE: Final = {**HEADERS, "Cache-Control": "no-store"}
_SCALE: Final = 8
"""Pixels of a QR code's module, where nothing else gives its size."""
_DOES: Final = {Role.VIEWER: "watch", Role.OPERATOR: "operate"}


class JoinPages:
    """Tells a teacher the codes in force; its routes go into an application."""

    def __init__(self, invitations: Invitations, access: Access, clock: Clock, base: str) -> None:
        """Tell codes.

        Args:
            invitations: The codes.
            access: Who may see them: who has the token of an admin.
            clock: Session time.
            base: Where the class finds the page, as `http://192.168.1.20:8600/`.
        """
        self._invitations, self._access, self._clock, self._base = invitations, access, clock, base

    @property
    def routes(self) -> list[BaseRoute]:
        """What it answers."""
        return [Route(PATH, self._tell), Route(PATH + "/{role}.svg", self._draw)]

    def link(self, invitation: Invitation) -> str:
        """What brings somebody to the page with a code."""
        return f"{self._base}?code={invitation.code}"

    def shown(self, *, pictures: bool) -> tuple[str, float]:
        """The links in force for a terminal, and how long they are shown [s].

        Args:
            pictures: Whether QR codes are shown, too.
        """
        now = self._clock.now()
        parts: list[str] = []
        shown = self._invitations.shown(now=now)
        for invitation in shown:
            parts.append(f"vrs: to {_DOES[invitation.role]}: {self.link(invitation)}\n")
            if pictures:
                drawn = io.StringIO()
                segno.make_qr(self.link(invitation)).terminal(drawn, compact=True)
                parts.append(drawn.getvalue())
        return "".join(parts), max(shown[0].until - now, 0.0)

    async def _tell(self, request: Request) -> Response:
        """The codes, for an admin; for others, that there's a class."""
        now = self._clock.now()
        told = [
            {"role": one.role, "code": one.code, "link": self.link(one), "expires_in": one.until - now}
            for one in self._invitations.shown(now=now)
        ]
        return JSONResponse(
            {"invitations": told if may_see(request, self._access, Role.ADMIN) else []}, headers=_PRIVATE
        )

    async def _draw(self, request: Request) -> Response:
        """The QR code of a role's link."""
        if refusal(request, self._access, Role.ADMIN):
            return Response("an admin's token is needed\n", 403, _PRIVATE, "text/plain")
        shown = dict(zip(INVITED, self._invitations.shown(now=self._clock.now()), strict=True))
        found = next((one for role, one in shown.items() if role == request.path_params["role"]), None)
        if found is None:
            return Response("not here\n", 404, _PRIVATE, "text/plain")
        drawn = io.BytesIO()
        segno.make_qr(self.link(found)).save(drawn, kind="svg", scale=_SCALE, light="#fff")
        return Response(drawn.getvalue(), 200, _PRIVATE, "image/svg+xml")
