"""A robot's microphone: what it hears of the sounds of a room, by distance and by the walls between.

A sound falls by 6 dB each time the distance doubles, as that of a point source in the open does. Each wall and leaf
of a door on the straight line from it takes off what the mass law for a diffuse field says. There's no echo, and
nothing bends around corners.

Source: Beranek, Vér, *Noise and Vibration Control Engineering*, 1992: spherical spreading, and the field-incidence
mass law, R = 20 lg(f m'') − 47 dB, with f in Hz and m'' in kg/m².
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from robots.mobile.floor_plan import FloorPlan
from robots.rooms import Room, Sound, is_wall
from vrs.model import Array

REFERENCE: Final = 20e-6
"""Sound pressure at 0 dB, root mean square [Pa]."""
SPEED: Final = 343.0
"""Of sound [m/s]."""
NEAREST: Final = 0.1
"""A sound doesn't get louder nearer than that [m]."""
DENSITY: Final = 250.0
"""Of walls and leaves [kg/m³], an assumption: boards on studs, so that 0.1 m has 25 kg/m²."""
SWELL: Final = 1.0
"""A tone swells and fades so often [1/s], as a telephone's; its level is that of whole periods."""
TOLD_RATE: Final = 8_000
"""Samples a second of a thin client's microphone, of 16 bits. Chosen."""
TOLD: Final = 320
"""Samples that it tells at once: each is told twice at 20 ms, so a lost packet takes none along."""
TOLD_MODULUS: Final = 32_768
"""Before them it tells how many it has heard, modulo that."""
FULL: Final = 85.0
"""Level of the sine that reaches the largest sample [dB]: speech at 1 m has 25 dB below that."""


def transmission_loss(pitch: float, thickness: float) -> float:
    """What a wall takes off a tone [dB].

    Args:
        pitch: [Hz].
        thickness: Of the wall [m].
    """
    return max(20.0 * math.log10(pitch * DENSITY * thickness) - 47.0, 0.0)


class Microphone:
    """Hears a room at the places and times that it's given."""

    def __init__(self, room: Room, height: float) -> None:
        """Take a room.

        Args:
            room: Where it is.
            height: Of the microphone [m]; walls and doors that aren't so high are in no sound's way.
        """
        walls = tuple(block for block in room.blocks if is_wall(block))
        self._plan = FloorPlan(Room(room.name, room.length, room.width, blocks=walls, doors=room.doors), height)
        self.sounds = room.sounds
        """What there's to hear."""

    def levels(self, x: float, y: float, t: float) -> Array:
        """Return how loud each of `sounds` is at a place.

        Args:
            x: [m].
            y: [m].
            t: Time in the room [s].

        Returns:
            Sound pressure levels [dB, re 20 µPa], (n,); −inf of what is silent then.
        """
        return np.array([self._level(sound, x, y, t) for sound in self.sounds])

    def level(self, x: float, y: float, t: float) -> float:
        """Return how loud it is at a place [dB, re 20 µPa], −inf in silence: powers add. Arguments as `levels`."""
        power = float((10.0 ** (0.1 * self.levels(x, y, t))).sum())
        return 10.0 * math.log10(power) if power else -math.inf

    def _level(self, sound: Sound, x: float, y: float, t: float) -> float:
        if not sound.start <= t < sound.end:
            return -math.inf
        distance = math.hypot(x - sound.x, y - sound.y)
        level = sound.level - 20.0 * math.log10(max(distance, NEAREST))
        if distance > NEAREST:
            walls = self._plan.crossed((sound.x, sound.y), (x, y), t)
            level -= sum(transmission_loss(sound.pitch, thickness) for thickness in walls.tolist())
        return level

    def hear(self, start: tuple[float, float, float], end: tuple[float, float, float], times: Array) -> Array:
        """Return what is heard on the way from one place to another.

        Distances and levels go straight from those of one place to those of the other, so nothing clicks where one
        way ends and the next begins, and who comes nearer hears a tone a little higher.

        Args:
            start: x, y [m] and the time in the room [s] before the first sample; what sounds and how doors stand.
            end: The same at the last sample.
            times: Of the samples [s], (k,), ascending evenly; the clock that the tones keep.

        Returns:
            Sound pressure [Pa], (k,).
        """
        share = np.arange(1, len(times) + 1) / len(times)
        levels = [REFERENCE * 10.0 ** (0.05 * self.levels(*place)) for place in (start, end)]
        heard = np.zeros(len(times))
        for sound, p_0, p_1 in zip(self.sounds, *levels, strict=True):
            if p_0 or p_1:
                near, far = (math.hypot(x - sound.x, y - sound.y) for x, y, _ in (start, end))
                left = times - (near + share * (far - near)) / SPEED
                heard += (p_0 + share * (p_1 - p_0)) * _tone(sound.pitch, left)
        return heard


def _tone(pitch: float, t: Array) -> Array:
    """A tone that swells and fades, of root mean square 1 over a whole swell, at times [s], (k,)."""
    swell = 1.0 - np.cos(2.0 * np.pi * SWELL * t)
    return np.asarray(swell * np.sin(2.0 * np.pi * pitch * t) / math.sqrt(0.75))


def samples_of(pressure: Array) -> NDArray[np.int16]:
    """Return sound pressure [Pa] as samples, the largest at the peaks of a sine of `FULL`; what's louder is cut."""
    largest = REFERENCE * 10.0 ** (0.05 * FULL) * math.sqrt(2.0)
    return np.asarray(np.clip(np.round(32767.0 / largest * pressure), -32767, 32767), dtype=np.int16)
