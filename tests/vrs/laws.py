"""The laws that every edit of a timeline keeps, as checks of what was there before and what is there after it.

Some edits keep the way and change when it's gone. Receipts are true, name what they should, and nothing else
changes them. Limits are judged by exact extremes of polynomials, apart from the certificates of planning.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, fields
from itertools import chain
from math import perm
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vrs.ledger import Receipt, Status
from vrs.model import Array, Limits
from vrs.segment import HOLD
from vrs.timeline import Timeline
from vrs.tree import Leaf

_CUBIC = 4
_GRID = 6
"""Points of the first grid for each coefficient of a polynomial."""
_ZOOMS = 2
"""Times that the neighbourhood of a grid's best point is looked at, each a quarter as wide as the one before."""
_STEPS = 3
"""Steps by Newton's rule after that."""


def values(a: Array, u: Array, order: int) -> Array:
    """Derivatives of polynomials, each at its own time.

    Args:
        a: Coefficients in ascending powers, (m, K, n).
        u: Times since each polynomial's start [s], (m,) or (..., m, n).
        order: Of the derivative.

    Returns:
        (m, n), or the shape of u.
    """
    x = u[:, None] if u.ndim == 1 else u
    total = np.zeros(np.broadcast_shapes(x.shape, a[:, 0].shape))
    for k in range(a.shape[1] - 1, order - 1, -1):
        total = total * x + perm(k, order) * a[:, k]
    return total


def extremes(a: Array, h: Array, order: int) -> tuple[Array, Array]:
    """Lowest and highest value of polynomials' derivatives on [0, h].

    Cubic polynomials by the roots of their derivatives; others on a grid, its best points refined.

    Args:
        a: Coefficients in ascending powers, (m, K, n).
        h: Durations [s], (m,).
        order: Of the derivative, 0 to 3.

    Returns:
        (m, n) each.
    """
    if a.shape[1] > _CUBIC and not a[:, _CUBIC:].any():
        a = a[:, :_CUBIC]
    if a.shape[1] <= _CUBIC:
        return _of_cubics(a, h, order)
    high = a[:, _CUBIC:].any((1, 2))
    lowest, highest = np.empty_like(a[:, 0]), np.empty_like(a[:, 0])
    lowest[~high], highest[~high] = _of_cubics(a[~high, :_CUBIC], h[~high], order)
    lowest[high], highest[high] = -_highest(-a[high], h[high], order), _highest(a[high], h[high], order)
    return lowest, highest


def _of_cubics(a: Array, h: Array, order: int) -> tuple[Array, Array]:
    c = np.zeros((len(a), _CUBIC, a.shape[2]))
    c[:, : a.shape[1]] = a
    u = np.broadcast_to(h[:, None], c[:, 0].shape)
    moments = [np.zeros_like(u), u]
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        if order == 0:
            spread = np.sqrt(c[:, 2] ** 2 - 3 * c[:, 3] * c[:, 1])
            # Both roots by the sum that doesn't cancel: c3 may be next to nothing.
            stable = -(c[:, 2] + np.copysign(spread, c[:, 2]))
            moments += [stable / (3 * c[:, 3]), c[:, 1] / stable]
        elif order == 1:
            moments.append(-c[:, 2] / (3 * c[:, 3]))
        m = np.array(moments)
        found = values(c, np.clip(np.where(np.isfinite(m), m, 0.0), 0.0, u), order)
    return found.min(0), found.max(0)


def _highest(a: Array, h: Array, order: int) -> Array:
    """Highest value on [0, h], (m, n), by a grid and its refinement."""
    K = a.shape[1]
    # Closer together at both ends, where polynomials of a high degree turn most.
    share = 0.5 - 0.5 * np.cos(np.linspace(0.0, np.pi, _GRID * K + 1))
    scaled = a * h[:, None, None] ** np.arange(K)[:, None]
    basis = np.array([[perm(k, order) * x ** (k - order) if k >= order else 0.0 for k in range(K)] for x in share])
    at = np.argmax(basis @ scaled, 1)
    best = share[at]
    gaps = np.diff(share)
    width = np.maximum(np.append(gaps, 0.0)[at], np.insert(gaps, 0, 0.0)[at])
    near = np.linspace(-1.0, 1.0, 9)[:, None, None]
    x = best
    for _ in range(_ZOOMS):
        places = np.clip(x + width * near, 0.0, 1.0)
        place = np.argmax(values(a, places * h[:, None], order), 0)[None]
        x = np.take_along_axis(places, place, 0)[0]
        width = 0.25 * width
    highest: Array = values(a, x * h[:, None], order)
    u, room = x * h[:, None], width * h[:, None]
    low, high = np.maximum(u - room, 0.0), np.minimum(u + room, h[:, None])
    for _ in range(_STEPS):
        slope, bend = values(a, u, order + 1), values(a, u, order + 2)
        with np.errstate(divide="ignore", invalid="ignore"):
            step = np.where(bend < 0, slope / bend, 0.0)
        u = np.clip(u - step, low, high)
        highest = np.maximum(highest, values(a, u, order))
    return highest


BOUNDS = {
    "gap [s]": 1e-9,
    "jump q [rad]": 1e-9,
    "jump qd [rad/s]": 1e-9,
    "jump qdd [rad/s²]": 1e-9,
    "position": 1e-9,
    "speed": 1e-9,
    "acceleration": 1e-9,
    "jerk": 1e-9,
    "tail's shift [s]": 1e-9,
    "off the way [rad]": 1e-9,
    "receipt's q [rad]": 1e-9,
    "end's qd [rad/s]": 1e-9,
    "pace": 1e-9,
}
"""Largest figure that each law allows; limits are passed by a share of the limit, or of 1 rad if that is more."""


SLIVER = 1e-12
"""Segments up to this long [s] may vanish when they're moved or their pace changes."""


class LawBrokenError(AssertionError):
    """An edit broke a law."""

    def __init__(self, law: str, detail: str) -> None:
        self.law, self.detail = law, detail
        super().__init__(f"{law}: {detail}")


@dataclass(slots=True)
class Figures:
    """The worst that was seen of each law."""

    worst: dict[str, float] = field(default_factory=dict)

    def see(self, law: str, value: float, detail: str = "") -> None:
        """Keep a figure.

        Raises:
            LawBrokenError: If it's more than the law allows, or NaN.
        """
        number = float(value)
        self.worst[law] = max(self.worst.get(law, -np.inf), number)
        if not number <= BOUNDS[law]:
            raise LawBrokenError(law, f"{number:.4g} > {BOUNDS[law]:g} {detail}")

    def add(self, other: Figures) -> None:
        """Take in what another run saw."""
        for law, value in other.worst.items():
            self.worst[law] = max(self.worst.get(law, -np.inf), value)


@dataclass(frozen=True, slots=True, eq=False)
class Columns:
    """All segments of a timeline, a column a property."""

    starts: Array
    """[s], (m,)."""
    durations: Array
    """[s], (m,)."""
    owners: tuple[int, ...]
    """Command ids; 0 for holds."""
    rows: tuple[bytes, ...]
    """Coefficients, as bytes of float64."""
    dof: int
    """Number of joints, n."""
    end: float
    """End of the last, or the timeline's start where there's none [s]."""

    def __len__(self) -> int:
        return len(self.rows)

    def padded(self, low: int, high: int) -> Array:
        """Coefficients of the segments low to high − 1, (m, K, n), at least cubic."""
        orders = [len(row) // (8 * self.dof) for row in self.rows[low:high]]
        a = np.zeros((len(orders), max(orders, default=1), self.dof))
        for target, order, row in zip(a, orders, self.rows[low:high], strict=True):
            target[:order] = np.frombuffer(row).reshape(order, self.dof)
        return a

    def lasting(self, first: int) -> list[int]:
        """Segments from an index on that last; a cut next to a knot may leave one that's only rounding."""
        return (first + np.flatnonzero(self.durations[first:] > SLIVER)).tolist()

    def known(self) -> dict[bytes, float]:
        """Longest duration [s] of each polynomial, by its coefficients."""
        longest: dict[bytes, float] = {}
        for row, duration in zip(self.rows, self.durations.tolist(), strict=True):
            longest[row] = max(duration, longest.get(row, 0.0))
        return longest

    def index_at(self, t: float) -> int:
        """Index of the segment with start ≤ t < end; −1 before the first, len(self) at the end and after it."""
        return len(self) if t >= self.end else int(np.searchsorted(self.starts, t, "right")) - 1

    def start_of(self, index: int) -> float:
        """Start of a segment [s]; of index len(self), the end."""
        return float(self.starts[index]) if index < len(self) else self.end

    def end_of_move(self, index: int) -> int:
        """One past the last segment of the move, with its inner holds, that a segment belongs to."""
        owner = self.owners[index]
        while True:
            following = self.next_move(index + 1)
            if following == len(self) or self.owners[following] != owner:
                return index + 1
            index = following

    def next_move(self, index: int) -> int:
        """First segment from an index on that isn't a hold; len(self) if there's none."""
        while index < len(self) and self.owners[index] == HOLD:
            index += 1
        return index


def columns(timeline: Timeline) -> Columns:
    """All segments of a timeline; much quicker than one by one."""
    starts: list[float] = []
    leaves: list[Leaf] = []

    def walk(node: Any, offset: float) -> None:
        if isinstance(node, Leaf):
            leaves.append(node)
            starts.extend([offset + start for start in node.starts])
            return
        for child, own in zip(node.children, node.offsets, strict=True):
            walk(child, offset + own)

    if len(timeline):
        walk(timeline.root, 0.0)
    durations = np.array(list(chain.from_iterable(leaf.durations for leaf in leaves)))
    owners = tuple(chain.from_iterable(leaf.owners for leaf in leaves))
    rows = tuple(chain.from_iterable(leaf.rows for leaf in leaves))
    return Columns(np.array(starts), durations, owners, rows, timeline.dof, timeline.end)


def check_past(before: Columns, after: Columns, t: float) -> None:
    """What lies before t is bit-identical: starts, durations, coefficients, commands; cut at t, at the earliest.

    Raises:
        LawBrokenError: If it isn't.
    """
    stays = min(len(before), max(before.index_at(t), -1) + 1)
    stays -= stays > 0 and before.start_of(stays - 1) >= t
    if len(after) < stays and any(before.owners[len(after) : stays]):
        raise LawBrokenError("the past", f"{len(after)} segments are left of {stays} before {t!r} s")
    # A hold at the end may come and go: after the end the arm stands as well.
    stays = min(stays, len(after))
    same = (
        np.array_equal(before.starts[:stays], after.starts[:stays])
        and before.rows[:stays] == after.rows[:stays]
        and before.owners[:stays] == after.owners[:stays]
        and np.array_equal(before.durations[: max(stays - 1, 0)], after.durations[: max(stays - 1, 0)])
    )
    if not same:
        raise LawBrokenError("the past", f"a segment before {t!r} s is another")
    if stays and before.durations[stays - 1] != after.durations[stays - 1]:
        ends = [float(run.starts[stays - 1] + run.durations[stays - 1]) for run in (before, after)]
        if min(ends) < t - 1e-9 and before.owners[stays - 1] != HOLD:
            raise LawBrokenError(
                "the past", f"a segment ended at {ends[0]!r} s, ends at {ends[1]!r} s, before {t!r} s"
            )


def check_memory(before: Timeline, after: Timeline, t: float) -> None:
    """Positions before t, g of eq. (4), are bit-identical.

    Raises:
        LawBrokenError: If it isn't.
    """
    low = before.start_of(max(before.index_at(t) - 2, 0))
    for share in (0.0, 0.271828, 0.618034, 0.931416):
        moment = low + share * (t - low)
        moment = moment if moment < t else float(np.nextafter(t, -np.inf))
        if not np.array_equal(before.sample(moment), after.sample(moment)):
            raise LawBrokenError("the past", f"the position at {moment!r} s, before {t!r} s, is another")


def changed(before: Columns, after: Columns, t: float) -> tuple[int, int]:
    """First segment from t on that isn't as it was, and one past the last: the tail that stayed follows."""
    low = min(max(before.index_at(t), 0), len(after))
    if low < len(before) and before.start_of(low) < t:
        low = min(low + 1, len(after))
    high, other = len(after), len(before)
    while high > low and other > 0:
        i, j = high - 1, other - 1
        alike = after.rows[i] == before.rows[j] and after.durations[i] == before.durations[j]
        if not alike or after.owners[i] != before.owners[j]:
            break
        high, other = i, j
    return low, high


def check_tail(before: Columns, after: Columns, first: int, shift: float | None, figures: Figures) -> None:
    """The segments from an index of before on are the last of after: bit-identical, shifted by one Δ ≥ 0.

    Args:
        before: Segments before the edit.
        after: Segments after it.
        first: Index, in before, of the first that stays.
        shift: Δ [s]; None for any.
        figures: Where the worst figures are kept.

    Raises:
        LawBrokenError: If they aren't.
    """
    stays = before.lasting(first)
    if not stays:
        return
    are = after.lasting(0)[-len(stays) :]
    if len(are) < len(stays):
        raise LawBrokenError("the tail", f"{len(stays)} segments should have stayed, {len(are)} are there")
    if shift is None:
        shift = float(after.starts[are[0]] - before.starts[stays[0]])
    if shift < -BOUNDS["tail's shift [s]"]:
        raise LawBrokenError("the tail", f"is shifted by {shift} s")
    for what, mine, others in (
        ("coefficients", before.rows, after.rows),
        ("commands", before.owners, after.owners),
        ("durations", before.durations, after.durations),
    ):
        if any(mine[i] != others[j] for i, j in zip(stays, are, strict=True)):
            raise LawBrokenError("the tail", f"{what} changed from {before.start_of(first)!r} s on")
    away = np.abs(after.starts[are] - before.starts[stays] - shift)
    figures.see("tail's shift [s]", away.max(), f"at {before.starts[stays[int(away.argmax())]]!r} s")


def check_moves(before: Columns, after: Columns, first: int, names: Collection[int], figures: Figures) -> None:
    """The segments of some commands, from an index of before on, are bit-identical, each shifted by one Δ ≥ 0.

    Args:
        before: Segments before the edit.
        after: Segments after it.
        first: Index, in before, from which on they're judged.
        names: The commands.
        figures: Where the worst figures are kept.

    Raises:
        LawBrokenError: If they aren't.
    """
    for name in {*before.owners[first:]}.intersection(names):
        mine = [i for i in range(first, len(before)) if before.owners[i] == name]
        same = [i for i, owner in enumerate(after.owners) if owner == name][-len(mine) :]
        alike = len(mine) == len(same) and all(
            before.rows[i] == after.rows[j] and before.durations[i] == after.durations[j]
            for i, j in zip(mine, same, strict=True)
        )
        if not alike:
            raise LawBrokenError("the tail", f"the move of command {name} changed")
        away = after.starts[same] - before.starts[mine]
        figures.see("tail's shift [s]", max(away.max() - away.min(), -away.min()), f"of command {name}")


def check_run(
    run: Columns,
    low: int,
    high: int,
    limits: Limits,
    smooth: set[int],
    figures: Figures,
    known: Mapping[bytes, float] | None = None,
) -> None:
    """Segments low to high − 1 follow one another without gap or jump and keep the limits; knots at both ends too.

    Args:
        run: All segments.
        low: First that is judged.
        high: One past the last.
        limits: In force.
        smooth: Commands whose segments keep jerk limits, and have no jumps in acceleration.
        figures: Where the worst figures are kept.
        known: Durations [s] of segments that were there before, by their coefficients: they may have been planned
            under other limits.

    Raises:
        LawBrokenError: If a law is broken.
    """
    first, last = max(low - 1, 0), min(high + 1, len(run))
    if first >= last:
        return
    a, h, starts = run.padded(first, last), run.durations[first:last], run.starts[first:last]
    if not (h > 0).all():
        raise LawBrokenError("durations", f"a segment of {h.min()!r} s")
    figures.see("gap [s]", np.abs(starts[:-1] + h[:-1] - starts[1:]).max(initial=0.0))
    zero = np.zeros(len(a) - 1)
    owners = np.array(run.owners[first:last])
    jerky = np.isin(owners, list(smooth))
    for order, law in enumerate(("jump q [rad]", "jump qd [rad/s]", "jump qdd [rad/s²]")):
        jump = np.abs(values(a[:-1], h[:-1], order) - values(a[1:], zero, order))
        if order == 2:
            jump[~(jerky[1:] & (owners[:-1] == owners[1:]))] = 0.0
        if jump.size:
            at = int(jump.max(1).argmax())
            figures.see(law, jump.max(), f"at {starts[at + 1]!r} s, command {owners[at]} to {owners[at + 1]}")
    known = {} if known is None else known
    made = [i for i in range(low, high) if run.durations[i] > known.get(run.rows[i], 0.0)]
    new = np.array(made, int) - first
    check_limits(a[new], h[new], limits, jerky[new], figures, f"of commands {sorted({*owners[new].tolist()})}")


def check_limits(
    a: Array, h: Array, limits: Limits, jerky: NDArray[np.bool_], figures: Figures, of: str = ""
) -> None:
    """Polynomials keep the limits at every instant.

    Args:
        a: Coefficients, (m, K, n).
        h: Durations [s], (m,).
        limits: To be kept.
        jerky: Which of them keep jerk limits, (m,).
        figures: Where the worst figures are kept.
        of: Whose they are, for the message.

    Raises:
        LawBrokenError: If one is passed.
    """
    if not len(a):
        return
    if not np.isfinite(a).all():
        raise LawBrokenError("finite", f"a coefficient {of} is NaN or infinite")
    low, high = extremes(a, h, 0)
    over = np.maximum(
        (high - limits.q_max) / np.maximum(1.0, np.abs(limits.q_max)),
        (limits.q_min - low) / np.maximum(1.0, np.abs(limits.q_min)),
    )
    figures.see("position", over.max(), f"in joint {int(over.max(0).argmax()) + 1} {of}")
    bounds = (("speed", limits.qd_max), ("acceleration", limits.qdd_max), ("jerk", limits.qddd_max))
    for order, (law, bound) in enumerate(bounds, 1):
        mine = jerky if order == 3 else np.ones(len(a), bool)
        if mine.any():
            low, high = extremes(a[mine], h[mine], order)
            over = np.maximum(high, -low) / bound - 1.0
            figures.see(law, over.max(), f"in joint {int(over.max(0).argmax()) + 1} {of}")


def check_rest(timeline: Timeline, run: Columns, figures: Figures) -> None:
    """The plan ends at rest.

    Raises:
        LawBrokenError: If it doesn't.
    """
    if len(run):
        a = run.padded(len(run) - 1, len(run))
        figures.see("end's qd [rad/s]", np.abs(values(a, run.durations[-1:], 1)).max())
    if timeline.sample(timeline.end, derivative=1).any():
        raise LawBrokenError("rest", "the arm moves after the end")


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


_KEPT = tuple(item.name for item in fields(Receipt) if item.name not in {"q", "shifted_names", "superseded_names"})
_ROUNDING = 1.001e-9
"""Times that differ by less [s] may be the same."""
_SHORT = 1e-6
"""Moves up to this long [s] aren't looked for at their receipts' times, which are rounded."""


def check_receipts(
    timeline: Timeline, run: Columns, receipts: dict[int, Receipt], moves: Collection[int], figures: Figures
) -> None:
    """Every receipt that stands says where the arm is at its end, and its move is under way when it says so.

    Args:
        timeline: What is scheduled.
        run: Its segments.
        receipts: All receipts, by command id.
        moves: Commands that have moves of their own, under way from beginning to end.
        figures: Where the worst figures are kept.

    Raises:
        LawBrokenError: If one doesn't.
    """
    for r in receipts.values():
        if r.status is Status.REJECTED and (r.stands or r.execute_at is not None or not r.reason):
            raise LawBrokenError(
                "receipts", f"command {r.command_id} was rejected, and its receipt says other things"
            )
        if r.stands and r.command_id in moves and r.execute_at is not None and r.end is not None:
            if r.end - r.execute_at <= _SHORT:
                continue
            middle = run.index_at(0.5 * (r.execute_at + r.end))
            if not 0 <= middle < len(run) or run.owners[middle] != r.command_id:
                raise LawBrokenError("receipts", f"command {r.command_id} isn't under way when its receipt says so")
    standing = [r for r in receipts.values() if r.stands and r.q is not None]
    if standing:
        away = np.abs(timeline.sample([r.end for r in standing]) - [r.q for r in standing]).max(1)  # type: ignore[arg-type]
        worst = standing[int(away.argmax())]
        figures.see("receipt's q [rad]", away.max(), f"in the receipt of command {worst.command_id}")


def check_names(
    answer: Receipt,
    before: dict[int, Receipt],
    after: dict[int, Receipt],
    moves: Collection[int],
    replanned: Collection[int],
) -> None:
    """A receipt names what it shifted and superseded, and no other.

    Args:
        answer: The receipt.
        before: All receipts before the edit, by command id.
        after: After it.
        moves: Commands that have moves of their own.
        replanned: Commands that the edit made go from elsewhere.

    Raises:
        LawBrokenError: If it doesn't.
    """
    mine, shifted, superseded = answer.command_id, set(answer.shifted), set(answer.superseded)
    gone: set[int] = set()
    moved: dict[int, float] = {}
    for i, was in before.items():
        r = after[i]
        if i == mine or not was.stands:
            continue
        if not r.stands:
            if r.superseded_by != mine:
                raise LawBrokenError("receipts", f"command {i} stands no more, and doesn't name command {mine}")
            if i in moves:
                gone.add(i)
        elif i in replanned:
            shifted.discard(i)
        elif was.execute_at != was.end:
            times = zip((was.execute_at, was.end), (r.execute_at, r.end), strict=True)
            moved[i] = max(abs(x - y) for x, y in times if x is not None and y is not None)
    # What stood no more, has no move or belongs to the engine that this one branched from may be named too.
    stands = {i for i in superseded if i != mine and i in after and after[i].stands}
    if not gone <= superseded or stands:
        raise LawBrokenError("receipts", f"superseded {sorted(gone)}, says {sorted(superseded)}")
    shifted = {i for i in shifted if i in moves and i in after and after[i].stands and i != mine}
    far = {i for i, away in moved.items() if away > _ROUNDING and i in moves}
    if not far <= shifted or not all(moved.get(i, 1.0) for i in shifted):
        raise LawBrokenError("receipts", f"shifted {sorted(far)}, says {sorted(shifted)}")


def check_same(was: dict[int, Receipt], now: dict[int, Receipt], law: str) -> None:
    """Receipts say the same.

    Args:
        was: Receipts by command id.
        now: The same ones, later.
        law: What's broken if they don't.

    Raises:
        LawBrokenError: If one doesn't.
    """
    if was.keys() != now.keys():
        raise LawBrokenError(law, f"receipts {sorted(was.keys() ^ now.keys())} came or went")
    for i, r in was.items():
        other = now[i]
        if other is r:
            continue
        for name in _KEPT:
            if getattr(r, name) != getattr(other, name):
                detail = f"receipt {i}: {name} was {getattr(r, name)!r}, is {getattr(other, name)!r}"
                raise LawBrokenError(law, detail)
        if not np.array_equal(r.q, other.q):  # type: ignore[arg-type]
            raise LawBrokenError(law, f"receipt {i}: q was {r.q}, is {other.q}")
