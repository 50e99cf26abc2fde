"""Mobile robots without their physics: commands, steps, senses, collisions; and the bare one, on exact arcs."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar, Final

import numpy as np
from numpy.typing import ArrayLike
from typing_extensions import override

from robots.base import PERIOD
from robots.mobile.chassis import Chassis, MobileReality, Senses, centre_of
from robots.mobile.drive_train import DriveTrain, Odometry, as_posture
from robots.mobile.floor_plan import FloorPlan
from robots.mobile.sensing import Fix, LaserScanner, OverheadCamera, SonarRing, SonarScan
from robots.onboard.following import SensorWatch
from robots.onboard.laser import LaserScan
from robots.robot import Closing
from robots.rooms import EMPTY, Room, load_room
from vrs.checks import finite, integer_in, number_in, one_of
from vrs.errors import FormatError, InvalidValueError
from vrs.mobile import DriveLimits
from vrs.model import Array, frozen_array

MOST_COLLISIONS = 1000
"""Collisions that are kept."""
_LEAP = 100.0
"""No wheel turns further from one reading to the next [rad]."""
_LONGEST = 1e3
"""No beam is longer [m]."""
_FAR = 1e4
"""No camera sees a robot further away [m, rad]."""
_ROOMS: Final = Path(__file__).parent / "rooms"
PLACES: Final = ("berths", "corridor", "empty", "fig13", "fig13_person", "furnished", "home", "lane", "slalom")
"""Rooms that come with the package."""


def place(name: str) -> Room:
    """Return a room that comes with the package.

    Raises:
        InvalidValueError: If there's none of that name.
    """
    return load_room(_ROOMS / f"{one_of('room', name, PLACES)}.room")


def find_room(what: str, folder: Path = Path()) -> Room:
    """A room by its name, or of a file.

    Args:
        what: A name of `PLACES`, or a file.
        folder: From where a file's name counts.

    Raises:
        InvalidValueError: If there's neither a room of that name nor such a file.
        FormatError: If the file can't be read.
    """
    if what in PLACES:
        return place(what)
    path = folder / what
    if not path.is_file():
        raise InvalidValueError("room", what, f"one of {', '.join(PLACES)}, or a file that's there")
    try:
        return load_room(path)
    except OSError as error:
        raise FormatError(path.name, error.strerror or str(error)) from None


@dataclass(frozen=True, slots=True)
class Collision:
    """The body began to touch something."""

    time: float
    """[s]."""
    thing: str
    """What, by its name in the room."""


class MobileRobot(Closing, ABC):
    """A real mobile robot: told (v, ω), it goes on by steps of `reality.dt` and senses on the way."""

    _STEP: ClassVar[float]
    """Step of a reality that isn't given [s]."""

    def __init__(
        self,
        chassis: Chassis,
        posture: ArrayLike | None = None,
        *,
        room: Room | str | None = None,
        reality: MobileReality | None = None,
        rng: np.random.Generator | int = 0,
        limits: DriveLimits | None = None,
        senses: Senses | None = None,
        period: float = PERIOD,
        since: float = 0.0,
    ) -> None:
        """Put a robot into a room, at rest.

        Args:
            chassis: What it is.
            posture: Middle of the driving axle [m] and heading [rad], (x, y, θ); where the room says, unless given.
            room: A room, or the name of one that comes with the package; only a floor, unless given.
            reality: How real it is; everything, unless given, in steps of 1/240 s, of the bare robot 1/60 s.
            rng: What slips and noise are drawn from, or a seed.
            limits: What commands must keep to; 0.5 m/s, 45 deg/s and 0.52 m/s², unless given.
            senses: What it senses with; everything, unless given.
            period: What `follow` goes on by [s], a multiple of the step.
            since: Time in the room when it's put there [s], to whole steps.

        Raises:
            InvalidValueError: If a value is out of range, or the robot would stand in something.
        """
        self.chassis = chassis
        self.room = room = EMPTY if room is None else place(room) if isinstance(room, str) else room
        self.reality = reality = MobileReality(dt=self._STEP) if reality is None else reality
        self.limits = limits = self.chassis.limits if limits is None else limits
        self.senses = senses = Senses() if senses is None else senses
        start = as_posture("posture", room.start if posture is None else posture)
        rng = np.random.default_rng(rng) if isinstance(rng, int) else rng
        drive_rng, sonar_rng, camera_rng, laser_rng = rng.spawn(4)
        self._train = DriveTrain(self.chassis, reality, limits, drive_rng)
        self._odometry = Odometry(self._train, start)
        self._plan = FloorPlan(room)
        self._steps = 0
        self._since = round(number_in("since", since, 0.0, 1e9, unit=" s") / reality.dt) * reality.dt
        self.truth = start
        """True posture as plain numbers: as `posture`, in a tenth of the time."""
        self.encoders = self._train.read((0.0, 0.0))
        """Last readings of the right and the left encoder: counts, or [rad] if they read exactly."""
        self._sonar: SonarRing | None = None
        self._camera: OverheadCamera | None = None
        self.sonar: SonarScan | None = None
        """Newest scan; None without sonars."""
        self._every_encoder = self._every(senses.encoder_rate)
        self._laser: LaserScanner | None = None
        self._every_sonar = self._every_frame = self._every_sweep = 0
        if senses.sonar is not None:
            self._sonar = SonarRing(self.chassis, senses.sonar, sonar_rng)
            self._every_sonar = self._every(senses.sonar.rate)
        if senses.camera is not None:
            self._camera = OverheadCamera(senses.camera, camera_rng)
            self._every_frame = self._every(senses.camera.rate)
        if senses.laser is not None:
            self._laser = LaserScanner(senses.laser, laser_rng)
            self._every_sweep = self._every(senses.laser.rate)
        every = self._every_encoder, self._every_sonar, self._every_frame, self._every_sweep
        self._ticks = [n for n in every if n]
        self.watch = SensorWatch()
        """What its sensors read is looked at before anybody uses it."""
        self._shafts_read, self._beams_sound = (0.0, 0.0), True
        self._fix: Fix | None = None
        self._looked: Fix | None = None
        self._period_steps = round(finite("period", period) / reality.dt)
        if self._period_steps < 1 or abs(self._period_steps * reality.dt - period) > 1e-9:
            raise InvalidValueError("period", period, f"a multiple of the step, {reality.dt:g} s")
        self._collisions: list[Collision] = []
        self.touching = ""
        """What the body touches now, by its name in the room; empty if nothing."""
        thing = self._overlap(start)
        if thing:
            raise InvalidValueError("posture", start, f"one where the robot stands free, not in the {thing}")
        self._begin()

    @property
    def time(self) -> float:
        """Time in its room [s], which begins when the robot is made unless that's said."""
        return self._since + self._steps * self.reality.dt

    @property
    def posture(self) -> Array:
        """True posture, (3,): middle of the driving axle [m] and heading [rad], not wrapped."""
        return frozen_array(self.truth)

    @property
    def reckoned(self) -> tuple[float, float, float]:
        """Posture by dead reckoning as plain numbers: as `odometry`."""
        return self._odometry.posture

    @property
    @abstractmethod
    def motion(self) -> tuple[float, float]:
        """True speed v of the middle of the axle, forward [m/s], and ω [rad/s]."""

    @property
    def odometry(self) -> Array:
        """Posture by dead reckoning from the encoders, (3,)."""
        return frozen_array(self._odometry.posture)

    @property
    def camera(self) -> Fix | None:
        """Newest posture that the overhead camera has told; None before the first, or without a camera."""
        fix = None if self._camera is None else self._camera.newest(self.time)
        if fix is not self._looked and fix is not None:
            self._looked = fix
            if self.watch.see("camera", fix.posture, -_FAR, _FAR, now=self.time):
                self._fix = fix
        return self._fix

    @property
    def laser(self) -> LaserScan | None:
        """Newest whole sweep of the laser scanner; None before the first, or without a scanner."""
        return None if self._laser is None else self._laser.newest

    @property
    def sonar_angles(self) -> Array:
        """Where each sonar looks [rad], (16,), in the robot's frame; empty without sonars."""
        return frozen_array([]) if self._sonar is None else self._sonar.angles

    @property
    def sonar_places(self) -> Array:
        """Where each sonar sits [m], (16, 2), in the robot's frame; (0, 2) without sonars."""
        return frozen_array(np.zeros((0, 2))) if self._sonar is None else self._sonar.places

    @property
    def collisions(self) -> tuple[Collision, ...]:
        """What the body has run into, or who into it; the first thousand."""
        return tuple(self._collisions)

    def drive(self, v: float, w: float, steps: int = 1) -> None:
        """Go on by steps with a command.

        Calls with the same command one after the other do what one call with all their steps does, to the last bit.

        Args:
            v: Linear speed [m/s].
            w: Angular speed [rad/s].
            steps: How many steps of `reality.dt`, in [0, 1,000,000].

        Raises:
            InvalidValueError: If the command passes a limit or isn't finite, or the steps aren't such a number; the
                robot hasn't moved then.
            WorldClosedError: If it's a closed PyBullet robot.
        """
        integer_in("steps", steps, 0, 1_000_000)
        self._ready()
        self._train.command(v, w)
        if self._steps == 0:
            self._sense()
        last = self._steps + steps
        while self._steps < last:
            n = min(last - self._steps, *(every - self._steps % every for every in self._ticks))
            if self._laser is not None and self._laser.sweeping:
                self._sweep(self._laser)
            else:
                self._advance(n)
            self._sense()

    def carry(self, posture: ArrayLike) -> None:
        """Put the robot somewhere else, as somebody would who lifts it: its wheels don't turn.

        Raises:
            InvalidValueError: If the robot would stand in something, or the posture isn't one.
            WorldClosedError: If it's a closed PyBullet robot.
        """
        self._ready()
        there = as_posture("posture", posture)
        thing = self._overlap(there)
        if thing:
            raise InvalidValueError("posture", there, f"one where the robot stands free, not in the {thing}")
        self._put(there)

    def follow(self, v: float, w: float) -> None:
        """Go on by one control period; arguments and errors as of `drive`."""
        self.drive(v, w, self._period_steps)

    @abstractmethod
    def _begin(self) -> None:
        """Make what the robot needs to go on, from `truth`."""

    @abstractmethod
    def _advance(self, n: int) -> None:
        """Go n steps on, no sense being due before their end; counts them in `_steps`, sets `truth`."""

    @abstractmethod
    def _put(self, posture: tuple[float, float, float]) -> None:
        """Be somewhere else, at rest."""

    @abstractmethod
    def shafts(self) -> tuple[float, float]:
        """Angles that the motors' shafts have turned by, at the wheel's side of the gear [rad]."""

    @abstractmethod
    def distances(self, origins: Array, directions: Array, reach: float, height: float) -> Array:
        """How far level rays go now at a height [m], inf where nothing is within reach."""

    def _ready(self) -> None:
        """Raise if the robot can't be used any more."""
        return

    def _every(self, rate: float) -> int:
        return max(1, round(1.0 / (rate * self.reality.dt)))

    def _sense(self) -> None:
        """Read what is due at this step."""
        if self._steps % self._every_encoder == 0:
            self._read_shafts()
            if self._steps:
                self._train.wander(self._every_encoder * self.reality.dt)
        if self._camera is not None and self._steps % self._every_frame == 0:
            self._camera.look(self.truth, self.time)
        if self._sonar is not None and self._steps % self._every_sonar == 0:
            origins, directions = self._sonar.rays(self.truth)
            found = self.distances(origins, directions, self._sonar.reach, self.chassis.sonar_height)
            if self._sees("sonar ring", found, len(origins)):
                self.sonar = self._sonar.scan(found, self.time)
        if self._laser is not None and self._steps % self._every_sweep == 0:
            self._laser.begin(self.time)
            self._go_on(self._laser, self.truth, self.time)

    def _sweep(self, laser: LaserScanner) -> None:
        """Go one step on while the laser sweeps."""
        before, begun = self.truth, self.time
        self._advance(1)
        self._go_on(laser, before, begun)

    def _go_on(self, laser: LaserScanner, before: tuple[float, float, float], begun: float) -> None:
        """Let the laser sweep from a posture and time on; a sweep with a beam that isn't sound is left out."""
        known = laser.newest
        laser.go_on(before, self.truth, (begun, self.time), self._cast_laser)
        if laser.newest is not known:
            if not self._beams_sound:
                laser.newest = known
            self._beams_sound = True

    def _read_shafts(self) -> None:
        """Read the encoders; what can't be is left out."""
        shafts, sound = self.shafts(), True
        for side, angle, before in zip(("right", "left"), shafts, self._shafts_read, strict=True):
            leap = before - _LEAP, before + _LEAP
            sound &= self.watch.see(f"{side} wheel's encoder", angle, *leap, now=self.time)
        if sound:
            self._shafts_read = shafts
            self.encoders = self._train.read(shafts)
            self._odometry.update(self.encoders)

    def _sees(self, sensor: str, distances: Array, count: int) -> bool:
        """Whether so many distances are sound; infinite ones met nothing."""
        if np.shape(distances) != (count,):
            return self.watch.note(sensor, f"numbers of shape {np.shape(distances)}, not ({count},)", now=self.time)
        return self.watch.see(sensor, distances, 0.0, _LONGEST, now=self.time, endless=True)

    def _cast_laser(self, origins: Array, directions: Array) -> Array:
        model = self.senses.laser
        assert model is not None
        found = self.distances(origins, directions, model.reach, model.height)
        if self._beams_sound and self._sees("laser scanner", found, len(origins)):
            return found
        self._beams_sound = False
        return np.full(len(origins), np.inf)

    def _overlap(self, posture: tuple[float, float, float]) -> str:
        """What the body's outline overlaps at a posture."""
        body = self.chassis
        x, y, theta = centre_of(posture, body.centre_x)
        return self._plan.touched(x, y, theta, (body.length / 2, body.width / 2), self.time)

    def _touch(self, thing: str) -> None:
        """Note what the body touches; a touch that goes on is one collision."""
        if thing and thing != self.touching and len(self._collisions) < MOST_COLLISIONS:
            self._collisions.append(Collision(self.time, thing))
        self.touching = thing


_CHECKS = 60.0
"""How often overlaps are looked for near a thing [Hz]: the robot goes 8 mm in between."""


class BareBody(MobileRobot):
    """A robot on wheels that always roll: ramps, lag, slip and wrong radii, but neither mass nor friction.

    What would overlap a thing doesn't happen: the robot goes back to where it was free 1/60 s before, while its
    wheels turn. Friction, torques and payload of its reality mean nothing to it.
    """

    _STEP = 1 / 60

    def _begin(self) -> None:
        self._angle_right = self._angle_left = 0.0
        self._speed = (0.0, 0.0)
        self._every_check = self._every(_CHECKS)
        self._free_until = 0
        self._free = self.truth
        self._seen: dict[float, FloorPlan] = {}

    @property
    def motion(self) -> tuple[float, float]:
        """True speed v of the middle of the axle, forward [m/s], and ω [rad/s]."""
        return self._speed

    def _advance(self, n: int) -> None:
        every = self._every_check
        while n:
            # Up to the next check, or to the first one after which something may be near.
            first = max(self._steps + 1, self._free_until)
            part = min(n, -(-first // every) * every - self._steps)
            self._roll(part)
            if self._steps % every == 0:
                if self._steps >= self._free_until:
                    self._look_out()
                self._free = self.truth
            n -= part

    def _roll(self, n: int) -> None:
        train, dt = self._train, self.reality.dt
        slip_right, slip_left = train.slips
        k_right, k_left = train.radii[0] * (1 - slip_right), train.radii[1] * (1 - slip_left)
        base, step, cos, sin = train.base, train.step, math.cos, math.sin
        x, y, theta = self.truth
        angle_right, angle_left = self._angle_right, self._angle_left
        v = w = 0.0
        for _ in range(n):
            right, left = step()
            angle_right += right * dt
            angle_left += left * dt
            a, b = k_right * right, k_left * left
            v, w = 0.5 * (a + b), (a - b) / base
            # An exact arc, as `arc` has it, without the calls.
            half = 0.5 * w * dt
            chord = v * dt * (sin(half) / half) if abs(half) > 1e-8 else v * dt
            x += chord * cos(theta + half)
            y += chord * sin(theta + half)
            theta += w * dt
        self._angle_right, self._angle_left = angle_right, angle_left
        self.truth, self._speed = (x, y, theta), (v, w)
        self._steps += n

    def _look_out(self) -> None:
        """Stay where the way leads into something; or work out how long nothing can be met."""
        body = self.chassis
        x, y, _ = centre_of(self.truth, body.centre_x)
        space = self._plan.clearance(x, y, self.time) - body.reach
        if space > 0:
            self._touch("")
            # Slip and wrong wheels add a few percent to the speeds; half as much again is beyond any of them.
            fastest = 1.5 * (self.limits.v_max + abs(body.centre_x) * self.limits.w_max) + self._plan.fastest
            changes = min((change for change in self._plan.changes if change > self.time), default=math.inf)
            steps = min(space / fastest, changes - self.time) / self.reality.dt
            self._free_until = self._steps + int(min(steps, 1e9))
            return
        thing = self._overlap(self.truth)
        self._touch(thing)
        if thing:
            self.truth = self._free
            self._speed = 0.0, 0.0

    @override
    def shafts(self) -> tuple[float, float]:
        return self._angle_right, self._angle_left

    def _put(self, posture: tuple[float, float, float]) -> None:
        self.truth = self._free = posture
        self._speed, self._free_until = (0.0, 0.0), 0

    @override
    def distances(self, origins: Array, directions: Array, reach: float, height: float) -> Array:
        if height not in self._seen:
            self._seen[height] = FloorPlan(self.room, height)
        return self._seen[height].cast(origins, directions, self.time, reach)
