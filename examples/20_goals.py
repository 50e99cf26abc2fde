"""A robot at home is told where to go: the nearest door is closed, so it goes round, and says where it waits."""

from __future__ import annotations

from dataclasses import replace

from robots.ipr.parameters import IPR
from robots.mobile.chassis import Senses
from robots.mobile.navigation import BodyNavigator
from robots.mobile.position import LaserPosition
from robots.mobile.robot import BareBody, place
from robots.onboard.driving import IPR_LIMITS, STAND, kept
from robots.onboard.journey import GOING, Goal
from robots.onboard.laser import LaserModel

PERIOD = 0.05
home = place("home")
# The door from the living room to the hall stays closed; the operator's map doesn't know.
doors = [
    replace(door, times=(0.0,), shares=(0.0 if k == 4 else 1.0,), repeat=False) for k, door in enumerate(home.doors)
]
home = replace(home, doors=tuple(doors), people=())
sofa = home.place("sofa")
start = sofa.x, sofa.y, -1.57
body = BareBody(IPR, start, room=home, senses=Senses(camera=None, laser=LaserModel()), rng=1)
position, on_board = LaserPosition(body), BodyNavigator(body, PERIOD)
journey, b, before, routes = on_board.navigator.journey, home.place("B"), STAND, 0
while body.time < 120.0:
    posture = position.posture()
    if body.time >= 0.5 and journey.goal is None:
        on_board.navigator.go(Goal(b.x, b.y, b.heading), posture, now=body.time)
    wanted = on_board.drive(posture, v_before=before.v)
    before = kept(wanted.v, wanted.w, before.v, PERIOD, IPR_LIMITS)
    body.drive(before.v, before.w, round(PERIOD / body.reality.dt))
    if journey.routes > routes and journey.route is not None:
        routes = journey.routes
        print(
            f"{body.time:5.1f} s  way {routes}: {journey.route.length:.1f} m by {len(journey.route.points)} points"
        )
    if journey.goal is not None and journey.state not in GOING:
        break

x, y, _ = body.truth
print(
    f"{body.time:5.1f} s  {journey.state} {journey.reason}: {100 * abs(complex(x - b.x, y - b.y)):.1f} cm from B,"
)
print(
    f"         {len(body.collisions)} touches, {len(on_board.navigator.obstacles.places())} cells that no map has"
)
