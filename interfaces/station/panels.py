"""The panels of the station, in one list. Each is a place in the page that a script fills."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from enum import StrEnum
from typing import Final, Literal, TypeAlias

from vrs.errors import InvalidValueError

PanelPlace: TypeAlias = Literal["header", "pane", "side", "strip", "nowhere"]
"""Where a panel stands: in the bar on top, always visible; over the 3D view; as a tab at the right; across the
bottom; or nowhere, as a script without a place of its own."""


class Offer(StrEnum):
    """What a server may have, of which some panels are."""

    POLYNOMIALS = "polynomials"
    """A timeline whose segments are an arm's joints, for pages to follow."""
    ARCS = "arcs"
    """A mobile robot that is driven, and tells its posture."""
    JOBS = "jobs"
    """A robot that goes to goals and does lists of jobs by itself."""
    CAMERA = "camera"
    TERMINALS = "terminals"
    """VAL-II's, for pages."""
    RECORDINGS = "recordings"
    QUEUE = "queue"
    """People who queue for control: a class, or all in the order in which they connect."""


@dataclass(frozen=True, slots=True)
class Panel:
    """A part of the page: its script is `static/NAME.js`, a module that exports the component `Panel`."""

    name: str
    """Of the panel and of its files; small letters."""
    title: str
    """On its tab."""
    place: PanelPlace
    icon: str = ""
    """Of its tab, as Material Icons name it."""
    of: Offer | None = None
    """What a server must have for it; None if any has it."""
    relayed: bool = True
    """Whether it's of use to those who watch at a relay, and works there."""

    def __post_init__(self) -> None:
        if not self.name.isascii() or not self.name.islower() or not self.name.isalpha():
            raise InvalidValueError("panel", self.name, "a name in small letters")


PANELS: Final[tuple[Panel, ...]] = (
    Panel("pane", "3D view", "pane", of=Offer.POLYNOMIALS),
    Panel("floor", "3D view", "pane", of=Offer.ARCS),
    Panel("drag", "Dragging the tool", "pane", of=Offer.POLYNOMIALS, relayed=False),
    Panel("link", "Connection", "header"),
    Panel("control", "Control", "header"),
    Panel("theme", "Light or dark", "header"),
    Panel("hints", "Hints", "header", relayed=False),
    Panel("stop", "Stop", "header", relayed=False),
    Panel("jog", "Jog", "side", icon="open_with", of=Offer.POLYNOMIALS, relayed=False),
    Panel("drive", "Drive", "side", icon="gamepad", of=Offer.ARCS, relayed=False),
    Panel("map", "Map", "side", icon="map", of=Offer.JOBS),
    Panel("jobs", "Jobs", "side", icon="checklist", of=Offer.JOBS, relayed=False),
    Panel("camera", "Camera", "side", icon="videocam", of=Offer.CAMERA),
    Panel("receipts", "Receipts", "side", icon="receipt_long", of=Offer.POLYNOMIALS, relayed=False),
    Panel("plots", "Plots", "side", icon="show_chart"),
    Panel("terminal", "Terminal", "side", icon="terminal", of=Offer.TERMINALS),
    Panel("network", "Link", "side", icon="network_check", relayed=False),
    Panel("record", "Record", "side", icon="fiber_manual_record", of=Offer.RECORDINGS),
    Panel("class", "People", "side", icon="person", of=Offer.QUEUE),
    Panel("strip", "Timeline", "strip", of=Offer.POLYNOMIALS),
)
"""What pages may have, in the order of their tabs and of the keyboard."""


def panels_of(offers: Collection[Offer], *, relayed: bool = False) -> tuple[Panel, ...]:
    """What the page of a server has.

    Args:
        offers: What the server has.
        relayed: Whether it's a relay's page.
    """
    found = (panel for panel in PANELS if panel.of is None or panel.of in offers)
    return tuple(panel for panel in found if panel.relayed or not relayed)
