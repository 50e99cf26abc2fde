"""The panels of the station, in one list. Each is a place in the page that a script fills."""

from __future__ import annotations

import enum
from dataclasses import dataclass
from typing import Final

from vrs.errors import InvalidValueError


class Place(enum.StrEnum):
    """Where a panel stands."""

    HEADER = "header"
    """In the bar on top, always visible."""
    PANE = "pane"
    """Over the 3D view."""
    SIDE = "side"
    """A tab at the right."""
    STRIP = "strip"
    """Across the bottom."""
    NOWHERE = "nowhere"
    """A script without a place of its own."""


@dataclass(frozen=True, slots=True)
class Panel:
    """A part of the page.

    Its script is `static/NAME.js`, a module that exports `mount(station, box)`, called with the panel's own
    element, which nobody else fills.
    """

    name: str
    """Of the panel and of its files; small letters."""
    title: str
    """On its tab."""
    place: Place
    icon: str = ""
    """Of its tab, as Material Icons name it."""

    def __post_init__(self) -> None:
        if not self.name.isascii() or not self.name.islower() or not self.name.isalpha():
            raise InvalidValueError("panel", self.name, "a name in small letters")


PANELS: Final[tuple[Panel, ...]] = (
    Panel("pane", "3D view", Place.PANE),
    Panel("drag", "Dragging the tool", Place.NOWHERE),
    Panel("link", "Connection", Place.HEADER),
    Panel("control", "Control", Place.HEADER),
    Panel("theme", "Light or dark", Place.HEADER),
    Panel("stop", "Stop", Place.HEADER),
    Panel("jog", "Jog", Place.SIDE, icon="open_with"),
    Panel("receipts", "Receipts", Place.SIDE, icon="receipt_long"),
    Panel("plots", "Plots", Place.SIDE, icon="show_chart"),
    Panel("terminal", "Terminal", Place.SIDE, icon="terminal"),
    Panel("network", "Link", Place.SIDE, icon="network_check"),
    Panel("record", "Record", Place.SIDE, icon="fiber_manual_record"),
    Panel("strip", "Timeline", Place.STRIP),
    Panel("hints", "Hints", Place.NOWHERE),
)
"""What the page has, in the order of its tabs and of the keyboard."""

MOBILE_PANELS: Final[tuple[Panel, ...]] = (
    Panel("floor", "3D view", Place.PANE),
    Panel("link", "Connection", Place.HEADER),
    Panel("control", "Control", Place.HEADER),
    Panel("theme", "Light or dark", Place.HEADER),
    Panel("stop", "Stop", Place.HEADER),
    Panel("drive", "Drive", Place.SIDE, icon="gamepad"),
    Panel("map", "Map", Place.SIDE, icon="map"),
    Panel("jobs", "Jobs", Place.SIDE, icon="checklist"),
    Panel("camera", "Camera", Place.SIDE, icon="videocam"),
    Panel("deviation", "Plots", Place.SIDE, icon="show_chart"),
    Panel("network", "Link", Place.SIDE, icon="network_check"),
    Panel("hints", "Hints", Place.NOWHERE),
)
"""What a mobile robot's page has."""
