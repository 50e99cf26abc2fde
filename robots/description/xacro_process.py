"""The process that expands xacro: `python -m robots.description.xacro_process FILE NAME:=VALUE …` writes URDF.

xacro keeps the state of a run in its module, evaluates what a file says, and needn't end: so it's a process.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from collections.abc import Mapping
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType
from typing import Final

from robots.description.files import LARGEST, packages, read_root
from vrs.errors import FormatError

TIME: Final = 20.0
"""Longest that a file may take [s]."""


def expanded(path: Path, arguments: Mapping[str, str]) -> str:
    """Return what xacro makes of a file.

    Args:
        path: Where it is.
        arguments: What the file's arguments are, where not their defaults.

    Raises:
        FormatError: If there's no processor here, or it fails, takes too long or writes too much.
    """
    if find_spec("xacro") is None:
        raise FormatError(str(path), "needs xacro's processor: pip install vrs-teleop[xacro]")
    read_root(path)
    given = [f"{name}:={value}" for name, value in arguments.items()]
    command = [sys.executable, "-m", __name__, str(path.resolve()), *given]
    with tempfile.TemporaryFile() as out, tempfile.TemporaryFile() as errors:
        try:
            done = subprocess.run(
                command, stdin=subprocess.DEVNULL, stdout=out, stderr=errors, timeout=TIME, check=False
            )
        except subprocess.TimeoutExpired:
            raise FormatError(str(path), f"xacro takes longer than {TIME:g} s") from None
        out.seek(0)
        errors.seek(0)
        text, said = out.read(LARGEST + 1), errors.read(LARGEST).decode(errors="replace").strip().splitlines()
    if done.returncode:
        raise FormatError(str(path), f"xacro: {said[-1][:500] if said else 'failed'}")
    if len(text) > LARGEST:
        raise FormatError(str(path), f"xacro makes more than {LARGEST} bytes of it")
    return text.decode()


def _expand(path: Path, arguments: Mapping[str, str]) -> str:
    """Expand in this process, whose packages are those that `packages` finds."""

    def share(name: str) -> str:
        folder = next(packages(name, path), None)
        if folder is None:
            raise FormatError(str(path), f"there's no package {name} above it or beside it")
        return str(folder)

    index, module = ModuleType("ament_index_python"), ModuleType("ament_index_python.packages")
    setattr(module, "get_package_share_directory", share)  # noqa: B010 - mypy knows of no such attribute
    sys.modules |= {index.__name__: index, module.__name__: module}
    import xacro

    document = xacro.process_file(str(path), mappings=dict(arguments))
    return str(document.toxml())


if __name__ == "__main__":
    _given = dict(argument.split(":=", 1) for argument in sys.argv[2:])
    try:
        sys.stdout.write(_expand(Path(sys.argv[1]), _given))
    except Exception as error:  # noqa: BLE001 - what a stranger's file makes of it is said in a line
        # xacro wraps what `share` raises in a text of its own, with its class and the file, which is said already.
        ours: BaseException | None = error
        while ours is not None and not isinstance(ours, FormatError):
            ours = ours.__context__
        said = f"{type(error).__name__}: {error}" if ours is None else ours.problem
        sys.stderr.write(f"{' '.join(said.split())}\n")
        sys.exit(2)
