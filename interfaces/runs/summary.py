"""The figures of a run, as summary.json and the report show them, and its errors split among causes."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Collection
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from interfaces.runs.twin_run import TwinRun
from vrs.comparison import Agreement, PathMatch, agreement, best_lag, match_paths, shifted, summed_up
from vrs.ledger import Receipt, Status
from vrs.model import Array, RobotModel

CAUSES = ("network", "payload_and_friction", "servo")
"""The order in which causes are switched off; each stays off in the runs after it."""


@dataclass(frozen=True, slots=True)
class Measures:
    """The errors of one run that are attributed; equal timeline time is the same place in the plan."""

    tool_rms_timeline_m: float
    """Tool distance at equal timeline time, rms [m]."""
    tool_rms_user_m: float
    """Tool distance at equal user time, rms [m]."""
    joint_rms_timeline_rad: float
    """Joint error at equal timeline time, rms over all joints that turn [rad]; 0 where none does."""


@dataclass(frozen=True, slots=True)
class Attribution:
    """One measure of a run or a drive, split: parts and residual add up to the total."""

    measure: str
    """Name of a field of Measures, whose last part is the unit, or of PathComparison."""
    total: float
    parts: tuple[tuple[str, float], ...]
    """Cause, and by how much the measure fell when it was switched off, in that order."""
    residual: float
    """What is left with every cause off."""


@dataclass(frozen=True, slots=True)
class OffsetOutcome:
    """What one choice of the offset makes of a network, with a body that follows exactly."""

    offset: str
    """`adaptive`, or `fixed:S` for D = −S."""
    behind_mean_s: float
    """How far the real robot played behind the operator, mean over the run [s]."""
    behind_max_s: float
    """The same, at most [s]."""
    late: int
    """Commands that were carried out later in the plan than asked, or not at all."""
    waits: int
    """How often the robot slowed down or waited."""
    tool_rms_timeline_m: float
    """Tool distance at equal timeline time, rms [m]."""


def measures(run: TwinRun) -> Measures:
    """Measure one run."""
    timeline = agreement(run.model, run.q_matched, run.q_real)
    user = agreement(run.model, run.q_shown, run.q_real)
    turning = np.delete(timeline.joint_rms, list(run.model.prismatic))
    joints = float(np.sqrt(np.mean(turning**2))) if len(turning) else 0.0
    return Measures(timeline.tool_rms, user.tool_rms, joints)


def attribute(stages: tuple[Measures, ...]) -> tuple[Attribution, ...]:
    """Split each measure among the causes.

    Args:
        stages: Measures of the whole run, then of the runs with the first one, two and three of CAUSES off.

    Returns:
        One attribution for each measure.
    """
    splits = []
    for name in Measures.__slots__:
        values = [float(getattr(stage, name)) for stage in stages]
        parts = tuple((cause, values[i] - values[i + 1]) for i, cause in enumerate(CAUSES))
        splits.append(Attribution(name, values[0], parts, values[-1]))
    return tuple(splits)


SCHEMA = "vrs-summary/1"
DIGITS = 9
"""Decimals of every figure in the file."""
MOST_CELLS = 4000
"""Most cells of a tool path; a longer path has longer cells."""

Json = dict[str, Any]


def summarize(
    run: TwinRun,
    attributions: tuple[Attribution, ...] = (),
    offsets: tuple[OffsetOutcome, ...] = (),
) -> Json:
    """Measure a run.

    Args:
        run: The record of both twins.
        attributions: Its measures split among causes; none where no counterfactual was run.
        offsets: What other choices of the offset make of the same network; none where none was tried.

    Returns:
        A JSON value; `docs/summary.md` describes its fields. The same run gives the same value.
    """
    seen = run.measured
    lag, D = best_lag(run.t, run.q_matched, run.q_real), float(run.D[seen].mean())
    aligned = run.q_matched if lag is None else shifted(run.t, run.q_matched, -lag)
    samples = run.at_samples
    errors = {
        "timeline_time": agreement(run.model, samples.q_matched, samples.q_real),
        "lag_removed": agreement(run.model, aligned[seen], run.q_real[seen]),
        "user_time": agreement(run.model, samples.q_shown, samples.q_real),
        "servo": agreement(run.model, samples.q_reference, samples.q_real),
    }
    value = {
        "schema": SCHEMA,
        **facts(run.session, "title", "delay", "service", "link_loss", "offset"),
        "robot": run.model.name,
        "seed": run.session.seed or 0,
        "clock_offset_s": D,
        "behind": _behind(run),
        "messages": _messages(run),
        "duration_s": float(run.t[-1]),
        "gap_s": run.gap_s,
        "commands": _commands(run),
        "errors": {name: _errors(value, run.model) for name, value in errors.items()},
        "lag_timeline_s": lag,
        "lag_user_s": None if lag is None else lag - D,
        "path": _path(run),
        "attribution_order": list(CAUSES),
        "attribution": [{**asdict(item), "parts": dict(item.parts)} for item in attributions],
        "offsets": [asdict(outcome) for outcome in offsets],
        "corrections": [
            facts(made, "t_s", "end_s", "reason") | in_units("error", made.error, run.model.prismatic)
            for made in run.corrections
        ],
        "receipts_virtual": [_receipt(receipt, run.model) for receipt in run.receipts_virtual],
        "receipts_real": [_receipt(receipt, run.model) for receipt in run.receipts_real],
        "packets": [
            facts(packet, "command_id", "real_id", "sent_s", "arrived_s", "lost") for packet in run.packets
        ],
        "events": [facts(event, "t_s", "kind", "text") for event in run.events],
    }
    rounded = _rounded(value)
    assert isinstance(rounded, dict)
    return rounded


UNIT = re.compile(r"_((?:s|m|rad_or_m|rad|byte)(?:_per_s\d*)?)$")
"""What a name ends with that says a unit."""


def facts(value: object, *names: str) -> Json:
    """Fields of a value by their names, which may say their units: `end_s` is its `end`."""
    return {name: getattr(value, UNIT.sub("", name)) for name in names}


def to_json(summary: Json) -> str:
    """Write a summary: sorted keys, two spaces, a final newline; equal values give equal bytes."""
    return json.dumps(summary, indent=2, sort_keys=True, ensure_ascii=False, allow_nan=False) + "\n"


def status_counts(receipts: tuple[Receipt, ...]) -> dict[str, int]:
    """How many receipts there are of each status."""
    return {str(status): sum(r.status is status for r in receipts) for status in Status}


def _commands(run: TwinRun) -> Json:
    kinds = [event.kind for event in run.events]
    return {
        "virtual": status_counts(run.receipts_virtual),
        "real": status_counts(run.receipts_real),
        "sent": len(run.packets),
        "lost": sum(packet.lost for packet in run.packets),
        "late": kinds.count("late"),
        "diverged": kinds.count("diverged"),
        "corrections": len(run.corrections),
    }


def _behind(run: TwinRun) -> Json:
    """How far the real robot played behind the operator."""
    behind = -run.D[run.measured]
    kinds = [event.kind for event in run.events]
    return {
        "mean_s": float(behind.mean()),
        "p95_s": float(np.quantile(behind, 0.95)),
        "max_s": float(behind.max()),
        "slowed": kinds.count("slowed"),
        "waited": kinds.count("waited"),
    }


def _messages(run: TwinRun) -> Json:
    """What the network did to the messages to the robot."""
    sent, arrived = run.messages.T
    delay = (arrived - sent)[np.isfinite(arrived)]
    some = len(delay) > 0
    return {
        "count": len(sent),
        "lost": len(sent) - len(delay),
        "delay_mean_s": float(delay.mean()) if some else None,
        "delay_p95_s": float(np.quantile(delay, 0.95)) if some else None,
        "delay_max_s": float(delay.max()) if some else None,
    }


def _errors(value: Agreement, model: RobotModel) -> Json:
    # Metres and radians don't compare; shares of what a joint can do, do.
    span = model.limits.q_max - model.limits.q_min if model.prismatic else 1.0
    worst = int(np.argmax(value.joint_rms / span))
    return {
        **in_units("joint_rms", value.joint_rms, model.prismatic),
        **in_units("joint_max", value.joint_max, model.prismatic),
        "worst_joint": worst + 1,
        **facts(value, "tool_rms_m", "tool_max_m"),
        "angle_rms_deg": math.degrees(value.angle_rms),
        "angle_max_deg": math.degrees(value.angle_max),
    }


def path_match(run: TwinRun) -> tuple[PathMatch, Json]:
    """The real tool's path matched to the virtual one's in user time, and by which cells [m] and speed [m/s]."""
    samples, gaps = run.at_samples, ~run.measured
    # The virtual robot's path goes on where the real one wasn't measured.
    t = np.concatenate((samples.t, run.t[gaps]))
    order = np.argsort(t, kind="stable")
    p_virtual = run.model.forward(np.vstack((samples.q_virtual, run.q_virtual[gaps])))[order, :3, 3]
    p_real = np.full((len(t), 3), np.nan)
    p_real[: len(samples.t)] = run.model.forward(samples.q_real)[:, :3, 3]
    steps = np.linalg.norm(np.diff(p_virtual, axis=0), axis=1)
    cell = max(0.01, float(steps.sum()) / MOST_CELLS)
    v_max = max(0.5, float((steps / np.diff(t[order])).max()))
    match = match_paths(t[order], p_virtual, p_real[order], v_max=v_max, cell=cell)
    return match, {"cell": cell, "v_max": v_max}


def _path(run: TwinRun) -> Json:
    """Tool path and time difference, in the metres and seconds of `docs/summary.md`."""
    match, options = path_match(run)
    return {**options, **asdict(summed_up(match))}


def _receipt(receipt: Receipt, model: RobotModel) -> Json:
    return {
        **facts(receipt, "command_id", "issued_at_s", "asked_at_s", "execute_at_s", "end_s", "reason", "shift_s"),
        **facts(receipt, "shifted", "superseded", "superseded_by"),
        **in_units("q", receipt.q, model.prismatic),
        "status": str(receipt.status),
    }


def in_units(name: str, values: Array | None, prismatic: Collection[int]) -> Json:
    """A number a joint in degrees, by its name and unit; where some joints are prismatic, another list in metres.

    Either list has None for the other's joints.
    """
    if values is None:
        return {f"{name}_deg": None}
    turning = [None if j in prismatic else float(x) for j, x in enumerate(np.degrees(values))]
    moving = [float(x) if j in prismatic else None for j, x in enumerate(values)]
    return {f"{name}_deg": turning, **({f"{name}_m": moving} if prismatic else {})}


def _rounded(value: Any) -> Any:
    """The value with plain floats of DIGITS decimals, no negative zero among them."""
    if isinstance(value, dict):
        return {str(key): _rounded(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_rounded(item) for item in value]
    if isinstance(value, (float, np.floating)):
        return round(float(value), DIGITS) + 0.0
    return int(value) if isinstance(value, np.integer) else value
