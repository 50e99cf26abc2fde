"""A service of a thin client: when somebody comes near it, it takes a picture and tells a story.

The robot has no brain: the service runs at the local system, and knows what the robot's sensors say.

Source: Kim, Suh, Kim, Oh, section IV-A: services over the Internet, multimedia with motion. Which, is chosen here.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from interfaces.rsp.devices import (
    CommandDevice,
    EffectorDevice,
    MemoryEventDevice,
    ModuleDevice,
    SensorDevice,
    StreamDevice,
)
from interfaces.rsp.errors import DeadlineError
from interfaces.rsp.host import FRAGMENT_TIME
from interfaces.rsp.middleware import Middleware
from robots.mobile.microphone import TOLD_MODULUS
from vrs.model import Array

STORY: Final = (
    "Once there was a small robot that had no brain at all.",
    "Its thoughts lived in a house on the other side of the town, and came to it by radio, fifty times a second.",
    "One day there was a storm, and half of the thoughts were lost on the way.",
    "The little robot kept still, held up its arms as it had been told last, and waited.",
    "And when the next thought came, it went on as if nothing had happened.",
    "That is why it is so good at listening. Thank you for coming by.",
)
"""What is told unless something else is."""
NEAR: Final = 0.6
"""Who is nearer than that has come [m]."""
_CLOSER: Final = 0.12
"""By so much nearer than what has been standing there [m]."""
_WINDOW: Final = 0.5
"""Over so long a sensor's median counts: single echoes are lost [s]."""
_GONE: Final = 2.0
"""Who hasn't been near for so long has gone [s]."""
_MOVED: Final = (0.03, 0.1)
"""A robot that has moved by more, or turned, looks at its surroundings anew [m, rad]."""


class Visitors:
    """Says when somebody comes near a robot that stands, by what its proximity sensors say; it's given the time.

    What has been standing there isn't somebody, a wall beside it least of all.
    """

    def __init__(self) -> None:
        """Look at the surroundings first."""
        self.here = False
        """Whether somebody is near."""
        self._readings: deque[tuple[float, Array]] = deque()
        self._standing: Array | None = None
        self._place: Array | None = None
        self._near = -math.inf

    def look(self, ranges: ArrayLike, place: Sequence[float], *, now: float) -> int | None:
        """Take what the sensors say.

        Args:
            ranges: What each sees [m], (k,).
            place: Where the robot is, x, y [m], θ [rad].
            now: [s].

        Returns:
            The sensor before which somebody has come just now; None otherwise.
        """
        at = np.array(place)
        if self._place is None or (np.abs(at - self._place) > [_MOVED[0], _MOVED[0], _MOVED[1]]).any():
            self._place, self._standing = at, None
            self._readings.clear()
        self._readings.append((now, np.array(ranges, dtype=np.float64)))
        if now - self._readings[0][0] < _WINDOW:
            return None
        while now - self._readings[1][0] >= _WINDOW:
            self._readings.popleft()
        steady = np.median([reading for _, reading in self._readings], axis=0)
        # What goes away makes room: then somebody may come there.
        self._standing = steady if self._standing is None else np.maximum(self._standing, steady)
        closer = (steady < NEAR) & (steady < self._standing - _CLOSER)
        before = self.here
        if closer.any():
            self._near = now
        self.here = now - self._near < _GONE
        return int(np.argmin(np.where(closer, steady, np.inf))) if self.here and not before else None


class Hearing:
    """Puts together what the microphone tells: each sample once, silence for what was lost."""

    def __init__(self) -> None:
        """Begin with what comes first."""
        self._count: int | None = None

    def take(self, values: Sequence[int]) -> NDArray[np.int16]:
        """Return the samples of what the sensor says that are new, (m,)."""
        count, told = values[0], np.array(values[1:], dtype=np.int16)
        new = len(told) if self._count is None else (count - self._count) % TOLD_MODULUS
        self._count = count
        lost = np.zeros(max(new - len(told), 0), dtype=np.int16)
        return np.concatenate([lost, told[len(told) - min(new, len(told)) :]])


class StoryTeller:
    """The service, on a robot whose model has the devices of `story.xmi`; call `turn` now and then."""

    def __init__(self, middleware: Middleware, sound: bytes, rate: int) -> None:
        """Look and listen from now on.

        Args:
            middleware: Of the robot.
            sound: The story as the speaker plays it, 16 bits a sample; empty where nothing can speak.
            rate: Samples a second of it.
        """
        self.proximity = SensorDevice[int](middleware, "proximity")
        self.position = SensorDevice[int](middleware, "position")
        self._speaker, self._lip = StreamDevice(middleware, "speaker"), EffectorDevice[int](middleware, "lip")
        self._look = CommandDevice[int](middleware, "look")
        self._sound, self._loudness = sound, _loudness(sound, rate)
        self._visitors, self._hearing = Visitors(), Hearing()
        self.pictures: deque[bytes] = deque(maxlen=16)
        """JPEGs of who came, that nobody has taken yet."""
        self.heard: deque[NDArray[np.int16]] = deque(maxlen=60 * 50)
        """What the microphone heard, in pieces, of the last minute at least."""
        self.told = 0
        """How often the story was begun."""
        self._began = -math.inf
        MemoryEventDevice(middleware, "picture").add_listener(self.pictures.append)
        microphone = SensorDevice[int](middleware, "microphone")
        microphone.add_listener(lambda values: self.heard.append(self._hearing.take(values)))
        ModuleDevice(middleware, "senses").set_active(True)

    @property
    def lasts(self) -> float:
        """How long the story takes [s]."""
        return FRAGMENT_TIME * len(self._loudness)

    def turn(self, *, now: float) -> tuple[float, float] | None:
        """Go on, as of now [s].

        Returns:
            If somebody has come just now, how far away they are [m] and where, to the left [rad]; None otherwise.
        """
        try:
            ranges = [0.001 * value for value in self.proximity.read_all()]
            x, y, angle = (1e-5 * value for value in self.position.read_all())
        except DeadlineError:
            return None
        sensor = self._visitors.look(ranges, (x, y, angle), now=now)
        telling = now < self._began + self.lasts
        if sensor is not None and not telling:
            self._look.send(1)
            self._speaker.play(self._sound)
            self._began, self.told = now, self.told + 1
        passed = int((now - self._began) / FRAGMENT_TIME) if now < self._began + self.lasts else len(self._loudness)
        open_by = self._loudness[passed] if passed < len(self._loudness) else 0
        self._lip.write_all((open_by,) * 3)
        if sensor is None:
            return None
        bearing = math.remainder(2.0 * math.pi * sensor / len(ranges), 2.0 * math.pi)
        return ranges[sensor], bearing


def _loudness(sound: bytes, rate: int) -> list[int]:
    """How far the lip is open during each fragment, 0 to 255."""
    samples = np.frombuffer(sound, dtype="<i2", count=len(sound) // 2).astype(np.float64)
    size = round(rate * FRAGMENT_TIME)
    padded = np.concatenate([samples, np.zeros(-len(samples) % size)]).reshape(-1, size)
    level = np.sqrt((padded**2).mean(axis=1)) if len(padded) else np.zeros(0)
    return [round(255.0 * part / max(float(level.max()), 1.0)) for part in level.tolist()]


def playable(samples: NDArray[np.int16], rate: int, wanted: int) -> bytes:
    """Samples of any rate [1/s], (k,), as a speaker plays them that wants another one [1/s]."""
    times = np.arange(math.ceil(len(samples) * wanted / rate)) * rate / wanted
    return np.interp(times, np.arange(len(samples)), samples).astype("<i2").tobytes()
