"""What a reproduction is made of, as frozen values: claims, tables, figures, and how they are measured."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
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


class Verdict(StrEnum):
    """What a claim's figures say together."""

    HOLDS = "holds"
    """The figure is as it should be, and without what is claimed it isn't."""
    FAILS = "doesn't hold"
    NOT_SHOWN = "not shown by this"
    """The figure is as it should be, but so it may be without what is claimed, or nothing is beside it."""


@dataclass(frozen=True, slots=True)
class Counterfactual:
    """The same figure without what is claimed: the mechanism switched off, or its obvious rival in its place."""

    what: str
    """What was switched off, or stands in its place."""
    measured: float | str
    """What there was then."""
    met: bool
    """Whether the figure may then be as it should be, too."""
    interval: tuple[float, float] | None = None
    """Interval over seeds of what was measured; None where nothing is random."""


@dataclass(frozen=True, slots=True)
class Claim:
    """One thing that a paper says or asks for, and what was measured with it and without it."""

    claim: str
    """What is claimed, with the unit of what was measured."""
    source: str
    """Where: section, equation or figure of the paper, or the page that asks for it."""
    expected: float | str
    """What there should be."""
    measured: float | str
    """What there was."""
    met: bool
    """Whether it's so."""
    interval: tuple[float, float] | None = None
    """Interval over seeds of what was measured, see `interfaces.lab.statistics`; None where nothing is random."""
    counterfactual: Counterfactual | None = None
    """What there was without it; None where nothing was put beside it."""

    @property
    def verdict(self) -> Verdict:
        """What the figures say: what would be so without what is claimed isn't shown."""
        if not self.met:
            return Verdict.FAILS
        return Verdict.NOT_SHOWN if self.counterfactual is None or self.counterfactual.met else Verdict.HOLDS

    @property
    def speed_verdict(self) -> Verdict:
        """The same of a bar of the machine's speed, which nothing has to stand beside."""
        return Verdict.HOLDS if self.met else Verdict.FAILS

    @property
    def holds(self) -> bool:
        """Whether the figures show it."""
        return self.verdict is Verdict.HOLDS

    @property
    def is_ours(self) -> bool:
        """Whether no paper gives the bar, so that it's ours."""
        return OWN_BAR in self.source


Measured: TypeAlias = float | Estimate
"""A figure, with its interval where it's random."""
Without: TypeAlias = tuple[str, Measured] | None
"""What was switched off, or stands in the place of what is claimed, and the same figure then; None for nothing."""


def at_most(
    claim: str, source: str, bar: float, measured: Measured, without: Without = None, *,
    slack: float = 0.0, note: str = "",
) -> Claim:  # fmt: skip
    """A claim that a figure, and the upper end of its interval, is no more than a bar.

    Args:
        claim: What is claimed, with the unit of what was measured.
        source: Where.
        bar: What there should be at most.
        measured: What there was.
        without: What there was without it; if its interval reaches the bar, the claim isn't shown.
        slack: How far the bar may be passed, by rounding.
        note: What the bar is, said behind it.
    """
    return _bounded(claim, source, f"≤ {_number(bar)}{note}", measured, without, lambda end: end <= bar + slack)


def at_least(
    claim: str, source: str, bar: float, measured: Measured, without: Without = None, *, note: str = ""
) -> Claim:
    """A claim that a figure, and the lower end of its interval, is no less than a bar; see `at_most`."""
    return _bounded(claim, source, f"≥ {_number(bar)}{note}", measured, without, lambda end: end >= bar)


def between(claim: str, source: str, low: float, high: float, measured: Measured, without: Without = None) -> Claim:
    """A claim that a figure, and both ends of its interval, lie from one bar to another; see `at_most`."""
    expected = f"{_number(low)} to {_number(high)}"
    return _bounded(claim, source, expected, measured, without, lambda end: low <= end <= high)


def above(claim: str, source: str, bar: float, measured: Measured, without: Without = None) -> Claim:
    """A claim that a figure, and the lower end of its interval, is more than a bar; see `at_most`."""
    return _bounded(claim, source, f"> {_number(bar)}", measured, without, lambda end: end > bar)


def below_zero(claim: str, source: str, difference: Estimate, without: Without = None) -> Claim:
    """A claim that a difference, with all of its interval, lies below zero; see `at_most`."""
    return _bounded(claim, source, "< 0", difference, without, lambda end: end < 0)


def none_of(claim: str, source: str, count: int, without: tuple[str, int] | None = None, *, of: int = 1) -> Claim:
    """A claim that nothing was counted among something; see `at_most`."""
    beside = None if without is None else Counterfactual(*without, met=without[1] == 0)
    return Claim(claim, source, 0, count, count == 0 < of, counterfactual=beside)


def all_of(claim: str, source: str, count: int, of: int, without: tuple[str, int] | None = None) -> Claim:
    """A claim that all of some things were counted; see `at_most`."""
    beside = None if without is None else Counterfactual(*without, met=without[1] == of)
    return Claim(claim, source, of, count, count == of > 0, counterfactual=beside)


def _bounded(
    claim: str, source: str, expected: str, measured: Measured, without: Without, keeps: Callable[[float], bool]
) -> Claim:
    """A claim that both ends of a figure's interval keep a bar; without what is claimed neither may."""
    value, ends, interval = _told(measured)
    beside = None
    if without is not None:
        what, found = without
        other, others, between = _told(found)
        beside = Counterfactual(what, other, any(map(keeps, others)), between)
    return Claim(claim, source, expected, value, all(map(keeps, ends)), interval, beside)


def _told(measured: Measured) -> tuple[float, tuple[float, ...], tuple[float, float] | None]:
    """A figure, what bars are laid to, and its interval."""
    if isinstance(measured, Estimate):
        return measured.value, measured.interval, measured.interval
    return measured, (measured,), None


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
        every = (*self.findings.claims, *self.findings.timings)
        return tuple(claim for claim in every if claim.verdict is Verdict.FAILS)
