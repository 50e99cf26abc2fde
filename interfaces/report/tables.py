"""The comparison table of a run, for a terminal."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rich.table import Table

Json = dict[str, Any]
ROWS = (
    ("timeline_time", "timeline"),
    ("lag_removed", "… no lag"),
    ("user_time", "user"),
    ("servo", "servo"),
)


def error_table(summary: Json) -> Table:
    """Joint and tool errors, a row a way of comparing."""
    from rich.table import Table

    table = Table(
        title=f"Virtual and real {summary['robot']}, delay {summary['delay']}, offset {summary['offset']}",
        title_justify="left",
    )
    for name in ("at equal", "joint", "rms\ndeg", "max\ndeg"):
        table.add_column(name, justify="left" if name == "at equal" else "right")
    for name in ("tool rms\nmm", "max\nmm", "angle\nrms deg", "max\ndeg"):
        table.add_column(name, justify="right")
    for key, label in ROWS:
        row = summary["errors"][key]
        joint = row["worst_joint"]
        table.add_row(
            label,
            str(joint),
            f"{row['joint_rms_deg'][joint - 1]:.3f}",
            f"{row['joint_max_deg'][joint - 1]:.3f}",
            f"{1e3 * row['tool_rms_m']:.2f}",
            f"{1e3 * row['tool_max_m']:.2f}",
            f"{row['angle_rms_deg']:.3f}",
            f"{row['angle_max_deg']:.3f}",
        )
    return table


def attribution_table(summary: Json) -> Table:
    """Errors split among their causes, a row a measure."""
    from rich.table import Table

    order = summary["attribution_order"]
    table = Table(title=f"Why: switched off in turn, {', '.join(map(_words, order))}", title_justify="left")
    for name in ("measure (rms)", "total", *map(_words, order), "residual"):
        table.add_column(name, justify="left" if name.startswith("measure") else "right")
    for item in summary["attribution"]:
        label, scale, unit = MEASURES[item["measure"]]
        values = [item["total"], *(item["parts"][cause] for cause in order), item["residual"]]
        table.add_row(f"{label}, {unit}", *(f"{round(scale * value, 3) + 0.0:.3f}" for value in values))
    return table


def offset_table(summary: Json) -> Table:
    """What other choices of the offset make of the same network."""
    from rich.table import Table

    table = Table(title="The same network, a body that follows exactly", title_justify="left")
    for name in OFFSETS:
        table.add_column(name, justify="left" if name == "offset" else "right")
    for row in offset_rows(summary):
        table.add_row(*(f"{value:.3f}" if isinstance(value, float) else str(value) for value in row))
    return table


def offset_rows(summary: Json) -> list[tuple[str | float, ...]]:
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


def time_lines(summary: Json) -> list[str]:
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


def _words(cause: str) -> str:
    return cause.replace("_", " ")


def _seconds(value: float | None) -> str:
    return "undefined" if value is None else f"{value:.3f} s"


def _millimetres(value: float | None) -> str:
    return "undefined" if value is None else f"{1e3 * value:.2f} mm"


def _counts(counts: dict[str, int]) -> str:
    return ", ".join(f"{number} {status}" for status, number in counts.items())
