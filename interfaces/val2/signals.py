"""Digital signals: outputs 1 to 512, inputs 1001 to 1512, internal ones 2001 to 2512; simulated cells; reactions.

A cell is a run of rules, the lines of a file's `.SIGNALS`: what sets the inputs where no factory does. An input
takes the value of an expression once it has held that value for the rule's delay without a break, as a part is
there when the belt has run for so long.

REACT and REACTI watch signals. A reaction is to a turning of the signal after REACT. It's done once, or with ALWAYS
each time. While the program that it calls runs, reactions of no higher priority wait, as while LOCK says so.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from typing import Final

from interfaces.val2.errors import NOWHERE, TextPosition, ValError
from interfaces.val2.syntax import Expression

OUTPUTS: Final = range(1, 513)
INPUTS: Final = range(1001, 1513)
INTERNAL: Final = range(2001, 2513)
SOONEST: Final = 1e-3
"""A rule acts at least so much later than what it waits for [s]: rules in a circle take time."""
MOST_RULES: Final = 200
MOST_IN_GROUP: Final = 32
"""Signals that BITS has at a time."""


@dataclass(frozen=True, slots=True)
class SignalRule:
    """A line of `.SIGNALS`, ours: what a simulated cell does to an input or an internal signal."""

    signal: int
    value: Expression
    """What it follows."""
    after: float = 0.0
    """So much later [s]."""
    lasting: float | None = None
    """Each turning-on is a pulse of so long [s]; None: it follows off, too."""
    at_time: float | None = None
    """Once, so long after EXECUTE [s]; None: all the time."""
    at: TextPosition = field(default=NOWHERE, compare=False)

    def require_valid(self) -> None:
        """Check the signal and the times.

        Raises:
            ValError: If a cell can't set the signal, or a time is out of range.
        """
        times = (self.after, self.lasting or 0.0, self.at_time or 0.0)
        if not all(math.isfinite(t) and 0.0 <= t <= 1e6 for t in times):
            raise ValError("Invalid signal rule", "times are 0 to 1000000 s")
        if legal(self.signal) in OUTPUTS or self.signal < 0:
            raise ValError("Invalid signal rule", f"{self.signal}: a cell sets inputs and internal signals")


_KNOWN: Final = frozenset({*OUTPUTS, *INPUTS, *INTERNAL})
_SETTABLE: Final = frozenset({*OUTPUTS, *INTERNAL})


def legal(number: float) -> int:
    """The number of a signal, without its sign.

    Raises:
        ValError: If there's no such signal.
    """
    if abs(number) in _KNOWN:
        return abs(int(number))
    raise _illegal(number, OUTPUTS, INPUTS, INTERNAL)


def settable(number: float) -> int:
    """The number of a signal that a program may set, without its sign; 0 stands for none.

    Raises:
        ValError: If there's no such signal.
    """
    if not number or abs(number) in _SETTABLE:
        return abs(int(number))
    raise _illegal(number, OUTPUTS, INTERNAL)


def require_bits(count: float, value: float) -> None:
    """See that a value has a bit for each of some signals, and no others.

    Raises:
        ValError: If it hasn't.
    """
    most = 2.0**count - 1.0
    if not 0 <= value <= most or value % 1:
        many = f"{count:.9g} signals" if count > 1 else "1 signal; allowed too: BITS first, count = value"
        raise ValError("Illegal value", f"{value:.9g}: 0 to {most:.10g} for {many}")


def group(first: float, count: float) -> range:
    """The numbers of a group of signals.

    Raises:
        ValError: If there are signals of the group that aren't there, or there are too many.
    """
    if not 1 <= count <= MOST_IN_GROUP:
        raise ValError("Illegal value", f"{count:.9g}: 1 to {MOST_IN_GROUP} signals")
    numbers = range(int(first), int(first) + int(count))
    for number in (numbers[0], numbers[-1]):
        if legal(number) != number:
            raise _illegal(number, OUTPUTS, INPUTS, INTERNAL)
    return numbers


def _illegal(number: float, *groups: range) -> ValError:
    allowed = ", ".join(f"{group[0]} to {group[-1]}" for group in groups)
    return ValError("Illegal digital signal", f"{number:.9g}; allowed: {allowed}")


class Signals:
    """The state of all signals, and the cell that runs beside the program."""

    def __init__(self) -> None:
        self._on: set[int] = set()
        self._changes: list[tuple[int, bool]] = []
        self._rules: tuple[SignalRule, ...] = ()
        self._values: tuple[Callable[[], bool], ...] = ()
        self._seen: list[bool] = []
        self._due: list[float] = []
        self._over: list[float] = []
        self._pulses: dict[int, float] = {}
        """When signals turn off that PULSE turned on [s]."""

    def on(self, number: float) -> bool:
        """Whether a signal is on; of a negative number, whether it's off.

        Raises:
            ValError: If there's no such signal.
        """
        return (legal(number) in self._on) == (number > 0)

    def set(self, numbers: Iterable[float]) -> None:
        """SIGNAL: turn outputs and internal signals on, or off where negative; 0 is passed over.

        Raises:
            ValError: If one of them is none of these; then nothing has changed.
        """
        wanted = [int(n) for n in numbers if settable(n)]
        for number in wanted:
            self._turn(abs(number), number > 0)

    def set_group(self, first: float, count: float, value: float) -> None:
        """BITS: turn the signals of a group on where a number's bits are set, the lowest first, and the others off.

        Raises:
            ValError: If one of them is none of those that SIGNAL turns, or the number has other bits.
        """
        numbers = group(first, count)
        settable(numbers[0])
        require_bits(len(numbers), value)
        self.set(number if int(value) >> i & 1 else -number for i, number in enumerate(numbers))

    def pulse(self, number: float, seconds: float, *, now: float) -> None:
        """PULSE: turn a signal on, and off after a time [s].

        Raises:
            ValError: If it's none of those that SIGNAL turns, or the time is negative.
        """
        if not 0.0 <= seconds < math.inf:
            raise ValError("Illegal value", f"{seconds:.9g}: a pulse is 0 s or longer")
        self.set([abs(number)])
        self._pulses[abs(int(number))] = now + max(seconds, SOONEST)

    def force(self, number: float) -> None:
        """Turn any signal on, or off if negative, inputs too: what a factory does, or a monitor in its stead.

        Raises:
            ValError: If there's no such signal.
        """
        self._turn(legal(number), number > 0)

    def reset(self) -> None:
        """RESET: all outputs off."""
        for number in sorted(self._on.intersection(OUTPUTS)):
            self._turn(number, on=False)

    def changes(self) -> list[tuple[int, bool]]:
        """What has changed since this was last asked, oldest first."""
        changes, self._changes = self._changes, []
        return changes

    @property
    def changed(self) -> bool:
        """Whether `changes` has something."""
        return bool(self._changes)

    def begin(self, rules: Sequence[SignalRule], values: Sequence[Callable[[], bool]], *, now: float) -> None:
        """Run a cell from now on; it takes the place of the one before.

        Args:
            rules: The cell's; valid ones.
            values: What each rule follows, as a function.
            now: Session time [s].

        Raises:
            ValError: If there are too many rules.
        """
        if len(rules) > MOST_RULES:
            raise ValError("Too many signal rules", f"{MOST_RULES} at most")
        self._rules, self._values = tuple(rules), tuple(values)
        self._seen = [r.signal in self._on for r in rules]
        self._due = [math.inf if r.at_time is None else now + r.at_time + r.after for r in rules]
        self._over = [math.inf] * len(rules)
        self.advance(now=now)

    def advance(self, *, now: float) -> None:
        """Do what the cell has to do until now, in its order; what it waits for is looked at now."""
        while (t := self.next_deadline()) <= now:
            if t in self._pulses.values():
                over = [number for number, end in self._pulses.items() if end == t]
                for number in over:
                    del self._pulses[number]
                    self._turn(number, on=False)
            elif t in self._over:
                i = self._over.index(t)
                self._over[i] = math.inf
                self._turn(self._rules[i].signal, on=False)
            else:
                i = self._due.index(t)
                self._due[i] = math.inf
                self._act(self._rules[i], i, t)
            self._watch(t)
        self._watch(now)

    def next_deadline(self) -> float:
        """When the cell next does something, or a pulse ends [s]; infinity for never."""
        return min((*self._due, *self._over, *self._pulses.values()), default=math.inf)

    def _act(self, rule: SignalRule, i: int, t: float) -> None:
        on = self._seen[i] if rule.at_time is None else self._values[i]()
        if rule.lasting is None:
            self._turn(rule.signal, on)
        elif on:
            self._turn(rule.signal, on=True)
            self._over[i] = t + max(rule.lasting, SOONEST)

    def _watch(self, now: float) -> None:
        """Notice what the rules' expressions have become."""
        for i, rule in enumerate(self._rules):
            if rule.at_time is None and (value := self._values[i]()) != self._seen[i]:
                self._seen[i] = value
                settled = rule.lasting is None and value == (rule.signal in self._on)
                self._due[i] = math.inf if settled else now + max(rule.after, SOONEST)

    def _turn(self, number: int, on: bool) -> None:
        if (number in self._on) == on:
            return
        (self._on.add if on else self._on.discard)(number)
        self._changes.append((number, on))


USUAL: Final = 1.0
"""Priority of a REACT, unless it says another; that of a REACTI is the next one."""
HIGHEST: Final = 254.0
"""Priority of what REACTE calls."""


@dataclass(frozen=True, slots=True)
class Reaction:
    """What is done when a signal turns."""

    signal: int
    """Negative for turning off."""
    program: str
    """What is called; empty to return from the program that runs."""
    immediate: bool
    always: bool
    priority: float = USUAL


class Reactions:
    """The watched signals; one reaction for each."""

    def __init__(self) -> None:
        self._watched: dict[int, Reaction] = {}
        self._turned: list[Reaction] = []
        self.priority = 0.0
        """Reactions of no higher one wait: that of LOCK, or of the reaction whose program runs."""
        self.on_error = ""
        """The program that REACTE names; empty for none."""

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
        """Watch nothing, and let nothing wait."""
        self._watched.clear()
        self._turned.clear()
        self.priority, self.on_error = 0.0, ""

    def notice(self, number: int, on: bool) -> None:
        """A signal has turned."""
        reaction = self._watched.get(number)
        if reaction is not None and (reaction.signal > 0) == on and reaction not in self._turned:
            self._turned.append(reaction)

    def due(self, *, immediate: bool = False) -> Reaction | None:
        """The most urgent reaction whose signal has turned, or of those of REACTI; it's taken off."""
        above = [r for r in self._turned if r.priority > self.priority and r.immediate >= immediate]
        if not above:
            return None
        reaction = max(above, key=lambda r: r.priority)
        self._turned.remove(reaction)
        if not reaction.always:
            self._watched.pop(abs(reaction.signal), None)
        return reaction
