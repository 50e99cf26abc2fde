"""Files of a description: XML from anybody, and what a file means by names of others."""

from __future__ import annotations

import io
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final
from urllib.parse import unquote

from vrs.checks import bounded_text
from vrs.errors import FormatError

LARGEST: Final = 16 * 2**20
"""Of a description, and of what is made of one [B]."""
_LEVELS: Final = 8
"""Folders above a file in which packages are looked for."""
_ENDINGS: Final = ("_description", "_support", "_resources", "_moveit_config")
"""What names of packages end in, and names of their folders sometimes don't."""


def read_root(path: Path) -> Any:
    """Return the root element of an XML file.

    Args:
        path: Where it is.

    Raises:
        FormatError: If it can't be read, is too large or isn't XML, or defines a document type, as entities need.
    """
    try:
        text = bounded_text(path, LARGEST, "utf-8-sig")
    except OSError as error:
        raise FormatError(str(path), f"can't be read: {error.strerror or error}") from None
    return parsed(text, str(path))


def parsed(text: str, where: str) -> Any:
    """Return the root element of XML.

    Args:
        text: The XML.
        where: Of what, for errors.

    Raises:
        FormatError: If it isn't XML, or defines a document type.
    """
    from lxml import etree

    if "<!DOCTYPE" in text or "\0" in text:
        raise FormatError(where, "defines a document type or has NUL bytes, as no description needs")
    # Prefixes of names that nobody has defined are common in old files, and harmless; else nothing is mended.
    parser = etree.XMLParser(
        encoding="utf-8", recover=True, resolve_entities=False, no_network=True, load_dtd=False,
        remove_comments=True, remove_pis=True,
    )  # fmt: skip
    root = etree.parse(io.BytesIO(text.encode()), parser).getroot() if text.strip() else None
    wrong = [entry for entry in parser.error_log if entry.domain_name != "NAMESPACE"]
    if wrong or root is None:
        said = f"line {wrong[0].line}: {wrong[0].message}" if wrong else "it's empty"
        raise FormatError(where, f"isn't XML: {said}")
    return root


def found(name: str, beside: Path) -> Path | None:
    """Return the file that a description means by a name; None where there's none.

    `package://NAME/REST` is looked for in folders named NAME, or whose package.xml has that name: those above the
    description, those beside them, and those of ROS_PACKAGE_PATH and AMENT_PREFIX_PATH; last as REST in the folders
    above it. Other names count from the description's folder, then from those above it.

    Args:
        name: As the description has it.
        beside: The description.
    """
    if name.startswith(("package://", "model://")):
        package, _, rest = unquote(name.partition("://")[2]).partition("/")
        folders = [*packages(package, beside), *_above(beside)]
    elif name.startswith("file://"):
        rest, folders = unquote(name.removeprefix("file://")), [Path()]
    elif "://" in name:
        return None
    else:
        rest, folders = name.replace("\\", "/"), list(_above(beside))
    for folder in folders:
        path = folder / rest
        try:
            if rest and path.is_file():
                return path
        except (OSError, ValueError):
            return None
    return None


def packages(name: str, beside: Path) -> Iterator[Path]:
    """Yield folders that are a package, the nearest first.

    Args:
        name: Of the package.
        beside: The description that names it.
    """
    shorter, longer = (name.removesuffix(ending) for ending in _ENDINGS), (name + ending for ending in _ENDINGS)
    names = dict.fromkeys((name, *shorter, *longer))
    above = list(_above(beside))
    yield from (folder for folder in above if folder.name == name or _named(folder) == name)
    paths = f"{os.environ.get('ROS_PACKAGE_PATH', '')}{os.pathsep}{os.environ.get('AMENT_PREFIX_PATH', '')}"
    roots = [*above, *(Path(part) for part in paths.split(os.pathsep) if part)]
    for own in names:
        for root in roots:
            for folder in (root / own, root / "src" / own, root / "share" / own):
                if own and folder.is_dir():
                    yield folder
    yield from (folder for folder in above if folder.name in names)


def _above(beside: Path) -> Iterator[Path]:
    """Yield a file's folder, and those above it."""
    yield from beside.resolve().parents[:_LEVELS]


def _named(folder: Path) -> str:
    """The name that a folder's package.xml gives it; empty without one."""
    path = folder / "package.xml"
    if not path.is_file():
        return ""
    try:
        return str(read_root(path).findtext("name", "")).strip()
    except FormatError:
        return ""
