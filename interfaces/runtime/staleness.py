"""Whether messages reach a robot in time to count."""

from __future__ import annotations

from interfaces.link import LinkConditions
from interfaces.runs.twin_run import QUANTILE


def too_slow(conditions: LinkConditions, max_age: float) -> str:
    """Say that messages will often be too old for a robot that halts then; empty where they won't.

    Args:
        conditions: The way to the robot and back.
        max_age: Older messages don't count there [s].
    """
    # Half a round trip isn't known of the clocks, and counts as age.
    usual = conditions.forward.delay.quantile(QUANTILE) + conditions.backward.delay.quantile(QUANTILE)
    if usual <= max_age:
        return ""
    return (
        f"messages will often be {usual:.2g} s old, with what isn't known of the clocks, and those older "
        f"than {max_age:g} s don't count under --link-loss halt"
    )


def late_often(conditions: LinkConditions, link_loss: str, max_age: float | None) -> str:
    """Say what mends it where messages will often be too old for a robot; empty where they won't.

    Args:
        conditions: See `too_slow`.
        link_loss: What the robot does when nothing is heard, `halt` or `hold`.
        max_age: See `too_slow`; None where that isn't known.
    """
    slow = "" if link_loss != "halt" or max_age is None else too_slow(conditions, max_age)
    return f"{slow}: start vrs serve with --link-loss hold, or vrs robot with --max-age up to 2" if slow else ""
