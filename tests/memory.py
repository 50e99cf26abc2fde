"""How much an object holds, found from outside: for tests that memory is bounded."""

from __future__ import annotations

import gc
from types import BuiltinFunctionType, FunctionType, MethodType, ModuleType

import numpy as np

_SHARED = (type, ModuleType, FunctionType, BuiltinFunctionType, MethodType)


def values_held(thing: object) -> int:
    """Return how many values an object keeps: items of every container that it reaches, bytes and array elements,
    words of 64 bits of large integers.

    Classes, modules and functions aren't gone into; what several hold counts once.
    """
    seen, todo, count = {id(thing)}, [thing], 0
    while todo:
        one = todo.pop()
        if isinstance(one, str | bytes | bytearray):
            count += len(one)
            continue
        if isinstance(one, int):
            count += one.bit_length() // 64
        if isinstance(one, np.ndarray):
            count += one.size
        for part in gc.get_referents(one):
            if id(part) in seen or isinstance(part, _SHARED):
                continue
            seen.add(id(part))
            count += 1
            todo.append(part)
    return count
