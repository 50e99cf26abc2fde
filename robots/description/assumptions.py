"""What is assumed where a description is silent: each of it is said, with the lines of TOML that state it."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from robots.description.description import Description, Joint, JointKind, Link, corners_of
from robots.description.rigid import rigid_chain
from robots.description.tips import tip_of
from vrs.model import Array

TURN, SLIDE = math.pi, 0.5
"""How far joints go either way whose limits aren't said [rad], [m]; continuous ones go twice as far."""
TURN_SPEED, SLIDE_SPEED = 1.0, 0.1
"""Largest speeds where none are said [rad/s], [m/s]."""
SPEED_TIME, ACCELERATION_TIME = 0.25, 0.1
"""In what time joints reach their largest speeds, and their largest accelerations, where nothing is said [s].

The speeds in a longer one where the efforts that are said don't give that.
"""
_MOTIONS, _OFTEN, _LONGEST = 256, 0.95, 2.5
"""Random poses and motions in which efforts are looked at, in what part of them they must do, and the longest time
that is assumed for it all the same [s]."""
ROTOR_TIME: Final = 0.02
"""In what time a drive with nothing on it reaches its joint's largest speed, where its inertia isn't said [s]."""
ROTOR_MOST: Final = (0.1, 10.0)
"""Inertia of a drive that is assumed at most [kg m²], and of prismatic joints [kg]."""
REACH_TIME: Final = 2.0
"""In what time a tool goes as far as the arm reaches, where its speed isn't said [s]."""
FASTEST: Final = 1.0
"""Largest speed of a tool that's assumed [m/s]."""
TURN_TOOL: Final = 1.0
"""Angular speed of a tool where none is said [rad/s]."""
DENSITY: Final = 800.0
"""Of what has no mass [kg/m³]: motors, gears and much air."""
_LEAST: Final = 0.05
"""Mass of what has neither mass nor shape [kg], and the side of its box [m]."""


def completed(description: Description, tip: str = "") -> Description:
    """Return a description of an arm in which nothing is missing, its tip chosen, and all that is assumed said.

    Args:
        description: What was read.
        tip: See `tips.tip_of`.

    Raises:
        InvalidValueError: If there's no such tip.
    """
    chosen = tip_of(description, tip)
    notes: list[str] = []
    of_masses: list[str] = []
    on_chain = [joint for joint in description.chain(chosen) if joint.moves]
    links = _with_inertia(description, of_masses)
    done = replace(description, joints=tuple(map(_assumed, description.joints)), links=links, tip=chosen)
    speed_time = _speed_time(done, [joint.name for joint in on_chain if not joint.qdd_max])
    if speed_time > SPEED_TIME:
        done = replace(done, joints=tuple(_assumed(joint, speed_time) for joint in description.joints))
    _say_joints(on_chain, notes, speed_time)
    notes += of_masses
    if not tip and not description.tip:
        leaves = [leaf for leaf in description.leaves() if leaf != chosen]
        others = f"; other ends are {', '.join(leaves)}" if leaves else ""
        notes.append(f"The tip is {chosen}{others}.")
    if done.tool_speed is None:
        speed = min(round(_reach(done) / REACH_TIME, 2), FASTEST) or 0.01
        notes.append(
            f"The tool's speed isn't said; assumed {speed:g} m/s, half of how far the arm reaches a second."
        )
        done = replace(done, tool_speed=speed)
    if done.tool_turn_speed is None:
        notes.append(f"The tool's angular speed isn't said; assumed {TURN_TOOL:g} rad/s.")
        done = replace(done, tool_turn_speed=TURN_TOOL)
    return replace(done, notes=(*description.notes, *notes))


def lines_to_state(before: Description, after: Description) -> list[str]:
    """Lines of TOML that state what was assumed of an arm.

    Args:
        before: What was read.
        after: What `completed` made of it.
    """
    lines = [] if before.tip else [f'tip = "{after.tip}"']
    missing = [name for name in ("tool_speed", "tool_turn_speed") if getattr(before, name) is None]
    lines += [f"{name} = {getattr(after, name):g}" for name in missing]
    was = {joint.name: joint for joint in before.joints}
    for joint in after.chain(after.tip):
        missing = [
            f"{key} = {getattr(joint, field):.6g}"
            for key, field in _KEYS.items()
            if joint.moves and getattr(was[joint.name], field) is None
        ]
        if missing:
            lines += ["", f'[joints."{joint.name}"]', *missing]
    return lines


_KEYS: Final = {
    "lower": "q_min", "upper": "q_max", "velocity": "qd_max", "acceleration": "qdd_max", "jerk": "qddd_max",
    "armature": "armature",
}  # fmt: skip
"""What limits are called in TOML, and here."""


def _speed_time(done: Description, silent: list[str]) -> float:
    """In what time joints of which no acceleration is said reach their largest speeds [s].

    Random motions at their speeds and accelerations ask no more, as a rule, than the efforts that are said.

    Args:
        done: Nothing is missing.
        silent: Their names.
    """
    moving = [joint for joint in done.chain(done.tip) if joint.moves]
    effort = np.array([joint.effort or np.inf for joint in moving])
    if not silent or not np.isfinite(effort).any():
        return SPEED_TIME
    bounds = np.array([(joint.q_min, joint.q_max, joint.qd_max, joint.qdd_max) for joint in moving], dtype=float).T
    rng = np.random.default_rng(0)
    size = (_MOTIONS, len(moving))
    q, qd = rng.uniform(bounds[0], bounds[1], size), bounds[2] * rng.uniform(-1.0, 1.0, size)
    qdd, free = bounds[3] * rng.choice([-1.0, 1.0], size), np.array([joint.name in silent for joint in moving])
    chain, still = rigid_chain(done, done.tip), np.zeros(size)
    others = chain.inverse_dynamics(q, qd, np.where(free, 0.0, qdd), gravity=done.gravity)
    friction = np.array([joint.damping for joint in moving]) * np.abs(qd) + [joint.friction for joint in moving]
    asked = np.abs(chain.inverse_dynamics(q, still, np.where(free, qdd, 0.0), gravity=0.0))
    share = (effort - np.abs(others) - friction) / np.maximum(asked, 1e-12)
    enough = float(np.quantile(share.min(axis=1), 1.0 - _OFTEN))
    return min(max(SPEED_TIME, round(SPEED_TIME / enough, 2) if enough > 0.0 else np.inf), _LONGEST)


def _assumed(joint: Joint, speed_time: float = SPEED_TIME) -> Joint:
    """A joint with all of its limits."""
    slides, far = joint.kind is JointKind.PRISMATIC, TURN
    if slides:
        far = SLIDE
    elif joint.kind is JointKind.CONTINUOUS:
        far = 2 * TURN
    speed = joint.qd_max or (SLIDE_SPEED if slides else TURN_SPEED)
    acceleration = joint.qdd_max or speed / speed_time
    low, high = joint.q_min, joint.q_max
    if low is None and high is None:
        low, high = -far, far
    elif low is None and high is not None:
        low = high - 2 * far
    elif high is None and low is not None:
        high = low + 2 * far
    return replace(
        joint,
        q_min=low,
        q_max=high,
        qd_max=speed,
        qdd_max=acceleration,
        qddd_max=joint.qddd_max or acceleration / ACCELERATION_TIME,
        armature=min(ROTOR_TIME * (joint.effort or 0.0) / speed, ROTOR_MOST[slides])
        if joint.armature is None
        else joint.armature,
    )


def _say_joints(joints: Sequence[Joint], notes: list[str], speed_time: float) -> None:
    """Say what was assumed of joints."""

    def say(of: Iterable[Joint], what: str) -> None:
        names = ", ".join(joint.name for joint in of)
        if names:
            notes.append(f"{names}: {what}")

    def lacking(test: Callable[[Joint], bool], *kinds: JointKind) -> list[Joint]:
        return [joint for joint in joints if test(joint) and (not kinds or joint.kind in kinds)]

    def boundless(joint: Joint) -> bool:
        return joint.q_min is None or joint.q_max is None

    turning, sliding = (JointKind.REVOLUTE, JointKind.CONTINUOUS), (JointKind.PRISMATIC,)
    say(
        lacking(boundless, JointKind.CONTINUOUS), "turns without end; assumed within ±360°, as a plan needs limits."
    )
    say(lacking(boundless, JointKind.REVOLUTE), f"no limits are said; assumed ±{math.degrees(TURN):g}°.")
    say(lacking(boundless, *sliding), f"no limits are said; assumed ±{SLIDE:g} m.")
    say(lacking(lambda joint: not joint.qd_max, *turning), f"no speed is said; assumed {TURN_SPEED:g} rad/s.")
    say(lacking(lambda joint: not joint.qd_max, *sliding), f"no speed is said; assumed {SLIDE_SPEED:g} m/s.")
    say(
        lacking(lambda joint: not joint.qdd_max),
        f"no acceleration is said; assumed such that the largest speed is reached in {speed_time:g} s"
        + (", as the efforts don't give more." if speed_time > SPEED_TIME else "."),
    )
    say(
        lacking(lambda joint: not joint.qddd_max),
        f"no jerk is said; assumed such that the largest acceleration is reached in {ACCELERATION_TIME:g} s.",
    )
    say(lacking(lambda joint: not joint.effort), "no effort is said; the drive has no limit.")
    say(
        lacking(lambda joint: joint.armature is None),
        f"no inertia of the drive (armature) is said; assumed such that it reaches the largest speed by itself in "
        f"{1e3 * ROTOR_TIME:g} ms, at most {ROTOR_MOST[0]:g} kg m² or {ROTOR_MOST[1]:g} kg.",
    )


def _reach(description: Description) -> float:
    """How far the tip is from the first joint of its chain at most, all joints between them straight [m]."""
    chain = description.chain(description.tip)
    first = next(k for k, joint in enumerate(chain) if joint.moves)
    straight = sum(float(np.linalg.norm(joint.X[:3, 3])) for joint in chain[first + 1 :])
    slides = sum(
        max(abs(joint.q_min or 0.0), abs(joint.q_max or 0.0))
        for joint in chain
        if joint.moves and joint.kind is JointKind.PRISMATIC
    )
    return straight + slides


def _with_inertia(description: Description, notes: list[str]) -> dict[str, Link]:
    """Links with masses and inertias that a body can have, as a body with dynamics needs them."""
    links = dict(description.links)
    massless, boxed, mended = [], [], []
    for bodies in _rigid(description):
        if not any(links[name].mass > 0 for name in bodies):
            heavy = max(bodies, key=lambda name: _volume(links[name]))
            links[heavy] = replace(links[heavy], mass=max(DENSITY * _volume(links[heavy]), _LEAST))
            links[heavy] = _as_box(links[heavy], moved=True)
            massless.append(f"{heavy} ({links[heavy].mass:.3g} kg)")
    for name, link in links.items():
        if link.mass <= 0 or name == description.root:
            continue
        moments = np.linalg.eigvalsh(0.5 * (link.inertia + link.inertia.T))
        if moments[0] <= 0:
            links[name] = _as_box(link)
            boxed.append(name)
        elif moments[0] + moments[1] < moments[2] * (1 - 1e-9):
            links[name] = replace(link, inertia=_mended(link.inertia))
            # Digits that a file leaves out are nothing to tell anybody.
            if moments[0] + moments[1] < moments[2] * (1 - 1e-3):
                mended.append(name)
    state = "State it as <inertial> in the file."
    if massless:
        notes.append(f"{', '.join(massless)}: no mass is said; assumed from the shape's volume. {state}")
    if boxed:
        notes.append(f"{', '.join(boxed)}: no inertia is said, or none that can be; assumed a box's. {state}")
    if mended:
        notes.append(
            f"{', '.join(mended)}: the inertia breaks the triangle inequality; the two smaller moments are raised. "
            f"{state}"
        )
    return links


def _rigid(description: Description) -> list[list[str]]:
    """Links that move as one, but for those that hang fast on the root."""
    of = {description.root: description.root}
    for joint in description.joints:
        of[joint.child] = of[joint.parent] if joint.kind is JointKind.FIXED else joint.child
    found: dict[str, list[str]] = {}
    for name, first in of.items():
        if first != description.root:
            found.setdefault(first, []).append(name)
    return list(found.values())


def _volume(link: Link) -> float:
    """Of a link's hull, roughly: half of the box about it [m³]."""
    corners = corners_of(link.collisions or link.shapes)
    return 0.5 * float(np.prod(np.ptp(corners, axis=0))) if len(corners) else 0.0


def _as_box(link: Link, *, moved: bool = False) -> Link:
    """A link with the inertia of a box about its shapes, and perhaps its centre in the middle of it."""
    corners = corners_of(link.collisions or link.shapes)
    sides = np.maximum(np.ptp(corners, axis=0), 1e-3) if len(corners) else np.full(3, _LEAST)
    middle = corners.min(axis=0) + 0.5 * np.ptp(corners, axis=0) if len(corners) else link.centre
    x, y, z = sides**2
    inertia = link.mass / 12 * np.diag([y + z, x + z, x + y])
    return replace(link, centre=middle if moved else link.centre, inertia=inertia)


def _mended(inertia: Array) -> Array:
    """An inertia whose two smaller moments are raised until they add up to the largest."""
    moments, axes = np.linalg.eigh(0.5 * (inertia + inertia.T))
    moments[:2] *= moments[2] / (moments[0] + moments[1]) * (1 + 1e-9)
    return np.asarray(axes @ np.diag(moments) @ axes.T)
