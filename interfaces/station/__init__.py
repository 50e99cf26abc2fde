"""The operator station: the page at `/` of `vrs serve`, a file a panel."""

from __future__ import annotations

from interfaces.station.panels import Panel, PanelPlace

__all__ = ["Panel", "PanelPlace"]
