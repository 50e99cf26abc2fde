"""Where the claim stops: success over speed factor, look-ahead, length of the path, correlation and delay."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Final, TypeAlias

import numpy as np

from interfaces.lab.claims import Cell, Figure, Findings, Study, Table
from interfaces.lab.output import INK, draw
from interfaces.lab.tipsuwan.run import (
    NetworkControl,
    NetworkRunSetting,
    PathMeasures,
    agent,
    leg,
    measured,
    no_delay,
    run,
    s_path,
)
from interfaces.lab.tipsuwan.success import MOST_RATIO, succeeds
from interfaces.link import DelayProfile
from interfaces.link.delays import CORRELATION_TIME
from robots.onboard.curve import Curve

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Canvas

TAUS: Final = (0.05, 0.1, 0.15, 0.2, 0.25, 0.3, 0.4, 0.6)
"""Median round trips [s]."""
NOMINAL_T_PRED: Final = 8.5
"""Of the paths in the maps over α and s_max, for a round trip of 0.23 s [s]."""
AXES: Final = {
    "alpha": (0.5, 1.0, 1.5, 2.0, 3.0, 4.0),
    "s_max": (0.1, 0.2, 0.3, 0.45, 0.6, 0.9),
    "T_pred": (4.0, 6.0, 7.0, 8.0, 9.0, 10.0, 12.0),
    "correlation": (0.2, 2.0, 20.0),
}
"""What is varied beside τ, each with everything else as it is fixed."""
NAMES: Final = {"alpha": "α [m/s]", "s_max": "s_max [m]", "T_pred": "T_pred [s]", "correlation": "correlation [s]"}
CASES: Final = tuple(f"{axis} {value:g}" for axis, values in AXES.items() for value in values)
WHY: Final = {
    "·": "success",
    "n": "doesn't arrive without delay",
    "w": "arrives without the middleware, too",
    "m": "doesn't arrive with the middleware",
    "e": f"mean error over {MOST_RATIO:g} of that without",
}


LETTERS: Final = "; ".join(f"{letter} {why}" for letter, why in WHY.items() if letter != "·")


MapRow: TypeAlias = tuple[NetworkRunSetting, float | None, float]
"""What a row of a map is about: what its runs have in common, T_pred of its paths at each delay [s], or None for
the same paths at all of them, and the correlation time of the delays [s]."""


def varied(axis: str, value: float, length: float) -> MapRow:
    """Everything as it is fixed but for what an axis varies; runs of a length [s]."""
    setting = NetworkRunSetting(length=length)
    if axis == "T_pred":
        return setting, value, CORRELATION_TIME
    if axis == "correlation":
        return setting, None, value
    tracker = setting.tracker
    tracker = replace(tracker, alpha=value) if axis == "alpha" else replace(tracker, s_max=value)
    return replace(setting, tracker=tracker), None, CORRELATION_TIME


def work(study: Study, case: str) -> dict[float, tuple[str, ...]]:
    """What became of each of the paths at each delay, a letter of `WHY` each, by delay."""
    axis, text = case.split()
    row = varied(axis, float(text), study.length)
    letters: dict[float, list[str]] = {tau: [] for tau in TAUS}
    for k in range(max(study.runs // 5, 1)):
        number, known = 1000 * study.seed + 500 + k, dict[Curve, PathMeasures]()
        for tau in TAUS:
            letters[tau].append(outcome_letter(number, tau, row, known))
    return {tau: tuple(found) for tau, found in letters.items()}


def outcome_letter(number: int, tau: float, row: MapRow, known: dict[Curve, PathMeasures]) -> str:
    """One path at one delay: a letter of `WHY`.

    Args:
        number: Of the path.
        tau: Median round trip [s].
        row: Of the map.
        known: What becomes of the robot without delay, by path; it's added to.
    """
    setting, t_pred, correlation_time = row
    curve = s_path(number, NOMINAL_T_PRED) if t_pred is None else s_path(number, t_pred, tau=tau)

    def drive(control: NetworkControl, delay: DelayProfile) -> PathMeasures:
        return measured(run(curve, agent(control, curve, setting), delay, number, setting=setting))

    network = leg(tau, correlation_time)
    if curve not in known:
        known[curve] = drive(NetworkControl.DIRECT, no_delay())
    ideal = known[curve]
    if not ideal.arrived:
        return "n"
    behind = drive(NetworkControl.EXACT, network)
    if not behind.arrived:
        return "m"
    without = drive(NetworkControl.DIRECT, network)
    if without.arrived:
        return "w"
    return "·" if succeeds(ideal, without, behind) else "e"


def conclude(_study: Study, results: tuple[Any, ...]) -> Findings:
    """Four maps, as tables and as a picture."""
    found: dict[str, dict[float, tuple[str, ...]]] = dict(zip(CASES, results, strict=True))
    return Findings(tables=tuple(_table(axis, found) for axis in AXES), figures=(_figure(found),))


def _table(axis: str, found: dict[str, dict[float, tuple[str, ...]]]) -> Table:
    rows: list[tuple[Cell, ...]] = []
    for value in AXES[axis]:
        letters = found[f"{axis} {value:g}"]
        rows.append((value, *(said(letters[tau]) for tau in TAUS)))
    columns = (NAMES[axis], *(f"{tau:g} s" for tau in TAUS))
    title = f"Share of success over {NAMES[axis]} and the median round trip; {LETTERS}"
    return Table(f"map_{axis}", title, columns, tuple(rows))


def said(letters: tuple[str, ...]) -> str:
    """The share of success, and why the others mostly failed."""
    failed = Counter(letter for letter in letters if letter != "·")
    share = f"{100 * letters.count('·') / len(letters):.0f}"
    return f"{share} {failed.most_common(1)[0][0]}" if failed else share


def _figure(found: dict[str, dict[float, tuple[str, ...]]]) -> Figure:
    def paint(canvas: Canvas) -> None:
        for ax, (axis, values) in zip(canvas.subplots(2, 2).flat, AXES.items(), strict=True):
            letters = [[found[f"{axis} {value:g}"][tau] for tau in TAUS] for value in values]
            shares = np.array([[cell.count("·") / len(cell) for cell in row] for row in letters])
            ax.imshow(shares, origin="lower", aspect="auto", cmap="YlGn", vmin=0.0, vmax=1.4)
            for i, row in enumerate(letters):
                for k, cell in enumerate(row):
                    ax.text(k, i, said(cell), ha="center", va="center", fontsize=5.5, color=INK)
            ax.set_xticks(range(len(TAUS)), [f"{tau:g}" for tau in TAUS], fontsize=6.5)
            ax.set_yticks(range(len(values)), [f"{value:g}" for value in values], fontsize=7.0)
            ax.set(xlabel="median round trip [s]", title=NAMES[axis])
            ax.grid(visible=False)
        canvas.supxlabel(LETTERS, fontsize=7.0)

    return draw("map", f"Where the claim stops: success in %; {LETTERS}", paint, height=5.6)
