"""Whether messages reach a robot in time to count."""

from __future__ import annotations

from interfaces.link import LinkConditions
from interfaces.runtime.offset import QUANTILE


def late_often(conditions: LinkConditions, link_loss: str, max_age: float | None) -> str:
    """Say that messages will often be too old for a robot that halts then; empty where they won't.

    Args:
        conditions: The way to the robot and back.
        link_loss: What the robot does when nothing is heard, `halt` or `hold`.
        max_age: Older messages don't count there [s]; None where that isn't known.
    """
    if link_loss != "halt" or max_age is None:
        return ""
    # Half a round trip isn't known of the clocks, and counts as age.
    usual = conditions.forward.delay.quantile(QUANTILE) + conditions.backward.delay.quantile(QUANTILE)
    if usual <= max_age:
        return ""
    return (
        f"messages will often be {usual:.2g} s old, with what isn't known of the clocks, and those older "
        f"than {max_age:g} s don't count: try --link-loss hold, or --max-age up to 2"
    )
