"""Where a robot will be when a command reaches it, from where it was a round trip before.

Source: Tipsuwan, Chow, eq. (19)–(22). The robot keeps the drive that it reported; eq. (21) and (22) divide by A and
are the exact arc of `vrs.mobile.advanced`, which has the straight line as its limit.
"""

from __future__ import annotations

from robots.onboard.driving import Drive, Posture
from vrs.mobile import advanced


def predicted(posture: Posture, drive: Drive, tau: float) -> Posture:
    """Return where a robot will be.

    Args:
        posture: Where it was when it reported.
        drive: What it was driving then.
        tau: Time from the report to when a command that is sent now reaches it [s]: the median round trip.
    """
    return Posture(*advanced(posture, drive.v, drive.w, tau))
