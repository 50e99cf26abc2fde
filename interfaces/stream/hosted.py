"""What a hub serves: the site of a robot, whichever robot that is."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple, Protocol

from interfaces.engine_server.broadcast import Broadcaster
from interfaces.engine_server.site import Site
from interfaces.messages import Order, Refusal, control
from interfaces.stream.session import Served, Welcome


class Edits(Protocol):
    """Counts edits."""

    def look(self) -> int:
        """Number of the newest."""


class Hosted(Protocol):
    """A robot's site, as its hub sees it."""

    @property
    def robot(self) -> str:
        """Name of the robot's model."""

    @property
    def broadcasters(self) -> Sequence[Broadcaster]:
        """What makes frames; none where there are none."""

    @property
    def journal(self) -> Edits:
        """What counts the edits of what clients follow."""

    def broadcast(self, rate: float) -> object:
        """Add a broadcaster of a rate [1/s]."""

    def servlet(self, *, admit: Callable[[Order], Refusal | None]) -> Served:
        """Make what serves one more client; `admit` says why an order isn't carried out now, None if it is."""

    def time(self, now: float) -> float:
        """The site's own time at the session time now [s]."""

    def advance(self, *, now: float) -> None:
        """Make the frames that are due."""

    def next_deadline(self) -> float | None:
        """When the next one is [s]."""


class Greeting(NamedTuple):
    """What every client is told that is let in."""

    session: str
    role: control.Role
    now: float
    lease: control.Lease
    resumed: bool
    instance: str
    server: str
    lease_timeout: float


Greeter = Callable[[Greeting], Welcome]


def arms(site: Hosted) -> Greeter:
    """What tells a client of an arm's site what there is."""
    assert isinstance(site, Site)
    model = site.engine.model

    def welcome(greeting: Greeting) -> control.Welcome:
        return control.Welcome(
            protocol=control.PROTOCOL,
            robot=model.name,
            dof=model.limits.dof,
            limits=model.limits,
            poses=dict(model.poses),
            rates=tuple(broadcaster.rate for broadcaster in site.broadcasters),
            **greeting._asdict(),
        )

    return welcome
