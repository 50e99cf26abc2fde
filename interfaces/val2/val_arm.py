"""ARM: a VAL-II program on a virtual PUMA 560 beside the runner.

A program is carried out beforehand, in virtual time, from where the arm stands: that says whether it can be, how
long it takes, and how the arm moves. Then the arm moves so. What is asked for while it moves, signals and answers,
it can't have: a program that waits for those fails.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from typing import TYPE_CHECKING, TypeAlias

from typing_extensions import override

from interfaces.jobs import ArmControl
from interfaces.messages.jobs import ArmJob
from vrs.model import Array

if TYPE_CHECKING:
    from interfaces.val2.playing import Rehearsal
    from vrs.timeline import Timeline

Task: TypeAlias = Callable[[], "Rehearsal | str"]
Beside: TypeAlias = Callable[[Task], "Future[Rehearsal | str]"]
"""Has something worked out, here or elsewhere."""


def rehearsed(
    program: str, source: str, programs: Mapping[str, str] | None = None, start: Array | None = None
) -> Rehearsal | str:
    """Carry a program out in virtual time; or why that can't be.

    Args:
        program: Its name.
        source: The file in which it is; empty for one of those that are known.
        programs: Files that are known, by the names of their programs.
        start: Where the arm stands [rad], (6,); in its `nominal` pose unless given.
    """
    from interfaces.val2.errors import ValError
    from interfaces.val2.playing import rehearse
    from interfaces.val2.source import joined, parse_file
    from robots import puma560

    text = source or (programs or {}).get(program, "")
    if not text:
        return f"there's no program {program} here: give its file as well"
    try:
        found = rehearse(joined([parse_file(text, program)], program), puma560.model(), start=start)
    except ValError as error:
        return f"{program}: {error}"
    return f"{program}: {found.findings[0].error}" if found.findings else found


def lasts(job: ArmJob, programs: Mapping[str, str] | None = None) -> float | str:
    """How long a program takes [s], or why it'd fail: for `dry_run`."""
    found = rehearsed(job.program, job.source, programs)
    return found if isinstance(found, str) else found.end


def at_once(task: Task) -> Future[Rehearsal | str]:
    """Work something out here and now: in virtual time nobody waits for it."""
    done: Future[Rehearsal | str] = Future()
    done.set_result(task())
    return done


class ValArm(ArmControl):
    """Carries programs out on a virtual PUMA 560, see `ArmControl`."""

    def __init__(self, programs: Mapping[str, str] | None = None, beside: Beside = at_once) -> None:
        """Stand in the arm's `nominal` pose.

        Args:
            programs: Files that are known, by the names of their programs.
            beside: Works programs out; a live robot doesn't wait for that, see `in_a_thread`.
        """
        self._programs, self._beside = programs, beside
        self._planned: Future[Rehearsal | str] | None = None
        self._timeline: Timeline | None = None
        """What the arm does; None before it has moved."""
        self._began = 0.0
        self._ends: float | None = None
        """When the program that it carries out does, by the timeline [s]; None while there's none."""

    @override
    def run(self, program: str, source: str, *, now: float) -> str:
        known, start = self._programs, self.joints(now)
        self._planned = self._beside(lambda: rehearsed(program, source, known, start))
        return ""

    def end(self, *, now: float) -> None:
        """See `ArmControl`; the arm brakes on its path."""
        self._planned = None
        if self._ends is None or self._timeline is None:
            return
        from robots import puma560
        from vrs.clock import ManualClock
        from vrs.engine import Engine

        engine = Engine(puma560.model(), timeline=self._timeline, clock=ManualClock(now - self._began))
        engine.stop()
        self._timeline, self._ends = engine.timeline, None

    @override
    def outcome(self, *, now: float) -> str | None:
        if self._planned is not None:
            if not self._planned.done():
                return None
            found, self._planned = self._planned.result(), None
            if isinstance(found, str):
                return found
            self._timeline, self._began, self._ends = found.timeline, now, found.end
        if self._ends is not None and now < self._began + self._ends:
            return None
        self._ends = None
        return ""

    def joints(self, now: float) -> Array | None:
        """Where the arm is [rad], (6,); None before it has moved."""
        if self._timeline is None:
            return None
        found: Array = self._timeline.sample(now - self._began)
        return found


def in_a_thread() -> Beside:
    """What works programs out in a thread of its own, one after the other."""
    pool = ThreadPoolExecutor(1, thread_name_prefix="vrs-arm")
    return pool.submit
