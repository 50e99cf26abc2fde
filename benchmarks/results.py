"""What a benchmark found: costs, the bars they're held against, parts of a run."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

NOT_INSTALLED = "not installed"


@dataclass(frozen=True, slots=True)
class Cost:
    """What something costs, in its result's unit."""

    median: float
    p99: float | None = None
    """99th percentile of single calls; None where there's but one figure."""


@dataclass(frozen=True, slots=True)
class Bar:
    """What is asked for; None asks for nothing."""

    median: float | None = None
    """Largest median."""
    p99: float | None = None
    """Largest 99th percentile."""
    ratio: float | None = None
    """Least ratio, the peer's median to ours."""

    def text(self, unit: str) -> str:
        """The bar in words; empty if nothing is asked."""
        words = []
        if self.median is not None:
            words.append(f"≤ {number(self.median)} {unit}".rstrip())
        if self.p99 is not None:
            words.append(f"p99 ≤ {number(self.p99)} {unit}".rstrip())
        if self.ratio is not None:
            words.append(f"ratio ≥ {self.ratio:g}")
        return ", ".join(words)

    def held(self, ours: Cost | None, ratio: float | None) -> bool | None:
        """Whether it's met; None where nothing is asked, or where the peer that it's about isn't there."""
        if ours is None:
            return None
        asked = []
        if self.median is not None:
            asked.append(ours.median <= self.median)
        if self.p99 is not None:
            asked.append(ours.p99 is not None and ours.p99 <= self.p99)
        if self.ratio is not None:
            if ratio is None:
                return None
            asked.append(ratio >= self.ratio)
        return all(asked) if asked else None


@dataclass(frozen=True, slots=True)
class Result:
    """One row: something of ours, and what a peer takes for it."""

    name: str
    ours: Cost | None
    """None where it's a comparison with a peer that isn't installed."""
    unit: str = "µs"
    bar: Bar = Bar()
    peer: str = ""
    """Whom it's compared with; empty for nobody."""
    theirs: Cost | None = None
    """What the peer takes; None where it isn't installed."""
    ratio: float | None = None
    """The peer's median over ours, from blocks that took turns: above 1, ours is the faster."""
    note: str = ""
    tries: int | None = None
    """How often it was tried, of what happens or doesn't; None of what is measured."""

    @property
    def asked(self) -> str:
        """The bar in words."""
        return self.bar.text(self.unit)

    @property
    def holds(self) -> bool | None:
        """Whether the bar is met; None where there's none or it can't be judged."""
        return self.bar.held(self.ours, self.ratio)


@dataclass(frozen=True, slots=True)
class Chart:
    """A plot as data."""

    name: str
    """File name without the ending."""
    title: str
    kind: Literal["lines", "spread", "dots"]
    """Lines over x; shares of calls that cost at most x; one dot a row."""
    x: str
    """Label of the horizontal axis."""
    y: str = ""
    """Label of the vertical axis, of lines alone."""
    series: dict[str, list[tuple[float, float]]] = field(default_factory=dict)
    """Points (x, y) by name; a spread's are (value, 0); of dots, y is the place of a row."""
    rows: tuple[str, ...] = ()
    """Names of the rows of dots."""
    bars: dict[str, float] = field(default_factory=dict)
    """Asked-for costs by name, drawn as rules."""
    log: bool = True
    """Whether the axis of costs is logarithmic."""


@dataclass(frozen=True, slots=True)
class Part:
    """What one benchmark found."""

    title: str
    text: str
    """What was measured and how, in a few sentences."""
    results: tuple[Result, ...] = ()
    charts: tuple[Chart, ...] = ()
    pace: float = 1.0
    """What the yardstick took before and after, in processor time [µs]: how slow the machine was."""


def number(value: float) -> str:
    """A figure with three digits."""
    size = abs(value)
    if size and not 1e-3 <= size < 1e8:
        return f"{value:.1e}"
    if size >= 100:
        return f"{value:,.0f}"
    return f"{value:.3g}"
