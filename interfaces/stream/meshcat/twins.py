"""What scenes of arms and of mobile robots share: two bodies, the committed path, and who looks at them."""

from __future__ import annotations

from collections.abc import Callable
from types import ModuleType
from typing import Any, Final

import numpy as np

from interfaces.stream.meshcat.commands import delete, set_object, set_property, set_transform
from interfaces.stream.meshcat.committed import Committed, CommittedPath, CommittedPiece, Kinematics
from interfaces.stream.meshcat.newest import Newest, ReaderPosition
from vrs.mobile import ArcTimeline
from vrs.model import Array
from vrs.timeline import Timeline

ROOT: Final = "/vrs"
"""The node below which everything stands."""
PATH_PERIOD: Final = 0.1
"""The committed path is renewed, trimmed and the traces are drawn at most this often [s]."""
NODES: Final = 64
"""Nodes for pieces of the committed path: they are used in turn, since the viewer never forgets one wholly."""
STILL: Final = 2e-7
"""A link is put anew where an element of its pose, (4, 4), is off by more than this [m, 1]."""
COLOURS: Final = {"virtual": 0x2F7DE1, "real": 0x8A8578}


class TwinScene:
    """What all viewers see, each as quickly as it can: a value that is overtaken is sent to nobody.

    The virtual robot is a ghost, the real one solid; the committed path runs ahead of the real one.
    """

    def __init__(self, kinematics: Kinematics, tool: Array, *, scale: float = 1.0) -> None:
        """Begin with nothing to be seen.

        Args:
            kinematics: Say where the robot is.
            tool: The point whose path is drawn, in the last link's frame [m], (3,).
            scale: What the thickness of the committed path is multiplied by.
        """
        self._kinematics, self._tool, self._scale = kinematics, tool, scale
        self._newest = Newest(delete(ROOT))
        self._poses: dict[str, Array] = {}
        self._path: tuple[Timeline | ArcTimeline, CommittedPath] | None = None
        self._drawn: dict[int, CommittedPiece] = {}
        self._due = float("-inf")
        self._objects: ModuleType

    @property
    def viewers(self) -> int:
        """How many viewers there are."""
        return self._newest.readers

    def join(self, changed: Callable[[], None] = lambda: None) -> ReaderPosition:
        """Give a viewer a place: it gets the scene, and from then on what changes.

        Args:
            changed: Is called when there may be something to take; it must return at once.

        Raises:
            InvalidValueError: If there are too many.
        """
        return self._newest.join(changed)

    def leave(self, slot: ReaderPosition) -> None:
        """Give a place back; one that was given back already is none."""
        self._newest.leave(slot)

    def _move(self, twin: str, links: Array) -> None:
        """Put the parts of a robot where they are, (m, 4, 4)."""
        shown = self._poses.get(twin)
        if shown is None:
            shown = self._poses[twin] = np.full_like(links, np.inf)
        moved = np.abs(links - shown).max(axis=(1, 2)) > STILL
        for i in np.flatnonzero(moved).tolist():
            path = f"{ROOT}/{twin}/body/{i}"
            self._put(path, set_transform(path, links[i]))
        shown[moved] = links[moved]

    def _draw(self, committed: Committed | None) -> None:
        """Renew the committed path."""
        pieces: tuple[CommittedPiece, ...] = ()
        if committed is not None:
            timeline, play = committed.timeline, committed.play
            known = self._path
            # A path reaches only so far ahead: it's sampled again as the robot comes nearer to where it was cut.
            if known is None or known[0] is not timeline or not known[1].reaches(play):
                known = self._path = timeline, CommittedPath(self._kinematics, timeline, play, self._tool)
            pieces = known[1].pieces(play)
            if pieces:
                self._set(f"{ROOT}/committed", "play", round(play, 2))
        wanted = {piece.index % NODES: piece for piece in pieces if piece}
        for node in self._drawn.keys() - wanted.keys():
            del self._drawn[node]
            self._set(f"{ROOT}/committed/{node}", "visible", False)
        for node, piece in wanted.items():
            known_piece = self._drawn.get(node)
            if known_piece is not None and known_piece.equals(piece):
                continue
            self._drawn[node] = piece
            where = f"{ROOT}/committed/{node}"
            label = {} if piece.t is None else {"t": round(piece.t, 3), "end": piece.ends}
            points, marks, scale = piece.points, piece.marks, self._scale
            self._set_object(where, self._objects.committed_piece(where, points, marks, label, scale=scale))
            self._set(where, "visible", True)

    def _set_object(self, path: str, lowered: dict[str, Any]) -> None:
        self._put(f"{path} object", set_object(path, lowered))

    def _set(self, path: str, name: str, value: Any) -> None:
        self._put(f"{path} {name}", set_property(path, name, value))

    def _put(self, key: str, command: bytes) -> None:
        self._newest.put(key, command)
