"""Tables of a run's figures: for a terminal, and as rows for a page."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final

from vrs.ledger import Receipt

if TYPE_CHECKING:
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


Summary = dict[str, Any]
ROWS = (
    ("timeline_time", "timeline"),
    ("lag_removed", "… no lag"),
    ("user_time", "user"),
    ("servo", "servo"),
)


def table_of(title: str, heads: Iterable[str], left: Collection[str]) -> Table:
    """An empty table for a terminal; columns with the heads `left` are set left, the others right."""
    from rich.table import Table

    table = Table(title=title, title_justify="left")
    for head in heads:
        table.add_column(head, justify="left" if head in left else "right")
    return table


def error_table(summary: Summary) -> Table:
    """Joint and tool errors, a row a way of comparing."""
    title = f"Virtual and real {summary['robot']}, delay {summary['delay']}, offset {summary['offset']}"
    mixed = "joint_rms_m" in summary["errors"]["timeline_time"]
    joints = ("rms", "max") if mixed else ("rms\ndeg", "max\ndeg")
    tools = ("tool rms\nmm", "max\nmm", "angle\nrms deg", "max\ndeg")
    table = table_of(title, ("at equal", "joint", *joints, *tools), left=("at equal",))
    for key, label in ROWS:
        row = summary["errors"][key]
        joint = row["worst_joint"]
        table.add_row(
            label,
            str(joint),
            *(_of_joint(row, name, joint, mixed=mixed) for name in ("joint_rms", "joint_max")),
            f"{1e3 * row['tool_rms_m']:.2f}",
            f"{1e3 * row['tool_max_m']:.2f}",
            f"{row['angle_rms_deg']:.3f}",
            f"{row['angle_max_deg']:.3f}",
        )
    return table


def _of_joint(row: Summary, name: str, joint: int, *, mixed: bool) -> str:
    """A figure of a joint, counted from 1, with its unit where joints have different ones."""
    angle = row[f"{name}_deg"][joint - 1]
    if angle is None:
        return f"{1e3 * row[f'{name}_m'][joint - 1]:.2f} mm"
    return f"{angle:.3f} deg" if mixed else f"{angle:.3f}"


def attribution_table(summary: Summary) -> Table:
    """Errors split among their causes, a row a measure."""
    order = summary["attribution_order"]
    causes = [cause.replace("_", " ") for cause in order]
    heads = ("measure (rms)", "total", *causes, "residual")
    table = table_of(f"Why: switched off in turn, {', '.join(causes)}", heads, left=("measure (rms)",))
    for item in summary["attribution"]:
        label, scale, unit = MEASURES[item["measure"]]
        values = [item["total"], *(item["parts"][cause] for cause in order), item["residual"]]
        table.add_row(f"{label}, {unit}", *(f"{round(scale * value, 3) + 0.0:.3f}" for value in values))
    return table


def offset_table(summary: Summary) -> Table:
    """What other choices of the offset make of the same network."""
    table = table_of("The same network, a body that follows exactly", OFFSETS, left=("offset",))
    for row in offset_rows(summary):
        table.add_row(*(f"{value:.3f}" if isinstance(value, float) else str(value) for value in row))
    return table


def offset_rows(summary: Summary) -> list[tuple[str | float, ...]]:
    """Cells below the heads of OFFSETS."""
    return [
        (
            row["offset"],
            float(row["behind_mean_s"]),
            float(row["behind_max_s"]),
            row["late"],
            row["waits"],
            1e3 * row["tool_rms_timeline_m"],
        )
        for row in summary["offsets"]
    ]


OFFSETS = ("offset", "behind, mean [s]", "at most [s]", "commands late", "waits", "tool rms [mm]")
MEASURES = {
    "tool_rms_timeline_m": ("tool, timeline", 1e3, "mm"),
    "tool_rms_user_m": ("tool, user time", 1e3, "mm"),
    "joint_rms_timeline_rad": ("joints, timeline", 57.29577951308232, "deg"),
}


def _times(count: int) -> str:
    return "once" if count == 1 else f"{count} times"


def time_lines(summary: Summary) -> list[str]:
    """Time difference, path error and what became of the commands, a sentence each."""
    path, commands, behind = summary["path"], summary["commands"], summary["behind"]
    lag = summary["lag_timeline_s"]
    control = "a robot that stands has no lag" if lag is None else f"its joints lag another {_seconds(lag)}"
    lines = [
        f"Network: the robot played {_seconds(behind['mean_s'])} behind the operator on average, at most "
        f"{_seconds(behind['max_s'])} (offset {summary['offset']}); it slowed down {_times(behind['slowed'])} and "
        f"waited {_times(behind['waited'])}. Control: {control}.",
        f"Time difference along the tool path: mean {_seconds(path['time_difference_mean'])}, "
        f"sd {_seconds(path['time_difference_sd'])}, max {_seconds(path['time_difference_max'])}.",
        f"Tool path error: mean {_millimetres(path['path_error_mean'])}, "
        f"95 % {_millimetres(path['path_error_p95'])}, max {_millimetres(path['path_error_max'])}.",
        f"Commands at the virtual robot: {_counts(commands['virtual'])}; at the real one: "
        f"{_counts(commands['real'])}; {commands['sent']} sent, {commands['lost']} lost, "
        f"{commands['late']} late; the virtual robot was corrected {_times(commands['corrections'])}.",
    ]
    if summary["gap_s"] > 0:
        lines.append(
            f"Of the {summary['duration_s']:.1f} s, the real robot wasn't measured for {summary['gap_s']:.1f} s: "
            "nothing then is in any figure."
        )
    if path["progress"] is not None and path["progress"] < 0.97:
        lines.append(
            f"The real robot reached {path['progress']:.1%} of the path: the means above don't compare; "
            f"the time difference is at least {_seconds(path['time_difference_bound'])}."
        )
    return lines


def _seconds(value: float | None) -> str:
    return "undefined" if value is None else f"{value:.3f} s"


def _millimetres(value: float | None) -> str:
    return "undefined" if value is None else f"{1e3 * value:.2f} mm"


def _counts(counts: dict[str, int]) -> str:
    return ", ".join(f"{number} {status}" for status, number in counts.items())


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
        out.append(("What the choice of the offset does", OFFSETS, offset_rows({"offsets": offsets}), note, True))
    if path := _part(summary, "path"):
        rows = [(words(name), _with_unit(value, _path_unit(name))) for name, value in path.items()]
        out.append(("Tool path and time difference, user time", ("", ""), rows, "", False))
    if commands := _part(summary, "commands"):
        out.append(("Commands", ("", ""), _flat(commands), "", False))
    rest = {name: value for name, value in summary.items() if name not in ELSEWHERE}
    if rest:
        out.append(("The run", ("", ""), _flat(rest), "", False))
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
    """A figure's text: three digits behind the point, none from 10,000 on."""
    if isinstance(value, bool) or not isinstance(value, float):
        return str(value)
    return f"{value:.0f}" if abs(value) >= 1e4 else f"{round(value, 3) + 0.0:.3f}".replace("-", "−")
