"""Programs run in virtual time, on an arm whose every motion takes the same time and which notes what was asked."""

from __future__ import annotations

import math
import random
from collections.abc import Callable
from dataclasses import dataclass, field

import pytest

from interfaces.val2.context import Event, ProgramFailed, Typed
from interfaces.val2.controller import Controller
from interfaces.val2.errors import ValError
from interfaces.val2.motion.places import Where
from interfaces.val2.parser import parse_expression, parse_line
from interfaces.val2.source import parse_file
from interfaces.val2.values import NULL, Location, PrecisionPoint, Transformation, Value

READY = PrecisionPoint((0.0, -90.0, 90.0, 0.0, 0.0, 0.0))


@dataclass(frozen=True, slots=True)
class Asked:
    """Something that the arm was asked for."""

    t: float
    """When [s]."""
    what: str
    values: tuple[object, ...] = ()


@dataclass(frozen=True, slots=True)
class _Motion:
    begin: float
    end: float
    destination: Where


class FakeArm:
    """An `Arm` without a robot: it stands where it was until a motion ends, and then at its destination."""

    def __init__(self, *, duration: float = 1.0, latency: float = 0.0) -> None:
        """Stand at NULL.

        Args:
            duration: Of every motion [s]; of the hand, too.
            latency: From asking to the answer [s].
        """
        self.duration, self.latency = duration, latency
        self.asked: list[Asked] = []
        self.refuse: ValError | None = None
        """What the next motion is refused with when it's answered."""
        self.monitor = 100.0
        self._stands = Where(NULL, READY, 100.0)
        self._motions: list[_Motion] = []
        self._answer = -math.inf
        self._refusal: ValError | None = None
        self._braked: _Motion | None = None
        self._tool = self._base = NULL

    def names(self) -> list[str]:
        """What was asked for, in its order."""
        return [a.what for a in self.asked]

    def reaches(self, location: Location, *, now: float) -> bool:
        """All but far ones."""
        return isinstance(location, PrecisionPoint) or abs(float(location.X[0, 3])) < 1e4

    def felt(self, *, now: float) -> bool:
        """Whether it's known where the hand came to: at once."""
        return now >= self._seen

    def here(self, *, now: float) -> Where:
        """Where it is."""
        self._seen = max(now, self._seen)
        done = [m for m in self._motions if m.end <= now]
        if done:
            self._stands = done[-1].destination
            self._motions = [m for m in self._motions if m.end > now]
        return self._stands

    def destination(self, *, now: float) -> Where:
        """Where it goes."""
        here = self.here(now=now)
        return self._motions[-1].destination if self._motions else here

    def real(self, *, now: float) -> Where | None:
        """There's no other twin."""
        return None

    def answered(self, *, now: float) -> bool:
        """Whether the latency is over."""
        self._seen = now
        if now < self._answer:
            return False
        refusal, self._refusal = self._refusal, None
        if refusal is not None:
            self._motions.clear()
            raise refusal
        return True

    def ready(self, *, now: float) -> bool:
        """Whether the last motion has begun."""
        return now >= self._answer and all(m.begin <= now for m in self._motions)

    def settled(self, *, now: float) -> bool:
        """Whether all motions have ended."""
        return now >= self._answer and all(m.end <= now for m in self._motions)

    def next_deadline(self) -> float:
        """The next beginning or end."""
        times = [self._answer, *(t for m in self._motions for t in (m.begin, m.end))]
        return min((t for t in times if t > self._seen), default=math.inf)

    _seen = 0.0

    def _note(self, now: float, what: str, *values: object) -> None:
        self.asked.append(Asked(now, what, values))

    def _motion(self, now: float, what: str, *values: object, to: Where | None = None, last: float = -1.0) -> None:
        self._note(now, what, *values)
        last = self.duration if last < 0.0 else last
        begin = max([now + self.latency, *(m.end for m in self._motions)])
        self._motions.append(_Motion(begin, begin + last, to or self.destination(now=now)))
        self._answer = now + self.latency
        self._refusal, self.refuse = self.refuse, None

    def move(self, target: Location, *, straight: bool, hand: float | bool | None = None, now: float) -> None:
        """MOVE and its like."""
        there = self.destination(now=now)
        if isinstance(target, Transformation):
            to = Where(target, there.joints, there.hand)
        else:
            to = Where(there.tool, target, there.hand)
        self._motion(now, "moves" if straight else "move", target, hand, to=to)

    def approach(self, target: Location, distance: float, *, straight: bool, now: float) -> None:
        """APPRO and its like."""
        self._motion(now, "appros" if straight else "appro", target, distance)

    def depart(self, distance: float, *, straight: bool, now: float) -> None:
        """DEPART and its like."""
        self._motion(now, "departs" if straight else "depart", distance)

    def drive(self, joint: int, change: float, speed: float, *, now: float) -> None:
        """DRIVE."""
        self._motion(now, "drive", joint, change, speed)

    def draw(self, dx: float, dy: float, dz: float, *, now: float) -> None:
        """DRAW."""
        self._motion(now, "draw", dx, dy, dz)

    def go_ready(self, *, now: float) -> None:
        """READY."""
        self._motion(now, "ready")

    def nest(self, *, now: float) -> None:
        """NEST."""
        self._motion(now, "nest")

    def align(self, *, now: float) -> None:
        """ALIGN."""
        self._motion(now, "align")

    def delay(self, seconds: float, *, now: float) -> None:
        """DELAY."""
        self._motion(now, "delay", seconds, last=seconds)

    def actuate(self, hand: float | bool | None, *, now: float) -> None:
        """OPENI and its like."""
        there = self.destination(now=now)
        opening = {None: there.hand, True: 100.0, False: 0.0}[hand] if isinstance(hand, bool | None) else hand
        self._motion(now, "actuate", hand, to=Where(there.tool, there.joints, opening))

    def set_hand(self, hand: float | bool | None) -> None:
        """OPEN and its like."""
        self._note(self._seen, "set_hand", hand)

    def set_speed(self, speed: float, *, turn: float | None, unit: str, always: bool) -> None:
        """SPEED."""
        self._note(self._seen, "set_speed", speed, turn, unit, always)

    def fastest(self, unit: str) -> float:
        """A PUMA's."""
        return {"%": 100.0, "MMPS": 500.0}.get(unit, 19.685)

    def set_acceleration(self, up: float, down: float) -> None:
        """ACCEL."""
        self._note(self._seen, "set_acceleration", up, down)

    def set_duration(self, seconds: float, *, always: bool) -> None:
        """DURATION."""
        self._note(self._seen, "set_duration", seconds, always)

    def set_tolerance(self, percent: float | None, *, fine: bool, always: bool) -> None:
        """COARSE and FINE."""
        self._note(self._seen, "set_tolerance", percent, fine, always)

    def tolerance(self) -> tuple[bool, float]:
        """Fine, always."""
        return True, 100.0

    def set_nulling(self, on: bool, *, always: bool) -> None:
        """NULL and NONULL."""
        self._note(self._seen, "set_nulling", on, always)

    def set_configuration(self, word: str) -> None:
        """RIGHTY and its like."""
        self._note(self._seen, "set_configuration", word)

    def set_tool(self, tool: Transformation) -> None:
        """TOOL."""
        self._note(self._seen, "set_tool", tool)
        self._tool = tool

    def tool(self) -> Transformation:
        """The tool."""
        return self._tool

    def set_base(self, base: Transformation) -> None:
        """BASE."""
        self._note(self._seen, "set_base", base)
        self._base = base

    def base(self) -> Transformation:
        """The base."""
        return self._base

    def set_monitor_speed(self, percent: float, *, now: float) -> None:
        """SPEED .. MONITOR."""
        self._note(now, "set_monitor_speed", percent)
        self.monitor = percent

    def monitor_speed(self) -> float:
        """The monitor speed."""
        return self.monitor

    def set_continuous_path(self, on: bool) -> None:
        """CP."""
        self._note(self._seen, "set_continuous_path", on)

    def set_dry_run(self, on: bool) -> None:
        """DRY.RUN."""
        self._note(self._seen, "set_dry_run", on)

    def at(self, t: float | None) -> None:
        """AT."""
        self._note(self._seen, "at", t)

    def alter(self, values: tuple[float, ...], *, now: float) -> str:
        """ALTOUT."""
        self._note(now, "alter", *values)
        return ""

    def renew(self, *, now: float) -> None:
        """No correction is on the way."""

    def renewal(self) -> float:
        """Never."""
        return math.inf

    def set_alter(self, mode: int | None, channel: int = 0, *, now: float) -> None:
        """ALTER, NOALTER."""
        self._note(now, "set_alter", mode)

    def brake(self, *, now: float) -> None:
        """Stop where it is, at once."""
        self._note(now, "brake")
        self.here(now=now)
        self._braked = self._motions[0] if self._motions else None
        self._motions.clear()

    def retry(self, *, now: float) -> bool:
        """Ask again for the motion that was under way."""
        if self._braked is None:
            return False
        self._motion(now, "retry", to=self._braked.destination)
        self._braked = None
        return True

    def begin_program(self) -> None:
        """EXECUTE."""
        self._note(self._seen, "begin_program")

    def undo(self, *, now: float) -> str:
        """Nothing can be taken back."""
        self._note(now, "undo")
        return "nothing to undo"

    def timeline(self, *, now: float) -> list[str]:
        """Nothing to show."""
        return []

    def past(self, t: float, *, now: float) -> Where:
        """Where it is."""
        return self.here(now=now)


@dataclass
class Rig:
    """A controller in virtual time."""

    arm: FakeArm = field(default_factory=FakeArm)
    now: float = 0.0
    events: list[tuple[float, Event]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.controller = Controller(self.arm, rng=random.Random(1), now=self.now)

    def load(self, text: str) -> str:
        """Take over a file's programs, values and cell; the first program's name."""
        source = parse_file(text, "test")
        for program in source.programs:
            self.controller.memory.programs[program.name] = program
        for entry in source.values:
            self.controller.memory.set(entry.variable, entry.value)
        self.controller.cell = source.signals
        return source.programs[0].name

    def advance(self, until: float = math.inf, *, when: Callable[[], bool] | None = None) -> None:
        """Let time pass until then, until nothing is left to do, or until something holds."""
        for _ in range(200_000):
            self.events += [(self.now, e) for e in self.controller.advance(now=self.now)]
            if when is not None and when():
                return
            t = self.controller.next_deadline()
            if t > until or t == math.inf:
                if until < math.inf:
                    self.now = max(self.now, until)
                    self.events += [(self.now, e) for e in self.controller.advance(now=self.now)]
                return
            self.now = max(self.now, t)
        raise AssertionError("it doesn't come to rest")

    def run(self, text: str, *, cycles: int = 1, until: float = math.inf) -> str:
        """Run a file's first program to its end; what it typed.

        Raises:
            ValError: What stopped it.
        """
        name = self.load(text)
        self.controller.execute(name, cycles=cycles, now=self.now)
        self.advance(until)
        for _, event in self.events:
            if isinstance(event, ProgramFailed):
                raise event.error
        return self.typed()

    def do(self, line: str) -> None:
        """DO a line, and let time pass until it's done."""
        self.controller.do(parse_line(line), now=self.now)
        self.advance(when=lambda: not self.controller.doing)

    def typed(self) -> str:
        """All that was typed."""
        return "".join(e.text for _, e in self.events if isinstance(e, Typed))

    def value(self, text: str) -> Value:
        """The value of an expression."""
        return self.controller.evaluate(parse_expression(text), now=self.now)

    def when(self, kind: type[Event]) -> list[tuple[float, Event]]:
        """Events of a kind, with their times."""
        return [(t, e) for t, e in self.events if isinstance(e, kind)]


def body(*lines: str) -> str:
    """A program `main` of these lines."""
    return "\n".join([".PROGRAM main()", *lines, ".END", ""])


def run(*lines: str) -> str:
    """What a program of these lines types."""
    return Rig().run(body(*lines))


def failure(text: str) -> ValError:
    """The error that stops a program."""
    with pytest.raises(ValError) as raised:
        Rig().run(text)
    return raised.value
