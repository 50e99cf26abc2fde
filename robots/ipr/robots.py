"""The IPR and the micro-robot as values."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Final

from robots.ipr import parameters
from robots.ipr.model import Kind, model
from robots.ipr.shapes import NECK, REACH, SCREEN_SIZE, headless, ipr_shapes, micro_shapes, screen_pose
from robots.mobile.body import bodies_of
from robots.mobile.chassis import Chassis
from robots.mobile.shapes import links
from robots.onboard.laser import LaserModel
from robots.robot import Appearance, Display, HeadCamera, Robot
from robots.solids import LinkShape


def _robot(kind: Kind, body: Chassis, shapes: Callable[[], Sequence[LinkShape]], *devices: object) -> Robot:
    return Robot(kind.value, model(kind), Appearance(shapes, partial(links, body)), bodies_of(body), devices)


ROBOT: Final = _robot(
    Kind.IPR,
    parameters.IPR,
    ipr_shapes,
    Display(SCREEN_SIZE, screen_pose),
    HeadCamera(NECK, REACH, headless),
    LaserModel(),
)
"""The 75 kg robot of section 2.1, with a display and a camera in its head."""
MICRO: Final = _robot(Kind.MICRO, parameters.MICRO, micro_shapes, LaserModel(forward=0.0, height=0.06))
"""The 430 g robot of section 4.2; a laser scanner would sit on its middle."""
