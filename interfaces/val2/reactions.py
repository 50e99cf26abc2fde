"""REACT and REACTI: which signals a program watches, and which of them have turned.

A reaction is to a turning of the signal after REACT. It's done once, or with ALWAYS each time. While the program
that it calls runs, other reactions wait; a REACTI alone comes into the program of a REACT.
"""

from __future__ import annotations

from dataclasses import dataclass

from interfaces.val2.signals import legal


@dataclass(frozen=True, slots=True)
class Reaction:
    """What is done when a signal turns."""

    signal: int
    """Negative for turning off."""
    program: str
    """What is called; empty to return from the program that runs."""
    immediate: bool
    always: bool

    @property
    def level(self) -> int:
        """REACTI is before REACT."""
        return 2 if self.immediate else 1


class Reactions:
    """The watched signals; one reaction for each."""

    def __init__(self) -> None:
        self._watched: dict[int, Reaction] = {}
        self._turned: list[Reaction] = []

    def add(self, reaction: Reaction) -> None:
        """REACT, REACTI: watch a signal; this takes the place of what was watched of it.

        Raises:
            ValError: If there's no such signal.
        """
        number = legal(reaction.signal)
        self.ignore(number)
        self._watched[number] = reaction

    def ignore(self, signal: float) -> None:
        """IGNORE: watch a signal no more, and forget that it turned.

        Raises:
            ValError: If there's no such signal.
        """
        number = legal(signal)
        self._watched.pop(number, None)
        self._turned = [r for r in self._turned if abs(r.signal) != number]

    def clear(self) -> None:
        """Watch nothing."""
        self._watched.clear()
        self._turned.clear()

    def notice(self, number: int, on: bool) -> None:
        """A signal has turned."""
        reaction = self._watched.get(number)
        if reaction is not None and (reaction.signal > 0) == on and reaction not in self._turned:
            self._turned.append(reaction)

    def due(self, level: int) -> Reaction | None:
        """The most urgent reaction whose signal has turned, above a level; it's taken off."""
        above = [r for r in self._turned if r.level > level]
        if not above:
            return None
        reaction = max(above, key=lambda r: r.level)
        self._turned.remove(reaction)
        if not reaction.always:
            self._watched.pop(abs(reaction.signal), None)
        return reaction


def reaction_to(signal: float, program: str, *, immediate: bool, always: bool) -> Reaction:
    """A reaction.

    Raises:
        ValError: If there's no such signal.
    """
    legal(signal)
    return Reaction(int(signal), program, immediate, always)
