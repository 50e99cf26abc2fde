"""A literal interpreter of the DEVS model of the command filter: states, δ_ext, δ_int, λ, ta as printed, eq.
(11)–(13).

It's written from the paper's symbols, not from the filter's code: a coupled model is a dictionary of atomic ones,
its couplings are pairs of ports, and a root coordinator picks the next event.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass, field
from typing import Any

INFINITY = math.inf


@dataclass(frozen=True)
class Atomic:
    """⟨X, Y, S, δ_ext, δ_int, λ, ta⟩."""

    s0: Hashable
    delta_ext: Callable[[Any, str], Hashable]
    delta_int: Callable[[Any], Hashable]
    output: Callable[[Any], str]
    ta: Callable[[Any], float]


def queue_ext(s, x):
    n, status = s
    if x == "U_in":
        return (n + 1, status)
    assert x == "done"
    return (n, "Free") if status == "Busy" else s


def queue_model() -> Atomic:
    return Atomic(
        s0=(0, "Free"),
        delta_ext=queue_ext,
        delta_int=lambda s: (s[0] - 1, "Busy"),
        output=lambda s: "U_out",
        ta=lambda s: 0.0 if s[0] != 0 and s[1] == "Free" else INFINITY,
    )


def generator_model(T: float) -> Atomic:
    return Atomic(
        s0="Free",
        delta_ext=lambda s, x: "Busy" if (s, x) == ("Free", "U_in") else s,
        delta_int=lambda s: "Free",
        output=lambda s: "U_out",
        ta=lambda s: T if s == "Busy" else INFINITY,
    )


EIC = {("Filter", "U_in"): [("Queue", "U_in")]}
EOC = {("Generator", "U_out"): ("Filter", "U_out")}
IC = {("Queue", "U_out"): [("Generator", "U_in")], ("Generator", "U_out"): [("Queue", "done")]}
SELECT = ("Queue", "Generator")
"""Select({Queue, Generator}) = Queue; the printed coupling Generator.U_out → Queue.U_in is the queue's port
`done`."""


@dataclass
class Simulator:
    """An atomic model, its state and the time of its last event."""

    model: Atomic
    s: Any = None
    t_last: float = 0.0
    t_next: float = INFINITY

    def __post_init__(self):
        self.s = self.model.s0
        self._schedule(0.0)

    def _schedule(self, t):
        self.t_last, self.t_next = t, t + self.model.ta(self.s)

    def external(self, t, x):
        elapsed_kept = self.t_next
        before = self.s
        self.s = self.model.delta_ext(before, x)
        if self.s == before:
            self.t_next = elapsed_kept
            return
        self._schedule(t)

    def internal(self, t):
        assert t == self.t_next
        y = self.model.output(self.s)
        self.s = self.model.delta_int(self.s)
        self._schedule(t)
        return y


@dataclass
class Filter:
    """The coupled model, run over a list of arrival times."""

    T: float
    trace: list[tuple[float, str, int, int]] = field(default_factory=list)

    def run(self, arrivals: Sequence[float]) -> list[tuple[float, str, int, int]]:
        """(time, event, number of the command, n after it) of every event, in order."""
        parts = {"Queue": Simulator(queue_model()), "Generator": Simulator(generator_model(self.T))}
        counts = {"received": 0, "passed": 0, "generated": 0}

        def note(t, kind):
            self.trace.append((t, kind, counts[kind], parts["Queue"].s[0]))
            counts[kind] += 1

        inputs = list(arrivals)
        while True:
            t_in = inputs[0] if inputs else INFINITY
            t_next = min(part.t_next for part in parts.values())
            t = min(t_in, t_next)
            if t == INFINITY:
                return self.trace
            imminent = [name for name in SELECT if parts[name].t_next == t]
            # An arrival is the queue's event: after the queue's own at this instant, before the generator's.
            if imminent[:1] == ["Queue"] or t_in > t:
                self._internal(parts, imminent[0], t, note)
            else:
                inputs.pop(0)
                for name, port in EIC["Filter", "U_in"]:
                    parts[name].external(t, port)
                note(t, "received")

    def _internal(self, parts, name, t, note):
        y = parts[name].internal(t)
        for target, port in IC[name, y]:
            parts[target].external(t, port)
        note(t, "generated" if (name, y) in EOC else "passed")
