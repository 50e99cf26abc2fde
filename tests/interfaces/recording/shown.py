"""Where other readers of a recording see the robots: Foxglove's messages, read by the public reader."""

from __future__ import annotations

import json
from collections import defaultdict
from pathlib import Path
from typing import Any

import numpy as np
from mcap.reader import make_reader

from interfaces.recording.recording import Recording
from interfaces.recording.track import REAL, VIRTUAL, SampleTrack
from vrs.model import Array

TOPICS = {"/virtual/pose": "virtual", "/real/pose": "real"}


def matrix(place: dict[str, float], turn: dict[str, float]) -> Array:
    """A transform (4, 4) of a translation and a quaternion."""
    x, y, z, w = (turn[name] for name in "xyzw")
    X = np.eye(4)
    X[:3, :3] = np.eye(3) + 2 * np.array([
        [-y * y - z * z, x * y - z * w, x * z + y * w],
        [x * y + z * w, -x * x - z * z, y * z - x * w],
        [x * z - y * w, y * z + x * w, -x * x - y * y],
    ])  # fmt: skip
    X[:3, 3] = [place[name] for name in "xyz"]
    return X


def links(transforms: list[dict[str, Any]]) -> dict[str, Array]:
    """Poses in the base frame (4, 4) of the frames of a message of `/tf`."""
    poses = {"base": np.eye(4)}
    for transform in transforms:
        X = matrix(transform["translation"], transform["rotation"])
        poses[transform["child_frame_id"]] = poses[transform["parent_frame_id"]] @ X
    del poses["base"]
    return poses


def seconds(timestamp: dict[str, int]) -> float:
    return timestamp["sec"] + 1e-9 * timestamp["nsec"]


def check(path: Path, recording: Recording, least: int) -> None:
    """Assert that the robots are shown where their joints put them, each of their links so often at least."""
    found: dict[str, list[tuple[float, Array]]] = defaultdict(list)
    with path.open("rb") as file:
        for _, channel, message in make_reader(file).iter_messages([*TOPICS, "/tf"]):
            value = json.loads(message.data)
            if channel.topic == "/tf":
                t = seconds(value["transforms"][0]["timestamp"])
                poses = links(value["transforms"])
            else:
                t, pose = seconds(value["timestamp"]), value["pose"]
                poses = {TOPICS[channel.topic]: matrix(pose["position"], pose["orientation"])}
            assert abs(t - 1e-9 * message.log_time) < 1e-9
            for name, X in poses.items():
                found[name].append((t, X))
    model, dof = recording.model, len(recording.session.q)
    for robot, topic in (("virtual", VIRTUAL), ("real", REAL)):
        samples = recording.track(topic)
        for number in range(1, dof + 1):
            q, X = _beside(samples, found.pop(f"{robot}/{number}"), least)
            np.testing.assert_allclose(X, model.links(q)[:, number], rtol=0, atol=2e-5)
        q, X = _beside(samples, found.pop(robot), least)
        np.testing.assert_allclose(X, model.forward(q), rtol=0, atol=1e-6)
    assert not found


def _beside(samples: SampleTrack, shown: list[tuple[float, Array]], least: int) -> tuple[Array, Array]:
    """Joints of the samples of the same times, which are whole nanoseconds here, and what was shown then."""
    assert len(shown) >= least
    t = np.array([at for at, _ in shown])
    apart = np.abs(samples.t - t[:, None])
    assert apart.min(axis=1).max() < 1e-9
    return samples.q[apart.argmin(axis=1)], np.array([X for _, X in shown])
