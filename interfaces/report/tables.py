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
    """The few figures that a reader looks for first, as far as they're defined: values, and what they are."""
    timeline, user = summary["errors"]["timeline_time"], summary["errors"]["user_time"]
    worst = max((x for x in timeline["joint_rms_deg"] if x is not None), default=None)
    behind, lag, commands = summary["behind"]["mean_s"], summary["lag_timeline_s"], summary["commands"]
    played = None if lag is None else f"{number(behind)} + {number(lag)} s"
    found = [
        (_with_unit(worst, "deg"), "worst joint, rms, equal timeline time"),
        (_with_unit(timeline["tool_rms_m"], "mm"), "tool, rms, equal timeline time"),
        (_with_unit(user["tool_rms_m"], "mm"), "tool, rms, as the user sees it"),
        (_with_unit(summary["path"]["time_difference_mean"], "s"), "mean time difference along the path"),
        (played, "network: behind by the clock, mean; control: the joints' lag"),
        (f"{commands['late']} / {commands['lost']}", "commands late / lost"),
    ]
    return [(value, label) for value, label in found if value is not None]


Sheet = tuple[str, Sequence[str], Sequence[Sequence[object]], str, bool]
"""A table's title, column heads and rows, a note, and whether it's wide."""


def figures(summary: Json) -> list[Sheet]:
    """The tables of every figure in a summary, also of those that this module doesn't know by name."""
    out: list[Sheet] = [("Errors, real against virtual", *_errors(summary["errors"]), "", True)]
    if attribution := summary["attribution"]:
        order = summary["attribution_order"]
        note = f"Counterfactual runs, switched off one after the other: {', then '.join(map(words, order))}."
        out.append(("Where the error comes from (rms)", *_attribution(attribution, order), note, True))
    if offsets := summary["offsets"]:
        note = (
            "The same messages with the same delays. A fixed offset postpones commands that take longer; an "
            "adaptive one slows the robot down along the committed path. The body follows exactly here, so that "
            "what is left is the network's."
        )
        rows = [[_scaled(each[name], "mm" if name.endswith("_m") else "") for name in OFFSETS] for each in offsets]
        out.append(("What the choice of the offset does", tuple(OFFSETS.values()), rows, note, True))
    path = summary["path"]
    pairs = [(words(name), _with_unit(value, _path_unit(name))) for name, value in path.items()]
    short = path["progress"] is not None and path["progress"] < WHOLE
    rest = {name: value for name, value in summary.items() if name not in ELSEWHERE}
    return [
        *out,
        ("Tool path and time difference, user time", ("", ""), pairs, ENDED_SHORT if short else "", False),
        ("Commands", ("", ""), _flat(summary["commands"]), "", False),
        ("The run", ("", ""), _flat(rest), NOT_MEASURED if summary["gap_s"] > 0 else "", False),
    ]


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
    rows: list[list[object]] = []
    for name in errors[columns[0]]:
        values, unit = [errors[key][name] for key in columns], _unit(name)
        if isinstance(values[0], list):
            for j, joint in enumerate(zip(*values, strict=True), 1):
                label = _label(name.replace("joint_", f"joint_{j}_", 1), unit)
                rows.append([label, *(_scaled(value, unit) for value in joint)])
        else:
            rows.append([_label(name, unit), *(_scaled(value, unit) for value in values)])
    return ("", *(COMPARISONS.get(key, words(key)) for key in columns)), rows


def _attribution(items: Sequence[Json], order: Sequence[str]) -> tuple[Sequence[str], Sequence[Sequence[object]]]:
    rows = []
    for item in items:
        label, scale, unit = MEASURES[item["measure"]]
        values = [item["total"], *(item["parts"][cause] for cause in order), item["residual"]]
        rows.append([f"{label} [{unit}]", *(scale * float(value) for value in values)])
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
