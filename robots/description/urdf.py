"""URDF as a description."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from robots.description import meshes
from robots.description.description import Description, Joint, JointKind, Link, Mimic
from robots.description.files import found
from robots.solids import LinkShape
from vrs.errors import FormatError
from vrs.model import Array

MOST: Final = 500
"""Links of a description."""
LARGEST_NUMBER: Final = 1e9
"""Size of the largest number that's read."""
_KINDS: Final = {
    "revolute": JointKind.REVOLUTE,
    "continuous": JointKind.CONTINUOUS,
    "prismatic": JointKind.PRISMATIC,
    "fixed": JointKind.FIXED,
    "floating": JointKind.FIXED,
    "planar": JointKind.FIXED,
    "spherical": JointKind.FIXED,
}
"""Kinds of joints, as they're read."""
_COUNTS: Final = {"xyz": 3, "rpy": 3, "size": 3, "rgba": 4}
"""How many numbers an attribute of a link or joint has."""
_VARIABLE: Final = re.compile(r"\$\(optenv\s+(\w+)\s*([^()]*)\)")
"""A variable of the environment, with its default."""


def read_urdf(root: Any, path: Path) -> Description:
    """Return what a URDF says.

    Args:
        root: Its root element.
        path: Of its file, for names of meshes.

    Raises:
        FormatError: If it's no tree of links and joints, or a value can't be read.
    """
    return _Reading(root, path).description()


class _Reading:
    """A URDF that is being read, with what there is to say of it."""

    def __init__(self, root: Any, path: Path) -> None:
        self._path, self._where = path, str(path)
        self._count: dict[str, list[str]] = defaultdict(list)
        self._surfaces: dict[tuple[Path, tuple[float, ...]], meshes.Surface | str] = {}
        self._drop_unknown(root)
        self._take_defaults(root)
        self._check_numbers(root)
        self._robot = self._parse(root)
        # A colour that one link gives a name counts for the others that name it.
        materials = [visual.material for link in self._robot.links for visual in link.visuals if visual.material]
        self._colours = {
            material.name: material.color.rgba
            for material in (*materials, *self._robot.materials)
            if material.color is not None
        }

    def description(self) -> Description:
        """Return all of it."""
        links = [link.name for link in self._robot.links]
        joints = [self._joint(joint) for joint in self._robot.joints]
        if not 1 <= len(links) <= MOST:
            raise FormatError(self._where, f"must have 1 to {MOST} links; has {len(links)}")
        for what, names in (("link", links), ("joint", [joint.name for joint in joints])):
            twice = next((name for k, name in enumerate(names) if name in names[:k]), None)
            if twice is not None:
                raise FormatError(self._where, f"{what} {twice!r} is there twice")
        ordered = self._ordered(links, joints)
        made = {link.name: self._link(link) for link in self._robot.links}
        return Description(str(self._robot.name or ""), made, self._mimicking(ordered), notes=tuple(self._notes()))

    def _say(self, what: str, of: str) -> None:
        """Note something of a link or joint; `{}` in it stands for all of which it's said."""
        if of not in self._count[what]:
            self._count[what].append(of)

    def _notes(self) -> Iterator[str]:
        return (what.replace("{}", ", ".join(of)) for what, of in self._count.items())

    def _drop_unknown(self, root: Any) -> None:
        """Leave out shapes that nothing here can draw, and say so: all else would be lost with one."""
        for link in root.findall("link"):
            for shape in [*link.findall("visual"), *link.findall("collision")]:
                geometry = shape.find("geometry")
                kind = None if geometry is None or not len(geometry) else geometry[0].tag
                if kind not in {"box", "cylinder", "sphere", "mesh"}:
                    self._say(f"{{}}: a shape of kind {kind or 'none'} isn't known and is left out.", _name(link))
                    link.remove(shape)

    def _take_defaults(self, root: Any) -> None:
        """Take what xacro left over of variables of an environment: their defaults."""
        for element in root.iter():
            for name, text in element.attrib.items():
                taken = _VARIABLE.sub(r"\2", text)
                if taken != text:
                    self._say(f"{text}: taken as {taken}.", "")
                    element.attrib[name] = taken
                elif "${" in text or "$(" in text:
                    raise FormatError(self._where, f"{text!r} is left of xacro: give the .xacro file itself")

    def _check_numbers(self, root: Any) -> None:
        """Look at what the library would read however many numbers there are, and whatever they are."""
        for part in [*root.findall("link"), *root.findall("joint")]:
            for element in part.iter():
                for name, count in _COUNTS.items():
                    text = element.get(name)
                    if text is None:
                        continue
                    try:
                        good = [abs(float(word)) <= LARGEST_NUMBER for word in text.split()] == [True] * count
                    except ValueError:
                        good = False
                    if not good:
                        allowed = f"{name} must be {count} numbers within ±{LARGEST_NUMBER:g}"
                        raise FormatError(
                            self._where, f"{part.tag} {_name(part)!r}: {allowed}; given: {text[:80]!r}"
                        )

    def _parse(self, root: Any) -> Any:
        """Let yourdfpy read it; if it can't, say of what."""
        try:
            return _by_library(root)
        except _LIBRARY as error:
            problem = error
        for element in root:
            try:
                _by_library(root.makeelement("robot"), element)
            except _LIBRARY as error:
                raise FormatError(self._where, f"{element.tag} {_name(element)!r}: {_said(error)}") from error
        raise FormatError(self._where, _said(problem)) from problem

    def _joint(self, joint: Any) -> Joint:
        name = joint.name
        where = f"joint {name!r}"
        if joint.type not in _KINDS:
            raise FormatError(
                self._where, f"{where}: type must be one of {', '.join(_KINDS)}; given: {joint.type!r}"
            )
        kind = _KINDS[joint.type]
        if joint.type in {"floating", "planar", "spherical"}:
            self._say(f"{{}}: {joint.type} joints are taken as fixed.", name)
        axis = self._finite(where, joint.axis, (3,))
        length = float(np.linalg.norm(axis))
        if kind is not JointKind.FIXED and length < 1e-9:
            raise FormatError(self._where, f"{where}: its axis is 0")
        limit, dynamics = joint.limit, joint.dynamics
        limits = [None] * 4 if limit is None else [limit.lower, limit.upper, limit.velocity, limit.effort]
        for value in limits:
            if value is not None and not abs(value) <= LARGEST_NUMBER:
                self._say(f"{{}}: limits that aren't within ±{LARGEST_NUMBER:g} count as not said.", name)
        lower, upper, velocity, effort = (
            None if v is None or not abs(v) <= LARGEST_NUMBER else float(v) for v in limits
        )
        for what, value in (("velocity", velocity), ("effort", effort)):
            if value is not None and value < 0:
                raise FormatError(self._where, f"{where}: {what} must be 0 or more; given: {value!r}")
        if kind in {JointKind.REVOLUTE, JointKind.PRISMATIC}:
            # One alone counts from 0, as URDF has it.
            if (lower is None) is not (upper is None):
                lower, upper = lower or 0.0, upper or 0.0
            if lower is not None and upper is not None and lower >= upper:
                self._say("{}: the lower limit isn't below the upper one, so both count as not said.", name)
                lower = upper = None
        elif kind is JointKind.CONTINUOUS:
            lower = upper = None
        mimic = None
        if joint.mimic is not None:
            numbers = self._finite(where, [joint.mimic.multiplier, joint.mimic.offset], (2,))
            mimic = Mimic(joint.mimic.joint, *numbers.tolist())
        damping, friction = (
            (0.0, 0.0) if dynamics is None else (float(dynamics.damping or 0.0), float(dynamics.friction or 0.0))
        )
        return Joint(
            name, kind, joint.parent, joint.child, self._pose(where, joint.origin),
            np.array([0.0, 0.0, 1.0]) if kind is JointKind.FIXED else axis / length,
            q_min=lower, q_max=upper, qd_max=velocity or None, effort=effort or None,
            damping=damping, friction=friction, mimic=mimic,
        )  # fmt: skip

    def _mimicking(self, joints: tuple[Joint, ...]) -> tuple[Joint, ...]:
        """The joints, those that mimic one that isn't there, or themselves in a circle, as fixed ones."""
        by_name = {joint.name: joint for joint in joints}
        known = []
        for joint in joints:
            seen, follows = {joint.name}, joint.mimic
            while follows is not None and follows.joint in by_name and follows.joint not in seen:
                seen.add(follows.joint)
                follows = by_name[follows.joint].mimic
            if follows is not None:
                self._say("{}: mimics a joint that isn't there or itself, and is taken as fixed.", joint.name)
            lost = follows is not None
            known.append(replace(joint, kind=JointKind.FIXED, mimic=None) if lost else joint)
        return tuple(known)

    def _ordered(self, links: list[str], joints: list[Joint]) -> tuple[Joint, ...]:
        """The joints, parents before children."""
        above: dict[str, Joint] = {}
        below: dict[str, list[Joint]] = defaultdict(list)
        for joint in joints:
            for link in (joint.parent, joint.child):
                if link not in links:
                    raise FormatError(self._where, f"joint {joint.name!r}: there's no link {link!r}")
            if joint.child in above:
                both = f"{above[joint.child].name!r} and {joint.name!r}"
                raise FormatError(self._where, f"link {joint.child!r} hangs on two joints, {both}")
            above[joint.child] = joint
            below[joint.parent].append(joint)
        roots = [link for link in links if link not in above]
        if len(roots) != 1:
            said = f"has {len(roots)}: {', '.join(roots[:8])}" if roots else "has none: links hang in a circle"
            raise FormatError(self._where, f"must have one link that hangs on no other; {said}")
        ordered, waiting = [], [roots[0]]
        while waiting:
            for joint in below[waiting.pop(0)]:
                ordered.append(joint)
                waiting.append(joint.child)
        if len(ordered) < len(joints):
            lost = next(joint for joint in joints if joint not in ordered)
            raise FormatError(self._where, f"links hang in a circle, as by joint {lost.name!r}")
        return tuple(ordered)

    def _link(self, link: Any) -> Link:
        where, inertial = f"link {link.name!r}", link.inertial
        mass, centre, inertia = 0.0, np.zeros(3), np.zeros((3, 3))
        if inertial is not None:
            mass = float(inertial.mass or 0.0)
            if not np.isfinite(mass) or mass < 0:
                raise FormatError(self._where, f"{where}: mass must be 0 kg or more; given: {mass!r}")
            X = self._pose(where, inertial.origin)
            if inertial.inertia is not None:
                own = self._finite(where, inertial.inertia, (3, 3))
                inertia, centre = X[:3, :3] @ own @ X[:3, :3].T, X[:3, 3]
            else:
                centre = X[:3, 3]
        shapes = [self._shape(link.name, visual, visual.material) for visual in link.visuals]
        collisions = [self._hull(link.name, collision) for collision in link.collisions]
        return Link(
            link.name,
            mass,
            centre,
            inertia,
            tuple(shape for shape in shapes if shape is not None),
            tuple(shape for shape in collisions if shape is not None),
        )

    def _shape(self, link: str, visual: Any, material: Any) -> LinkShape | None:
        surface = self._surface(link, visual.geometry)
        if surface is None:
            return None
        colour = None
        if material is not None:
            colour = self._colours.get(material.name) if material.color is None else material.color.rgba
            if colour is not None:
                colour = self._finite(f"link {link!r}", colour, (4,))

        def heavy() -> None:
            self._say(f"{{}}: meshes of more than {meshes.MOST_TRIANGLES} triangles are drawn with fewer.", link)

        return meshes.shape(link, surface, self._pose(f"link {link!r}", visual.origin), colour, heavy)

    def _hull(self, link: str, collision: Any) -> LinkShape | None:
        surface = self._surface(link, collision.geometry)
        if surface is None:
            return None
        made = meshes.hull(link, surface, self._pose(f"link {link!r}", collision.origin))
        if made is None:
            self._say("{}: a collision shape is flat, and touches nothing.", link)
        return made

    def _surface(self, link: str, geometry: Any) -> meshes.Surface | None:
        where = f"link {link!r}"
        if geometry.box is not None:
            return meshes.box(self._sizes(where, geometry.box.size, 3))
        if geometry.sphere is not None:
            radius = self._sizes(where, geometry.sphere.radius, 1)
            return meshes.ellipsoid(np.repeat(radius, 3))
        if geometry.cylinder is not None:
            return meshes.cylinder(
                *self._sizes(where, [geometry.cylinder.radius, geometry.cylinder.length], 2).tolist()
            )
        name, scale = geometry.mesh.filename, geometry.mesh.scale
        factors = np.ones(3) if scale is None else np.ravel(scale) * np.ones(3 if np.size(scale) == 1 else 1)
        if not self._finite(where, factors, (3,)).all():
            raise FormatError(self._where, f"{where}: a mesh's scale must not be 0; given: {factors.tolist()}")
        path = None if not name else found(name, self._path)
        if path is None:
            fetched = (
                ""
                if "://" not in str(name) or str(name).startswith(("package:", "model:", "file:"))
                else (" (nothing is fetched from a network)")
            )
            self._say(f"{{}}: mesh {name} wasn't found{fetched}; that shape is missing.", link)
            return None
        key = path, tuple(factors.tolist())
        if key not in self._surfaces:
            try:
                self._surfaces[key] = meshes.read_mesh(path, factors)
            except FormatError as error:
                self._surfaces[key] = str(error)
        surface = self._surfaces[key]
        if isinstance(surface, str):
            self._say(f"{{}}: mesh {surface}; that shape is missing.", link)
            return None
        return surface

    def _sizes(self, where: str, sizes: Any, count: int) -> Array:
        values = self._finite(where, np.atleast_1d(sizes), (count,))
        if not (values > 0).all():
            raise FormatError(self._where, f"{where}: sizes must be positive; given: {values.tolist()}")
        return values

    def _pose(self, where: str, X: Any) -> Array:
        return np.eye(4) if X is None else self._finite(where, X, (4, 4))

    def _finite(self, where: str, values: Any, shape: tuple[int, ...]) -> Array:
        array = np.asarray(values, dtype=np.float64)
        if array.shape != shape or not (np.abs(array) <= LARGEST_NUMBER).all():
            count = " × ".join(map(str, shape))
            allowed = f"{count} numbers within ±{LARGEST_NUMBER:g}"
            raise FormatError(self._where, f"{where}: must have {allowed}; given: {array.tolist()}")
        return array


_LIBRARY: Final = (AttributeError, IndexError, KeyError, TypeError, ValueError)
"""What yourdfpy raises of elements that aren't as they should be."""


def _by_library(root: Any, *elements: Any) -> Any:
    """Let yourdfpy read a robot, to which some elements are added."""
    import io
    from copy import deepcopy

    from lxml import etree
    from yourdfpy import URDF

    root.extend([deepcopy(element) for element in elements])
    if "name" not in root.attrib:
        root.attrib["name"] = ""
    data = io.BytesIO(etree.tostring(root, encoding="utf-8"))
    # Numbers that aren't finite are refused later, by name.
    with np.errstate(invalid="ignore"):
        return URDF.load(data, build_scene_graph=False, load_meshes=False).robot


def _said(error: Exception) -> str:
    if isinstance(error, KeyError):
        return f"has no {error.args[0]}"
    if isinstance(error, AttributeError | TypeError | IndexError):
        return "something that belongs to it is missing"
    return str(error)


def _name(element: Any) -> str:
    return str(element.get("name", ""))
