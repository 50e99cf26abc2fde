"""The scene of a virtual and a real robot, for all who look: two arms, or two mobile robots in their room."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import ArrayLike

from interfaces.stream.meshcat.committed import Committed, CommittedPath, CommittedPiece
from interfaces.stream.meshcat.hands import DrawnHands
from interfaces.stream.meshcat.meshes import Bodies, rod_of
from interfaces.stream.meshcat.newest import ROOT, Nodes
from interfaces.stream.meshcat.room import DrawnRoom
from interfaces.teleop.predicted_grasp import Hands
from robots.robot import Display, Robot
from vrs.checks import finite_array, number_in
from vrs.mobile import ArcTimeline, Grid
from vrs.model import Array, RobotModel, frozen_array
from vrs.timeline import Timeline

if TYPE_CHECKING:
    from robots.rooms import Room
    from robots.things import Scene

PATH_PERIOD: Final = 0.1
"""The committed path is renewed, trimmed and the traces are drawn at most this often [s]."""
NODES: Final = 64
"""Nodes for pieces of the committed path: they are used in turn, since the viewer never forgets one wholly."""
STILL: Final = 2e-7
"""A link is put anew where an element of its pose, (4, 4), is off by more than this [m, 1]."""
COLOURS: Final = {"virtual": 0x2F7DE1, "real": 0x8A8578}
TRACE: Final = 3.0
"""How long an arm without shapes leaves a trace [s]."""
OPACITY: Final = {"virtual": 0.42, "real": 1.0}
PIECE: Final = 64
"""Points of a piece of the path that was driven: what is driven later leaves it as it is."""
DRIVEN: Final = {"virtual": (0.10, 0x2F7DE1), "real": (0.26, 0x6E675C)}
"""Width of a path that was driven, as a share of the robot, and its colour: where both lie, both are seen."""
SCREEN_LIFT: Final = 0.011
"""How far a message shines before the middle of the robot's display [m]: just before its glass."""
_USUAL = 0.2
"""Length of a robot whose committed path is as thick as an arm's [m]."""
_HEIGHTS: Final = {"real": 0.008, "virtual": 0.012, "committed": 0.03}
"""Of paths above the floor [m], so that none hides in another."""


class TwinScene(Nodes):
    """What all viewers see, each as quickly as it can: a value that is overtaken is sent to nobody.

    The virtual robot is a ghost, the real one solid; the committed path runs ahead of the real one.
    """

    def __init__(
        self,
        robot: Robot,
        start: ArrayLike | None = None,
        *,
        looks: Bodies | None = None,
        room: Room | None = None,
        grid: Grid | None = None,
        extent: ArrayLike | None = None,
    ) -> None:
        """Make the scene, with both robots at the start and only the virtual one shown.

        Args:
            robot: What both are; an arm that has no shapes is shown by its frames and traces.
            start: Where both begin: joints [rad], (n,), the first of an arm's named poses unless given; of a mobile
                robot its posture (x, y, θ) [m, m, rad], (3,).
            looks: `bodies` of the robot; unless given, nothing is to be seen until `dress`.
            room: See `DrawnRoom`; so are `grid` and `extent`.
            grid: Of the cells of the virtual environment.
            extent: What is to be seen of the floor.

        Raises:
            InvalidValueError: If something isn't finite or has another shape.
        """
        from interfaces.stream.meshcat import objects

        super().__init__()
        self._robot, self._objects = robot, objects
        self._links: Callable[[ArrayLike], Array]
        self._surroundings = room, grid, extent
        self._room: DrawnRoom | None = None
        self._hands: DrawnHands | None = None
        if robot.is_base:
            n, self._length = 3, robot.base.body.length
            self._links = robot.placed
            tool: ArrayLike = (0.0, 0.0, _HEIGHTS["committed"] * min(self._length / 0.45, 1.0))
        else:
            model = robot.arm
            n, self._length = model.limits.dof, _USUAL
            self._links, tool = model.links, robot.tool
            if start is None:
                start = next(iter(model.poses.values()), 0.5 * (model.limits.q_min + model.limits.q_max))
        self.tool = frozen_array(tool)
        """The point whose path is drawn, in the last link's frame [m], (3,), read-only."""
        self._shape = (n,)
        self._start = self._checked("start", () if start is None else start)
        self._poses: dict[str, Array] = {}
        self._path: tuple[Timeline | ArcTimeline, CommittedPath] | None = None
        self._drawn: dict[int, CommittedPiece] = {}
        self._driven: dict[tuple[str, int], tuple[int, bytes]] = {}
        self._trails: dict[str, deque[tuple[float, Array]]] = {twin: deque(maxlen=128) for twin in COLOURS}
        self.path_due = float("-inf")
        if looks is not None:
            self.dress(looks)

    def dress(self, looks: Bodies) -> None:
        """Show the robots from now on; once.

        Args:
            looks: From `bodies` of the scene's robot, which takes its time and may be asked for in a thread.
        """
        assert not self._poses
        objects, (meshes, floor) = self._objects, looks
        rest = np.asarray(self._links(self._start))
        rods: list[Array | None] = []
        if self._robot.is_base:
            self._room = DrawnRoom(self, self._start, *self._surroundings)
        else:
            model = self._robot.arm
            self.put_property(ROOT, "box", _box(model, floor))
            # Below the floor by a hair: no stripes where a foot stands on it.
            self.put_transform("/Grid", _at(0.0, 0.0, floor - 0.001))
            self.put_property("/Axes", "visible", False)
            if not meshes:
                rods = [None, *(rod_of(model, i) for i in range(1, len(rest)))]
        self._traced = bool(rods)
        if self._robot.hand is not None and meshes:
            self._hands = DrawnHands(self, self._robot.hand, len(rest) - 1)
        for twin in COLOURS:
            for i, mesh in enumerate(meshes):
                path = f"{ROOT}/{twin}/body/{i}"
                self.put_object(path, (objects.ghost if twin == "virtual" else objects.solid)(path, mesh))
            for i, rod in enumerate(rods):
                path = f"{ROOT}/{twin}/body/{i}"
                self.put_object(path, objects.frame(path, rod, COLOURS[twin], OPACITY[twin]))
            self._move(twin, rest)
        self.put_property(f"{ROOT}/real", "visible", False)
        self.wake()

    def show(
        self,
        *,
        virtual: ArrayLike,
        real: ArrayLike | None = None,
        path: Committed | None = None,
        driven: Mapping[str, Array] | None = None,
        learned: tuple[tuple[int, int], ...] = (),
        hands: Hands | None = None,
        t: float = 0.0,
        now: float,
    ) -> None:
        """Show both robots where they are now; to be called at the rate of frames, also while they rest.

        Args:
            virtual: Joints of the virtual robot [rad], (n,), or its posture (x, y, θ) [m, m, rad], (3,).
            real: The real one's; None hides it.
            path: What the real robot is committed to; None for no path.
            driven: Where `virtual` and `real` drove until now [m], (k, 2) each; all of it, so that what was given
                before begins with it or is its beginning. None leaves what is drawn.
            learned: Cells that the virtual environment has.
            hands: Of arms with fingers, and the things around them; None leaves what is drawn.
            t: Time in the room [s]: who walks in it, and what comes and goes.
            now: [s], never less than before; the same origin as ever, it only spaces updates.

        Raises:
            InvalidValueError: If joints or a posture have another shape or aren't finite; nothing changes then.
        """
        number_in("now", now, -1e15, 1e15)
        number_in("t", t, -1e9, 1e9)
        assert self._poses
        shown = {"virtual": virtual} | ({} if real is None else {"real": real})
        poses = {twin: np.asarray(self._links(self._checked(twin, q))) for twin, q in shown.items()}
        before = self.version
        for twin, links in poses.items():
            self._move(twin, links)
        self.put_property(f"{ROOT}/real", "visible", real is not None)
        if self._room is not None:
            self._room.show(t)
        if self._hands is not None and hands is not None:
            self._hands.show(hands)
        if now >= self.path_due:
            self.path_due = now + PATH_PERIOD
            self._draw(path)
            for twin, points in (driven or {}).items():
                self._drive(twin, points)
            if self._room is not None:
                self._room.learn(learned)
            if self._traced:
                self._trace(poses, now)
        if self.version != before:
            self.wake()

    def furnish(self, scene: Scene) -> None:
        """Show the things of a scene from now on, instead of another's; a robot without fingers has none."""
        if self._hands is not None:
            self._hands.furnish(scene)
            self.wake()

    def say(self, text: str) -> None:
        """Show a message on the real robot's display, if it has one; an empty one clears it."""
        display = self._robot.device(Display)
        if display is None:
            return
        path = f"{ROOT}/real/body/0/screen"
        if text:
            X = display.pose()
            X[:3, 3] += SCREEN_LIFT * X[:3, 0]
            self.put_object(path, self._objects.sign(path, self._objects.text_picture(text), display.size, X))
        self.put_property(path, "visible", bool(text))
        self.wake()

    def _checked(self, name: str, q: ArrayLike) -> Array:
        return finite_array(name, q, self._shape, f"finite numbers of shape {self._shape}")

    def _tool_at(self, q: Array) -> Array:
        """Where the tool is [m], (k, 3), at joints or postures (k, n)."""
        if self._robot.is_base:
            return np.column_stack([q[:, :2], np.full(len(q), self.tool[2])])
        X = np.asarray(self._robot.arm.forward(q))
        points: Array = X[:, :3, :3] @ self.tool + X[:, :3, 3]
        return points

    def _move(self, twin: str, links: Array) -> None:
        """Put the parts of a robot where they are, (m, 4, 4)."""
        shown = self._poses.get(twin)
        if shown is None:
            shown = self._poses[twin] = np.full_like(links, np.inf)
        moved = np.abs(links - shown).max(axis=(1, 2)) > STILL
        for i in np.flatnonzero(moved).tolist():
            self.put_transform(f"{ROOT}/{twin}/body/{i}", links[i])
        shown[moved] = links[moved]

    def _draw(self, committed: Committed | None) -> None:
        """Renew the committed path."""
        pieces: tuple[CommittedPiece, ...] = ()
        if committed is not None:
            timeline, play = committed.timeline, committed.play
            known = self._path
            # A path reaches only so far ahead: it's sampled again as the robot comes nearer to where it was cut.
            if known is None or known[0] is not timeline or not known[1].reaches(play):
                known = self._path = timeline, CommittedPath(self._tool_at, timeline, play)
            pieces = known[1].pieces(play)
            if pieces:
                self.put_property(f"{ROOT}/committed", "play", round(play, 2))
        wanted = {piece.index % NODES: piece for piece in pieces if piece}
        for node in self._drawn.keys() - wanted.keys():
            del self._drawn[node]
            self.put_property(f"{ROOT}/committed/{node}", "visible", False)
        for node, piece in wanted.items():
            known_piece = self._drawn.get(node)
            if known_piece is not None and known_piece.equals(piece):
                continue
            self._drawn[node] = piece
            where = f"{ROOT}/committed/{node}"
            label = {} if piece.t is None else {"t": round(piece.t, 3), "end": piece.ends}
            points, marks, scale = piece.points, piece.marks, self._length / _USUAL
            self.put_object(where, self._objects.committed_piece(where, points, marks, label, scale=scale))
            self.put_property(where, "visible", True)

    def _drive(self, twin: str, points: Array) -> None:
        """Draw where a robot drove, in pieces that stay as they are once they're whole."""
        places = np.column_stack([points, np.full(len(points), _HEIGHTS[twin])])
        count = max(math.ceil((len(points) - 1) / PIECE), 0)
        for k in range(count):
            piece = places[k * PIECE : (k + 1) * PIECE + 1]
            state = len(piece), piece[-1].tobytes()
            if self._driven.get((twin, k)) != state:
                path = f"{ROOT}/driven/{twin}/{k}"
                width, colour = DRIVEN[twin]
                self.put_object(path, self._objects.band(path, piece, width * self._length, colour))
                self.put_property(path, "visible", True)
                self._driven[twin, k] = state
        for _, k in [key for key in self._driven if key[0] == twin and key[1] >= count]:
            self.put_property(f"{ROOT}/driven/{twin}/{k}", "visible", False)
            del self._driven[twin, k]

    def _trace(self, poses: dict[str, Array], now: float) -> None:
        for twin, trail in self._trails.items():
            links = poses.get(twin)
            if links is not None:
                point = links[-1, :3, :3] @ self.tool + links[-1, :3, 3]
                if not trail or np.linalg.norm(point - trail[-1][1]) > 1e-3:
                    trail.append((now, point))
            while trail and trail[0][0] < now - TRACE:
                trail.popleft()
            path = f"{ROOT}/{twin}/trace"
            if len(trail) > 1:
                points = np.array([point for _, point in trail])
                self.put_object(path, self._objects.trace(path, points, COLOURS[twin]))
            self.put_property(path, "visible", len(trail) > 1)


def _at(x: float, y: float, z: float) -> Array:
    X = np.eye(4)
    X[:3, 3] = x, y, z
    return X


def _box(model: RobotModel, floor: float) -> list[list[float]]:
    """Corners of what the camera is to show [m]: the floor, and the arm at its named poses, turned about z."""
    poses = list(model.poses.values()) or [0.5 * (model.limits.q_min + model.limits.q_max)]
    points = np.asarray(model.links(np.array(poses)))[..., :3, 3].reshape(-1, 3)
    reach = float(np.linalg.norm(points[:, :2], axis=1).max()) + 0.05
    return [[-reach, -reach, floor], [reach, reach, max(float(points[:, 2].max()), floor + reach) + 0.05]]
