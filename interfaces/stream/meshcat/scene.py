"""Scenes of a virtual and a real robot as MeshCat's commands: everything once, then what changes."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from types import ModuleType
from typing import Any, Final

import msgspec
import numpy as np
from numpy.typing import ArrayLike

from interfaces.stream.meshcat.committed import Committed, CommittedPath, CommittedPiece, Kinematics
from interfaces.stream.meshcat.meshes import Bodies, bodies
from interfaces.stream.meshcat.newest import Newest, ReaderPosition
from robots.robot import Robot
from vrs.checks import number_in
from vrs.errors import InvalidValueError
from vrs.mobile import ArcTimeline
from vrs.model import Array, RobotModel, frozen_array
from vrs.timeline import Timeline

Json = dict[str, Any]


def set_transform(path: str, X: Array) -> bytes:
    """Put a node at X, (4, 4), in its parent's frame; the bytes are those of `meshcat.commands.SetTransform`."""
    return _encoder.encode({"type": "set_transform", "path": path, "matrix": X.T.ravel().tolist()})


def set_object(path: str, lowered: Json) -> bytes:
    """Show an object at a node, in place of the one that's there.

    Args:
        path: The node; its children and its transform stay.
        lowered: The object as MeshCat's classes lower it: `geometries`, `materials`, `object`.
    """
    return _encoder.encode({"type": "set_object", "object": lowered, "path": path})


def set_property(path: str, name: str, value: Any) -> bytes:
    """Set a property of a node; the viewer keeps those that it doesn't know with the node."""
    return _encoder.encode({"type": "set_property", "path": path, "property": name, "value": value})


def delete(path: str) -> bytes:
    """Take a node away, and all below it; where there's none, nothing happens."""
    return _encoder.encode({"type": "delete", "path": path})


def _ext(value: Any) -> msgspec.msgpack.Ext:
    """MeshCat's typed arrays are extensions of its own msgpack library."""
    return msgspec.msgpack.Ext(value.type, value.data)


_encoder = msgspec.msgpack.Encoder(enc_hook=_ext)


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
        self.path_due = float("-inf")
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


TRACE: Final = 3.0
"""How long a robot without shapes leaves a trace [s]."""
OPACITY: Final = {"virtual": 0.42, "real": 1.0}


class MeshcatScene(TwinScene):
    """Two arms: see `TwinScene`. The committed path runs ahead of the real one's tool."""

    def __init__(self, robot: Robot, *, tool: ArrayLike | None = None, dressed: bool = True) -> None:
        """Make the scene, with both robots at the first of the model's named poses and only the virtual one shown.

        Args:
            robot: An arm; if it has no shapes, its frames and traces are shown.
            tool: The point whose path is drawn, in the last link's frame [m], (3,); the robot's own unless given.
            dressed: Whether to make the robot's bodies now; else nothing is to be seen until `dress`.
        """
        self._model = model = robot.arm
        point = frozen_array(robot.tool if tool is None else tool)
        if point.shape != (3,) or not np.isfinite(point).all():
            raise InvalidValueError("tool", tool, "finite, of shape (3,)")
        super().__init__(model, point)
        self._trails: dict[str, deque[tuple[float, Array]]] = {twin: deque(maxlen=128) for twin in COLOURS}
        self._dressed = False
        if dressed:
            self.dress(bodies(robot))

    def dress(self, looks: Bodies) -> None:
        """Show the robots from now on; once.

        Args:
            looks: From `bodies` of the scene's robot, which takes its time and may be asked for in a thread.
        """
        from interfaces.stream.meshcat import objects

        assert not self._dressed
        self._dressed = True
        self._objects = objects
        model, meshes = self._model, looks.meshes
        self._traced = not meshes
        q = next(iter(model.poses.values()), 0.5 * (model.limits.q_min + model.limits.q_max))
        rest = np.asarray(model.links(q))
        self._set(ROOT, "box", _box(model, looks.floor))
        # Below the floor by a hair: no stripes where a foot stands on it.
        self._put("/Grid", set_transform("/Grid", _at(0.0, 0.0, looks.floor - 0.001)))
        self._set("/Axes", "visible", False)
        for twin in COLOURS:
            for i in range(len(rest)):
                path = f"{ROOT}/{twin}/body/{i}"
                if meshes:
                    body = (objects.ghost if twin == "virtual" else objects.solid)(path, meshes[i])
                else:
                    before = None if i == 0 else _rod(model, i)
                    body = objects.frame(path, before, COLOURS[twin], OPACITY[twin])
                self._set_object(path, body)
            self._move(twin, rest)
        self._set(f"{ROOT}/real", "visible", False)
        self._newest.wake()

    @property
    def tool(self) -> Array:
        """The point whose path is drawn, in the last link's frame [m], (3,), read-only."""
        return self._tool

    def show(
        self, *, virtual: ArrayLike, real: ArrayLike | None = None, path: Committed | None = None, now: float
    ) -> None:
        """Show both robots where they are now; to be called at the rate of frames, also while they rest.

        Args:
            virtual: Poses of the virtual robot's base and links, (n + 1, 4, 4), as `model.links(q)`.
            real: The real one's; None hides it.
            path: What the real robot is committed to; None for no path.
            now: [s], never less than before; the same origin as ever, it only spaces updates.

        Raises:
            InvalidValueError: If poses have another shape or aren't finite; nothing changes then.
        """
        number_in("now", now, -1e15, 1e15)
        assert self._dressed
        poses = {"virtual": self._checked("virtual", virtual)}
        if real is not None:
            poses["real"] = self._checked("real", real)
        before = self._newest.version
        for twin, links in poses.items():
            self._move(twin, links)
        self._set(f"{ROOT}/real", "visible", real is not None)
        if now >= self.path_due:
            self.path_due = now + PATH_PERIOD
            self._draw(path)
            if self._traced:
                self._trace(poses, now)
        if self._newest.version != before:
            self._newest.wake()

    def _checked(self, name: str, links: ArrayLike) -> Array:
        X = np.asarray(links, dtype=np.float64)
        shape = (self._model.limits.dof + 1, 4, 4)
        if X.shape != shape or not np.isfinite(X).all():
            raise InvalidValueError(name, X.shape, f"finite poses of shape {shape}")
        return X

    def _trace(self, poses: dict[str, Array], now: float) -> None:
        for twin, trail in self._trails.items():
            links = poses.get(twin)
            if links is not None:
                point = links[-1, :3, :3] @ self._tool + links[-1, :3, 3]
                if not trail or np.linalg.norm(point - trail[-1][1]) > 1e-3:
                    trail.append((now, point))
            while trail and trail[0][0] < now - TRACE:
                trail.popleft()
            path = f"{ROOT}/{twin}/trace"
            if len(trail) > 1:
                points = np.array([point for _, point in trail])
                self._set_object(path, self._objects.trace(path, points, COLOURS[twin]))
            self._set(path, "visible", len(trail) > 1)


def _at(x: float, y: float, z: float) -> Array:
    X = np.eye(4)
    X[:3, 3] = x, y, z
    return X


def _rod(model: RobotModel, i: int) -> Array | None:
    """Origin of link i − 1 in link i's frame [m], (3,); None where that isn't constant."""
    low, span = model.limits.q_min, model.limits.q_max - model.limits.q_min
    one, other = ((np.linalg.inv(X[i]) @ X[i - 1])[:3, 3] for X in model.links(low + np.outer((0.4, 0.6), span)))
    return one if np.allclose(one, other, atol=1e-9) else None


def _box(model: RobotModel, floor: float) -> list[list[float]]:
    """Corners of what the camera is to show [m]: the floor, and the arm at its named poses, turned about z."""
    poses = list(model.poses.values()) or [0.5 * (model.limits.q_min + model.limits.q_max)]
    points = np.asarray(model.links(np.array(poses)))[..., :3, 3].reshape(-1, 3)
    reach = float(np.linalg.norm(points[:, :2], axis=1).max()) + 0.05
    return [[-reach, -reach, floor], [reach, reach, max(float(points[:, 2].max()), floor + reach) + 0.05]]
