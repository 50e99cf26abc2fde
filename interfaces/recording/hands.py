"""A recorded hand and the things around it: where they were at a time."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Sequence
from operator import attrgetter
from typing import Any

from interfaces.messages.recording import HandEntry, SceneEntry
from robots.things import Scene, ThingPose

_AT = attrgetter("t")


class RecordedHands:
    """What the channel of the hand says; it's read as far as the file has come."""

    def __init__(self, entries: Callable[[], Sequence[Any]]) -> None:
        """Take what gives the channel's messages."""
        self._entries = entries
        self._seen = 0
        self._hands: list[HandEntry] = []
        self._moves: dict[int, list[tuple[float, ThingPose]]] = {}
        self._scene: Scene | None = None

    def _read(self) -> None:
        entries = self._entries()
        if len(entries) == self._seen:
            return
        self._seen = len(entries)
        self._scene = next((one.scene for one in entries if isinstance(one, SceneEntry)), None)
        self._hands = sorted((one for one in entries if isinstance(one, HandEntry)), key=_AT)
        self._moves = {}
        for hand in self._hands:
            for k, pose in hand.things:
                self._moves.setdefault(k, []).append((hand.t, pose))

    @property
    def scene(self) -> Scene | None:
        """What was around the real arm; None where nothing was that it could grasp."""
        self._read()
        return self._scene

    def opening(self, t: float) -> float | None:
        """How far the real hand was open at a time [s], [m]; None where it wasn't measured by then."""
        self._read()
        place = bisect_right(self._hands, t, key=_AT)
        return self._hands[place - 1].opening if place else None

    def poses(self, t: float) -> dict[int, ThingPose]:
        """Where things were at a time [s], by number; before they were measured first, as they were then."""
        self._read()
        return {
            k: moves[max(bisect_right(moves, t, key=lambda move: move[0]) - 1, 0)][1]
            for k, moves in self._moves.items()
        }
