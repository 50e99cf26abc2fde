"""Both hands with their fingers, and the things around them, in the 3D view."""

from __future__ import annotations

from typing import Final

import numpy as np

from interfaces.stream.meshcat.meshes import shaded
from interfaces.stream.meshcat.newest import ROOT, Nodes
from interfaces.teleop.predicted_grasp import Hands
from robots.bullet.grasping import PALM, finger_poses, moving
from robots.robot import Gripper
from robots.solids import Builder, LinkShape
from robots.things import Scene, pose_matrix
from vrs.model import Array

STEEL: Final = (0.55, 0.57, 0.60)
PADS: Final = (0.20, 0.22, 0.25)
STILL: Final = 1e-5
"""What moves by less [m, 1] is left where it is."""


def hand_shapes(gripper: Gripper) -> tuple[LinkShape | None, ...]:
    """Palm and both fingers, about their middles; no palm where that's a part of the last link."""
    if gripper.shapes:
        return (None, *gripper.shapes)
    import trimesh

    fingers = gripper.fingers
    assert fingers is not None
    broad = fingers.stroke + 2.0 * fingers.thickness
    parts = (
        ("palm", (broad, fingers.width, PALM), STEEL),
        ("finger", (fingers.thickness, fingers.width, fingers.length), PADS),
    )
    shapes = []
    for name, extents, colour in (*parts, parts[1]):
        build = Builder(name, colour)
        build.add(trimesh.creation.box(extents=extents))
        shapes.append(build.shape())
    return tuple(shapes)


class DrawnHands:
    """The hands and the things of a scene."""

    def __init__(self, nodes: Nodes, gripper: Gripper, link: int) -> None:
        """Put both hands up, open; the things come with `furnish`.

        Args:
            nodes: The scene that they're part of.
            gripper: It has fingers.
            link: Number of the link's node that they go along with, the last.
        """
        from interfaces.stream.meshcat import objects

        self._nodes, self._gripper, self._link, self._objects = nodes, gripper, link, objects
        self._at: dict[str, Array] = {}
        self._scene: Scene | None = None
        for twin, draw in (("virtual", objects.ghost), ("real", objects.solid)):
            nodes.put_transform(self._hand(twin), gripper.X_LH)
            for i, shape in enumerate(hand_shapes(gripper)):
                if shape is not None:
                    path = self._part(twin, i)
                    nodes.put_object(path, draw(path, shaded(shape)))
        fingers = gripper.fingers
        assert fingers is not None
        self.show(Hands(fingers.stroke, fingers.stroke))

    def _hand(self, twin: str) -> str:
        return f"{ROOT}/{twin}/body/{self._link}/hand"

    def _part(self, twin: str, i: int) -> str:
        return f"{self._hand(twin)}/{i}"

    def furnish(self, scene: Scene) -> None:
        """Put up the things of a scene, instead of another's."""
        if scene == self._scene:
            return
        nodes, objects = self._nodes, self._objects
        for kind, count in self._counts().items():
            for k in range(count):
                nodes.put_property(f"{ROOT}/{kind}/{k}", "visible", False)
        self._scene = scene.coloured
        fixed = [thing for thing in self._scene.things if thing.mass is None]
        for kind, things in (("fixed", fixed), ("things", moving(self._scene))):
            for k, thing in enumerate(things):
                path = f"{ROOT}/{kind}/{k}"
                mesh = shaded(thing.shape())
                nodes.put_object(path, objects.solid(path, mesh))
                self._place(path, pose_matrix(thing.pose))
                nodes.put_property(path, "visible", True)
                if kind == "things":
                    path = f"{ROOT}/predicted/{k}"
                    nodes.put_object(path, objects.ghost(path, mesh))
                    nodes.put_property(path, "visible", False)

    def _counts(self) -> dict[str, int]:
        if self._scene is None:
            return {}
        count = len(moving(self._scene))
        return {"fixed": len(self._scene.things) - count, "things": count, "predicted": count}

    def show(self, hands: Hands) -> None:
        """Show everything where it is."""
        for twin, opening in (("virtual", hands.virtual), ("real", hands.real)):
            if opening is not None:
                for i, pose in enumerate(finger_poses(self._gripper, opening)):
                    if i or not self._gripper.shapes:
                        self._place(self._part(twin, i), pose)
        count = self._counts().get("things", 0)
        for k, pose in hands.poses.items():
            if k < count:
                self._place(f"{ROOT}/things/{k}", pose_matrix(pose))
        taken = None if hands.predicted is None else hands.predicted[0]
        for k in range(count):
            self._nodes.put_property(f"{ROOT}/predicted/{k}", "visible", k == taken)
        if hands.predicted is not None and hands.predicted[0] < count:
            self._place(f"{ROOT}/predicted/{hands.predicted[0]}", hands.predicted[1])

    def _place(self, path: str, X: Array) -> None:
        known = self._at.get(path)
        if known is None or np.abs(known - X).max() > STILL:
            self._at[path] = X
            self._nodes.put_transform(path, X)
