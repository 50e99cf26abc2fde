"""What a reproduction is made of, as frozen values: claims, tables, figures, and how they are measured."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, TypeAlias

from vrs.checks import validated, within
from vrs.commands import finite
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

    def __post_init__(self) -> None:
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


@dataclass(frozen=True, slots=True)
class PaperPart:
    """Something to be measured, in cases that don't depend on each other."""

    title: str
    work: Callable[[Study, str], Any]
    """Measures a case, perhaps in another process."""
    conclude: Callable[[Study, tuple[Any, ...]], Findings]
    """Makes findings of what was measured, a value a case."""
    cases: tuple[str, ...] = ("",)

    @classmethod
    def single(cls, title: str, work: Callable[[Study, str], Findings]) -> PaperPart:
        """A part whose one case makes the findings itself."""
        return cls(title, work, _only)


def _only(_study: Study, found: tuple[Findings, ...]) -> Findings:
    """The findings of the only case."""
    return found[0]


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
