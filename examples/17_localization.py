"""A robot whose wheels are 1 % wrong drives about an apartment: where is it, and how well does it know?"""

from __future__ import annotations

import math

import numpy as np

from interfaces.lab.localization.trial import Wanderer
from robots.ipr.parameters import IPR
from robots.mobile.apartments import ApartmentConfig, apartment
from robots.mobile.chassis import MobileReality, Senses
from robots.mobile.floor_plan import plan_map
from robots.mobile.robot import BareBody
from robots.onboard.laser import LaserModel
from robots.onboard.localizer import Localizer, Status

room = apartment(7, ApartmentConfig(rooms=3, people=2))
worn = MobileReality(radius_error=(0.01, -0.01), slip_spread=0.01, dt=1 / 60)
senses = Senses(sonar=None, camera=None, laser=LaserModel(noise=0.02, sweep=0.03))
body = BareBody(IPR, room=room, reality=worn, senses=senses, rng=1)
# Nobody tells it where it begins: it has the plan, and turns on the spot until it knows.
localizer = Localizer(plan_map(room))
driver = Wanderer(room, np.random.default_rng(1))
errors = []
while body.time < 30.0:
    localizer.move(body.time, body.reckoned)
    if body.laser is not None:
        localizer.see(body.laser)
    if localizer.status is Status.TRACKING and localizer.posture is not None:
        errors.append(math.dist(localizer.posture[:2], body.truth[:2]))
    drive = driver.drive(body.time, body.truth, 0.05)
    body.drive(*((0.0, 0.65) if localizer.wants_turn else drive), 3)

for event in localizer.events:
    print(f"{event.time:5.1f} s  {event.status}")
x, y, _ = body.truth
told = 100 * np.sqrt(np.diag(localizer.covariance))
print(f"dead reckoning is off by {100 * math.dist(body.reckoned[:2], (x, y)):.0f} cm")
print(
    f"by laser 95 % within {100 * np.quantile(errors, 0.95):.2f} cm; it says ±{told[0]:.2f} and ±{told[1]:.2f} cm"
)
