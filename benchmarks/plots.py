"""Charts as SVG that are readable on light and on dark pages: no background, greys and hues between the two."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.results import Chart

INK = "#7d8590"
HUES = ("#2f81f7", "#e8590c", "#2f9e44", "#ae5ad6", "#c99a00", "#e64980")
SIZE = (7.2, 3.6)
STYLE: Any = {
    "svg.fonttype": "none",
    "svg.hashsalt": "vrs",
    "font.family": "sans-serif",
    "font.size": 10.0,
    "text.color": INK,
    "axes.labelcolor": INK,
    "axes.edgecolor": INK,
    "axes.titlecolor": INK,
    "axes.titlesize": 11.0,
    "axes.titlelocation": "left",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "xtick.color": INK,
    "ytick.color": INK,
    "grid.color": INK,
    "grid.alpha": 0.25,
    "grid.linewidth": 0.6,
    "legend.frameon": False,
    "legend.fontsize": 9.0,
    "lines.linewidth": 1.8,
    "figure.constrained_layout.use": True,
}


def draw(chart: Chart, folder: Path) -> Path:
    """Write a chart as SVG and return its path."""
    # matplotlib dates its files by this.
    os.environ.setdefault("SOURCE_DATE_EPOCH", "0")
    import matplotlib as mpl

    mpl.use("agg")
    from matplotlib import pyplot

    path = folder / f"{chart.name}.svg"
    with mpl.rc_context(STYLE):
        height = 1.3 + 0.5 * len(chart.rows) if chart.kind == "dots" else SIZE[1]
        figure, axes = pyplot.subplots(figsize=(SIZE[0], height))
        {"lines": _lines, "spread": _spread, "dots": _dots}[chart.kind](axes, chart)
        axes.set_title(chart.title)
        axes.set_xlabel(chart.x)
        axes.set_ylabel(chart.y)
        figure.savefig(path, transparent=True, metadata={"Date": None, "Creator": None})
        pyplot.close(figure)
    return path


def _legend(axes: Any) -> None:
    axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))


def _plain(axis: Any) -> None:
    """Numbers as they're said on a logarithmic axis."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    axis.set_major_locator(LogLocator(subs=(1.0,)))
    low, high = axis.get_view_interval()
    if high / low < 30:
        axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:,.4g}" if value < 1 else f"{value:,.0f}"))
    axis.set_minor_formatter(NullFormatter())


def _lines(axes: Any, chart: Chart) -> None:
    # A rival keeps its hue; its second kind of line is dashed.
    hues: dict[str, str] = {}
    for name, points in chart.series.items():
        rival, _, kind = name.partition(", ")
        hue = hues.setdefault(rival, HUES[len(hues) % len(HUES)])
        repeated = any(other.startswith(f"{rival}, ") and other != name for other in chart.series)
        first = next(other for other in chart.series if other.partition(", ")[0] == rival)
        style = "--" if repeated and kind and name != first else "-"
        x, y = zip(*points, strict=True)
        axes.plot(x, y, style, color=hue, marker="o", markersize=3.5, label=name)
    for name, bar in chart.bars.items():
        axes.axhline(bar, color=INK, linestyle=":", linewidth=1.2, label=name)
    if chart.log:
        axes.set_xscale("log")
        axes.set_yscale("log")
        _plain(axes.xaxis)
        _plain(axes.yaxis)
    else:
        axes.set_ylim(bottom=0.0)
    axes.grid(axis="y")
    _legend(axes)


def _spread(axes: Any, chart: Chart) -> None:
    ends = []
    for hue, (name, points) in zip(HUES, chart.series.items(), strict=False):
        values = np.sort([value for value, _ in points])
        shares = (np.arange(len(values)) + 1) / len(values)
        axes.step(values, shares, where="post", color=hue, label=name)
        ends += [values[0], np.percentile(values, 99.5)]
    for style, (name, bar) in zip((":", "--"), chart.bars.items(), strict=False):
        axes.axvline(bar, color=INK, linestyle=style, linewidth=1.2, label=name)
        ends.append(bar)
    if chart.log:
        axes.set_xscale("log")
    axes.set_xlim(0.95 * min(ends), 1.05 * max(ends))
    if chart.log:
        _plain(axes.xaxis)
    axes.set_ylim(0.0, 1.02)
    axes.grid(axis="both")
    _legend(axes)


def _dots(axes: Any, chart: Chart) -> None:
    for place in range(len(chart.rows)):
        values = [value for points in chart.series.values() for value, row in points if row == place]
        axes.plot([min(values), max(values)], [place, place], color=INK, linewidth=1.0, alpha=0.5, zorder=1)
    for hue, (name, points) in zip(HUES, chart.series.items(), strict=False):
        x, y = zip(*points, strict=True)
        axes.plot(x, y, "o", color=hue, markersize=7, label=name, zorder=2)
    axes.set_xscale("log")
    low, high = axes.get_xlim()
    axes.set_xlim(low / 1.15, high * 1.15)
    _plain(axes.xaxis)
    axes.set_yticks(range(len(chart.rows)), chart.rows)
    axes.set_ylim(len(chart.rows) - 0.5, -0.5)
    axes.tick_params(axis="y", length=0)
    axes.spines["left"].set_visible(False)
    axes.grid(axis="x")
    _legend(axes)
