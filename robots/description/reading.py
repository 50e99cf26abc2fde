"""Descriptions of files: which format one has, and what stands beside it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Final

from robots.description.beside import joined, stated_of
from robots.description.description import Description
from robots.description.files import parsed, read_root
from robots.description.mjcf import read_mjcf
from robots.description.numbers import Stated, stem
from robots.description.urdf import read_urdf
from robots.description.xacro_process import expanded
from vrs.errors import FormatError

FORMATS: Final = (".urdf", ".xacro", ".xml", ".mjcf")
"""Endings of descriptions."""


def read(path: Path, stated: Stated | None = None) -> Description:
    """Return what a description says, with what stands beside it; nothing is assumed yet.

    Args:
        path: A URDF, xacro or MJCF file; what it is, its root element says.
        stated: What its TOML file states, where that has been read already.

    Raises:
        FormatError: If it can't be read, isn't one, or something beside it isn't as it should be.
    """
    if not path.is_file():
        raise FormatError(str(path), "there's no such file")
    stated = stated_of(path) if stated is None else stated
    root = read_root(path)
    if path.suffix.lower() == ".xacro" or (root.tag == "robot" and _is_xacro(root)):
        root = parsed(expanded(path, stated.arguments), str(path))
    if root.tag == "robot":
        description = read_urdf(root, path)
    elif root.tag == "mujoco":
        description = read_mjcf(path)
    else:
        raise FormatError(str(path), f"must have <robot> (URDF) or <mujoco> (MJCF) at its root; has <{root.tag}>")
    made = joined(description, stated, path)
    return replace(made, name=made.name or stem(path))


def _is_xacro(root: object) -> bool:
    """Whether xacro has something to do in a file that isn't called so."""
    return any(
        isinstance(element.tag, str) and element.tag.startswith("{http://www.ros.org/wiki/xacro}")
        for element in root.iter()  # type: ignore[attr-defined]
    )
