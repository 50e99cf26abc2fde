"""A design sweep: what it will cost before it starts, its runs as a table, which architecture wins where."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import groupby
from pathlib import Path
from typing import Any, Final, NamedTuple

from interfaces.lab.finished import KeptRow, Machine
from interfaces.lab.statistics import Estimate
from interfaces.link.delays import delay_profile
from interfaces.recording.export import RecordingTable, TableColumn, write_csv, write_parquet
from interfaces.runs.drive_run import COLUMNS, KEYS, values_of
from vrs.errors import InvalidValueError

AXES: Final = ("delay", "robot", "operator", "transport")
"""What a place of the surface is."""
TEXTS: Final = (*KEYS, *Machine._fields)
WHOLE: Final = ("seed", "collisions", "limits_passed", "sent_bytes")


def delays_of(profiles: Sequence[str], correlations: Sequence[float]) -> list[str]:
    """Delay profiles with each correlation time, `thu@20`; what has none, or says its own, is taken as it is.

    Raises:
        InvalidValueError: If a profile isn't one.
        FormatError: If a trace can't be read.
    """
    found = []
    for profile in profiles:
        known = delay_profile(profile)
        varies = hasattr(known, "correlation_time") and "@" not in profile
        found += [f"{profile}@{tau:g}" for tau in correlations] if varies and correlations else [profile]
    return found


def span(seconds: float) -> str:
    """How long something takes, for people."""
    for size, unit in ((86400, "days"), (3600, "h"), (60, "min")):
        if seconds >= 2 * size:
            return f"{seconds / size:.1f} {unit}"
    return f"{seconds:.1f} s"


def planned(settings: Mapping[str, Any], runs: int, kept: int, each: float, workers: int | None) -> list[str]:
    """What a sweep will run and cost, in lines.

    Args:
        settings: Of its summary.
        runs: How many there are.
        kept: How many of them are finished already.
        each: How long one of them took, here [s].
        workers: Who work at once; None if that isn't known.
    """
    axes = [
        f"{len(settings[name])} {name if len(settings[name]) > 1 else name.removesuffix('s')}"
        for name in ("architectures", "transports", "delays", "robots", "operators")
    ]
    seeds, left = settings["runs"], (runs - kept) * each
    shared = f", {span(left / workers)} on {workers}" if workers is not None and workers > 1 else ""
    plan = f"{' × '.join(axes)} × {seeds} seed{'s' if seeds > 1 else ''} = {runs:,} runs, {kept:,} of them finished"
    if kept == runs:
        return [plan]
    return [plan, f"one took {each:.2f} s here: about {span(left)} on one worker{shared}"]


def write_table(rows: Sequence[KeptRow], out: Path) -> Path:
    """Write runs.parquet, a row a run with all digits and its machine; runs.csv where pyarrow isn't installed.

    Raises:
        FormatError: If the directory can't hold it.
    """
    names = *COLUMNS, *Machine._fields
    values = list(zip(*([*values_of(row.value), *row.machine] for row in rows), strict=True))
    kinds = [str if name in TEXTS else int if name in WHOLE else float for name in names]
    columns = [TableColumn(*one) for one in zip(names, kinds, values, strict=True)]
    taus = {delay: getattr(delay_profile(delay), "correlation_time", None) for delay in set(values[2])}
    columns.insert(3, TableColumn("correlation_s", float, [taus[delay] for delay in values[2]]))
    table = RecordingTable("runs", tuple(columns))
    try:
        (path,) = write_parquet([table], out)
    except InvalidValueError:
        (path,) = write_csv([table], out)
    return path


class Contender(NamedTuple):
    """An architecture at a place of the surface."""

    name: str
    median: Estimate | None
    """None where it never has the figure."""
    leads: bool
    """Whether no other is better, as far as the intervals of paired differences tell."""


class Place(NamedTuple):
    """A place of the surface: delay, robot, operator and transport."""

    key: tuple[str, ...]
    """In the order of `AXES`."""
    contenders: tuple[Contender, ...]
    """Those that lead first, then by their medians."""

    @property
    def winner(self) -> str:
        """The architecture that is better than each of the others; empty where there's none."""
        leads = [one.name for one in self.contenders if one.leads]
        return leads[0] if len(leads) == 1 else ""


def surface(found: Mapping[str, Any], metric: str) -> list[Place]:
    """Which architecture leads where.

    Args:
        found: The sweep's summary.
        metric: One of those compared there, of which less is better.
    """
    better = {
        (_place(one["first"]), *sides)
        for one in found["paired"]
        if one["metric"] == metric
        for verdict, sides in (
            ("below", (one["first"]["architecture"], one["second"]["architecture"])),
            ("above", (one["second"]["architecture"], one["first"]["architecture"])),
        )
        if one["verdict"] == verdict
    }
    places = []
    for key, members in groupby(sorted(found["groups"], key=_place), _place):
        groups = {one["architecture"]: one["median"][metric] for one in members}
        medians = {name: _estimate(one) for name, one in groups.items()}
        beaten = {worse for where, _, worse in better if where == key} | {n for n in medians if medians[n] is None}
        contenders = [Contender(name, median, name not in beaten) for name, median in medians.items()]
        contenders.sort(key=lambda one: (not one.leads, one.median is None, one.median or ()))
        places.append(Place(key, tuple(contenders)))
    order = {key: k for k, key in enumerate(dict.fromkeys(map(_place, found["groups"])))}
    return sorted(places, key=lambda place: order[place.key])


def _place(group: Mapping[str, Any]) -> tuple[str, ...]:
    return tuple(group[name] for name in AXES)


def _estimate(found: Mapping[str, Any] | None) -> Estimate | None:
    return None if found is None else Estimate(**found)
