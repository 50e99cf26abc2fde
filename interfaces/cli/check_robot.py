"""`vrs check ROBOT`: what a description says, what's assumed where it's silent, and how to state that."""

from __future__ import annotations

import json
import math
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import typer

from robots.described import DescribedRobot, split
from robots.described import described as examined
from robots.description.description import JointKind
from robots.robot import described
from robots.simulated import missing_for
from vrs.errors import InvalidValueError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from robots.description.description import Joint

_LIMITS = {
    "q_min": "lower",
    "q_max": "upper",
    "qd_max": "velocity",
    "qdd_max": "acceleration",
    "qddd_max": "jerk",
    "effort": "effort",
}
"""What limits are called here, and in TOML."""


def check_robots(names: Sequence[str], tip: str, *, as_json: bool) -> None:
    """Say what descriptions say.

    Args:
        names: As `--robot` takes them, files or numbers.
        tip: The link at the end of the arm; where none is given, what stands to reason.
        as_json: Whether it's said as JSON.

    Raises:
        InvalidValueError: If one isn't of a robot, or there's no such tip.
        FormatError: If a file can't be read.
    """
    strange = next((name for name in names if not described(name)), None)
    if strange is not None:
        raise InvalidValueError("file", strange, "a robot's, as the others are")
    found = [examined(f"{name}#{tip}" if tip else name) for name in names]
    if as_json:
        facts = [_facts(one) for one in found]
        typer.echo(json.dumps(facts[0] if len(facts) == 1 else facts, indent=2, ensure_ascii=False))
        return
    for one in found:
        _show(one)


def _facts(found: DescribedRobot) -> dict[str, Any]:
    """What is known of a robot."""
    robot, description = found.robot, found.description
    facts: dict[str, Any] = {
        "robot": robot.name,
        "file": split(robot.found_by)[0],
        "kind": "mobile robot" if robot.is_base else "arm",
        "bodies": [{"name": name, "missing": missing_for(name) or None} for name in robot.body_names],
        "notes": list(found.notes),
        "to_state": list(found.to_state),
        "state_in": None if found.stated is None else str(found.stated),
    }
    if robot.is_base:
        base = robot.base
        limits, body = base.limits, base.body
        facts |= {
            "wheelbase_m": base.wheels.base, "wheel_radius_m": base.wheels.radius, "length_m": body.length,
            "width_m": body.width, "height_m": body.height, "mass_kg": body.mass, "axle_offset_m": body.axle_offset,
            "v_max": limits.v_max, "w_max": limits.w_max, "a_max": limits.a_max, "alpha_max": limits.alpha_max,
        }  # fmt: skip
    else:
        fingers = None if robot.hand is None else robot.hand.fingers
        facts |= {
            "tool_speed": robot.arm.tool_speed,
            "tool_turn_speed": robot.arm.tool_turn_speed,
            "fingers": None if fingers is None else asdict(fingers),
        }
    if description is not None:
        facts |= {
            "tip": None if robot.is_base else description.tip,
            "links": [_link(link) for link in description.links.values()],
            "joints": [_joint(joint) for joint in description.joints],
            "driven": []
            if robot.is_base
            else [joint.name for joint in description.chain(description.tip) if joint.moves],
            "poses": {name: dict(pose) for name, pose in description.poses.items()},
        }
    return facts


def _link(link: Any) -> dict[str, Any]:
    return {"name": link.name, "mass_kg": link.mass, "shapes": len(link.shapes), "collisions": len(link.collisions)}


def _joint(joint: Joint) -> dict[str, Any]:
    mimic = (
        None
        if joint.mimic is None
        else {"joint": joint.mimic.joint, "multiplier": joint.mimic.multiplier, "offset": joint.mimic.offset}
    )
    limits = {key: getattr(joint, field) for field, key in _LIMITS.items()}
    return {
        "name": joint.name, "kind": joint.kind.value, "parent": joint.parent, "child": joint.child, **limits,
        "mimic": mimic,
    }  # fmt: skip


def _show(found: DescribedRobot) -> None:
    """Show what is known of a robot, for people."""
    from rich.console import Console

    facts = _facts(found)
    console = Console(markup=False, highlight=False, soft_wrap=True)
    description, robot = found.description, found.robot
    where = f"{facts['file']}: {robot.name}"
    if robot.is_base:
        limits, body = robot.base.limits, robot.base.body
        sizes = f"{body.length:.3g} × {body.width:.3g} × {body.height:.3g} m, {body.mass:.3g} kg"
        wheels = f"wheels of {facts['wheel_radius_m']:.3g} m at {facts['wheelbase_m']:.3g} m"
        fastest = f"{limits.v_max:.3g} m/s, {limits.w_max:.3g} rad/s"
        steepest = f"{limits.a_max:.3g} m/s², {limits.alpha_max:.3g} rad/s²"
        console.print(f"{where}, a mobile robot: {sizes}, {wheels}, up to {fastest}, {steepest}")
    else:
        arm = robot.arm
        tool = f"tool {arm.tool_speed:.3g} m/s, {arm.tool_turn_speed:.3g} rad/s"
        console.print(f"{where}, an arm of {arm.limits.dof} joints that ends at {facts['tip']}; {tool}")
    if description is not None:
        console.print(f"links: {', '.join(description.links)}")
        if not robot.is_base:
            console.print(_table(found))
            console.print("[1/s], [1/s²], [1/s³]: largest speed, acceleration and jerk; * assumed")
        others = [joint for joint in description.joints if joint.mimic is not None]
        for joint in others:
            assert joint.mimic is not None
            says = f"{joint.mimic.multiplier:g} × {joint.mimic.joint} + {joint.mimic.offset:g}"
            console.print(f"{joint.name} mimics another: {says}")
        if facts.get("fingers"):
            opens, force, speed = (facts["fingers"][key] for key in ("stroke", "force", "speed"))
            console.print(f"fingers: open {1e3 * opens:.3g} mm at {speed:.3g} m/s, press with {force:.3g} N each")
        if description.poses:
            console.print(f"poses: {', '.join(description.poses)}")
    console.print(f"bodies: {', '.join(map(_body, facts['bodies']))}")
    for note in found.notes:
        console.print(f"- {note}")
    if found.to_state:
        into = "as more numbers" if found.stated is None else f"in {found.stated}"
        console.print(f"To state what's assumed, {into}:")
        console.print("\n".join(f"    {line}".rstrip() for line in found.to_state))


def _body(body: dict[str, str | None]) -> str:
    return (
        f"{body['name']} (needs {body['missing']}, which isn't installed)" if body["missing"] else f"{body['name']}"
    )


def _table(found: DescribedRobot) -> Any:
    """The joints that move the arm, with their limits, those that are assumed marked."""
    from rich.box import SIMPLE
    from rich.table import Table

    description = found.description
    assert description is not None
    table = Table(box=SIMPLE, pad_edge=False, padding=(0, 1))
    for head in ("joint", "from", "to", "[1/s]", "[1/s²]", "[1/s³]", "torque"):
        table.add_column(head, justify="left" if head == "joint" else "right", no_wrap=True)
    assumed = _assumed(found.to_state)
    for joint in description.chain(description.tip):
        if not joint.moves:
            continue
        slides = joint.kind is JointKind.PRISMATIC
        factor, unit = (1.0, " m") if slides else (math.degrees(1.0), "°")
        marks = assumed.get(joint.name, set())
        cells = [
            f"{factor * getattr(joint, field):.4g}{unit}{'*' if key in marks else ''}"
            for field, key in _LIMITS.items()
            if key != "effort"
        ]
        effort = "–" if joint.effort is None else f"{joint.effort:.4g} {'N' if slides else 'N m'}"
        table.add_row(joint.name, *cells, effort)
    return table


def _assumed(lines: Sequence[str]) -> dict[str, set[str]]:
    """Keys that the lines to state hold, by joint."""
    import tomllib

    joints = tomllib.loads("\n".join(lines)).get("joints", {})
    return {name: set(keys) for name, keys in joints.items()}
