"""The newest value of each key, for readers that are as slow as they like; of a scene, of each of its nodes."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

import msgspec
from typing_extensions import override

from vrs.errors import InvalidValueError
from vrs.model import Array

Json = dict[str, Any]
ROOT: Final = "/vrs"
"""The node below which everything of a scene stands."""

MOST_READERS = 1024
"""Readers of one scene."""


class Newest:
    """Bytes by key, made once for all readers; an old value is kept for nobody.

    Putting never waits. A reader costs a number: the version that it has read up to.
    """

    def __init__(self, greeting: bytes, most: int = MOST_READERS) -> None:
        """Start without values.

        Args:
            greeting: What each reader gets before anything else.
            most: Most readers.
        """
        self.greeting, self._most = greeting, most
        self.version = 0
        """Counts up with each change of any value."""
        self.values: dict[str, tuple[int, bytes]] = {}
        """The newest of each key, and the version it came with."""
        self._slots: set[ReaderPosition] = set()
        self._later: dict[int, tuple[bytes, ...]] = {}

    @property
    def readers(self) -> int:
        """How many readers there are."""
        return len(self._slots)

    def put(self, key: str, data: bytes) -> None:
        """Replace the value of a key; an equal value changes nothing."""
        known = self.values.get(key)
        if known is not None and known[1] == data:
            return
        self.values.pop(key, None)
        self.version += 1
        self.values[key] = self.version, data
        self._later.clear()

    def wake(self) -> None:
        """Tell the readers that wait that something may have changed."""
        for slot in self._slots:
            slot.changed()

    def join(self, changed: Callable[[], None] = lambda: None) -> ReaderPosition:
        """Give a reader a place.

        Args:
            changed: Is called when there may be something to take; it must return at once.

        Raises:
            InvalidValueError: If there are too many.
        """
        if len(self._slots) >= self._most:
            raise InvalidValueError("viewers", len(self._slots) + 1, f"at most {self._most} a scene")
        slot = ReaderPosition(self, changed)
        self._slots.add(slot)
        return slot

    def leave(self, slot: ReaderPosition) -> None:
        """Give a place back; one that was given back already is none."""
        self._slots.discard(slot)

    def later(self, version: int) -> tuple[bytes, ...]:
        """Values newer than a version, the oldest first; readers at the same version share the answer."""
        found = self._later.get(version)
        if found is None:
            found = self._later[version] = tuple(data for _, data in self.entries(version))
        return found

    def entries(self, version: int) -> list[tuple[str, bytes]]:
        """The same with their keys."""
        newer = []
        for key, (of, data) in reversed(self.values.items()):
            if of <= version:
                break
            newer.append((key, data))
        return newer[::-1]

    def version_of(self, count: int, version: int) -> int:
        """Version of the last of the first `count` values newer than a version."""
        newer = len(self.later(version))
        if count >= newer:
            return self.version
        versions = [of for of, _ in self.values.values()]
        return versions[len(versions) - newer + count - 1]


class ReaderPosition:
    """A reader's place: how far it has read."""

    def __init__(self, newest: Newest, changed: Callable[[], None]) -> None:
        self.changed = changed
        self._newest = newest
        self._version = -1

    def __bool__(self) -> bool:
        """Whether there's something to take."""
        return self._version < self._newest.version

    def take(self, most: int) -> tuple[bytes, ...]:
        """Take what changed since the last time, the oldest first.

        Args:
            most: Most bytes; but a value comes whole, and there's at least one if anything changed.
        """
        newest = self._newest
        if self._version < 0:
            self._version = 0
            return (newest.greeting,)
        found = newest.later(self._version)
        room = most
        for count, data in enumerate(found):
            room -= len(data)
            if room < 0 and count:
                self._version = newest.version_of(count, self._version)
                return found[:count]
        self._version = newest.version
        return found


def set_transform(path: str, X: Array) -> bytes:
    """Put a node at X, (4, 4), in its parent's frame; the bytes are those of `meshcat.commands.SetTransform`."""
    return _encoder.encode({"type": "set_transform", "path": path, "matrix": X.T.ravel().tolist()})


def _ext(value: Any) -> msgspec.msgpack.Ext:
    """MeshCat's typed arrays are extensions of its own msgpack library."""
    return msgspec.msgpack.Ext(value.type, value.data)


_encoder = msgspec.msgpack.Encoder(enc_hook=_ext)


class Nodes(Newest):
    """A scene's nodes by MeshCat's commands: everything once, then what changes."""

    def __init__(self, most: int = MOST_READERS) -> None:
        """Begin with nothing to be seen.

        Args:
            most: Most readers.
        """
        super().__init__(_encoder.encode({"type": "delete", "path": ROOT}), most)
        self._others: list[tuple[Nodes, str, frozenset[str] | None]] = []
        """Scenes in which this one's robots are seen, too, below which node there, and what of them."""

    def show_in(self, other: Nodes, name: str, X: Array, parts: frozenset[str] | None = None) -> None:
        """Let what stands below `ROOT` from now on be seen in another scene, too.

        Args:
            other: That scene.
            name: What this is called there.
            X: Where this scene's frame is in that one's, (4, 4).
            parts: Names of the nodes below `ROOT` that are; None for all.
        """
        root = f"/beside/{name}"
        self._others.append((other, root, parts))
        other.put_transform(root, X)

    @property
    @override
    def readers(self) -> int:
        return super().readers + sum(super(Nodes, other).readers for other, *_ in self._others)

    @override
    def wake(self) -> None:
        super().wake()
        for other, *_ in self._others:
            super(Nodes, other).wake()

    def _show(self, path: str, what: str, written: Callable[[str], bytes]) -> None:
        """Put what a node has, here and wherever else it's seen: written once for each name that it has there.

        Args:
            path: The node.
            what: Of it, to tell its values apart.
            written: Makes the command, of the node's name.
        """
        self.put(path + what, written(path))
        if not path.startswith(f"{ROOT}/"):
            # What is said of the scene as a whole is its own.
            return
        below = path[len(ROOT) :]
        part = below.split("/", 2)[1]
        known: dict[str, bytes] = {}
        for other, root, parts in self._others:
            if parts is None or part in parts:
                where = root + below
                if where not in known:
                    known[where] = written(where)
                other.put(where + what, known[where])

    def put_transform(self, path: str, X: Array) -> None:
        """Put a node at X, (4, 4), in its parent's frame."""
        self._show(path, "", lambda where: set_transform(where, X))

    def put_object(self, path: str, lowered: Json) -> None:
        """Show an object at a node, in place of the one that's there.

        Args:
            path: The node; its children and its transform stay.
            lowered: The object as MeshCat's classes lower it: `geometries`, `materials`, `object`.
        """
        command = {"type": "set_object", "object": lowered}
        self._show(path, " object", lambda where: _encoder.encode({**command, "path": where}))

    def put_property(self, path: str, name: str, value: Any) -> None:
        """Set a property of a node; the viewer keeps those that it doesn't know with the node."""
        command = {"type": "set_property", "property": name, "value": value}
        self._show(path, f" {name}", lambda where: _encoder.encode({**command, "path": where}))
