"""The far past of a long session, in a file instead of in memory.

A leaf or a node of the tree is a value; where its columns are is no part of it. One that's put away keeps its place
in every timeline that shares it, takes another class, and reads its columns back, bit by bit what they were, when
somebody asks for them. Those that are in memory pay nothing for that.
"""

from __future__ import annotations

import errno
import os
import threading
from array import array
from bisect import bisect_right
from itertools import accumulate, pairwise
from math import inf
from typing import Any

from vrs.timeline import Timeline
from vrs.tree import CacheLimit, Leaf, Node

KEPT = 100_000
"""Newest segments of a timeline, which stay in memory: 27 MB of cubic ones of six joints."""

RECENT = 300.0
"""Segments stay in memory for so long after their end [s]."""

PORTION = 1
"""Leaves that one command puts away: what five steering inputs leave behind, or two moves."""

BACKLOG = 250_000
"""Segments to be put away that raise the portion by a leaf."""

PATIENCE = 1.0
"""When nothing was old enough, or the file took no more, time to the next look [s]."""

RESERVE = 2**30
"""Space that's left to others on the disk [B]."""

GRANT = 2**20
"""How much is written between looks at the space that's left [B]."""

_exchange = threading.Lock()
"""Held while something takes another class: branches share leaves."""


class _File:
    """A file without a name, which the system takes away with the last leaf or node in it."""

    __slots__ = ("_file", "_granted", "process", "size")

    def __init__(self) -> None:
        # What few programs need loads when it's used: `import vrs` is to be quick.
        from tempfile import TemporaryFile

        named = any(os.environ.get(name) for name in ("TMPDIR", "TEMP", "TMP"))
        # Many systems keep /tmp in memory.
        place = "/var/tmp" if not named and os.access("/var/tmp", os.W_OK | os.X_OK) else None  # noqa: S108
        self._file: Any = TemporaryFile(buffering=0, dir=place)  # noqa: SIM115
        self.size = 0
        """[B]."""
        self._granted = 0
        self.process = os.getpid()
        """Who may write: after a fork, files are shared."""

    def __del__(self) -> None:
        file = getattr(self, "_file", None)
        if file is not None:
            file.close()

    def write(self, data: bytes) -> int:
        """Append, and return where it begins.

        Raises:
            OSError: If that's not possible; what was written before is still there.
        """
        handle = self._file.fileno()
        if self.size >= self._granted:
            disk = os.fstatvfs(handle)
            if disk.f_bavail * disk.f_frsize < RESERVE + GRANT:
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
            self._granted = self.size + GRANT
        if os.pwrite(handle, data, self.size) < len(data):
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        position = self.size
        self.size += len(data)
        return position

    def read(self, position: int, size: int) -> bytes:
        """What was written.

        Raises:
            OSError: If the disk doesn't give it back.
        """
        data = os.pread(self._file.fileno(), size, position)
        if len(data) < size:
            raise OSError(errno.EIO, os.strerror(errno.EIO))
        return data


class _Place:
    """Where something that's put away is, and what it is while it's in memory again."""

    __slots__ = ("__weakref__", "file", "head", "live", "position", "size")

    def __init__(self, file: _File, position: int, size: int, head: tuple[float, float] | None = None) -> None:
        self.file = file
        self.position = position
        self.size = size
        """[B]."""
        self.head = head
        """A node's `head`."""
        self.live: Any = None

    def fetched(self, live: Leaf | Node, read: CacheLimit[_Place]) -> None:
        """Keep in memory what was read, until there's too much of it."""
        self.live = live
        read.add(self)

    def forget(self) -> None:
        """Drop what was read."""
        self.live = None


READ_LEAVES, READ_NODES = CacheLimit(256, _Place.forget), CacheLimit(32, _Place.forget)
"""Leaves and nodes that are in memory again in all: 2.4 and 0.7 MB."""


class StoredLeaf(Leaf):
    """A leaf whose columns are in a file; `first` and `count` are here."""

    __slots__ = ()

    def __getattr__(self, name: str) -> Any:
        place: _Place = self.place
        live = place.live
        if live is None:
            live = _leaf(place.file.read(place.position, place.size), self.count)
            place.fetched(live, READ_LEAVES)
        return getattr(live, name)

    def __reduce__(self) -> tuple[Any, ...]:
        return Leaf, (self.starts, self.durations, self.owners, self.rows)


class StoredNode(Node):
    """A node of height 1 whose columns are in a file; `first`, `count`, `head` and caches are here."""

    __slots__ = ()

    @property
    def head(self) -> tuple[float, float] | None:  # type: ignore[override]
        """Time offset of the first child, and where its first segment starts in the child's time [s]."""
        place: _Place = self.place
        return place.head

    def __getattr__(self, name: str) -> Any:
        place: _Place = self.place
        live = place.live
        if live is None:
            live = _node(place.file, place.file.read(place.position, place.size))
            place.fetched(live, READ_NODES)
        return getattr(live, name)

    def __reduce__(self) -> tuple[Any, ...]:
        return Node, (self.children, self.offsets, self.firsts, self.counts)


class Keeper:
    """Puts the far past of one engine's timeline away, a portion at each command.

    If the file can't be written, everything stays in memory, and the log says so once.
    """

    def __init__(self) -> None:
        self._file: _File | None = None
        self._done = 0
        self._due = -inf
        self._warned = False

    @property
    def size(self) -> int:
        """What is in the file [B]."""
        return 0 if self._file is None else self._file.size

    def tidy(self, timeline: Timeline, now: float) -> None:
        """Put a portion of what's long past away.

        Args:
            timeline: The engine's. Its value stays what it is.
            now: Present time [s].
        """
        if len(timeline) > KEPT and now >= self._due:
            try:
                self._put_away(timeline, now)
            except OSError as error:
                self._due = now + PATIENCE
                if not self._warned:
                    self._warned = True
                    _warn(error)

    def _put_away(self, timeline: Timeline, now: float) -> None:
        root, height = timeline.root, timeline.height
        old = len(timeline) - KEPT
        for _ in range(PORTION + max(old - self._done, 0) // BACKLOG):
            if root is None or self._done >= old:
                self._due = now + PATIENCE
                return
            node, before = root, 0
            for _ in range(height - 1):
                child = bisect_right(node.counts, self._done - before) - 1
                before += node.counts[child]
                node = node.children[child]
            stop = before + node.count
            if type(node) is StoredNode:
                self._done = stop
                continue
            if stop > old or timeline.start_of(stop) > now - RECENT:
                self._due = now + PATIENCE
                return
            if self._file is None or self._file.process != os.getpid():
                self._file = _File()
            child = bisect_right(node.counts, self._done - before) - 1
            _store_leaf(node.children[child], self._file)
            self._done = before + node.counts[child + 1]
            if self._done == stop:
                _store_node(node, self._file)


def _warn(error: OSError) -> None:
    import logging

    text = "the far past stays in memory: no temporary file takes it (%s)"
    logging.getLogger(__name__).warning(text, error)


def _store_leaf(leaf: Leaf, file: _File) -> _Place:
    """Put a leaf away, if it isn't in this file yet."""
    place: _Place
    if type(leaf) is StoredLeaf and leaf.place.file is file:
        place = leaf.place
        return place
    rows = leaf.rows
    sizes = array("q", map(len, rows))
    data = b"".join((leaf.starts, leaf.durations, leaf.owners, sizes, *rows))
    place = _Place(file, file.write(data), len(data))
    with _exchange:
        leaf.place = place
        if type(leaf) is not StoredLeaf:
            leaf.__class__ = StoredLeaf
            del leaf.starts, leaf.durations, leaf.owners, leaf.rows
    return place


def _leaf(data: bytes, count: int) -> Leaf:
    starts, durations = array("d", data[: 8 * count]), array("d", data[8 * count : 16 * count])
    owners, sizes = array("q", data[16 * count : 24 * count]), array("q", data[24 * count : 32 * count])
    rows = tuple([data[a:b] for a, b in pairwise(accumulate(sizes, initial=32 * count))])
    return Leaf(starts, durations, owners, rows)


def _store_node(node: Node, file: _File) -> None:
    """Put a node of height 1 away, and what of its leaves isn't in the file yet."""
    leaves: tuple[Leaf, ...] = node.children
    places = [_store_leaf(leaf, file) for leaf in leaves]
    begins = array("d", [leaf.first for leaf in leaves])
    where = array("q", [number for place in places for number in (place.position, place.size)])
    data = b"".join((node.counts, node.offsets, node.firsts, begins, where))
    place = _Place(file, file.write(data), len(data), (node.offsets[0], leaves[0].first))
    with _exchange:
        node.place = place
        if type(node) is not StoredNode:
            node.__class__ = StoredNode
            del node.children, node.offsets, node.firsts, node.counts


def _node(file: _File, data: bytes) -> Node:
    count = len(data) // 48
    counts = array("q", data[: 8 * count + 8])
    columns = array("d", data[8 * count + 8 : 32 * count + 8])
    where = array("q", data[32 * count + 8 :])
    leaves = []
    for i, begin in enumerate(columns[2 * count :]):
        leaf = StoredLeaf.__new__(StoredLeaf)
        leaf.first, leaf.count = begin, counts[i + 1] - counts[i]
        leaf.place = _Place(file, where[2 * i], where[2 * i + 1])
        leaves.append(leaf)
    return Node(tuple(leaves), columns[:count], columns[count : 2 * count], counts)
