"""What a controller remembers: programs and variables.

A name without a prefix is a real or a transformation by its first use, and stays what it is until it's deleted. A
name is a scalar or an array, never both; the elements of an array are of one type.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Final, TypeAlias

from interfaces.val2.errors import NOWHERE, TextPosition, ValError
from interfaces.val2.syntax import Number, Program, Variable, literal
from interfaces.val2.values import PrecisionPoint, Transformation, Value

MOST_VALUES: Final = 100_000
"""Elements of arrays that all programs have together, and, apart from them, names."""
LARGEST_INDEX: Final = 32_767
MOST_DIMENSIONS: Final = 3
LONGEST_STRING: Final = 1_024
"""Characters."""

Key: TypeAlias = int | tuple[int, ...]
Slots: TypeAlias = list[Any]
"""Of a call: a `VariableSlot` for each name, then what FOR keeps."""
KINDS: Final[dict[str, Any]] = {"locations": (Transformation, PrecisionPoint), "reals": float, "strings": str}
"""Types of values."""


class VariableSlot:
    """What stands behind a name, or behind an element of an array; arguments by reference are shared slots."""

    __slots__ = ("elements", "parent", "value")

    def __init__(self, value: Value | None = None, parent: VariableSlot | None = None) -> None:
        self.value = value
        """None if it's unset."""
        self.elements: dict[Key, VariableSlot] | None = None
        """Of an array."""
        self.parent = parent
        """The array whose element it is."""

    def defined(self) -> bool:
        """Whether it, or an element of it, has a value."""
        return self.value is not None or any(s.value is not None for s in (self.elements or {}).values())


def shown(name: str, key: Key | None = None) -> str:
    """A name with indices, as it's written: `a[1,2]`."""
    if key is None:
        return name
    return f"{name}[{','.join(map(str, key if isinstance(key, tuple) else (key,)))}]"


def undefined(variable: Variable, key: Key | None = None, *, location: bool = False) -> ValError:
    """The error of reading what is unset."""
    what = "Undefined location" if location or variable.prefix == "#" else "Undefined value"
    return ValError(what, shown(variable.name, key), place=variable.at)


def mismatch(variable: Variable) -> ValError:
    """The error of a name that is used as what it isn't."""
    return ValError("Variable type mismatch", variable.name, place=variable.at)


def index(value: float, at: TextPosition = NOWHERE) -> int:
    """An index: the integer part of a real.

    Raises:
        ValError: If it's negative or over 32,767.
    """
    if not -1.0 < value < LARGEST_INDEX + 1:
        raise ValError("Invalid array index", f"{value:.9g}: 0 to {LARGEST_INDEX}", place=at)
    return int(value)


class Memory:
    """Programs and variables; names are lower case."""

    def __init__(self) -> None:
        self.programs: dict[str, Program] = {}
        """By name; who changes it replaces whole programs."""
        self._slots: dict[str, VariableSlot] = {}
        self._own: dict[tuple[str, str], VariableSlot] = {}
        self._elements = 0

    def slot(self, name: str) -> VariableSlot:
        """The slot of a global name, made if need be; it stays the same one for ever.

        Raises:
            ValError: If there are too many names.
        """
        slot = self._slots.get(name)
        if slot is None:
            if len(self._slots) >= MOST_VALUES:
                raise ValError("Not enough storage area", f"{MOST_VALUES} names")
            slot = self._slots[name] = VariableSlot()
        return slot

    def own(self, program: str, name: str) -> VariableSlot:
        """The slot of a program's LOCAL name."""
        if len(self._own) >= MOST_VALUES:
            raise ValError("Not enough storage area", f"{MOST_VALUES} names")
        return self._own.setdefault((program, name), VariableSlot())

    def element(self, slot: VariableSlot, key: Key) -> VariableSlot:
        """An element of an array, made if need be.

        Raises:
            ValError: If there are too many elements.
        """
        if slot.elements is None:
            slot.elements = {}
        element = slot.elements.get(key)
        if element is None:
            if self._elements >= MOST_VALUES:
                raise ValError("Not enough storage area", f"{MOST_VALUES} elements of arrays")
            self._elements += 1
            element = slot.elements[key] = VariableSlot(None, slot)
        return element

    def store(self, slot: VariableSlot, value: Value, variable: Variable) -> None:
        """Give a slot a value.

        Raises:
            ValError: If the slot is of another type, or if a scalar is used as an array or the other way.
        """
        old = slot.value
        if old is None:
            if slot.elements and slot.defined():
                raise mismatch(variable)
            array = slot.parent
            if array is not None and array.elements is not None:
                other = next((s.value for s in array.elements.values() if s.value is not None), None)
                if array.value is not None or (other is not None and type(other) is not type(value)):
                    raise mismatch(variable)
        elif type(old) is not type(value):
            raise mismatch(variable)
        if isinstance(value, str) and len(value) > LONGEST_STRING:
            raise ValError("String too long", f"{LONGEST_STRING} characters at most", place=variable.at)
        slot.value = value

    def release(self, slot: VariableSlot) -> None:
        """Forget a name of a call that is over."""
        if slot.elements:
            self._elements -= len(slot.elements)
            slot.elements = None

    # By names, for the monitor and for files.

    def found(self, variable: Variable) -> Value | None:
        """The value of a variable; None where it's unset."""
        slot, key = self._slots.get(variable.name), _key(variable)
        if slot is not None and key is not None:
            slot = (slot.elements or {}).get(key)
        return None if slot is None else slot.value

    def get(self, variable: Variable) -> Value:
        """The value of a variable.

        Args:
            variable: Its indices are numbers.

        Raises:
            ValError: If it's unset.
        """
        value = self.found(variable)
        if value is None:
            raise undefined(variable, _key(variable))
        return value

    def set(self, variable: Variable, value: Value) -> None:
        """Give a variable a value; the name's prefix must allow it.

        Raises:
            ValError: If it's of another type.
        """
        prefix = "$" if isinstance(value, str) else "#" if isinstance(value, PrecisionPoint) else ""
        if variable.prefix != prefix:
            raise mismatch(variable)
        key = _key(variable)
        slot = self.slot(variable.name)
        self.store(slot if key is None else self.element(slot, key), value, variable)

    def delete(self, variable: Variable) -> None:
        """Forget a variable, or an element; without indices an array is forgotten whole.

        Raises:
            ValError: If it's unset.
        """
        slot, key = self._slots.get(variable.name), _key(variable)
        if slot is None or (not slot.defined() if key is None else key not in (slot.elements or {})):
            raise undefined(variable, key)
        if key is None:
            slot.value = None
            self.release(slot)
        else:
            assert slot.elements is not None
            del slot.elements[key]
            self._elements -= 1

    def clear(self) -> None:
        """ZERO: forget all programs and variables."""
        self.programs.clear()
        self._own.clear()
        for slot in self._slots.values():
            slot.value = None
            slot.elements = None
        self._elements = 0

    def variables(self) -> Iterator[tuple[Variable, Value]]:
        """All global variables that are set, by name, then by indices."""
        for name in sorted(self._slots):
            slot = self._slots[name]
            if slot.value is not None:
                yield Variable(name), slot.value
            elements = slot.elements or {}
            for key in sorted(elements, key=lambda k: k if isinstance(k, tuple) else (k,)):
                value = elements[key].value
                if value is not None:
                    keys = key if isinstance(key, tuple) else (key,)
                    yield Variable(name, tuple(Number(float(k)) for k in keys)), value


def _key(variable: Variable) -> Key | None:
    """The indices of a variable where they're numbers.

    Raises:
        ValError: If they're something else, out of range, or too many.
    """
    if not variable.indices:
        return None
    keys = []
    for part in variable.indices:
        if (value := literal(part)) is None:
            raise ValError("Invalid array index", variable.name, place=variable.at)
        keys.append(index(value, variable.at))
    if len(keys) > MOST_DIMENSIONS:
        raise ValError("Invalid array index", f"{variable.name}: {MOST_DIMENSIONS} dimensions at most")
    return keys[0] if len(keys) == 1 else tuple(keys)
