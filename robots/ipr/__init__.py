"""The mobile robot IPR (Mybot), and the micro-robot of its first experiment."""

from __future__ import annotations

from robots.ipr.model import Kind, model

__all__ = ["Kind", "model"]
