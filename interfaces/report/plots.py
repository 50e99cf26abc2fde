"""The report's plots, as SVG that takes its colours from the page and repeats byte for byte."""

from __future__ import annotations

import io
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import ArrayLike

from interfaces.runs.twin_run import TwinRun
from vrs.model import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# Stand-ins that the SVG backend writes out literally; the page's style sheet gives the real colours.
_COLOURS: Final = {
    "#010101": "var(--ink)",
    "#020202": "var(--muted)",
    "#030303": "var(--line)",
    "#040404": "var(--virtual)",
    "#050505": "var(--real)",
    "#060606": "var(--bad)",
    "#0a0101": "var(--j1)",
    "#0a0202": "var(--j2)",
    "#0a0303": "var(--j3)",
    "#0a0404": "var(--j4)",
    "#0a0505": "var(--j5)",
    "#0a0606": "var(--j6)",
}
INK, MUTED, LINE, VIRTUAL, REAL, BAD = list(_COLOURS)[:6]
JOINTS: Final = tuple(list(_COLOURS)[6:])
MAX_POINTS: Final = 6_000
"""Most samples of a curve that are handed to the plotter."""


@dataclass(frozen=True, slots=True)
class Plot:
    """One plot of the report."""

    name: str
    """Short name, unique in the page."""
    title: str
    svg: str
    """An `<svg>` element."""
    low: float
    """User time at the left edge of the axes [s]."""
    high: float
    """User time at the right edge of the axes [s]."""
    left: float
    """Left edge of the axes, as a share of the picture's width."""
    right: float
    """Right edge of the axes, as a share of the picture's width."""
    note: str = ""
    """One line of explanation."""
    is_joint: bool = False
    """Whether it shows the trajectory of one joint."""


def plots(run: TwinRun) -> tuple[Plot, ...]:
    """Draw how far behind the real robot was, joint errors, tool error, and the trajectory of every joint."""
    prismatic = run.model.prismatic
    error = run.q_real - run.q_matched
    turning = [j for j in range(error.shape[1]) if j not in prismatic]
    sliding = [j for j in range(error.shape[1]) if j in prismatic]
    same = "Control: real minus virtual at the same place in the plan, when the real robot was there."
    out = [
        _plot(
            run,
            "behind",
            "How far the real robot is behind",
            "s",
            lambda ax: _behind(ax, run),
            note="Network: −D, the user's time less the robot's play time. A dot is the delay of a message, at its "
            "arrival, or at the upper edge if it's longer. Where messages "
            "were late the robot slowed down, and was further behind from there on.",
        ),
        *(
            _plot(run, name, title, unit, partial(_lines, t=run.t, values=scale * error, joints=joints), note=same)
            for name, title, unit, scale, joints in (
                ("joint-errors", "Joint errors", "deg", 180.0 / np.pi, turning),
                ("prismatic-errors", "Errors of prismatic joints", "mm", 1e3, sliding),
            )
            if joints
        ),
        _plot(run, "tool-error", "Tool error", "mm", lambda ax: _tool_error(ax, run), note=same),
    ]
    out.extend(
        _plot(
            run,
            f"joint-{j + 1}",
            f"Joint {j + 1}",
            "m" if j in prismatic else "deg",
            partial(_trajectory, run=run, j=j),
            size=(4.6, 2.3),
            is_joint=True,
        )
        for j in range(error.shape[1])
    )
    return tuple(out)


def _tool_error(ax: Axes, run: TwinRun) -> None:
    p_virtual = np.asarray(run.model.forward(run.q_matched))[:, :3, 3]
    distance = np.full(len(run.t), np.nan)
    p_real = np.asarray(run.model.forward(run.q_real[run.measured]))[:, :3, 3]
    distance[run.measured] = 1e3 * np.linalg.norm(p_real - p_virtual[run.measured], axis=1)
    ax.plot(*_thin(run.t, distance), color=REAL, linewidth=1.4)
    ax.set_ylim(bottom=0.0)


def _lines(ax: Axes, *, t: Array, values: Array, joints: Sequence[int]) -> None:
    for j in joints:
        ax.plot(*_thin(t, values[:, j]), color=JOINTS[j % len(JOINTS)], linewidth=1.3, label=f"{j + 1}")
    _legend(ax, columns=len(joints))


def _behind(ax: Axes, run: TwinRun) -> None:
    sent, arrived = run.messages.T
    there = np.isfinite(arrived) & (arrived <= run.t[-1])
    delay = arrived[there] - sent[there]
    behind = np.where(run.measured, -run.D, np.nan)
    # The delays of a bad network span decades; above what matters here they are drawn at the edge.
    top = 1.25 * max(float(np.nanmax(behind)), float(np.quantile(delay, 0.9)) if len(delay) else 0.0, 1e-3)
    at, height = _thin(arrived[there], np.minimum(delay, top))
    ax.plot(at, height, ".", color=VIRTUAL, markersize=2.2, alpha=0.55, label="message", clip_on=False)
    lost = sent[~np.isfinite(arrived)]
    if len(lost):
        ax.plot(lost, np.full(len(lost), 0.0), "x", color=BAD, markersize=5, label="lost", clip_on=False)
    ax.plot(*_thin(run.t, behind), color=REAL, linewidth=1.5, label="real robot")
    _legend(ax, columns=3)
    ax.set_ylim(0.0, top)


def _trajectory(ax: Axes, *, run: TwinRun, j: int) -> None:
    for q, colour, label in ((run.q_shown, VIRTUAL, "virtual"), (run.q_real, REAL, "real")):
        values = q[:, j] if j in run.model.prismatic else np.degrees(q[:, j])
        ax.plot(*_thin(run.t, values), color=colour, linewidth=1.3, label=label)
    _legend(ax, columns=2)


def _legend(ax: Axes, columns: int) -> None:
    ax.legend(
        loc="lower right",
        bbox_to_anchor=(1.0, 1.0),
        ncols=columns,
        frameon=False,
        handlelength=1.0,
        columnspacing=1.0,
        handletextpad=0.4,
        borderaxespad=0.1,
        labelcolor=INK,
    )


def _thin(t: ArrayLike, values: ArrayLike) -> tuple[Array, Array]:
    """Keep at most MAX_POINTS samples: of every bucket its extremes, so that no peak is lost, nor a gap of NaN."""
    x, y = np.asarray(t, dtype=np.float64), np.asarray(values, dtype=np.float64)
    if len(x) <= MAX_POINTS:
        return x, y
    edges = np.linspace(0, len(x), MAX_POINTS // 2 + 1).astype(int)
    picks = {0, len(x) - 1}
    unknown = np.isnan(y)
    filled = np.where(unknown, y[~unknown].mean() if not unknown.all() else 0.0, y) if unknown.any() else y
    for low, high in pairwise(edges):
        picks.update((low + int(np.argmin(filled[low:high])), low + int(np.argmax(filled[low:high]))))
        if unknown[low:high].any():
            picks.add(low + int(np.argmax(unknown[low:high])))
    order = np.array(sorted(picks))
    return x[order], y[order]


def _plot(
    run: TwinRun,
    name: str,
    title: str,
    unit: str,
    draw: Callable[[Axes], None],
    *,
    size: tuple[float, float] = (5.6, 2.9),
    note: str = "",
    is_joint: bool = False,
) -> Plot:
    """Draw one plot over user time."""
    import matplotlib
    from matplotlib.backends.backend_svg import FigureCanvasSVG
    from matplotlib.figure import Figure

    style: dict[Any, Any] = {
        "svg.fonttype": "none",
        "svg.hashsalt": "vrs",
        "font.family": "sans-serif",
        "font.size": 9.5,
        "path.simplify": True,
        "path.simplify_threshold": 0.2,
        "text.color": INK,
        "axes.labelcolor": MUTED,
        "axes.edgecolor": LINE,
        "xtick.color": MUTED,
        "ytick.color": MUTED,
        "grid.color": LINE,
        "axes.unicode_minus": True,
    }
    with matplotlib.rc_context(style):
        figure = Figure(figsize=size)
        FigureCanvasSVG(figure)
        ax = figure.add_axes((52.0 / (72 * size[0]), 0.15, 1 - 62.0 / (72 * size[0]), 0.73))
        figure.patch.set_visible(False)
        ax.patch.set_visible(False)
        ax.grid(visible=True, linewidth=0.6)
        ax.set_axisbelow(True)
        for side in ("top", "right", "left"):
            ax.spines[side].set_visible(False)
        ax.tick_params(length=0, pad=4)
        ax.locator_params(axis="y", nbins=5)
        draw(ax)
        ax.set_xlim(float(run.t[0]), float(run.t[-1]))
        ax.annotate(unit, (0.0, 1.0), xytext=(-6, 8), textcoords="offset points", xycoords="axes fraction",
                    ha="right", color=MUTED)  # fmt: skip
        buffer = io.StringIO()
        figure.savefig(buffer, format="svg", metadata={"Date": None, "Creator": None})
        (low, high), (left, right) = ax.get_xlim(), ax.get_position().intervalx
    svg = _inline(buffer.getvalue(), name, title)
    return Plot(name, title, svg, float(low), float(high), float(left), float(right), note, is_joint)


def _inline(text: str, name: str, title: str) -> str:
    """Make a standalone SVG file one that can stand beside others in a page."""
    text = text[text.index("<svg") :]
    text = re.sub(r"<metadata>.*?</metadata>", "", text, flags=re.DOTALL)
    text = re.sub(r'<svg [^>]*viewBox="([^"]*)"[^>]*>',
                  rf'<svg viewBox="\1" role="img" aria-label="{title}">', text, count=1)  # fmt: skip
    text = re.sub(r'\bid="([^"]*)"', rf'id="{name}-\1"', text)
    text = text.replace("url(#", f"url(#{name}-").replace('href="#', f'href="#{name}-')
    text = text.replace("xlink:href", "href")
    text = re.sub(r"font: ([\d.]+px) [^;\"]*", r"font-size: \1", text)
    for stand_in, colour in _COLOURS.items():
        text = text.replace(stand_in, colour)
    return text
