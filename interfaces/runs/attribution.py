"""A run's errors split among causes; and what a choice of the offset makes of a network."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from interfaces.runs.twin_run import TwinRun
from vrs.comparison import agreement

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
    """Joint error at equal timeline time, rms over all joints [rad]."""


@dataclass(frozen=True, slots=True)
class Attribution:
    """One measure, split: parts and residual add up to the total."""

    measure: str
    """Name of a field of Measures; its last part is the unit."""
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
    return Measures(timeline.tool_rms, user.tool_rms, float(np.sqrt(np.mean(timeline.joint_rms**2))))


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
