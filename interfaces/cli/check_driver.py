"""`vrs check --driver`: whether a driver of hardware does what one must."""

from __future__ import annotations

import typer

from robots.driver import conformance, load_driver
from vrs.model import Limits


def check_driver(what: str, limits: Limits, *, move: bool) -> bool:
    """Try a driver, and print each check as it's done; returns whether all of them hold.

    Args:
        what: `MODULE:NAME` of what makes it.
        limits: Of the robot's joints.
        move: Whether joints are moved.

    Raises:
        FormatError: If its module can't be imported.
        InvalidValueError: If there's no such thing in it.
    """
    good = True
    for check in conformance(load_driver(what), limits, move=move):
        typer.echo(f"{'yes' if check.holds else 'NO ':3} {check.name}: {check.said}")
        good = good and check.holds
    if good and not move:
        typer.echo("Nothing was moved; --move lets each joint go by 0.05 rad (m) and back.")
    return good
