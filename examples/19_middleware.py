"""A path tracker written for no delay drives a robot over a network: as it is, and behind the middleware."""

from __future__ import annotations

import math

from interfaces.lab.tipsuwan.run import leg, no_delay, run
from interfaces.middleware import GainSchedulingMiddleware, MiddlewareConfig, default_network
from robots.onboard.curve import read_curve
from robots.onboard.curve_trackers import QuadraticCurveTracker, QuadraticTrackerConfig

curve = read_curve("""
path 1
curve cubic
0 1
1.5 2.3
3.5 -0.6
5 1.2
""")
print(f"an S of {curve.length:.1f} m, bends of up to {curve.most_curvature(0, curve.length):.1f} /m")


def tracker() -> QuadraticCurveTracker:
    """Make the tracker of Tipsuwan and Chow: 2 m/s, looking 0.3 m ahead."""
    return QuadraticCurveTracker(curve, QuadraticTrackerConfig(alpha=2.0, s_max=0.3, beta=0.1))


nothing = MiddlewareConfig(predicts=False, schedules=False)
network = leg(0.22)
for name, agent, delay in (
    ("no delay", GainSchedulingMiddleware(tracker().control, nothing), no_delay()),
    ("round trips of 0.22 s", GainSchedulingMiddleware(tracker().control, nothing), network),
    (
        "the same, behind the middleware",
        GainSchedulingMiddleware(tracker().control, network=default_network()),
        network,
    ),
):
    track = run(curve, agent, delay, seed=1)
    away = [math.dist(curve.at(curve.nearest(x, y))[:2], (x, y)) for x, y, _ in track.postures[::5].tolist()]
    end = f"arrived after {track.t[-1]:.1f} s" if track.arrived else f"not there after {track.t[-1]:.0f} s"
    slowed = agent.scheduler.slowed
    print(
        f"{name:32} {end}, {100 * sum(away) / len(away):.1f} cm off the path on average, {slowed} commands slowed"
    )
