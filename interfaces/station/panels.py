"""The panels of the station, in one list. Each is a place in the page that a script fills."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal, TypeAlias

from vrs.errors import InvalidValueError

PanelPlace: TypeAlias = Literal["header", "pane", "side", "strip", "nowhere"]
"""Where a panel stands: in the bar on top, always visible; over the 3D view; as a tab at the right; across the
bottom; or nowhere, as a script without a place of its own."""


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
    Panel("pane", "3D view", "pane"),
    Panel("drag", "Dragging the tool", "nowhere"),
    Panel("link", "Connection", "header"),
    Panel("control", "Control", "header"),
    Panel("theme", "Light or dark", "header"),
    Panel("stop", "Stop", "header"),
    Panel("jog", "Jog", "side", icon="open_with"),
    Panel("receipts", "Receipts", "side", icon="receipt_long"),
    Panel("plots", "Plots", "side", icon="show_chart"),
    Panel("terminal", "Terminal", "side", icon="terminal"),
    Panel("network", "Link", "side", icon="network_check"),
    Panel("record", "Record", "side", icon="fiber_manual_record"),
    Panel("strip", "Timeline", "strip"),
    Panel("hints", "Hints", "nowhere"),
)
"""What the page has, in the order of its tabs and of the keyboard."""

MOBILE_PANELS: Final[tuple[Panel, ...]] = (
    Panel("floor", "3D view", "pane"),
    Panel("link", "Connection", "header"),
    Panel("control", "Control", "header"),
    Panel("theme", "Light or dark", "header"),
    Panel("stop", "Stop", "header"),
    Panel("drive", "Drive", "side", icon="gamepad"),
    Panel("map", "Map", "side", icon="map"),
    Panel("jobs", "Jobs", "side", icon="checklist"),
    Panel("camera", "Camera", "side", icon="videocam"),
    Panel("deviation", "Plots", "side", icon="show_chart"),
    Panel("network", "Link", "side", icon="network_check"),
    Panel("hints", "Hints", "nowhere"),
)
"""What a mobile robot's page has."""
