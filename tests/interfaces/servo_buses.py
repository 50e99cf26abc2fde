"""Drivers of the example's bus, with faults."""

from __future__ import annotations

import importlib
from typing import Any

_BUS = importlib.import_module("examples.28_servo_bus").Bus


def Sound() -> Any:
    """It loses a packet in fifty."""
    return _BUS()


def Stuck() -> Any:
    """Its second servo doesn't turn."""
    return _BUS(stuck=1)
