"""A timeline's segments as a sequence."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, TypeVar, overload

from vrs.segment import Segment

if TYPE_CHECKING:
    from vrs.track import Track

S = TypeVar("S", bound=Segment)


class SegmentView(Sequence[S]):
    """A timeline's segments, made one by one as they're asked for."""

    __slots__ = ("_timeline",)

    def __init__(self, timeline: Track[S]) -> None:
        self._timeline: Track[S] = timeline

    def __len__(self) -> int:
        return len(self._timeline)

    @overload
    def __getitem__(self, index: int) -> S: ...
    @overload
    def __getitem__(self, index: slice) -> tuple[S, ...]: ...
    def __getitem__(self, index: int | slice) -> S | tuple[S, ...]:
        if isinstance(index, slice):
            return tuple(self._timeline.segment(i) for i in range(*index.indices(len(self))))
        if not -len(self) <= index < len(self):
            raise IndexError(index)
        return self._timeline.segment(index % len(self))

    def __iter__(self) -> Iterator[S]:
        return (self._timeline.segment(i) for i in range(len(self)))

    def __repr__(self) -> str:
        return f"<{len(self)} segments>"
