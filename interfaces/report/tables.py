"""Tables of a run's figures: for a terminal, and as rows for a page."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final

from vrs.ledger import Receipt

if TYPE_CHECKING:
    from rich.columns import Columns
    from rich.table import Table

FIGURES: Final = (
    ("path_error_mean", "path error, mean", 1e2, "cm"),
    ("path_error_p95", "path error, 95 %", 1e2, "cm"),
    ("path_error_max", "path error, max", 1e2, "cm"),
    ("time_difference_mean", "time difference, mean", 1.0, "s"),
    ("time_difference_sd", "time difference, sd", 1.0, "s"),
    ("time_difference_max", "time difference, max", 1.0, "s"),
    ("time_difference_bound", "time difference, bound", 1.0, "s"),
    ("speed_error", "speed error", 1e2, "cm/s"),
    ("progress", "progress", 1e2, "%"),
    ("collisions", "collisions", 1.0, ""),
    ("limits_passed", "limits passed", 1.0, ""),
    ("sent_bytes", "bytes sent", 1.0, ""),
    ("longest_delay", "longest delay", 1.0, "s"),
)
"""Name in a summary, name for people, factor and unit (none: a count)."""


def shown(value: float | None, scale: float, unit: str) -> str:
    """A value in its unit; without one it's a count."""
    if value is None:
        return "undefined"
    return f"{scale * value:z.3f}" if unit else f"{value:z.0f}"


def table_of(title: str, heads: Iterable[str], left: Collection[str]) -> Table:
    """An empty table for a terminal; columns with the heads `left` are set left, the others right."""
    from rich.table import Table

    table = Table(title=title, title_justify="left")
    for head in heads:
        table.add_column(head, justify="left" if head in left else "right")
    return table


def rich_tables(summary: Json) -> Iterator[Table | Columns]:
    """The tables of `tiles` and `figures` but the last for a terminal; what they hold isn't markup."""
    from rich.columns import Columns

    title = f"Virtual and real {summary['robot']}, delay {summary['delay']}, offset {summary['offset']}"
    gap = f"{NOT_MEASURED} ({_with_unit(summary['gap_s'], 's')})" if summary["gap_s"] > 0 else ""
    short: Sheet = (title, ("", ""), [(label, value) for value, label in tiles(summary)], gap, True)
    narrow = []
    for name, heads, rows, note, wide in (short, *figures(summary)[:-1]):
        table = table_of(name, heads, left=heads[:1])
        table.columns[0].no_wrap = True
        table.show_header, table.caption, table.caption_justify = any(heads), note or None, "left"
        for row in rows:
            table.add_row(*map(number, row))
        if wide:
            yield table
        else:
            narrow.append(table)
    yield Columns(narrow)


OFFSETS: Final = {
    "offset": "offset",
    "behind_mean_s": "behind, mean [s]",
    "behind_max_s": "at most [s]",
    "late": "commands late",
    "waits": "waits",
    "tool_rms_timeline_m": "tool rms [mm]",
}
"""Figures of an outcome, and their heads."""
MEASURES = {
    "tool_rms_timeline_m": ("tool, timeline", 1e3, "mm"),
    "tool_rms_user_m": ("tool, user time", 1e3, "mm"),
    "joint_rms_timeline_rad": ("joints, timeline", 57.29577951308232, "deg"),
}


Json = Mapping[str, Any]

ELSEWHERE: Final = frozenset(
    {
        "schema",
        "title",
        "robot",
        "seed",
        "delay",
        "service",
        "link_loss",
        "offset",
        "offsets",
        "corrections",
        "receipts_virtual",
        "receipts_real",
        "packets",
        "events",
        "attribution_order",
        "errors",
        "attribution",
        "commands",
        "path",
    }
)
"""Parts of a summary that the report shows in a form of its own."""
UNITS: Final = {
    "path_error": "mm", "time_difference": "s", "speed_error": "m/s", "progress": "%", "cell": "m", "v_max": "m/s",
}  # fmt: skip
"""Units of the figures on the tool path, by the start of their names."""
COMPARISONS: Final = {
    "timeline_time": "equal timeline time",
    "lag_removed": "best lag removed",
    "user_time": "as the user sees it",
    "servo": "real against its reference",
}
"""Heads of the error table."""
WHOLE: Final = 0.97
"""A real robot that got less far along the path didn't reach its end."""
ENDED_SHORT: Final = "The real robot didn't reach the end of the path: the means don't compare."
NOT_MEASURED: Final = "What happened while the real robot wasn't measured is in no figure."
SUFFIXES: Final = {"_deg": "deg", "_rad": "rad", "_m": "mm", "_s": "s"}
SCALES: Final = {"mm": 1e3, "%": 100.0}


def tiles(summary: Json) -> list[tuple[str, str]]:
    """The few figures that a reader looks for first, as far as the summary has them: values, and what they are."""
    timeline = _part(_part(summary, "errors"), "timeline_time")
    user = _part(_part(summary, "errors"), "user_time")
    path, commands = _part(summary, "path"), _part(summary, "commands")
    joint_rms = [x for x in timeline.get("joint_rms_deg") or () if x is not None] or [None]
    late, lost, behind = commands.get("late"), commands.get("lost"), _part(summary, "behind")
    shares = [behind.get("mean_s"), summary.get("lag_timeline_s")]
    played = None if None in shares else " + ".join(map(number, shares))
    found = [
        (_with_unit(max(joint_rms, key=lambda x: x or 0.0), "deg"), "worst joint, rms, equal timeline time"),
        (_with_unit(timeline.get("tool_rms_m"), "mm"), "tool, rms, equal timeline time"),
        (_with_unit(user.get("tool_rms_m"), "mm"), "tool, rms, as the user sees it"),
        (_with_unit(path.get("time_difference_mean"), "s"), "mean time difference along the path"),
        (None if played is None else f"{played} s", "network: behind by the clock, mean; control: the joints' lag"),
        (None if late is None or lost is None else f"{late} / {lost}", "commands late / lost"),
    ]
    return [(value, label) for value, label in found if value is not None]


Sheet = tuple[str, Sequence[str], Sequence[Sequence[object]], str, bool]
"""A table's title, column heads and rows, a note, and whether it's wide."""


def figures(summary: Json) -> list[Sheet]:
    """The tables of every figure in a summary, also of those that this module doesn't know by name."""
    out: list[Sheet] = []
    if errors := _part(summary, "errors"):
        out.append(("Errors, real against virtual", *_errors(errors), "", True))
    if attribution := summary.get("attribution"):
        order = [str(cause) for cause in summary.get("attribution_order", attribution[0]["parts"])]
        note = f"Counterfactual runs, switched off one after the other: {', then '.join(map(words, order))}."
        out.append(("Where the error comes from (rms)", *_attribution(attribution, order), note, True))
    if offsets := summary.get("offsets"):
        note = (
            "The same messages with the same delays. A fixed offset postpones commands that take longer; an "
            "adaptive one slows the robot down along the committed path. The body follows exactly here, so that "
            "what is left is the network's."
        )
        rows = [[_scaled(each[name], "mm" if name.endswith("_m") else "") for name in OFFSETS] for each in offsets]
        out.append(("What the choice of the offset does", tuple(OFFSETS.values()), rows, note, True))
    if path := _part(summary, "path"):
        note = "" if (path.get("progress") or 1.0) >= WHOLE else ENDED_SHORT
        pairs = [(words(name), _with_unit(value, _path_unit(name))) for name, value in path.items()]
        out.append(("Tool path and time difference, user time", ("", ""), pairs, note, False))
    if commands := _part(summary, "commands"):
        out.append(("Commands", ("", ""), _flat(commands), "", False))
    rest = {name: value for name, value in summary.items() if name not in ELSEWHERE}
    if rest:
        note = NOT_MEASURED if rest.get("gap_s") else ""
        out.append(("The run", ("", ""), _flat(rest), note, False))
    return out


def receipts(items: Sequence[Receipt]) -> list[tuple[object, ...]]:
    """One engine's receipts, a row each."""
    rows: list[tuple[object, ...]] = []
    for r in items:
        reason = r.reason
        if r.superseded_by is not None:
            by = r.superseded_by or "a correction"
            reason += f"{'; ' if reason else ''}superseded by {by}"
        rows.append((str(r.command_id), r.status, r.asked_at, r.execute_at, r.end, reason))
    return rows


def words(name: str) -> str:
    """Turn a name of the summary into words, its unit taken off."""
    for suffix in SUFFIXES:
        name = name.removesuffix(suffix)
    return name.replace("_", " ")


def _errors(errors: Json) -> tuple[Sequence[str], Sequence[Sequence[object]]]:
    columns = [str(key) for key in errors]
    names: dict[str, None] = {str(name): None for key in columns for name in errors[key]}
    rows: list[list[object]] = []
    for name in names:
        values = [errors[key].get(name) for key in columns]
        unit = _unit(name)
        size = max((len(v) for v in values if isinstance(v, list)), default=0)
        if not size:
            rows.append([_label(name, unit), *(_scaled(v, unit) for v in values)])
        for j in range(size):
            label = _label(name.replace("joint_", f"joint_{j + 1}_", 1), unit)
            rows.append([label, *(_scaled(v[j], unit) if isinstance(v, list) else None for v in values)])
    return ("", *(COMPARISONS.get(key, words(key)) for key in columns)), rows


def _attribution(items: Sequence[Json], order: Sequence[str]) -> tuple[Sequence[str], Sequence[Sequence[object]]]:
    rows = []
    for item in items:
        label, scale, unit = MEASURES.get(item["measure"], (words(item["measure"]), 1.0, _unit(item["measure"])))
        values = [item["total"], *(item["parts"].get(cause) for cause in order), item["residual"]]
        rows.append([f"{label} [{unit}]", *(None if v is None else scale * float(v) for v in values)])
    return ("", "total", *map(words, order), "residual"), rows


def _flat(values: Json, prefix: str = "") -> list[tuple[str, object]]:
    rows: list[tuple[str, object]] = []
    for name, value in values.items():
        label = f"{prefix}{words(str(name))}"
        if isinstance(value, Mapping):
            rows.extend(_flat(value, f"{label}: "))
        elif isinstance(value, (list, tuple)):
            rows.append((label, ", ".join(number(x) if isinstance(x, float) else str(x) for x in value)))
        else:
            rows.append((label, _with_unit(value, _unit(str(name)))))
    return rows


def _part(values: Json, name: str) -> Json:
    part = values.get(name)
    return part if isinstance(part, Mapping) else {}


def _unit(name: str) -> str:
    return next((unit for suffix, unit in SUFFIXES.items() if name.endswith(suffix)), "")


def _path_unit(name: str) -> str:
    return next((unit for start, unit in UNITS.items() if name.startswith(start)), _unit(name))


def _label(name: str, unit: str) -> str:
    return f"{words(name)} [{unit}]" if unit else words(name)


def _scaled(value: object, unit: str) -> object:
    return value * SCALES.get(unit, 1.0) if isinstance(value, float) else value


def _with_unit(value: object, unit: str) -> str | None:
    """Text of a figure in its unit; None where it isn't defined."""
    if value is None or isinstance(value, str):
        return value
    text = number(_scaled(value, unit))
    return f"{text} {unit}" if unit else text


def number(value: object) -> str:
    """A figure's text: three digits behind the point, none from 10,000 on; a dash where it isn't defined."""
    if value is None:
        return "–"
    if isinstance(value, bool) or not isinstance(value, float):
        return str(value)
    return f"{value:.0f}" if abs(value) >= 1e4 else f"{round(value, 3) + 0.0:.3f}".replace("-", "−")
