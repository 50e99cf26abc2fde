"""Arguments of functions: how many, and those that were left out."""

from __future__ import annotations

from interfaces.val2.errors import ValError
from interfaces.val2.expressions import Expressions
from interfaces.val2.memory import where
from interfaces.val2.operations import Real
from interfaces.val2.syntax import Apply, Expression, Format


def arguments(e: Apply, least: int, most: int) -> list[Expression | None]:
    """The arguments, filled up with None.

    Raises:
        ValError: If there are too few or too many.
    """
    given = [None if isinstance(a, Format) else a for a in e.arguments]
    if len(given) > most or len(given) < least or any(a is None for a in given[:least]):
        counts = f"{least}" if least == most else f"{least} to {most}"
        raise ValError("Missing argument" if len(given) <= most else "Too many arguments",
                       f"{e.function} takes {counts}", place=where(e.at))  # fmt: skip
    return given + [None] * (most - len(given))


def reals(x: Expressions, e: Apply, least: int, most: int, *, otherwise: float = 0.0) -> list[Real]:
    """The arguments, reals all; those that were left out are `otherwise`."""
    return [x.real(a) if a is not None else (lambda _: otherwise) for a in arguments(e, least, most)]
