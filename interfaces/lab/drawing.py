"""Pictures of reproductions: standalone SVG files that repeat byte for byte."""

from __future__ import annotations

import io
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Final

from interfaces.lab.claims import Figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Canvas

INK: Final = "#1b2733"
MUTED: Final = "#5c6b7a"
LINE: Final = "#d5dce3"
VIRTUAL: Final = "#1f6fb4"
REAL: Final = "#d2691e"
BAD: Final = "#b3261e"
GOOD: Final = "#2e8540"
WIDTH: Final = 7.2
"""Of a picture [inch]."""


def draw(name: str, title: str, paint: Callable[[Canvas], None], *, height: float = 3.2) -> Figure:
    """Paint a picture.

    Args:
        name: Of its file, without the ending.
        title: What it shows.
        paint: Adds axes to the canvas, and draws in them.
        height: Its height [inch].
    """
    import matplotlib
    from matplotlib.backends.backend_svg import FigureCanvasSVG
    from matplotlib.figure import Figure as Canvas

    style: dict[Any, Any] = {
        "svg.fonttype": "none",
        "svg.hashsalt": "vrs",
        "font.family": "sans-serif",
        "font.size": 9.0,
        "axes.titlesize": 9.5,
        "axes.titlelocation": "left",
        "axes.titlecolor": INK,
        "axes.labelcolor": MUTED,
        "axes.edgecolor": LINE,
        "axes.grid": True,
        "axes.axisbelow": True,
        "axes.spines.top": False,
        "axes.spines.right": False,
        "grid.color": LINE,
        "grid.linewidth": 0.6,
        "xtick.color": MUTED,
        "ytick.color": MUTED,
        "xtick.major.size": 0.0,
        "ytick.major.size": 0.0,
        "text.color": INK,
        "legend.frameon": False,
        "lines.linewidth": 1.4,
        "path.simplify": True,
    }
    buffer = io.StringIO()
    with matplotlib.rc_context(style):
        canvas = Canvas(figsize=(WIDTH, height), layout="constrained", facecolor="white")
        FigureCanvasSVG(canvas)
        paint(canvas)
        canvas.savefig(buffer, format="svg", metadata={"Date": None, "Creator": None, "Title": title})
    return Figure(name, title, buffer.getvalue())


def legend(ax: Axes, *, columns: int = 1, place: Any = "best") -> None:
    """A legend without a frame."""
    ax.legend(loc=place, ncols=columns, fontsize=8.0, handlelength=1.6, labelcolor=INK, borderaxespad=0.3)
