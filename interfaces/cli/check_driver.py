"""`vrs check --driver`: whether a driver of hardware does what one must."""

from __future__ import annotations

import json
from dataclasses import asdict

import typer

from robots.driver import conformance, load_driver
from vrs.model import Limits


def check_driver(what: str, limits: Limits, *, move: bool, as_json: bool) -> bool:
    """Try a driver, and print each check as it's done, or all as JSON; returns whether all of them hold.

    Args:
        what: `MODULE:NAME` of what makes it.
        limits: Of the robot's joints.
        move: Whether joints are moved.
        as_json: Whether the checks are JSON.

    Raises:
        FormatError: If its module can't be imported.
        InvalidValueError: If there's no such thing in it.
    """
    checks = []
    for check in conformance(load_driver(what), limits, move=move):
        checks.append(check)
        if not as_json:
            typer.echo(f"{'yes' if check.holds else 'NO ':3} {check.name}: {check.said}")
    good = all(check.holds for check in checks)
    if as_json:
        typer.echo(json.dumps({"driver": what, "checks": [asdict(check) for check in checks]}, indent=2))
    elif good and not move:
        typer.echo("Nothing was moved; --move lets each joint go by 0.05 rad (m) and back.")
    return good
