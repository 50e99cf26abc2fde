"""A unicycle to be driven: ideal, or with motors of first order; its arcs are exact."""

from __future__ import annotations

import math

from robots.onboard.driving import Drive, Posture
from vrs.mobile import advanced


class Unicycle:
    """Follows drives, `tau` seconds behind."""

    def __init__(self, posture, tau=0.0):
        self.posture, self.tau, self.v, self.w = Posture(*posture), tau, 0.0, 0.0

    def run(self, drive: Drive, dt: float, parts: int = 2) -> None:
        for _ in range(parts):
            share = 1 - math.exp(-dt / parts / self.tau) if self.tau else 1.0
            self.v += share * (drive.v - self.v)
            self.w += share * (drive.w - self.w)
            self.posture = Posture(*advanced(self.posture, self.v, self.w, dt / parts))


def assert_kept(drives, limits, dt):
    """Limits at each step."""
    before = 0.0
    for drive in drives:
        assert abs(drive.v) <= limits.v_max + 1e-12
        assert abs(drive.w) <= limits.w_max + 1e-12
        assert abs(drive.v - before) <= limits.a_max * dt + 1e-12
        before = drive.v
