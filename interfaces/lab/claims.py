"""What a reproduction is made of, as frozen values: claims, tables, figures, and how they are measured."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Annotated, Any, TypeAlias

from interfaces.lab.statistics import Estimate
from robots.simulated import WORLDS
from vrs.checks import finite, one_of, validated, within
from vrs.errors import InvalidValueError

OWN_BAR = "our own bar"
"""The source of a claim that no paper makes; after a section, that of a bar where the paper gives none."""

Cell: TypeAlias = float | int | str | None
"""What stands in a table; None for nothing."""


def said(cell: Cell) -> str:
    """A cell as it's shown."""
    if cell is None:
        return ""
    return f"{cell:.4g}" if isinstance(cell, float) else str(cell)


def interval_said(interval: Sequence[float] | None) -> str:
    """An interval as it's shown."""
    return "" if interval is None else " to ".join(map(said, interval))


@dataclass(frozen=True, slots=True)
@validated
class Study:
    """How much is measured."""

    seed: Annotated[int, within(0, 2**32 - 1)] = 0
    """Seed of everything random, 0 to 2³² − 1."""
    runs: Annotated[int, within(2, 1000)] = 10
    """Runs behind each random figure, 2 to 1000."""
    length: float = 20.0
    """For how long each run's operator gives commands [s], 2 to 3600."""
    body: str = ""
    """World of physics that robots with a body in one have it in; the usual one unless given."""

    def __post_init__(self) -> None:
        one_of("body", self.body, ("", *WORLDS))
        if not 2 <= finite("length", self.length, "2 to 3600 s") <= 3600:
            raise InvalidValueError("length", self.length, "2 to 3600 s")


@dataclass(frozen=True, slots=True)
class Claim:
    """One thing that a paper says or asks for, and what was measured."""

    claim: str
    """What is claimed, with the unit of what was measured."""
    source: str
    """Where: section, equation or figure of the paper, or the page that asks for it."""
    expected: float | str
    """What there should be."""
    measured: float | str
    """What there was."""
    holds: bool
    """Whether it's so."""
    interval: tuple[float, float] | None = None
    """Interval over seeds of what was measured, see `interfaces.lab.statistics`; None where nothing is random."""


def at_most(
    claim: str, source: str, bar: float, measured: float | Estimate, *, slack: float = 0.0, note: str = ""
) -> Claim:
    """A claim that holds if what was measured, or the upper end of its interval, is no more than a bar.

    Args:
        claim: What is claimed, with the unit of what was measured.
        source: Where.
        bar: What there should be at most.
        measured: What there was.
        slack: How far the bar may be passed, by rounding.
        note: What the bar is, said behind it.
    """
    highest = measured.high if isinstance(measured, Estimate) else measured
    return _beside(claim, source, f"≤ {_number(bar)}{note}", measured, holds=highest <= bar + slack)


def at_least(claim: str, source: str, bar: float, measured: float | Estimate, *, note: str = "") -> Claim:
    """A claim that holds if what was measured, or the lower end of its interval, is no less than a bar."""
    lowest = measured.low if isinstance(measured, Estimate) else measured
    return _beside(claim, source, f"≥ {_number(bar)}{note}", measured, holds=lowest >= bar)


def above(claim: str, source: str, bar: float, measured: float | Estimate) -> Claim:
    """A claim that holds if what was measured, or the lower end of its interval, is more than a bar."""
    lowest = measured.low if isinstance(measured, Estimate) else measured
    return _beside(claim, source, f"> {_number(bar)}", measured, holds=lowest > bar)


def below_zero(claim: str, source: str, difference: Estimate) -> Claim:
    """A claim that holds if the interval of a difference lies below zero."""
    return _beside(claim, source, "< 0", difference, holds=difference.is_below_zero)


def none_of(claim: str, source: str, count: int, *, of: int = 1) -> Claim:
    """A claim that holds if nothing was counted among something."""
    return Claim(claim, source, 0, count, count == 0 and of > 0)


def _beside(claim: str, source: str, expected: str, measured: float | Estimate, *, holds: bool) -> Claim:
    if isinstance(measured, Estimate):
        return Claim(claim, source, expected, measured.value, holds, measured.interval)
    return Claim(claim, source, expected, measured, holds)


def _number(bar: float) -> str:
    """A bar as claims spell it: 1e-9."""
    return f"{bar:g}".replace("e-0", "e-")


class Results(SimpleNamespace):
    """What was measured, by name; whoever makes one says beside each figure what it is."""


@dataclass(frozen=True, slots=True)
class Table:
    """Figures in rows."""

    name: str
    title: str
    columns: tuple[str, ...]
    """What the columns hold, with units."""
    rows: tuple[tuple[Cell, ...], ...]

    def __post_init__(self) -> None:
        for row in self.rows:
            if len(row) != len(self.columns):
                raise InvalidValueError("row", row, f"of {len(self.columns)} cells")

    @classmethod
    def of(cls, name: str, title: str, rows: Iterable[Sequence[tuple[str, Cell]]]) -> Table:
        """A table of rows whose cells say which column they're in.

        Raises:
            ValueError: If rows name other columns than the others do, or there are none.
        """
        named = tuple(rows)
        (columns,) = {tuple(column for column, _ in row) for row in named}
        return cls(name, title, columns, tuple(tuple(cell for _, cell in row) for row in named))


@dataclass(frozen=True, slots=True)
class Figure:
    """A picture."""

    name: str
    """Of its file, without the ending."""
    title: str
    svg: str


@dataclass(frozen=True, slots=True)
class Findings:
    """What a part of a reproduction found."""

    claims: tuple[Claim, ...] = ()
    tables: tuple[Table, ...] = ()
    figures: tuple[Figure, ...] = ()
    timings: tuple[Claim, ...] = ()
    """Claims about this machine's speed: they differ from run to run."""


def _only(_study: Study, found: tuple[Findings, ...]) -> Findings:
    """The findings of the only case."""
    return found[0]


@dataclass(frozen=True, slots=True)
class PaperPart:
    """Something to be measured, in cases that don't depend on each other."""

    title: str
    work: Callable[[Study, str], Any]
    """Measures a case, perhaps in another process."""
    conclude: Callable[[Study, tuple[Any, ...]], Findings] = _only
    """Makes findings of what was measured, a value a case; unless given, the only case makes them itself."""
    cases: tuple[str, ...] = ("",)
    physical: bool = False
    """Whether robots with physics have part in it, so that `Study.body` makes a difference."""


@dataclass(frozen=True, slots=True)
class Paper:
    """A paper that can be reproduced: its file gives claims and figures, part by part."""

    name: str
    """As the command line spells it."""
    citation: str
    parts: tuple[PaperPart, ...]
    runs: int = 10
    """Behind each random figure, unless said otherwise."""
    length: float = 20.0
    """For how long each run's operator gives commands, unless said otherwise [s]."""

    def in_world(self, body: str) -> Paper:
        """The paper itself, or where a world of physics is named, what of it robots with physics have part in."""
        return replace(self, parts=tuple(part for part in self.parts if part.physical or not body))


@dataclass(frozen=True, slots=True)
class Reproduction:
    """What came of reproducing a paper."""

    paper: Paper
    study: Study
    findings: Findings

    @property
    def failed(self) -> tuple[Claim, ...]:
        """The claims that don't hold, those about speed included."""
        return tuple(claim for claim in (*self.findings.claims, *self.findings.timings) if not claim.holds)
