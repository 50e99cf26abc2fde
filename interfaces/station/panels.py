"""The panels of the station, in one list. Each is a place in the page that a script fills."""

from __future__ import annotations

import enum
from dataclasses import dataclass
from typing import Final

from vrs.errors import InvalidValueError


class PanelPlace(enum.StrEnum):
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
    place: PanelPlace
    icon: str = ""
    """Of its tab, as Material Icons name it."""

    def __post_init__(self) -> None:
        if not self.name.isascii() or not self.name.islower() or not self.name.isalpha():
            raise InvalidValueError("panel", self.name, "a name in small letters")


PANELS: Final[tuple[Panel, ...]] = (
    Panel("pane", "3D view", PanelPlace.PANE),
    Panel("drag", "Dragging the tool", PanelPlace.NOWHERE),
    Panel("link", "Connection", PanelPlace.HEADER),
    Panel("control", "Control", PanelPlace.HEADER),
    Panel("theme", "Light or dark", PanelPlace.HEADER),
    Panel("stop", "Stop", PanelPlace.HEADER),
    Panel("jog", "Jog", PanelPlace.SIDE, icon="open_with"),
    Panel("receipts", "Receipts", PanelPlace.SIDE, icon="receipt_long"),
    Panel("plots", "Plots", PanelPlace.SIDE, icon="show_chart"),
    Panel("terminal", "Terminal", PanelPlace.SIDE, icon="terminal"),
    Panel("network", "Link", PanelPlace.SIDE, icon="network_check"),
    Panel("record", "Record", PanelPlace.SIDE, icon="fiber_manual_record"),
    Panel("strip", "Timeline", PanelPlace.STRIP),
    Panel("hints", "Hints", PanelPlace.NOWHERE),
)
"""What the page has, in the order of its tabs and of the keyboard."""

MOBILE_PANELS: Final[tuple[Panel, ...]] = (
    Panel("floor", "3D view", PanelPlace.PANE),
    Panel("link", "Connection", PanelPlace.HEADER),
    Panel("control", "Control", PanelPlace.HEADER),
    Panel("theme", "Light or dark", PanelPlace.HEADER),
    Panel("stop", "Stop", PanelPlace.HEADER),
    Panel("drive", "Drive", PanelPlace.SIDE, icon="gamepad"),
    Panel("map", "Map", PanelPlace.SIDE, icon="map"),
    Panel("jobs", "Jobs", PanelPlace.SIDE, icon="checklist"),
    Panel("camera", "Camera", PanelPlace.SIDE, icon="videocam"),
    Panel("deviation", "Plots", PanelPlace.SIDE, icon="show_chart"),
    Panel("network", "Link", PanelPlace.SIDE, icon="network_check"),
    Panel("hints", "Hints", PanelPlace.NOWHERE),
)
"""What a mobile robot's page has."""
