"""What stands beside a description: MoveIt's joint_limits.yaml, an SRDF, and NAME.vrs.toml, which counts most."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

from robots.description.description import Description, Joint
from robots.description.files import read_root
from robots.description.numbers import Stated, StatedJoint, read_stated, stem
from vrs.checks import bounded_text
from vrs.errors import FormatError

_LARGEST: Final = 2**20
"""Of joint_limits.yaml [B]."""
_KINDS: Final = {"velocity": "qd_max", "acceleration": "qdd_max", "jerk": "qddd_max"}
"""What joint_limits.yaml calls limits, and what they're called here."""


def stated_file(path: Path) -> Path | None:
    """The TOML file beside a description; None where there's none."""
    names = f"{stem(path)}.vrs.toml", f"{stem(path)}.toml"
    return next((found for name in names if (found := path.parent / name) != path and found.is_file()), None)


def stated_of(path: Path) -> Stated:
    """What is stated beside a description.

    Raises:
        FormatError: If the file can't be read, or states what isn't known or allowed.
    """
    file = stated_file(path)
    return Stated() if file is None else read_stated(file)


def joined(description: Description, stated: Stated, path: Path) -> Description:
    """Return a description with what stands beside its file.

    Args:
        description: Of the file alone.
        stated: Of the TOML file.
        path: Of the description.

    Raises:
        FormatError: If one of those files can't be read, or says what can't be.
    """
    notes: list[str] = []
    for limits in _beside(path, "joint_limits.yaml"):
        description = _limited(description, _yaml(limits), limits, notes)
        break
    for srdf in _beside(path, "*.srdf"):
        root = read_root(srdf)
        if srdf.stem == stem(path) or root.get("name") == description.name:
            description = _semantic(description, root, srdf)
            break
    description = _stated(description, stated, path)
    return replace(description, notes=(*description.notes, *notes))


def _beside(path: Path, pattern: str) -> Iterator[Path]:
    """Files in a description's folder, then in the folders `config` in it and beside it."""
    here = path.resolve().parent
    for folder in (here, here / "config", here.parent / "config"):
        yield from (found for found in sorted(folder.glob(pattern)) if found.is_file())


def _yaml(path: Path) -> Mapping[str, Any]:
    """The joints of a joint_limits.yaml."""
    import yaml

    try:
        document = yaml.safe_load(bounded_text(path, _LARGEST))
    except (yaml.YAMLError, OSError, RecursionError) as error:
        raise FormatError(str(path), f"isn't YAML: {' '.join(str(error).split())[:200]}") from None
    joints = document.get("joint_limits") if isinstance(document, dict) else None
    if not isinstance(joints, dict) or not all(isinstance(limits, dict) for limits in joints.values()):
        raise FormatError(str(path), "must have joint_limits with a table for each joint")
    return joints


def _limited(description: Description, joints: Mapping[str, Any], path: Path, notes: list[str]) -> Description:
    """Return a description with the limits of a joint_limits.yaml."""
    known = {joint.name for joint in description.joints}
    strange = sorted(str(name) for name in joints if name not in known)
    if strange:
        notes.append(f"{path.name}: there are no joints {', '.join(strange)}; those limits count for nothing.")
    changed = []
    for joint in description.joints:
        limits, given = joints.get(joint.name, {}), dict[str, Any]()
        for kind, field in _KINDS.items():
            if limits.get(f"has_{kind}_limits"):
                given[field] = _number(limits.get(f"max_{kind}"), f"{joint.name}: max_{kind}", path)
        if limits.get("has_position_limits"):
            low, high = (limits.get(f"{end}_position") for end in ("min", "max"))
            given["q_min"] = _number(low, f"{joint.name}: min_position", path, least=-1e6)
            given["q_max"] = _number(high, f"{joint.name}: max_position", path, least=-1e6)
        changed.append(replace(joint, **given))
    return replace(description, joints=tuple(changed))


def _number(value: object, what: str, path: Path, least: float = 1e-6) -> float:
    """A limit of a file."""
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not least <= value <= 1e6:
        raise FormatError(str(path), f"{what} must be a number in [{least:g}, 1e+06]; given: {value!r}")
    return float(value)


def _semantic(description: Description, root: Any, path: Path) -> Description:
    """Return a description with the named poses and the groups' tips of an SRDF."""
    children = {joint.name: joint.child for joint in description.joints}
    tips = dict(description.tips)
    for group in root.findall("group"):
        name = group.get("name", "")
        for chain in group.findall("chain"):
            tips[name] = chain.get("tip_link", "")
        links = [children.get(joint.get("name", ""), "") for joint in group.findall("joint")]
        links += [link.get("name", "") for link in group.findall("link")]
        deepest = max(
            links, key=lambda link: len(description.chain(link)) if link in description.links else -1, default=""
        )
        if name not in tips and deepest and all(_above(description, link, deepest) for link in links):
            tips[name] = deepest
    ends = {hand.get("group", "") for hand in root.findall("end_effector")}
    groups = [group for group in root.findall("group") if group.get("name", "") in ends]
    of_hand = tuple(joint.get("name", "") for group in groups for joint in group.findall("joint"))
    for hand in root.findall("end_effector"):
        tips.pop(hand.get("group", ""), None)
        if hand.get("parent_group") and hand.get("parent_link"):
            tips.setdefault(hand.get("parent_group"), hand.get("parent_link"))
    poses = {name: dict(pose) for name, pose in description.poses.items()}
    for state in root.findall("group_state"):
        pose = poses.setdefault(state.get("name", ""), {})
        for joint in state.findall("joint"):
            try:
                value = float(joint.get("value", ""))
            except ValueError:
                continue
            if joint.get("name") in children and math.isfinite(value):
                pose[joint.get("name")] = value
    known = {name: tip for name, tip in tips.items() if tip in description.links}
    lost = sorted(set(tips) - set(known))
    notes = [f"{path.name}: groups {', '.join(lost)} end at links that aren't there."] if lost else []
    return replace(description, poses=poses, tips=known, hand=of_hand, notes=(*description.notes, *notes))


def _above(description: Description, link: str, tip: str) -> bool:
    """Whether a link is on the chain to a tip."""
    return link == tip or any(joint.parent == link for joint in description.chain(tip))


def _stated(description: Description, stated: Stated, path: Path) -> Description:
    """Return a description with what its TOML file states."""
    file, names = str(stated_file(path)), {joint.name for joint in description.joints}
    for name in (*stated.joints, *(joint for pose in stated.poses.values() for joint in pose)):
        if name not in names:
            raise FormatError(file, f"there's no joint {name!r}: {', '.join(sorted(names))}")
    if stated.tip and stated.tip not in description.links:
        raise FormatError(file, f"there's no link {stated.tip!r}: {', '.join(description.links)}")
    return replace(
        description,
        name=stated.name or description.name,
        joints=tuple(_joint(joint, stated.joints.get(joint.name), file) for joint in description.joints),
        poses={**description.poses, **stated.poses},
        tip=stated.tip,
        tool_speed=stated.tool_speed,
        tool_turn_speed=stated.tool_turn_speed,
        point=stated.point,
    )


def _joint(joint: Joint, stated: StatedJoint | None, file: str) -> Joint:
    if stated is None:
        return joint
    given: dict[str, Any] = {
        "q_min": stated.lower, "q_max": stated.upper, "qd_max": stated.velocity, "qdd_max": stated.acceleration,
        "qddd_max": stated.jerk, "effort": stated.effort, "armature": stated.armature,
    }  # fmt: skip
    changed = replace(joint, **{name: value for name, value in given.items() if value is not None})
    if changed.q_min is not None and changed.q_max is not None and changed.q_min >= changed.q_max:
        raise FormatError(file, f"{joint.name}: lower must be below upper: {changed.q_min:g}, {changed.q_max:g}")
    return changed
