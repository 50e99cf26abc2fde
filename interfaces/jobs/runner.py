"""Does a list of jobs, one after the other: a state machine that asks others to carry them out.

It knows no clock and no robot. Each thing asked for is an attempt with a number of its own, so that a late answer
to one that was ended counts for nothing. Whatever isn't running has been ended: a list that is paused, aborted or
has failed asks for no motion.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, Final, Protocol, TypeAlias

from msgspec.structs import replace
from typing_extensions import override

from interfaces.messages.jobs import (
    ArmJob,
    Job,
    JobList,
    JobProgress,
    JobStage,
    ListCommand,
    MessageJob,
    MoveJob,
    OperatorLoss,
    Progress,
    VoiceJob,
    WaitJob,
)
from vrs.checks import finite, validated, within


@dataclass(frozen=True, slots=True)
class CarryOut:
    """Do a job; answer when it's done, or can't be."""

    attempt: int
    job: MoveJob | VoiceJob | ArmJob
    """A move with its goal, whatever that's called in the list."""


@dataclass(frozen=True, slots=True)
class Show:
    """Show a text, nothing if it's empty; it's done as soon as it's asked for."""

    text: str


@dataclass(frozen=True, slots=True)
class EndJob:
    """Stop with what was asked for, at once; no answer is expected, and none counts."""

    attempt: int


Request: TypeAlias = CarryOut | Show | EndJob
"""What a runner asks for."""


SYLLABLE: Final = 0.065
"""So long a character takes to be spoken, about 170 words a minute [s]."""
BREATH: Final = 0.3
"""And each text besides [s]."""


def speaking_time(text: str) -> float:
    """About how long it takes to say something [s]."""
    return BREATH + SYLLABLE * len(text)


class Speaker(Protocol):
    """Whatever says something aloud, one text at a time."""

    def speak(self, text: str, *, now: float) -> None:
        """Begin to say something, in place of anything else, at a time [s]."""

    def hush(self) -> None:
        """Be silent at once."""

    def is_speaking(self, *, now: float) -> bool:
        """Whether what was begun isn't over yet."""


class ArmControl(Protocol):
    """Whatever carries out VAL-II programs on an arm, one at a time."""

    def run(self, program: str, source: str, *, now: float) -> str:
        """Begin a program at a time [s]; why it can't be, empty if it has begun."""

    def end(self, *, now: float) -> None:
        """Stop the arm."""

    def outcome(self, *, now: float) -> str | None:
        """What became of the program: None while it runs, empty if it came to its end, else why not."""


class SilentSpeaker(Speaker):
    """Says nothing, and takes as long as saying it would: where there's no loudspeaker."""

    def __init__(self) -> None:
        """Be silent."""
        self.text = ""
        """What is being said."""
        self._until = -math.inf

    @override
    def speak(self, text: str, *, now: float) -> None:
        self.text, self._until = text, now + speaking_time(text)

    @override
    def hush(self) -> None:
        self.text, self._until = "", -math.inf

    @override
    def is_speaking(self, *, now: float) -> bool:
        if now >= self._until:
            self.text = ""
        return now < self._until


RUNS = "the list is being done: pause or abort it first"
"""Why a list can't be changed or begun."""
STANDS = "the list isn't being done"
"""Why it can't be paused or aborted."""
EMPTY = "there's no job in the list"
"""Why it can't be run."""
ALL_DONE = "all jobs of the list are done: run it"
"""Why it can't be resumed."""
ANEW = "the station was started anew"
"""Why a list is paused that was being done when it was saved."""
NO_TRIAL = "the virtual robot alone tries a list"
"""Why a runner makes no dry run."""
NO_KEY = "no job waits for the key"
"""Why the key does nothing."""


@dataclass(frozen=True, slots=True)
@validated
class RunnerConfig:
    """How a runner behaves."""

    loss: OperatorLoss = OperatorLoss.STOP
    """When the operator is lost."""
    longest_move: Annotated[float, within(1.0, 86_400.0, "s")] = 3600.0
    """A move that takes longer has failed [s], in [1, 86400]."""
    longest_voice: Annotated[float, within(1.0, 86_400.0, "s")] = 120.0
    """The same of speaking [s], in [1, 86400]."""
    longest_arm: Annotated[float, within(1.0, 86_400.0, "s")] = 3600.0
    """The same of a program [s], in [1, 86400]."""


def carried_over(jobs: JobList, progress: Progress, following: JobList, known: Progress | None = None) -> Progress:
    """How far a list is that takes the place of another; nothing of it is being done.

    Args:
        jobs: The list before.
        progress: How far that is.
        following: What takes its place.
        known: How far this is already; None keeps what's known of jobs with the same number that are unchanged.
    """
    given = progress if known is None else known
    same = {job.number for job in following.jobs if known is not None or job in jobs.jobs}
    before = {job.number: job for job in given.jobs if job.number in same}
    states = tuple(before.get(job.number, JobProgress(job.number)) for job in following.jobs)
    if given.stage is JobStage.RUNNING:
        states = tuple(
            replace(job, stage=JobStage.PAUSED, reason=ANEW) if job.stage is JobStage.RUNNING else job
            for job in states
        )
        given = Progress(JobStage.PAUSED, reason=ANEW)
    stages = {job.stage for job in states}
    if given.stage not in stages or (given.stage is JobStage.DONE and len(stages) > 1):
        return Progress(jobs=states)
    return replace(given, jobs=states)


class JobRunner:
    """Holds a list, and does it."""

    def __init__(self, jobs: JobList | None = None, config: RunnerConfig | None = None) -> None:
        """Hold a list of which nothing is done.

        Args:
            jobs: The list; an empty one unless given.
            config: How to behave.
        """
        self.jobs = JobList() if jobs is None else jobs
        self.config = RunnerConfig() if config is None else config
        """How it behaves."""
        self.progress = Progress.of(self.jobs)
        """How far it is."""
        self._requests: list[Request] = []
        self._attempt = 0
        self._open = False
        """Whether somebody carries out the attempt."""
        self._due = math.inf
        """When the running job is over, or has failed [s]."""

    @classmethod
    def at(cls, jobs: JobList, progress: Progress) -> JobRunner:
        """As one that is as far as that, to try what it'd answer; nothing is asked for again."""
        runner = cls(jobs)
        runner.progress = progress
        return runner

    @property
    def running(self) -> bool:
        """Whether the list is being done."""
        return self.progress.stage is JobStage.RUNNING

    @property
    def waits_for_key(self) -> bool:
        """Whether the key would end a WAIT."""
        wait = self._waiting()
        return wait is not None and wait.seconds is None

    def receive(self, command: ListCommand, *, now: float) -> str:
        """Take in what a person asks for at a time [s]; why it isn't done, empty if it is."""
        self._catch_up(finite("now", now, "finite seconds"))
        return self._commanded(command, now)

    def answer(self, attempt: int, failure: str | None = None, *, now: float) -> None:
        """Take in what became of a request; of an attempt that's over it counts for nothing.

        Args:
            attempt: Its number.
            failure: Why it can't be done; None if it has been.
            now: [s].
        """
        self._catch_up(finite("now", now, "finite seconds"))
        if not self._open or attempt != self._attempt:
            return
        self._open, self._due = False, math.inf
        if failure is None:
            self._finish(now)
        else:
            self._stage_of_running(JobStage.FAILED, failure)

    def interrupt(self, reason: str, *, now: float) -> None:
        """Pause: the robot has to stop, whatever the policy, as it touches something, or is told to."""
        self._catch_up(finite("now", now, "finite seconds"))
        self._pause(reason, now)

    def lose_operator(self, reason: str, *, now: float) -> None:
        """Follow the policy: nobody is heard any more who could stop the robot."""
        self._catch_up(finite("now", now, "finite seconds"))
        if self.config.loss is OperatorLoss.STOP:
            self._pause(reason, now)

    def load(self, jobs: JobList, progress: Progress | None = None, *, now: float) -> str:
        """Take a list in place of the one before.

        Args:
            jobs: The list.
            progress: See `carried_over`.
            now: [s].

        Returns:
            Why it isn't taken; empty if it is.
        """
        self._catch_up(finite("now", now, "finite seconds"))
        if self.running:
            return RUNS
        self.jobs, self.progress = jobs, carried_over(self.jobs, self.progress, jobs, progress)
        return ""

    def advance(self, *, now: float) -> tuple[Request, ...]:
        """Do what is due by now [s], and say what is to be done next."""
        self._catch_up(now)
        requests, self._requests = tuple(self._requests), []
        return requests

    def next_deadline(self) -> float | None:
        """When there's something to do [s]; −∞ for at once, None if nothing is due."""
        if self._requests:
            return -math.inf
        return None if math.isinf(self._due) else self._due

    def _commanded(self, command: ListCommand, now: float) -> str:
        if command is ListCommand.KEY:
            if not self.waits_for_key:
                return NO_KEY
            self._finish(now)
        elif command is ListCommand.PAUSE:
            if not self.running:
                return STANDS
            self._pause("", now)
        elif command is ListCommand.ABORT:
            return self._abort()
        elif command is ListCommand.DRY_RUN:
            return NO_TRIAL
        else:
            return self._begin(command, now)
        return ""

    def _begin(self, command: ListCommand, now: float) -> str:
        if self.running:
            return RUNS
        if not self.jobs.jobs:
            return EMPTY
        if command is ListCommand.RUN:
            self.progress = Progress.of(self.jobs)
        elif all(job.stage is JobStage.DONE for job in self.progress.jobs):
            return ALL_DONE
        self.progress = replace(self.progress, stage=JobStage.RUNNING, reason="")
        self._next(now)
        return ""

    def _abort(self) -> str:
        if self.progress.stage not in (JobStage.RUNNING, JobStage.PAUSED):
            return STANDS
        self._end()
        for job in self.progress.jobs:
            if job.stage in (JobStage.RUNNING, JobStage.PAUSED):
                self._mark(JobProgress(job.number, JobStage.ABORTED))
        self.progress = replace(self.progress, stage=JobStage.ABORTED, reason="")
        self._requests.append(Show(""))
        return ""

    def _pause(self, reason: str, now: float) -> None:
        """Stop what is being done, if anything is; the list goes on when it's resumed."""
        if not self.running:
            return
        left = self._due - now if self._waiting() is not None else math.inf
        self._end()
        self._stage_of_running(JobStage.PAUSED, reason, None if math.isinf(left) else max(0.0, left))

    def _stage_of_running(self, stage: JobStage, reason: str, left: float | None = None) -> None:
        """Let the list, and the job that's running, be at a stage."""
        job = self.progress.running
        if job is not None:
            self._mark(JobProgress(job.number, stage, reason, left))
        self.progress = replace(self.progress, stage=stage, reason=reason)

    def _end(self) -> None:
        """Nobody carries out anything any more."""
        if self._open:
            self._requests.append(EndJob(self._attempt))
        self._open, self._due = False, math.inf

    def _finish(self, now: float) -> None:
        """The running job is done: on to the next."""
        job = self.progress.running
        assert job is not None
        self._due = math.inf
        self._mark(JobProgress(job.number, JobStage.DONE))
        self._next(now)

    def _next(self, now: float) -> None:
        """Begin the first job that isn't done; messages, which take no time, as well as what follows them."""
        for job in self.jobs.jobs:
            before = self._of(job)
            if before.stage is JobStage.DONE:
                continue
            self._mark(JobProgress(job.number, JobStage.RUNNING))
            if not isinstance(job, MessageJob):
                self._ask(job, before, now)
                return
            self._requests.append(Show(job.text))
            self._mark(JobProgress(job.number, JobStage.DONE))
        self.progress = replace(self.progress, stage=JobStage.DONE, reason="")

    def _ask(self, job: MoveJob | VoiceJob | WaitJob | ArmJob, before: JobProgress, now: float) -> None:
        """Let a job be carried out."""
        config = self.config
        if isinstance(job, WaitJob):
            seconds = job.seconds if before.left is None else before.left
            self._due = math.inf if seconds is None else now + seconds
            return
        if isinstance(job, MoveJob):
            job = replace(job, to=self.jobs.goal(job))
        self._attempt += 1
        self._open = True
        self._requests.append(CarryOut(self._attempt, job))
        longest = {MoveJob: config.longest_move, VoiceJob: config.longest_voice, ArmJob: config.longest_arm}
        self._due = now + longest[type(job)]

    def _catch_up(self, now: float) -> None:
        """Do what is due by now: a wait ends when it was to, however late this is called."""
        while self._due <= now:
            due = self._due
            if self._waiting() is not None:
                self._finish(due)
            else:
                self._end()
                self._stage_of_running(JobStage.FAILED, "it took longer than is allowed")

    def _waiting(self) -> WaitJob | None:
        """The WAIT that is being done."""
        running = self.progress.running
        job = None if running is None else self.jobs.jobs[self.jobs.index(running.number)]
        return job if isinstance(job, WaitJob) else None

    def _of(self, job: Job) -> JobProgress:
        return next(known for known in self.progress.jobs if known.number == job.number)

    def _mark(self, progress: JobProgress) -> None:
        jobs = tuple(progress if job.number == progress.number else job for job in self.progress.jobs)
        self.progress = replace(self.progress, jobs=jobs)
