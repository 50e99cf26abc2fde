"""Robots from descriptions and from numbers: arms and mobile bases of URDF, xacro, MJCF and TOML files."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache, partial
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from robots.base import upright
from robots.description.arm import arm_model
from robots.description.assumptions import completed, lines_to_state
from robots.description.beside import stated_file, stated_of
from robots.description.description import Description
from robots.description.hand import DescribedHand, hand_of
from robots.description.numbers import BaseNumbers, parse_base, read_base, stem
from robots.description.reading import read
from robots.description.rigid import carried, rigid_chain
from robots.description.wheels import wheeled
from robots.mobile import differential
from robots.onboard.laser import LaserModel
from robots.robot import NUMBERS, TIP, Appearance, Gripper, Robot
from robots.simulated import WORLDS, chain_arm
from robots.solids import LinkShape, together
from vrs.model import Array, frozen_array


@dataclass(frozen=True, slots=True, eq=False)
class DescribedRobot:
    """A robot from a description or from numbers, and what's to be said of it."""

    robot: Robot
    description: Description | None
    """What was read, with what is assumed; None of a mobile robot from numbers."""
    notes: tuple[str, ...] = ()
    """What was missing or can't be, and what was assumed for it, a sentence each."""
    to_state: tuple[str, ...] = ()
    """Lines of TOML that state what was assumed."""
    stated: Path | None = field(default=None)
    """Where they'd go; None of `diff:…`, which takes them itself."""


def robot_of(what: str) -> Robot:
    """Return a robot from a description or from numbers.

    Args:
        what: `FILE` or `FILE#TIP`, a URDF, xacro or MJCF file and perhaps the link at the end of its arm; a TOML
            file with the numbers of a mobile robot; or `diff:wheelbase=…,wheel=…`.

    Raises:
        InvalidValueError: If there's no such tip, or a number isn't allowed.
        FormatError: If a file can't be read.
    """
    return _robot_of(what, _stamps(what))


@lru_cache(maxsize=8)
def _robot_of(what: str, _stamps: tuple[int, ...]) -> Robot:
    """A robot of files as they are; runs of a study ask for theirs again and again."""
    return described(what).robot


def _stamps(what: str) -> tuple[int, ...]:
    """When a description and what's stated beside it were written last."""
    path = Path(split(what)[0]).expanduser()
    files = (path, stated_file(path)) if path.is_file() else ()
    return tuple(file.stat().st_mtime_ns for file in files if file is not None)


def described(what: str) -> DescribedRobot:
    """Return the same with what's to be said of it; arguments and errors as of `robot_of`."""
    if what.startswith(NUMBERS):
        return _differential("diff", parse_base(what), what)
    name, tip = split(what)
    path = Path(name).expanduser().absolute()
    if path.suffix.lower() == ".toml":
        called, numbers = read_base(path)
        return replace(_differential(called, numbers, str(path)), stated=path)
    stated = stated_of(path)
    description, file = read(path, stated), stated_file(path) or path.parent / f"{stem(path)}.vrs.toml"
    base = None if tip else wheeled(description, stated.base or BaseNumbers())
    if base is not None:
        made = _differential(_called(description, path), base.numbers, str(path))
        frames = base.frames
        looks = Appearance(lambda: base.shapes, partial(_carried, frames)) if base.shapes else None
        return replace(
            made,
            robot=replace(made.robot, appearance=looks),
            description=description,
            notes=(*description.notes, *base.notes, *made.notes),
            to_state=("[base]", *made.to_state) if made.to_state else (),
            stated=file,
        )
    whole = completed(description, tip)
    model = arm_model(whole, whole.tip)
    hand = hand_of(whole)
    shapes = _arm_shapes(whole, hand)
    chain = rigid_chain(whole, whole.tip)
    bodies = {world: partial(chain_arm, world, chain, model.limits, whole.gravity) for world in WORLDS}
    robot = Robot(
        _called(whole, path),
        model,
        Appearance(lambda: shapes, model.links) if shapes else None,
        bodies,
        _grippers(whole, hand),
        tuple(joint.name for joint in whole.chain(whole.tip) if joint.moves),
        f"{path}{TIP}{tip}" if tip else str(path),
    )
    notes = (*whole.notes, *(() if hand is None else hand.notes))
    return DescribedRobot(robot, whole, notes, tuple(lines_to_state(description, whole)), file)


def split(what: str) -> tuple[str, str]:
    """A file, and the link after it at which its arm ends; empty where none is said."""
    name, mark, tip = what.rpartition(TIP)
    return (what, "") if not mark or Path(what).is_file() else (name, tip)


def _called(description: Description, path: Path) -> str:
    """What a robot is called: a word that names of files and addresses may have in them."""
    return re.sub(r"[^\w.-]+", "_", description.name).strip("_.")[:60] or stem(path)


def _differential(name: str, given: BaseNumbers, found_by: str) -> DescribedRobot:
    """A mobile robot from numbers."""
    made = differential.differential(name, given)
    body = made.model.body
    laser = LaserModel(forward=0.0, height=min(max(0.8 * body.height, 0.02), 1.0))
    robot = Robot(name, made.model, None, made.bodies(), (laser,), found_by=found_by)
    lines = tuple(differential.lines_to_state(given))
    said = f"Not said, so assumed: {', '.join(lines)}."
    return DescribedRobot(robot, None, (said,) if lines else (), lines)


def _carried(frames: Array, posture: ArrayLike) -> Array:
    """Where shapes are that a base carries, at a posture (x, y, θ)."""
    return upright(*np.asarray(posture, dtype=np.float64).tolist()) @ frames


def _grippers(description: Description, hand: DescribedHand | None) -> tuple[Gripper, ...]:
    """What an arm holds with."""
    if hand is None:
        return () if description.point is None else (Gripper(description.point),)
    return (Gripper(description.point or (0.0, 0.0, 0.0), hand.fingers, frozen_array(hand.X_TH), hand.shapes),)


def _arm_shapes(description: Description, hand: DescribedHand | None) -> Sequence[LinkShape]:
    """What an arm looks like: a shape for its base and one for each joint, with all that hangs on it but fingers.

    What has none is drawn as a ball at its joint; nothing at all is drawn where no link has a shape.
    """
    if not any(link.shapes for link in description.links.values()):
        return ()
    moving = [joint.name for joint in description.chain(description.tip) if joint.moves]
    placed = carried(description, moving)
    last, X_tip = placed[description.tip]
    to_tip = np.linalg.inv(X_tip)
    groups: list[list[tuple[LinkShape, Array]]] = [[] for _ in range(len(moving) + 1)]
    fingers = frozenset() if hand is None or not hand.shapes else hand.links
    for name, link in description.links.items():
        owner, X = placed[name]
        if name in fingers:
            continue
        groups[owner + 1] += [(shape, to_tip @ X if owner == last else X) for shape in link.shapes]
    return [_together(k, group) for k, group in enumerate(groups)]


def _together(k: int, shapes: Sequence[tuple[LinkShape, Array]]) -> LinkShape:
    """Shapes as one, in the frame of what they hang on."""
    if shapes:
        return together(shapes)
    import trimesh

    ball = trimesh.creation.icosphere(subdivisions=2, radius=0.01)
    grey = np.array([0.5, 0.5, 0.5])
    return LinkShape(f"link {k}", ball.vertices, ball.faces, grey, np.tile(grey, (len(ball.faces), 1)))
