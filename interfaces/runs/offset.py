"""How far behind the operator the robot plays, as the command line spells it."""

from __future__ import annotations

import math

from interfaces.link import ConstantDelay, DelayProfile
from interfaces.link.delay import MAX_DELAY
from vrs.errors import InvalidValueError

QUANTILE = 0.95
"""Share of packets that a fixed offset covers where it's taken from a random profile."""
STEP = 0.02
"""What that offset is rounded up to [s]."""
ADAPTIVE = "adaptive"
FIXED = "fixed"
_ALLOWED = f"'adaptive', 'fixed', or 'fixed:S' with S seconds in [0, {MAX_DELAY:g}], as in fixed:0.5"


def fixed_offset(text: str, profile: DelayProfile) -> float | None:
    """Read a choice of offset.

    Args:
        text: `adaptive`; `fixed` for D = −D_f from the profile; `fixed:S` for D = −S.
        profile: The link's delay.

    Returns:
        D [s], ≤ 0; None for an offset that adapts.

    Raises:
        InvalidValueError: If it's none of these.
    """
    if text == ADAPTIVE:
        return None
    if text == FIXED:
        return -covered(profile)
    kind, _, number = text.partition(":")
    try:
        behind = float(number) if kind == FIXED else math.nan
    except ValueError:
        behind = math.nan
    if not 0 <= behind <= MAX_DELAY:
        raise InvalidValueError("offset", text, _ALLOWED)
    return -behind


def covered(profile: DelayProfile) -> float:
    """D_f [s]: the constant delay, or the 95 % quantile rounded up to a step of the record."""
    if isinstance(profile, ConstantDelay):
        return profile.delay
    return STEP * math.ceil(profile.quantile(QUANTILE) / STEP - 1e-9)


def spelled(D: float | None) -> str:
    """The choice as the command line spells it."""
    return ADAPTIVE if D is None else f"{FIXED}:{-D:.9g}"
