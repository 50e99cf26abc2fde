"""The kinds of robots that recordings are of: what is sampled of them, and how other readers see them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from interfaces.messages.recording import VirtualPosture, VirtualSample
from interfaces.recording.channels import Message
from interfaces.recording.poses import BASE, WORLD, FrameTransforms, link_transforms, robot_frames
from interfaces.recording.track import REAL, REAL_POSTURE, VIRTUAL, VIRTUAL_POSTURE
from robots.base import upright
from vrs.model import Array, RobotModel


@dataclass(frozen=True, slots=True)
class RecordingKind:
    """A kind of robot, as recordings know it."""

    name: str
    """For people, with its article."""
    word: str
    """For programs."""
    virtual: str
    """Topic of the virtual robot's samples."""
    real: str
    """Topic of the real robot's."""
    unit: str
    """Of how far the real robot is from the virtual one: `rad` or `m`."""
    state: str
    """What an engine calls where it begins."""
    sample: Callable[[float, list[float], int], Message]
    """Makes the virtual robot's sample, of a time [s], where it is, and its newest edit."""
    frame: str
    """What its poses are in."""
    poses: Callable[[Any, Array], Array]
    """Says where a model's last link is, or the robot itself, (k, 4, 4), at joints or postures (k, n)."""
    frames: Callable[[Any, Sequence[float], Mapping[str, Array]], list[FrameTransforms]]
    """Makes messages with all links, of a model, times [s], (k,), and joints or postures, (k, n), by robot."""


def _forward(model: RobotModel, q: Array) -> Array:
    return model.forward(q)


def _links(model: RobotModel, times: Sequence[float], robots: Mapping[str, Array]) -> list[FrameTransforms]:
    links = {name: model.links(q)[:, 1:] for name, q in robots.items()}
    return [link_transforms(t, [(name, X[row]) for name, X in links.items()]) for row, t in enumerate(times)]


def _posture(t: float, q: list[float], edit: int) -> Message:
    x, y, theta = q
    return VirtualPosture(t, x, y, theta, edit)


def _upright(_model: object, q: Array) -> Array:
    return np.stack([upright(*row) for row in q.tolist()])


def _placed(_model: object, times: Sequence[float], robots: Mapping[str, Array]) -> list[FrameTransforms]:
    rows = zip(*(q.tolist() for q in robots.values()), strict=True)
    return [
        robot_frames(t, WORLD, tuple(robots), np.stack([upright(*q) for q in row]))
        for t, row in zip(times, rows, strict=True)
    ]


ARM: Final = RecordingKind(
    "an arm", "arm", VIRTUAL, REAL, "rad", "q", sample=VirtualSample, frame=BASE, poses=_forward, frames=_links
)
"""Joints, and polynomials on its timeline."""
MOBILE: Final = RecordingKind(
    "a mobile robot", "mobile", VIRTUAL_POSTURE, REAL_POSTURE, "m", "posture",
    sample=_posture, frame=WORLD, poses=_upright, frames=_placed,
)  # fmt: skip
"""Postures, and arcs on its timeline."""
