"""Descriptions for tests of kinematics: public robots, by what kinematics need of URDF, and made-up ones."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
from scipy.spatial.transform import Rotation

from robots.description.arm import DescribedArm, arm_model
from robots.description.description import Description, Joint, JointKind, Link, Mimic

FILES = {
    "panda": ("pybullet_data", "franka_panda/panda.urdf", "panda_hand"),
    "iiwa": ("pybullet_data", "kuka_iiwa/model.urdf", "lbr_iiwa_link_7"),
    "xarm6": ("pybullet_data", "xarm/xarm6_robot.urdf", "link6"),
    "al5d": ("rtbdata", "xacro/lynxmotion_al5d_description/urdf/al5d_robot.urdf", "link4"),
    "puma": ("rtbdata", "xacro/unimation_puma560_description/urdf/puma560_robot.urdf", "link7"),
}
R, P, C = JointKind.REVOLUTE, JointKind.PRISMATIC, JointKind.CONTINUOUS
X_, Y_, Z_ = (1, 0, 0), (0, 1, 0), (0, 0, 1)


def file(name: str) -> tuple[Path, str]:
    """A public robot's file, and the link at the end of its arm."""
    package, path, tip = FILES[name]
    return Path(str(__import__(package).__file__)).parent / path, tip


@lru_cache
def arm(name: str) -> DescribedArm:
    """A public or made-up robot's arm."""
    if name in MADE:
        return chain(name, *MADE[name])
    path, tip = file(name)
    root = ET.parse(path).getroot()
    links = [link.get("name") for link in root.iterfind("link")]
    left = {joint.find("parent").get("link"): [] for joint in root.iterfind("joint")}
    for joint in root.iterfind("joint"):
        left[joint.find("parent").get("link")].append(_joint(joint))
    (first,) = set(links) - {joint.child for joints in left.values() for joint in joints}
    joints, todo = [], [first]
    while todo:
        found = left.get(todo.pop(), [])
        joints += found
        todo += [joint.child for joint in found]
    return arm_model(described(name, joints, links), tip)


def _joint(joint) -> Joint:
    def numbers(tag, key, usual):
        found = joint.find(tag)
        return np.array([float(x) for x in (usual if found is None else found.get(key, usual)).split()])

    X = np.eye(4)
    X[:3, :3] = Rotation.from_euler("xyz", numbers("origin", "rpy", "0 0 0")).as_matrix()
    X[:3, 3] = numbers("origin", "xyz", "0 0 0")
    axis, limit, mimic = numbers("axis", "xyz", "1 0 0"), joint.find("limit"), joint.find("mimic")
    kind = JointKind(joint.get("type"))
    far = 2 * np.pi if kind is C else np.pi
    low, high = (float(limit.get(key, 0)) if limit is not None else 0.0 for key in ("lower", "upper"))
    return joined(
        joint.get("name"), kind, joint.find("parent").get("link"), joint.find("child").get("link"), X,
        axis / np.linalg.norm(axis) if axis.any() else axis, (low, high) if low < high else (-far, far),
        mimic=None if mimic is None else Mimic(mimic.get("joint"), float(mimic.get("multiplier", 1))),
    )  # fmt: skip


def joined(name, kind, parent, child, X, axis, limits=(-np.pi, np.pi), mimic=None) -> Joint:
    """A joint with all of its limits."""
    axis = np.asarray(axis, float)
    return Joint(name, kind, parent, child, np.asarray(X, float), axis, *limits, 1.0, 4.0, 40.0, mimic=mimic)


def described(name, joints, links) -> Description:
    """A description with a tool's speeds."""
    return Description(name, {one: Link(one) for one in links}, tuple(joints), tool_speed=0.25, tool_turn_speed=1.0)


def chain(name, *steps) -> DescribedArm:
    """Links in a row, each on a joint of a kind about an axis, shifted from the link before, within limits."""
    joints = [
        joined(f"j{k}", kind, f"l{k}", f"l{k + 1}", shifted(offset), axis, limits)
        for k, (kind, axis, offset, limits) in enumerate(steps)
    ]
    return arm_model(described(name, joints, [f"l{k}" for k in range(len(steps) + 1)]), f"l{len(steps)}")


def shifted(offset, turn=(0, 0, 0)) -> np.ndarray:
    """A pose: a shift [m] and a rotation vector [rad]."""
    X = np.eye(4)
    X[:3, :3], X[:3, 3] = Rotation.from_rotvec(turn).as_matrix(), offset
    return X


MADE = {
    "scara": (
        (R, Z_, (0, 0, 0.4), (-2.5, 2.5)), (R, Z_, (0.3, 0, 0), (-2.4, 2.4)),
        (P, (0, 0, -1), (0.25, 0, 0), (0, 0.2)), (C, Z_, (0, 0, -0.05), (-6.28, 6.28)),
    ),
    "five": (
        (R, Z_, (0, 0, 0.1), (-2.8, 2.8)), (R, Y_, (0, 0, 0.1), (-1.6, 1.6)), (R, Y_, (0, 0, 0.2), (-2.4, 2.4)),
        (R, Y_, (0, 0, 0.2), (-2, 2)), (R, Z_, (0, 0, 0.05), (-3.1, 3.1)),
    ),
    "rail": (
        (P, X_, (0, 0, 0.2), (-0.5, 0.8)), (R, Z_, (0, 0, 0.3), (-2.8, 2.8)), (R, Y_, (0, 0, 0.1), (-1.8, 1.8)),
        (R, Y_, (0, 0, 0.4), (-2.4, 2.4)), (R, Z_, (0, 0, 0.3), (-2.8, 2.8)), (R, Y_, (0, 0, 0.1), (-2, 2)),
        (C, Z_, (0, 0, 0.1), (-6.28, 6.28)),
    ),
    "flat": (
        (R, Z_, (0, 0, 0.1), (-2.8, 2.8)), (R, Z_, (0.3, 0, 0), (-2.6, 2.6)), (R, Z_, (0.25, 0, 0), (-2.4, 2.4)),
    ),
    "gantry": ((P, X_, (0, 0, 0), (-0.5, 0.5)), (P, Y_, (0, 0, 0), (-0.5, 0.5)), (P, Z_, (0, 0, 0), (0, 0.5))),
    "knob": ((R, Z_, (0.1, 0, 0), (-2, 2)),),
    "snake": tuple((R, (Z_, Y_, X_)[k % 3], (0, 0, 0.1), (-1.5, 1.5)) for k in range(12)),
}  # fmt: skip
