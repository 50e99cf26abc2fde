"""Finished calls of a sweep, kept as files: what each returned, and where, by its arguments and our version.

What is kept is plain data in msgpack (numbers, texts, arrays, our own values by name): nothing in a file is
run when it's read, whoever wrote it.
"""

from __future__ import annotations

import csv
import hashlib
import platform
import re
from collections import Counter
from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import fields, is_dataclass
from enum import Enum
from functools import cache, partial
from importlib import import_module, metadata, resources, util
from itertools import starmap
from pathlib import Path
from typing import Any, Final, NamedTuple

import msgspec
import numpy as np

from interfaces.system import is_own, write_whole
from vrs.errors import FormatError

PACKAGES: Final = ("vrs", "robots", "interfaces")
COMPUTING: Final = (
    "numpy", "scipy", "msgspec", "networkx", "shapely", "ruckig", "trimesh", "pybullet", "mujoco",
    "roboticstoolbox-python", "spatialmath-python",
)  # fmt: skip
"""Distributions whose versions count: what they compute, or how results cross, may change with them."""
SOURCES: Final = "vrs-teleop's sources"
"""Name of our own sources among the versions."""
SUFFIX: Final = ".row"
_ROW: Final = re.compile(r"[0-9a-f]{40}\.row")
_DIGEST: Final = 16
"""Bytes before a kept row that tell whether it's whole."""


class Machine(NamedTuple):
    """Where a call was made, as far as last digits may hang on it."""

    platform: str
    """System, processor's kind and vector units, C library."""
    blas: str
    """Of NumPy, with its version."""


@cache
def machine() -> Machine:
    """This machine."""
    found: dict[str, Any] = np.show_config("dicts")  # type: ignore[assignment]
    blas, units = found["Build Dependencies"]["blas"], found["SIMD Extensions"]["found"]
    known = platform.system(), platform.machine(), *units[-1:], " ".join(platform.libc_ver())
    return Machine(" ".join(filter(None, known)), f"{blas['name']} {blas['version']}")


@cache
def versions() -> dict[str, str]:
    """What results hang on beside their arguments: Python, what computes, and a hash of our own sources."""
    found = {"Python": platform.python_version()}
    for name in COMPUTING:
        try:
            found[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            continue
    kept = hashlib.sha256()
    for package in PACKAGES:
        root = Path(str(resources.files(package)))
        for path in sorted(root.rglob("*")):
            if path.is_file() and "__pycache__" not in path.parts:
                kept.update(f"{package}/{path.relative_to(root).as_posix()}\0".encode() + path.read_bytes())
    return found | {SOURCES: kept.hexdigest()[:12]}


class KeptRow(NamedTuple):
    """What a call returned, and where it was made."""

    value: Any
    machine: Machine


class FinishedRows:
    """The finished calls of a sweep, a file each in a folder of their own."""

    def __init__(self, folder: Path, *, resume: bool) -> None:
        """Take a folder.

        Args:
            folder: Made when the first row is kept.
            resume: Whether rows that are there already count.
        """
        self.folder, self.resume = folder, resume
        self.problem = ""
        """Why rows aren't kept any more; empty while they are."""
        self.machines: list[tuple[str, int, Machine]] = []
        """Where all were made so far: which function, its place among the calls, the machine."""

    def clear(self) -> None:
        """Remove the rows, and the folder if nothing else is in it."""
        if self.folder.is_dir():
            for path in self.folder.iterdir():
                if _ROW.fullmatch(path.name):
                    path.unlink(missing_ok=True)
            if not any(self.folder.iterdir()):
                self.folder.rmdir()

    def ready(self, calls: Iterable[tuple[Callable[..., Any], tuple[Any, ...]]]) -> int:
        """How many of some calls are kept, and needn't be made."""
        return sum(path is not None and path.exists() for path in starmap(self._path, calls)) if self.resume else 0

    def note(self, work: Callable[..., Any], place: int, row: KeptRow) -> None:
        """Note where a call was made."""
        self.machines.append((getattr(work, "__qualname__", repr(work)), place, row.machine))

    def write_machines(self, path: Path) -> None:
        """Write which call was made on what machine, a row a call in the order in which they were asked for.

        Raises:
            OSError: If it can't be written.
        """
        with path.open("w", encoding="utf-8", newline="") as file:
            table = csv.writer(file, lineterminator="\n")
            table.writerow(("of", "place", *Machine._fields))
            table.writerows((work, place, *where) for work, place, where in sorted(self.machines))

    def find(self, work: Callable[..., Any], given: tuple[Any, ...]) -> KeptRow | None:
        """What a call returned; None where it's to be made.

        A call that was to write files is to be made again when they aren't there.
        """
        path = self._path(work, given) if self.resume else None
        if path is None or not all(each.exists() for each in given if isinstance(each, Path)):
            return None
        try:
            data = path.read_bytes()
            if hashlib.sha256(data[_DIGEST:]).digest()[:_DIGEST] != data[:_DIGEST]:
                return None
            where, value = msgspec.msgpack.decode(data[_DIGEST:], type=tuple[Machine, Any])
            return KeptRow(unpacked(value), where)
        except (OSError, msgspec.MsgspecError, FormatError):
            return None

    def keep(self, work: Callable[..., Any], given: tuple[Any, ...], row: KeptRow) -> None:
        """Keep what a call returned, whole or not at all; what can't be kept is made again another time."""
        path = None if self.problem else self._path(work, given)
        if path is None:
            return
        try:
            data = msgspec.msgpack.encode((row.machine, packed(row.value)))
            self.folder.mkdir(parents=True, exist_ok=True)
            write_whole(path, hashlib.sha256(data).digest()[:_DIGEST] + data)
        except (TypeError, OverflowError):
            return
        except OSError as error:
            self.problem = f"{self.folder}: finished runs aren't kept any more: {error.strerror or error}"

    def _path(self, work: Callable[..., Any], given: tuple[Any, ...]) -> Path | None:
        try:
            key = msgspec.msgpack.encode((versions(), _called(work), packed(given), _read(given)))
        except (TypeError, OverflowError):
            return None
        return self.folder / (hashlib.sha256(key).hexdigest()[:40] + SUFFIX)


def _called(work: Callable[..., Any]) -> Any:
    """A function of a module, with what is bound of its arguments, as plain data."""
    if isinstance(work, partial):
        return [_called(work.func), packed(work.args), packed(work.keywords)]
    return f"{work.__module__}.{work.__qualname__}"


def _read(given: object) -> list[str]:
    """Digests of files that texts among arguments name, as `trace:FILE`, `MODULE:NAME` or FILE do."""
    if isinstance(given, str):
        before, _, behind = given.partition(":")
        named = [Path(each) for each in (given.partition("#")[0], behind) if 0 < len(each) < 4096]
        if is_own(given.partition("@")[0]):
            named.append(_source(before))
        return [hashlib.sha256(path.read_bytes()).hexdigest() for path in named if _is_file(path)]
    if is_dataclass(given):
        return [digest for item in fields(given) for digest in _read(getattr(given, item.name))]
    return [digest for each in given for digest in _read(each)] if isinstance(given, (tuple, list)) else []


def _is_file(path: Path) -> bool:
    try:
        return path.is_file()
    except (OSError, ValueError):
        return False


def _source(module: str) -> Path:
    """The file of a module, which may lie in the working directory."""
    here = Path(*module.split(".")).with_suffix(".py")
    if here.is_file():
        return here
    try:
        found = util.find_spec(module)
    except (ImportError, ValueError, AttributeError):
        found = None
    return Path(found.origin if found is not None and found.origin else "")


def packed(value: Any) -> Any:
    """A value as plain data that `unpacked` makes the same of, type by type.

    Raises:
        TypeError: If it is, or holds, something else than numbers, texts, arrays, enums, paths, tuples, lists,
            dicts, and our own classes that are nothing but their fields.
    """
    kind = type(value)
    if value is None or kind in {bool, int, float, str, bytes}:
        return value
    if kind is list:
        return list(map(packed, value))
    if kind is dict or kind is Counter:
        return {kind.__name__: [[packed(key), packed(one)] for key, one in value.items()]}
    if kind is np.ndarray and not value.dtype.hasobject and not value.dtype.names:
        order = "F" if np.isfortran(value) else "C"
        return {"array": [value.dtype.str, list(value.shape), order, value.tobytes(order)]}
    if isinstance(value, np.generic) and not value.dtype.hasobject:
        return {"scalar": [value.dtype.str, value.tobytes()]}
    if isinstance(value, Path):
        return {"path": str(value)}
    if kind is tuple:
        return {"tuple": ["", *map(packed, value)]}
    if kind.__module__.partition(".")[0] not in PACKAGES:
        raise TypeError(f"{kind.__module__}.{kind.__qualname__} can't be kept")
    name = f"{kind.__module__}:{kind.__qualname__}"
    if isinstance(value, Enum):
        return {"enum": [name, value.name]}
    if isinstance(value, tuple):
        return {"tuple": [name, *map(packed, value)]}
    if not _has_fields(kind):
        raise TypeError(f"{name} can't be kept")
    if isinstance(value, msgspec.Struct):
        names = list(value.__struct_fields__)
    else:
        names = [item.name for item in fields(value)] if is_dataclass(value) else list(vars(value))
    return {"fields": [name, *([each, packed(getattr(value, each))] for each in names)]}


def unpacked(data: Any) -> Any:
    """The value of plain data that `packed` made.

    Raises:
        FormatError: If it made it of something else, or never.
    """
    if isinstance(data, list):
        return list(map(unpacked, data))
    if not isinstance(data, dict):
        return data
    try:
        ((kind, parts),) = data.items()
        return _MAKES[kind](parts)
    except (KeyError, ValueError, TypeError, AttributeError, IndexError) as error:
        raise FormatError("a finished run", f"isn't one that this version kept: {error!r}") from None


def _class_of(name: str, is_kind: Callable[[type], bool]) -> type:
    """A class of ours by its name; nothing of it is called.

    Raises:
        FormatError: If there's none, or not of that kind.
    """
    module, _, path = name.partition(":")
    found: Any = None
    if module.split(".")[0] in PACKAGES and "__" not in module:
        with suppress(ImportError):
            found = import_module(module)
        for part in path.split("."):
            found = getattr(found, part, None)
    if not isinstance(found, type) or found.__module__ != module or not is_kind(found):
        raise FormatError(name, "is no class of what is kept")
    return found


def _has_fields(kind: type) -> bool:
    """Whether a class is nothing but its fields: nothing of it runs when one is made so, or goes."""
    is_plain = is_dataclass(kind) or issubclass(kind, msgspec.Struct)
    return is_plain or (kind.__dictoffset__ != 0 and not hasattr(kind, "__del__"))


def _array(parts: Any) -> Any:
    dtype, shape, order, data = parts
    return np.frombuffer(data, _dtype(dtype)).reshape(shape, order=order).copy(order)


def _dtype(text: str) -> np.dtype[Any]:
    found = np.dtype(text)
    if found.hasobject:
        raise FormatError(text, "is no number")
    return found


def _tuple(parts: Any) -> Any:
    name, *values = parts
    made = tuple(map(unpacked, values))
    return tuple.__new__(_class_of(name, lambda kind: issubclass(kind, tuple)), made) if name else made


def _enum(parts: Any) -> Any:
    found: Any = _class_of(parts[0], lambda kind: issubclass(kind, Enum))
    return found[parts[1]]


def _fields(parts: Any) -> Any:
    name, *items = parts
    kind: Any = _class_of(name, _has_fields)
    values = {each: unpacked(value) for each, value in items}
    if issubclass(kind, msgspec.Struct):
        # Nothing makes one without its fields; it checks them, and does nothing else.
        return kind(**values)
    made: object = kind.__new__(kind)
    for each, value in values.items():
        object.__setattr__(made, each, value)
    return made


_MAKES: Final[dict[str, Callable[[Any], Any]]] = {
    "dict": lambda items: {unpacked(key): unpacked(value) for key, value in items},
    "Counter": lambda items: Counter({unpacked(key): unpacked(value) for key, value in items}),
    "array": _array,
    "scalar": lambda parts: np.frombuffer(parts[1], _dtype(parts[0]))[0],
    "path": Path,
    "tuple": _tuple,
    "enum": _enum,
    "fields": _fields,
}
"""What makes a value, by the word before its parts."""
