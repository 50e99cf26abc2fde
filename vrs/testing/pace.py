"""Laws of edits that keep to the way and change when it's gone."""

from __future__ import annotations

import numpy as np

from vrs.model import Array
from vrs.testing.laws import SLIVER, Columns, Figures, LawBrokenError
from vrs.timeline import Timeline

_PLACES = 6
"""Places at which a way is compared."""
_DIPS = 4
"""Places where the way comes near that are looked at closely."""
_ASTRAY = 1e-3
"""How far from where it's looked for a place may lie [s], as where the arm hardly moves times aren't certain."""
_STEADY = 1e-24
"""Square of a speed [rad²/s²] below which the arm stands."""


def check_way(
    before: Timeline, after: Timeline, span: tuple[float, float], there: float | None, pace: float, figures: Figures
) -> None:
    """While its pace changes, the arm is on the way that it had, and goes on along it.

    Args:
        before: The motion as it was.
        after: The motion at another pace.
        span: From when to when its pace changes, steadily [s].
        there: Where on the old way the arm then is [s]; None if that isn't known.
        pace: To which it changes from 1; 0 stops.
        figures: Where the worst figures are kept.

    Raises:
        LawBrokenError: If it isn't.
    """
    begin, end = span
    if end <= begin:
        return
    slow, fast = min(pace, 1.0), max(pace, 1.0)
    s, step = begin, (end - begin) / _PLACES
    for k in range(1, _PLACES + 1):
        t = begin + k * step
        # Places found where the arm hardly moves are too uncertain to bound the next ones from above.
        low, high = s + slow * step, begin + fast * (t - begin)
        if there is not None:
            low, high = max(low, there - fast * (end - t)), min(high, there - slow * (end - t))
        q = after.sample(t)
        s = _nearest(before, q, max(low - _ASTRAY, begin), high + _ASTRAY)
        figures.see("off the way [rad]", np.abs(before.sample(s) - q).max(), f"at {t!r} s")


def _nearest(timeline: Timeline, q: Array, low: float, high: float) -> float:
    """Where between two times the timeline is nearest to q [s]; a way may come by again."""
    moments = np.linspace(low, high, 129)
    away = np.abs(timeline.sample(moments) - q).max(1)
    beside = np.concatenate([[np.inf], away, [np.inf]])
    dips = np.flatnonzero((away <= beside[:-2]) & (away <= beside[2:]))
    found = []
    for dip in dips[np.argsort(away[dips])][:_DIPS].tolist():
        s = _refined(timeline, q, float(moments[max(dip - 1, 0)]), float(moments[min(dip + 1, 128)]))
        found.append((float(np.abs(timeline.sample(s) - q).max()), s))
    return min(found)[1]


def _refined(timeline: Timeline, q: Array, low: float, high: float) -> float:
    for _ in range(2):
        moments = np.linspace(low, high, 17)
        best = int(np.abs(timeline.sample(moments) - q).max(1).argmin())
        low, high = float(moments[max(best - 1, 0)]), float(moments[min(best + 1, 16)])
    s = 0.5 * (low + high)
    for _ in range(5):
        qd = timeline.sample(s, derivative=1)
        square = float(qd @ qd)
        if square < _STEADY:
            break
        s = min(max(s + float((q - timeline.sample(s)) @ qd) / square, low), high)
    return s


def check_pace(
    before: Columns, after: Columns, first: int, factor: float, figures: Figures
) -> tuple[int, int] | None:
    """The last segments of after are the last of before, run `factor` times as fast.

    Args:
        before: Segments before the edit.
        after: Segments after it.
        first: Index, in after, of the first that is whole.
        factor: Ratio of the paces.
        figures: Where the worst figures are kept.

    Returns:
        Indices, in before and after, of the first pair; None if there's none.

    Raises:
        LawBrokenError: If they aren't.
    """
    new = [i for i in range(first, len(after)) if after.durations[i] * factor > SLIVER]
    old = before.lasting(0)[-len(new) :] if new else []
    if [before.owners[i] for i in old] != [after.owners[i] for i in new]:
        raise LawBrokenError("pace", "other commands than before follow the change of pace")
    if not new:
        return None
    figures.see("pace", np.abs(after.durations[new] * factor / before.durations[old] - 1.0).max())
    for i, j in zip(old, new, strict=True):
        a, b = before.padded(i, i + 1)[0], after.padded(j, j + 1)[0]
        if a.shape != b.shape:
            raise LawBrokenError("pace", "polynomials of another degree follow the change of pace")
        scaled = a * factor ** np.arange(len(a))[:, None]
        figures.see("pace", (np.abs(b - scaled) / np.maximum(np.abs(scaled), 1e-300)).max(initial=0.0))
    return old[0], new[0]
