"""How the tool follows a hand that drags it: the hand's speed as far as it has shown, and back to the hand.

`static/dragging.js` is the same law for the page; a test compares them.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from vrs.model import Array

PERIOD: Final = 0.04
"""Between two inputs [s]."""
GAIN: Final = 3.0
"""How fast the tool is drawn to the hand, beside the hand's own speed [1/s]."""
POSITION: Final = 0.91
"""Share of what was foreseen wrongly that counts as the hand's place."""
SPEED: Final = 0.49
"""Share of it that counts as the hand's speed, over the time that it took."""
LONGEST: Final = 0.2
"""After so long without an input the hand's speed isn't known any more [s]."""


class DragLaw:
    """An alpha-beta filter of the hand, and feedback; it never looks ahead."""

    def __init__(self) -> None:
        self._t: float | None = None
        self._hand = self._speed = np.zeros(3)

    def speed(self, t: float, hand: Array, tool: Array, fastest: float) -> Array:
        """How fast the tool is to go [m/s], (3,).

        Args:
            t: Present time [s], growing.
            hand: Where the hand is [m], (3,).
            tool: Where the tool is [m], (3,).
            fastest: Largest speed [m/s].
        """
        since = np.inf if self._t is None else t - self._t
        if since > LONGEST:
            self._hand, self._speed = hand, np.zeros(3)
        elif since > 0:
            foreseen = self._hand + self._speed * since
            wrong = hand - foreseen
            self._hand, self._speed = foreseen + POSITION * wrong, self._speed + SPEED / since * wrong
        self._t = t
        wish = self._speed + GAIN * (hand - tool)
        size = float(np.sqrt(wish @ wish))
        return wish * min(1.0, fastest / size) if size > 0 else wish
