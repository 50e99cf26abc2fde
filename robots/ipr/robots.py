"""The IPR and the micro-robot as values."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any, Final

from robots.ipr.body import MobileBody
from robots.ipr.model import Kind, model
from robots.ipr.robot import BareBody
from robots.ipr.shapes import SCREEN_SIZE, links, screen_pose, shapes
from robots.onboard.laser import LaserModel
from robots.robot import Appearance, Display, HeadCamera, Robot


def _robot(kind: Kind, *devices: object) -> Robot:
    bodies: dict[str, Callable[..., Any]] = {"bullet": partial(MobileBody, kind), "bare": partial(BareBody, kind)}
    return Robot(kind, model(kind), Appearance(partial(shapes, kind), partial(links, kind)), bodies, devices)


ROBOT: Final = _robot(Kind.IPR, Display(SCREEN_SIZE, screen_pose), HeadCamera(), LaserModel())
"""The 75 kg robot of section 2.1, with a display and a camera in its head."""
MICRO: Final = _robot(Kind.MICRO, LaserModel(forward=0.0, height=0.06))
"""The 430 g robot of section 4.2; a laser scanner would sit on its middle."""
