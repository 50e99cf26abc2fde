"""A camera in a robot's head: two axes with limits, speeds and accelerations; where it looks from, what it sees.

Source: Kim, Han, Kim, Kim, 2002, section 2.1: one colour camera in the head, which two DC motors turn about a
vertical and a horizontal axis; section 4.2: at most 5 pictures a second. What it doesn't say is an assumption; its
reason stands beside it.

It sees the room, what comes and goes in it, people, and the robot's own body.
"""

from __future__ import annotations

import io
import math
from dataclasses import dataclass
from typing import Annotated, Final, NamedTuple

import numpy as np
from msgspec import Meta

from robots.base import upright
from robots.mobile.renderer import Picture, Renderer
from robots.mobile.shapes import GROUND, box, door_shape, person_shape, room_shapes
from robots.robot import Appearance, HeadCamera
from robots.rooms import EMPTY, Room, is_wall
from robots.solids import Builder, LinkShape
from vrs.checks import finite, number_in, validated, within
from vrs.errors import InvalidValueError
from vrs.insertion import piece
from vrs.model import Array, Limits, frozen_array
from vrs.planning import parabolic
from vrs.timeline import Timeline


@dataclass(frozen=True, slots=True)
@validated
class Lens:
    """What the camera sees of what is before it."""

    width: Annotated[int, Meta(ge=64, le=1920, multiple_of=16)] = 352
    """Pixels across, a multiple of 16, 64 to 1920."""
    height: Annotated[int, Meta(ge=48, le=1080, multiple_of=2)] = 264
    """Pixels down, a multiple of 2, 48 to 1080."""
    view: Annotated[float, within(0.2, 2.4)] = math.radians(65.0)
    """Horizontal angle of view [rad], 0.2 to 2.4; an assumption: a usual wide lens of such cameras."""
    near: Annotated[float, within(0.001, 1.0)] = 0.03
    """Nothing nearer is seen [m], 0.001 to 1."""
    far: Annotated[float, within(2.0, 1000.0)] = 60.0
    """Nothing farther is seen [m], 2 to 1000."""


@dataclass(frozen=True, slots=True)
@validated
class PanTiltConfig:
    """How the camera can be turned. Pan is positive to the left, tilt is positive upwards."""

    pan: Annotated[float, within(0.1, 3.1)] = math.radians(100.0)
    """Farthest to either side [rad], 0.1 to 3.1; an assumption: over both shoulders with the angle of view."""
    down: Annotated[float, within(0.1, 1.5)] = math.radians(35.0)
    """Farthest down [rad], 0.1 to 1.5; an assumption: farther down its own display fills the picture."""
    up: Annotated[float, within(0.1, 1.5)] = math.radians(45.0)
    """Farthest up [rad], 0.1 to 1.5; an assumption: the face of who stands before the robot is seen."""
    speed: Annotated[float, within(0.01, 20.0)] = math.radians(60.0)
    """Largest speed of each axis [rad/s], 0.01 to 20; an assumption: a look to the side takes two seconds."""
    acceleration: Annotated[float, within(0.01, 200.0)] = math.radians(180.0)
    """Largest acceleration of each axis [rad/s²], 0.01 to 200; an assumption: full speed in a third of a second."""

    @property
    def limits(self) -> Limits:
        """Of pan and tilt, as of two joints."""
        both = np.ones(2)
        return Limits(
            np.array([-self.pan, -self.down]),
            np.array([self.pan, self.up]),
            self.speed * both,
            self.acceleration * both,
        )


class Look(NamedTuple):
    """Where the camera looks."""

    pan: float
    """[rad], positive to the left."""
    tilt: float
    """[rad], positive upwards."""


class PanTilt:
    """Both axes: told where to look, they go there in the least time, also out of a motion. It's given the time."""

    def __init__(self, config: PanTiltConfig | None = None, *, now: float = 0.0) -> None:
        """Look straight ahead.

        Args:
            config: How it can be turned.
            now: [s].
        """
        self.config = PanTiltConfig() if config is None else config
        self._limits = self.config.limits
        self._now = finite("now", now)
        self._motion = Timeline(np.zeros(2), self._now)
        self.target = Look(0.0, 0.0)
        """Where it's to look."""

    def aim(self, pan: float, tilt: float, *, now: float) -> None:
        """Look elsewhere from now on.

        Args:
            pan: [rad], within the limits.
            tilt: [rad], within the limits.
            now: [s], not before the time of the last call.

        Raises:
            InvalidValueError: If an angle is outside its limits, or time runs back; it goes on as before then.
        """
        config = self.config
        pan = number_in("pan", pan, -config.pan, config.pan, unit=" rad")
        tilt = number_in("tilt", tilt, -config.down, config.up, unit=" rad")
        if not finite("now", now) >= self._now:
            raise InvalidValueError("now", now, f"at or after {self._now} s")
        target = np.array([pan, tilt])
        if now >= self._motion.end:
            # The way here is of no more use.
            self._motion = Timeline(self._motion.final(), now)
        plan = parabolic.to_rest(self._motion.state_before(now), target, 1.0, self._limits)
        self._motion = self._motion.edited(now, [piece(plan, 0)] if len(plan) else [])
        self._now, self.target = now, Look(pan, tilt)

    def look(self, now: float) -> Look:
        """Where it looks at a time from the last `aim` on [s]."""
        return Look(*self._motion.sample(now).tolist())

    def moves(self, now: float) -> bool:
        """Whether it's turning at a time [s]."""
        return now < self._motion.end


def lens_pose(look: Look, camera: HeadCamera) -> Array:
    """Pose of a camera's lens in the robot's frame, (4, 4): x along the line of sight, y to the left, z up."""
    c, s = math.cos(look.pan), math.sin(look.pan)
    u, v = math.cos(look.tilt), math.sin(look.tilt)
    X = np.eye(4)
    X[:3, :3] = [[c * u, -s, -c * v], [s * u, c, -s * v], [v, 0.0, u]]
    X[:3, 3] = np.array(camera.neck) + camera.reach * X[:3, 0]
    return frozen_array(X)


TILE: Final = 0.5
"""Side of the floor's tiles [m]: a floor of one colour doesn't show that the robot moves."""
_JOINT: Final = 0.93
"""How dark every second tile is."""
_AROUND: Final = 12.0
"""So far the floor of no room is drawn around the robot [m]."""
_CEILING: Final = (0.90, 0.90, 0.88)
_MOST_TILES: Final = 4000
_QUALITY: Final = 85
"""Of a JPEG."""
OVERHEAD_VIEW: Final = math.radians(25.0)
"""Horizontal angle of view of the overhead camera [rad]: so narrow that walls hide little, from high above."""
OVERHEAD_SPAN: Final = 12.0
"""It shows a room whole, but no more of it than so much, about the robot [m]."""
_SPARE: Final = 1.05
"""So much more than that is seen."""
_INSET: Final = 0.4
"""Share of the picture's width that the overhead one takes in its corner."""


class Sight:
    """Draws a room as the robot's camera sees it, and as one sees it from above."""

    def __init__(
        self, room: Room, camera: HeadCamera, lens: Lens | None = None, looks: Appearance | None = None
    ) -> None:
        """Build the room once.

        Args:
            room: Where the robot is.
            camera: Where it sits on the robot.
            lens: What it sees of what is before it.
            looks: What the robot is from above; unless given, that's what its own camera may see of it.
        """
        self.lens = Lens() if lens is None else lens
        self._room, self._camera, self._renderer = room, camera, Renderer()
        self._endless, self._ceiling = room == EMPTY, -1
        if self._endless:
            self._floor = self._tile((-_AROUND, -_AROUND), (_AROUND, _AROUND), TILE)
        else:
            self._tile((0.0, 0.0), (room.length, room.width), _tile_side(room))
            self._cover()
        add = self._renderer.add
        self._looks = looks
        self._whole = [] if looks is None else [add(shape) for shape in looks.shapes()]
        _, *things = room_shapes(room)
        self._things = [(add(shape), thing) for shape, thing in zip(things, room.things, strict=True)]
        self._doors = [(add(door_shape(door)), door) for door in room.doors]
        self._people = [(add(person_shape(person)), person) for person in room.people]
        self._body = add(camera.body())

    def draw(self, posture: tuple[float, float, float], look: Look, t: float) -> Picture:
        """Draw what is seen.

        Args:
            posture: Where the robot is, x, y [m], θ [rad].
            look: Where its camera looks.
            t: Time in the room [s]: who walks in it, and what stands.
        """
        X_WR, lens = upright(*posture), self.lens
        self._stand(posture, t)
        self._renderer.place(self._body, X_WR)
        return self._renderer.draw(
            X_WR @ lens_pose(look, self._camera),
            width=lens.width,
            height=lens.height,
            view=lens.view,
            near=lens.near,
            far=lens.far,
        )

    def above(self, posture: tuple[float, float, float], t: float, *, share: float = 1.0) -> Picture:
        """Draw the room from above, without a ceiling: x to the right, y upwards.

        Args:
            posture: Where the robot is, x, y [m], θ [rad].
            t: Time in the room [s].
            share: Of the lens' width and height.
        """
        self._stand(posture, t)
        if self._ceiling >= 0:
            self._renderer.place(self._ceiling, None)
        if self._looks is None:
            self._renderer.place(self._body, upright(*posture))
        else:
            for figure, X_WS in zip(self._whole, self._looks.poses(posture), strict=True):
                self._renderer.place(figure, X_WS)
        width, height = round(share * self.lens.width), round(share * self.lens.height)
        room, ratio = self._room, width / height
        across, up = min(OVERHEAD_SPAN, room.length), min(OVERHEAD_SPAN / ratio, room.width)
        middle = posture[:2]
        if not self._endless:
            middle = _within(posture[0], across, room.length), _within(posture[1], up, room.width)
        highest = max((block.height for block in room.blocks), default=0.0)
        away = highest + 0.5 * _SPARE * max(across, up * ratio) / math.tan(0.5 * OVERHEAD_VIEW)
        X_WC = np.eye(4)
        X_WC[:3, :3] = [[0.0, -1.0, 0.0], [0.0, 0.0, 1.0], [-1.0, 0.0, 0.0]]
        X_WC[:3, 3] = *middle, away
        return self._renderer.draw(
            X_WC, width=width, height=height, view=OVERHEAD_VIEW, near=self.lens.near, far=away + 1.0
        )

    def both(self, posture: tuple[float, float, float], look: Look, t: float) -> Picture:
        """Draw what the robot's camera sees, and the room from above in its corner; arguments as of `draw`."""
        picture, inset = self.draw(posture, look, t), self.above(posture, t, share=_INSET)
        height, width = inset.shape[:2]
        picture[: height + 1, -width - 1 :] = 255
        picture[:height, -width:] = inset
        return picture

    def _stand(self, posture: tuple[float, float, float], t: float) -> None:
        """Put all there is where it stands at a time [s], but for the robot, which is away."""
        place = self._renderer.place
        if self._ceiling >= 0:
            place(self._ceiling, np.eye(4))
        for figure in (self._body, *self._whole):
            place(figure, None)
        if self._endless:
            # By whole pairs of tiles: the floor seems to lie still.
            x, y = (2 * TILE * round(part / (2 * TILE)) for part in posture[:2])
            place(self._floor, upright(x, y, 0.0))
        for figure, thing in self._things:
            if math.isfinite(thing.start) or math.isfinite(thing.end):
                place(figure, np.eye(4) if thing.stands(t) else None)
        for figure, door in self._doors:
            leaf = door.at(t)
            place(figure, upright(leaf.x, leaf.y, leaf.angle))
        for figure, person in self._people:
            place(figure, upright(*person.at(t), 0.0))

    def _tile(self, low: tuple[float, float], high: tuple[float, float], side: float) -> int:
        """Lay a floor of tiles, light and dark in turn."""
        x0, y0 = np.meshgrid(*(np.arange(a, b - 1e-9, side) for a, b in zip(low, high, strict=True)), indexing="ij")
        x1, y1 = np.minimum(x0 + side, high[0]), np.minimum(y0 + side, high[1])
        corners = np.stack([x0, y0, x1, y0, x1, y1, x0, y1], axis=-1).reshape(-1, 2)
        first = 4 * np.arange(len(corners) // 4)[:, None, None]
        faces = (first + np.array([[0, 1, 2], [0, 2, 3]])).reshape(-1, 3)
        odd = np.add.outer(np.arange(len(x0)), np.arange(x0.shape[1])).ravel() % 2
        shade = np.repeat(np.where(odd, _JOINT, 1.0), 2)[:, None]
        ground = np.array(GROUND)
        vertices = np.column_stack([corners, np.zeros(len(corners))])
        return self._renderer.add(LinkShape("floor", vertices, faces, ground, shade * ground))

    def _cover(self) -> None:
        """Put a ceiling on the highest walls, if there are any."""
        walls = [thing.height for thing in self._room.blocks if is_wall(thing)]
        if not walls or max(walls) < 2.0:
            return
        build = Builder("ceiling", _CEILING)
        z = max(walls)
        build.add(box((-0.1, -0.1, z), (self._room.length + 0.1, self._room.width + 0.1, z + 0.02)))
        self._ceiling = self._renderer.add(build.shape())


def jpeg(picture: Picture) -> bytes:
    """A picture by itself, as JPEG, by Pillow."""
    from PIL import Image

    file = io.BytesIO()
    Image.fromarray(picture).save(file, "JPEG", quality=_QUALITY)
    return file.getvalue()


def _within(at: float, span: float, length: float) -> float:
    """The middle nearest to a place of a span that lies within [0, length]."""
    return min(max(at, 0.5 * span), length - 0.5 * span)


def _tile_side(room: Room) -> float:
    """Side of a room's tiles [m]: larger in a hall, so that there aren't too many."""
    side = TILE
    while room.length * room.width > _MOST_TILES * side * side:
        side *= 2.0
    return side
