"""A timeline's segments as a sequence."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, overload

from vrs.segment import PolynomialSegment

if TYPE_CHECKING:
    from vrs.timeline import Timeline


class SegmentView(Sequence[PolynomialSegment]):
    """A timeline's segments, made one by one as they're asked for."""

    __slots__ = ("_timeline",)

    def __init__(self, timeline: Timeline) -> None:
        self._timeline = timeline

    def __len__(self) -> int:
        return len(self._timeline)

    @overload
    def __getitem__(self, index: int) -> PolynomialSegment: ...
    @overload
    def __getitem__(self, index: slice) -> tuple[PolynomialSegment, ...]: ...
    def __getitem__(self, index: int | slice) -> PolynomialSegment | tuple[PolynomialSegment, ...]:
        if isinstance(index, slice):
            return tuple(self._timeline.segment(i) for i in range(*index.indices(len(self))))
        if not -len(self) <= index < len(self):
            raise IndexError(index)
        return self._timeline.segment(index % len(self))

    def __iter__(self) -> Iterator[PolynomialSegment]:
        return (self._timeline.segment(i) for i in range(len(self)))

    def __repr__(self) -> str:
        return f"<{len(self)} segments>"
