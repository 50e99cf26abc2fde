"""Geometry of the mobile robot IPR, and of the micro-robot that stood in for it in the experiment.

Sources: Han, Kim, Kim, Kim, 2001 [H]: section 2.1, 4.2. Kim, Han, Kim, Kim, 2002 [K]: sizes of the
same robot. What neither gives is an assumption; its reason stands beside it.
"""

from __future__ import annotations

from typing import Final

PERIOD: Final = 0.1
"""T: time between commands [s], an assumption: [H] has 'every sampling time T' without a figure."""

CELLS: Final = (125, 61)
"""Cells of the virtual environment along x and y; [H], section 3.2."""
CELL: Final = 0.1
"""Side of a cell [m], an assumption: a room of 12.5 m × 6.1 m, and a robot of about five cells across."""

IPR_LENGTH: Final = 0.52
"""Along the direction of travel [m]; [K]: 45 × 52 × 75 cm."""
IPR_WIDTH: Final = 0.45
"""Across it [m]."""
IPR_HEIGHT: Final = 0.75
"""[m]."""
IPR_MASS: Final = 75.0
"""[kg]; [K]."""
IPR_WHEEL_RADIUS: Final = 0.10
"""[m], an assumption: passes the door sills of a house, and 0.5 m/s is a common gear motor's 48 turns/min."""
IPR_AXLE_OFFSET: Final = 0.06
"""How far the driving axle is ahead of the body's centre [m], D of [K], eq. (2); its size is an assumption."""

MICRO_SIDE: Final = 0.075
"""Length, width and height [m]; [H], section 4.2."""
MICRO_MASS: Final = 0.430
"""[kg]; [H], section 4.2."""
MICRO_WHEEL_BASE: Final = 0.068
"""L [m], an assumption: wheels 7 mm thick flush with the sides."""
MICRO_WHEEL_RADIUS: Final = 0.022
"""[m], an assumption: usual for soccer robots of this size, on which it's built."""
MICRO_AXLE_OFFSET: Final = 0.0
"""How far the driving axle is ahead of the body's centre [m], an assumption: they turn about their centre."""
