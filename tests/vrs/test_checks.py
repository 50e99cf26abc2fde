"""Ranges stand in annotations; one validator holds the fields to them."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Annotated

import msgspec
import numpy as np
import pytest

from vrs.checks import at_least, check_fields, positive, validated, within
from vrs.errors import InvalidValueError


@dataclass(frozen=True, slots=True)
@validated
class Pace:
    period: Annotated[float, within(0.1, 10.0, "s")] = 1.0
    count: Annotated[int, within(1, 5)] = 1
    limit: Annotated[float, within(0.0, 1.0)] | None = None
    smooth: bool = True
    gain: Annotated[float, positive()] = 1.0
    wait: Annotated[float, at_least(0.0, "finite seconds ≥ 0")] = 0.0
    steps: Annotated[tuple[int, ...], msgspec.Meta(min_length=1, max_length=3)] = (1,)
    name: str = ""
    notes: list[str] = field(default_factory=list)

    def __post_init__(self):
        self.notes.append("own check ran")


@dataclass(frozen=True, slots=True)
class Hurry(Pace):
    factor: Annotated[float, within(1.0, 2.0)] = 1.0


def test_what_is_in_range_is_kept_numbers_as_floats():
    pace = Pace(period=3, count=5, limit=1, smooth=False)
    assert (pace.period, pace.count, pace.limit) == (3.0, 5, 1.0)
    assert type(pace.period) is float
    assert type(pace.limit) is float
    assert type(Pace(period=np.float32(0.5)).period) is float
    assert pace.notes == ["own check ran"]
    assert Pace(period=0.1).period == 0.1
    assert Pace(period=10.0).period == 10.0
    assert (Pace(gain=5e-324).gain, Pace(wait=0).wait, Pace(steps=(1, 2, 3)).steps) == (5e-324, 0.0, (1, 2, 3))


@pytest.mark.parametrize(
    ("name", "value", "allowed"),
    [
        ("period", 0.0999, r"in \[0.1, 10\] s"),
        ("period", 10.001, r"in \[0.1, 10\] s"),
        ("period", math.nan, r"in \[0.1, 10\] s"),
        ("period", None, r"in \[0.1, 10\] s"),
        ("period", True, r"in \[0.1, 10\] s"),
        ("period", "1", r"in \[0.1, 10\] s"),
        ("count", 0, r"an integer in \[1, 5\]"),
        ("count", 6, r"an integer in \[1, 5\]"),
        ("count", 2.0, r"an integer in \[1, 5\]"),
        ("count", True, r"an integer in \[1, 5\]"),
        ("limit", -0.1, r"a number in \[0, 1\]"),
        ("smooth", 1, "True or False"),
        ("smooth", None, "True or False"),
        ("gain", 0, "a positive number"),
        ("gain", math.inf, "a positive number"),
        ("wait", -1e-9, "finite seconds ≥ 0"),
        ("wait", math.nan, "finite seconds ≥ 0"),
        ("steps", (), "1 to 3"),
        ("steps", (1, 2, 3, 4), "1 to 3"),
    ],
)
def test_what_is_not_is_refused_with_what_is_allowed(name, value, allowed):
    with pytest.raises(InvalidValueError, match=f"{name}.*{allowed}"):
        Pace(**{name: value})


def test_a_subclass_is_held_to_its_own_ranges_too():
    assert Hurry(factor=2).factor == 2.0
    with pytest.raises(InvalidValueError, match="factor"):
        Hurry(factor=2.5)
    with pytest.raises(InvalidValueError, match="period"):
        Hurry(period=0.0)


class Place(msgspec.Struct, frozen=True):
    x: Annotated[float, within(-10.0, 10.0, "m")]
    heading: Annotated[float, within(-4.0, 4.0)] | None = None

    def __post_init__(self):
        check_fields(self)


def test_a_struct_is_held_to_its_ranges_made_and_read():
    made = Place(2)
    assert (type(made.x), made) == (float, Place(2.0))
    assert msgspec.json.decode(b'{"x": 2}', type=Place) == made
    with pytest.raises(InvalidValueError, match=r"x .*a number in \[-10, 10\] m"):
        Place(10.5)
    with pytest.raises(InvalidValueError, match="heading"):
        Place(1.0, math.nan)
    with pytest.raises(msgspec.ValidationError, match="x"):
        msgspec.json.decode(b'{"x": 10.5}', type=Place)
