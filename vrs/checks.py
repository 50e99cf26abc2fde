"""Checks of values that many parts share, and of text files from anybody: of a bounded size, and text indeed."""

from __future__ import annotations

import functools
import math
import sys
from collections.abc import Callable, Iterable
from dataclasses import fields
from enum import StrEnum
from pathlib import Path
from types import NoneType
from typing import Annotated, Any, TypeAlias, TypeVar, get_args, get_origin, get_type_hints

import msgspec
import numpy as np
from numpy.typing import ArrayLike

from vrs.errors import FormatError, InvalidValueError
from vrs.model import Array, frozen_array
from vrs.record import LARGEST

_ClassT = TypeVar("_ClassT", bound=type)
_WordT = TypeVar("_WordT", bound=StrEnum)
_Converters: TypeAlias = tuple[tuple[str, Callable[[object], object]], ...]

SMALLEST = sys.float_info.min
"""Size of the smallest number besides 0 [2.2e-308]; what is divided by a subnormal one overflows."""


def finite(name: str, value: object, allowed: str = "a finite number") -> float:
    """Return value as a float.

    Raises:
        InvalidValueError: If value is not a real number, or NaN or infinite.
    """
    if type(value) is float and math.isfinite(value):
        return value
    if isinstance(value, bool) or not isinstance(value, (int, float, np.integer, np.floating)):
        raise InvalidValueError(name, value, allowed)
    try:
        number = float(value)
    except OverflowError:
        raise InvalidValueError(name, value, allowed) from None
    if not math.isfinite(number):
        raise InvalidValueError(name, value, allowed)
    return number


def not_before(name: str, value: object, earliest: float, allowed: str) -> float:
    """Return a time that doesn't run back [s].

    Args:
        name: What it's called, for the message.
        value: To be checked.
        earliest: The latest so far [s].
        allowed: What is allowed, in the message; `{}` in it stands for the latest so far.

    Raises:
        InvalidValueError: If it isn't finite, or lies before the earliest.
    """
    now = finite(name, value, "finite seconds")
    if now < earliest:
        raise InvalidValueError(name, now, allowed.format(earliest))
    return now


def normal(value: float) -> float:
    """The same number; 0 where it's subnormal."""
    return 0.0 if 0.0 < abs(value) < SMALLEST else value


def finite_array(name: str, value: ArrayLike, shape: tuple[int, ...] | None, allowed: str) -> Array:
    """Copy value into a read-only array of finite numbers of the given shape.

    Raises:
        InvalidValueError: If it holds anything else.
    """
    try:
        raw = np.asarray(value)
    except ValueError:
        raise InvalidValueError(name, value, allowed) from None
    if raw.dtype.kind not in "iuf" or (shape is not None and raw.shape != shape):
        raise InvalidValueError(name, value, allowed)
    array = frozen_array(raw)
    if not np.isfinite(array).all():
        raise InvalidValueError(name, value, allowed)
    return array


def sized_array(
    name: str, value: ArrayLike, shape: tuple[int, ...] | None, allowed: str, *, largest: float = LARGEST
) -> Array:
    """Copy what a command asks for: as `finite_array`, within ±`largest`, and a subnormal number counts as 0.

    Raises:
        InvalidValueError: If it holds anything else.
    """
    array = finite_array(name, value, shape, allowed)
    size = np.abs(array)
    if (size > largest).any():
        raise InvalidValueError(name, value, f"{allowed}, within ±{largest:g}")
    subnormal = (size > 0.0) & (size < SMALLEST)
    return frozen_array(np.where(subnormal, 0.0, array)) if subnormal.any() else array


def number_in(name: str, value: object, low: float, high: float, what: str = "a number", unit: str = "") -> float:
    """Return value as a float in [low, high].

    Args:
        name: What it's called, for the message.
        value: To be checked.
        low: Smallest allowed.
        high: Largest allowed.
        what: What it counts, before the range in the message.
        unit: What follows the range.

    Raises:
        InvalidValueError: If it is anything else.
    """
    if type(value) is float and low <= value <= high and math.isfinite(value):
        return value
    allowed = f"{what} in [{low:g}, {high:g}]{unit}"
    number = finite(name, value, allowed)
    if not low <= number <= high:
        raise InvalidValueError(name, value, allowed)
    return number


def integer_in(name: str, value: object, low: int, high: int) -> int:
    """Return value as an integer in [low, high].

    Args:
        name: What it's called, for the message.
        value: To be checked.
        low: Smallest allowed.
        high: Largest allowed.

    Raises:
        InvalidValueError: If it is anything else.
    """
    if isinstance(value, bool) or not isinstance(value, int) or not low <= value <= high:
        raise InvalidValueError(name, value, f"an integer in [{low}, {high}]")
    return value


def one_of(name: str, value: str, words: Iterable[str], *more: str) -> str:
    """Return value if it's one of some words.

    Args:
        name: What it's called, for the message.
        value: To be checked.
        words: What is allowed.
        *more: What else is, elsewhere, for the message.

    Raises:
        InvalidValueError: If it isn't.
    """
    allowed = tuple(words)
    if value not in allowed:
        raise InvalidValueError(name, value, f"one of {', '.join((*allowed, *more))}", did_you_mean(value, allowed))
    return value


def word(name: str, value: Any, kind: type[_WordT]) -> _WordT:
    """Return the member of an enumeration that a value is or names.

    Args:
        name: What it's called, for the message.
        value: To be checked.
        kind: The enumeration.

    Raises:
        InvalidValueError: If it names none.
    """
    if isinstance(value, kind):
        return value
    return kind(one_of(name, value, kind))


def did_you_mean(given: object, words: Iterable[str]) -> str:
    """`; did you mean wed?` of the word that's most like what was given; empty where none is."""
    close = closest(given, words) if isinstance(given, str) else ""
    return f"; did you mean {close}?" if close else ""


def closest(given: str, words: Iterable[str]) -> str:
    """The word that's most like what was given, whatever its case; empty where none is like it."""
    # Only errors need it: at the top it would take a millisecond of the engine's import.
    import difflib

    folded = {word.casefold(): word for word in words}
    return next((folded[one] for one in difflib.get_close_matches(given.casefold(), folded, n=1, cutoff=0.65)), "")


def within(low: float, high: float, unit: str = "") -> msgspec.Meta:
    """Return a range that stands in the annotation of a field.

    `pace: Annotated[float, within(0.1, 10.0, "s")]` is what it looks like there.

    Args:
        low: Smallest allowed.
        high: Largest allowed.
        unit: What follows the range in messages.
    """
    return msgspec.Meta(ge=low, le=high, extra={"unit": unit} if unit else None)


def positive(said: str = "a positive number") -> msgspec.Meta:
    """Return what stands in the annotation of a field for any finite number above 0.

    Args:
        said: What is allowed, in messages.
    """
    return msgspec.Meta(gt=0, extra={"said": said})


def at_least(low: float, said: str) -> msgspec.Meta:
    """Return what stands in the annotation of a field for any finite number from `low` on.

    Args:
        low: Smallest allowed.
        said: What is allowed, in messages.
    """
    return msgspec.Meta(ge=low, extra={"said": said})


def validated(cls: _ClassT) -> _ClassT:
    """Check the fields of a dataclass by their annotations when one is made; stands below `@dataclass`.

    A field with a range (`within`, `positive`, `at_least`) is a number in it, kept as a float, or an integer where
    the annotation says so; one with a least and a most length has as many elements; a `bool` is True or False; None
    passes where the annotation admits it. The class's own `__post_init__` follows; after it texts become members of
    the enumeration that a field is of. What is not allowed raises InvalidValueError.

    Args:
        cls: The class, its fields annotated.
    """
    own = cls.__dict__.get("__post_init__")

    def check(self: Any) -> None:
        kind: Any = type(self)
        for name, convert in _converters(kind):
            object.__setattr__(self, name, convert(getattr(self, name)))
        if own is not None:
            own(self)
        for name, words in _enumerations(kind):
            object.__setattr__(self, name, word(name, getattr(self, name), words))

    setattr(cls, "__post_init__", check)  # noqa: B010 (mypy knows of no such attribute)
    return cls


def check_fields(value: msgspec.Struct) -> None:
    """Check the fields of a Struct by their annotations, as `validated` does those of a dataclass.

    Its `__post_init__` calls it.

    Args:
        value: The Struct; a number that isn't a float where one is asked for becomes one.

    Raises:
        InvalidValueError: If a field is out of its range.
    """
    for name, convert in _converters(type(value)):
        given = getattr(value, name)
        found = convert(given)
        if found is not given:
            msgspec.structs.force_setattr(value, name, found)


@functools.cache
def _converters(cls: Any) -> _Converters:
    """Return what checks and converts each field of a class that says what it allows."""
    hints = get_type_hints(cls, include_extras=True)
    names = cls.__struct_fields__ if issubclass(cls, msgspec.Struct) else [item.name for item in fields(cls)]
    return tuple((name, found) for name in names if (found := _converter(name, hints[name])))


@functools.cache
def _enumerations(cls: Any) -> tuple[tuple[str, type[StrEnum]], ...]:
    """Return the enumeration of each field of a dataclass that is of one."""
    hints = get_type_hints(cls)
    kinds = ((item.name, hints[item.name]) for item in fields(cls))
    return tuple((name, kind) for name, kind in kinds if isinstance(kind, type) and issubclass(kind, StrEnum))


def _converter(name: str, hint: object) -> Callable[[object], object] | None:
    """Return what checks a field of this annotation; None where it allows all."""
    kinds = [kind for kind in get_args(hint) if kind is not NoneType] if NoneType in get_args(hint) else [hint]
    optional = kinds != [hint]
    if kinds == [bool]:
        return functools.partial(_boolean, name)
    if len(kinds) != 1 or get_origin(kinds[0]) is not Annotated:
        return None
    base, *notes = get_args(kinds[0])
    for note in notes:
        if isinstance(note, msgspec.Meta):
            return functools.partial(_in_range, name, base, note, optional)
    return None


def _boolean(name: str, value: object) -> object:
    if not isinstance(value, bool):
        raise InvalidValueError(name, value, "True or False")
    return value


def _in_range(name: str, kind: type, note: msgspec.Meta, optional: bool, value: object) -> object:
    if optional and value is None:
        return None
    if note.max_length is not None:
        return _counted(name, note, value)
    low, high = note.ge, note.le
    said = (note.extra or {}).get("said")
    if said is not None:
        number = finite(name, value, said)
        if number <= note.gt if note.gt is not None else low is not None and number < low:
            raise InvalidValueError(name, value, said)
        return number
    assert low is not None, name
    assert high is not None, name
    if kind is int:
        step = note.multiple_of or 1
        if step != 1 and (not isinstance(value, int) or value % step):
            raise InvalidValueError(name, value, f"a multiple of {step} in [{low}, {high}]")
        return integer_in(name, value, int(low), int(high))
    unit = (note.extra or {}).get("unit", "")
    return number_in(name, value, low, high, unit=unit and f" {unit}")


def _counted(name: str, note: msgspec.Meta, value: Any) -> object:
    least, most = note.min_length or 0, note.max_length or 0
    if not least <= len(value) <= most:
        raise InvalidValueError(name, len(value), f"{least} to {most}")
    return value


def bounded_text(path: Path, most: int, encoding: str = "utf-8") -> str:
    """Return the text of a file.

    Args:
        path: Where it is.
        most: Largest size [B]; no more is read.
        encoding: UTF-8 of a kind.

    Raises:
        FormatError: If it's longer, or isn't UTF-8.
        OSError: If it can't be read.
    """
    with path.open("rb") as file:
        data = file.read(most + 1)
    if len(data) > most:
        raise FormatError(path.name, f"longer than {most} bytes")
    try:
        return data.decode(encoding)
    except UnicodeDecodeError as error:
        raise FormatError(path.name, f"no UTF-8 at byte {error.start}") from None
