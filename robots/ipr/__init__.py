"""The mobile robot IPR (Mybot), and the micro-robot of its first experiment."""

from __future__ import annotations

from robots.ipr.model import Body, Ipr, Kind, model

__all__ = ["Body", "Ipr", "Kind", "model"]
