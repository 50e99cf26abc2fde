"""What commands are counted as."""

from __future__ import annotations

from math import inf

from vrs.commands import Command, InsertVia, Motion, MotionCommand, PoseTarget, SteerCommand


def kinds_of(command: Command) -> tuple[str, ...]:
    """What a command is counted as, the main thing first."""
    if isinstance(command, MotionCommand):
        kinds = [f"move: {command.insertion}", f"move: {command.profile}"]
        kinds += ["move: line"] if command.motion is Motion.LINE else []
        kinds += ["move: pose"] if isinstance(command.target, PoseTarget) else []
        kinds += ["move: rounded"] if 0 < command.deviation < inf else []
        kinds += ["move: continuous"] if command.deviation == inf else []
        kinds += ["move: pace"] if command.pace < 1 else []
        kinds += ["move: acceleration"] if command.acceleration < 1 else []
        kinds += ["move: tool"] if command.tool is not None else []
        return tuple(kinds)
    if isinstance(command, SteerCommand):
        return ("steer: rates" if command.twist is None else f"steer: twist in {command.frame}",)
    if isinstance(command, InsertVia):
        return ("via", "via: rounded") if command.deviation > 0 else ("via",)
    return (type(command).__name__.lower(),)
