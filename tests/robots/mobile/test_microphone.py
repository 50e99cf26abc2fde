"""What a microphone hears falls with the distance, and by the walls between, as formulas of their own have it."""

from __future__ import annotations

import math

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st
from shapely.affinity import rotate, translate

from robots.mobile.microphone import (
    DENSITY,
    FULL,
    NEAREST,
    REFERENCE,
    SPEED,
    Microphone,
    samples_of,
    transmission_loss,
)
from robots.mobile.robot import place
from robots.rooms import Room, is_wall, read_room

OPEN = read_room("room 1\nsize 20 20\nsound 2 10 level=60 pitch=440\n")
RATE = 48_000
SECOND = np.arange(1, RATE + 1) / RATE


def measured(room: Room, x: float, y: float, t: float = 0.0) -> float:
    """Level of a second of what's heard [dB]: of the samples themselves, by their root mean square."""
    heard = Microphone(room, 0.7).hear((x, y, t), (x, y, t), SECOND)
    return 20.0 * math.log10(math.sqrt(float((heard**2).mean())) / 20e-6)


@pytest.mark.parametrize("distance", [0.5, 1.0, 2.0, 4.0, 8.0, 16.0])
def test_in_the_open_the_same_power_goes_through_a_larger_sphere(distance: float) -> None:
    # At 1 m the intensity is p²/ρc; what passes a sphere around the source is the same for all spheres.
    power = (20e-6 * 10 ** (60 / 20)) ** 2 * 4 * math.pi * 1.0**2
    pressure = math.sqrt(power / (4 * math.pi * distance**2))
    expected = 20 * math.log10(pressure / 20e-6)
    assert measured(OPEN, 2.0 + distance, 10.0) == pytest.approx(expected, abs=0.05)
    assert Microphone(OPEN, 0.7).level(2.0 + distance, 10.0, 0.0) == pytest.approx(expected, abs=1e-9)


def test_a_sound_is_not_louder_nearer_than_it_is_large() -> None:
    ear = Microphone(OPEN, 0.7)
    assert ear.level(2.0, 10.0, 0.0) == ear.level(2.0 + NEAREST, 10.0, 0.0) == pytest.approx(80.0)


@pytest.mark.parametrize("pitch", [125.0, 500.0, 2000.0])
@pytest.mark.parametrize("thickness", [0.05, 0.1, 0.3])
def test_a_wall_takes_off_what_its_impedance_says(pitch: float, thickness: float) -> None:
    # A limp wall of m'' between air on both sides: at right angles 10 lg(1 + (ω m'' / 2 ρ c)²), and in a diffuse
    # field 5 dB less. Air at 20 °C: ρ c = 413 Pa s/m.
    room = read_room(
        f"room 1\nsize 20 20\nwall 5 0  5 20 thickness={thickness}\nsound 2 10 level=60 pitch={pitch}\n"
    )
    surface = 250.0 * thickness
    expected = 10 * math.log10(1 + (2 * math.pi * pitch * surface / (2 * 413.0)) ** 2) - 5.0
    without = read_room(f"room 1\nsize 20 20\nsound 2 10 level=60 pitch={pitch}\n")
    taken = measured(without, 8.0, 10.0) - measured(room, 8.0, 10.0)
    assert taken == pytest.approx(expected, abs=0.5)
    assert DENSITY == 250.0


def between(room: Room, x: float, y: float) -> int:
    """Walls on the way to the first sound, as polygons that the line meets."""
    way = shapely.LineString([(room.sounds[0].x, room.sounds[0].y), (x, y)])
    found = 0
    for wall in filter(is_wall, room.blocks):
        half_x, half_y = wall.length / 2, wall.width / 2
        turned = rotate(shapely.box(-half_x, -half_y, half_x, half_y), wall.angle, (0, 0), use_radians=True)
        found += translate(turned, wall.x, wall.y).intersects(way)
    return found


@given(st.floats(0.3, 8.7), st.floats(0.3, 6.7))
def test_at_home_each_wall_on_the_way_counts_once(x: float, y: float) -> None:
    room = place("home")
    without_doors = Room(room.name, room.length, room.width, blocks=room.blocks, sounds=room.sounds)
    sound = room.sounds[0]
    level = Microphone(without_doors, 0.7).level(x, y, 0.0)
    free = sound.level - 20 * math.log10(max(math.hypot(x - sound.x, y - sound.y), NEAREST))
    walls = (free - level) / transmission_loss(sound.pitch, 0.1)
    assert walls == pytest.approx(between(without_doors, x, y), abs=1e-9)


def test_a_door_that_opens_lets_it_through_and_furniture_and_low_walls_always_do() -> None:
    room = read_room(
        "room 1\nsize 20 20\nwall 5 0  5 9.5\nwall 5 10.5  5 20\nwall 6 0  6 20 height=0.5\n"
        "box 7 10  1 1 height=2\ndoor 5 9.5  5 10.5 sliding 0,0 10,0 12,1\nsound 2 10 level=60 pitch=1000\n"
    )
    ear = Microphone(room, 0.7)
    shut, wide = ear.level(9.0, 10.0, 5.0), ear.level(9.0, 10.0, 20.0)
    assert wide == pytest.approx(60 - 20 * math.log10(7.0))
    assert wide - shut == pytest.approx(20 * math.log10(1000 * 250 * 0.04) - 47)
    assert Microphone(room, 0.3).level(9.0, 10.0, 20.0) < wide


def test_powers_add_and_what_is_over_is_silent() -> None:
    room = read_room("room 1\nsize 9 9\nsound 4 3 level=60\nsound 2 5 level=60 pitch=700 until=5\n")
    ear = Microphone(room, 0.7)
    one = 60 - 20 * math.log10(2.0)
    assert ear.level(4.0, 5.0, 0.0) == pytest.approx(one + 10 * math.log10(2.0))
    assert ear.level(4.0, 5.0, 5.0) == pytest.approx(one)
    assert measured(room, 4.0, 5.0) == pytest.approx(one + 10 * math.log10(2.0), abs=0.05)
    silent = Microphone(read_room("room 1\nsize 9 9\n"), 0.7)
    assert silent.level(1.0, 1.0, 0.0) == -math.inf
    assert not silent.hear((1.0, 1.0, 0.0), (1.0, 1.0, 0.0), SECOND).any()


def test_who_drives_up_hears_it_louder_and_a_little_higher_and_no_piece_clicks() -> None:
    ear, v = Microphone(OPEN, 0.7), 10.0
    size = 960
    at = [(14.0 - v * k * size / RATE, 10.0, 0.0) for k in range(51)]
    heard = np.concatenate([
        ear.hear(at[k], at[k + 1], (k * size + np.arange(1, size + 1)) / RATE) for k in range(50)
    ])  # fmt: skip
    # As far as the envelope, a second of it, lets one see: the strongest line of the spectrum.
    spectrum = np.abs(np.fft.rfft(heard * np.hanning(len(heard)), 8 * len(heard)))
    pitch = np.argmax(spectrum) * RATE / (8 * len(heard))
    assert pitch == pytest.approx(440.0 * (1 + v / SPEED), abs=0.5)
    assert pitch > 440.0 + 10.0
    steps = np.abs(np.diff(heard))
    edges = steps[size - 1 :: size]
    assert edges.max() <= 1.05 * steps.max()


def test_samples_are_in_proportion_and_what_is_too_loud_is_cut() -> None:
    full = REFERENCE * 10 ** (FULL / 20) * math.sqrt(2)
    assert samples_of(np.array([0.0, full / 2, full, -3 * full])).tolist() == [0, 16384, 32767, -32767]
