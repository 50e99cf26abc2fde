"""The figures of a run, from its recording alone: of an arm's twins, and of a mobile robot's drive."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from interfaces.messages.recording import (
    COLLISION,
    OWN,
    Anchor,
    CommandPacket,
    CommandRecord,
    DriveFacts,
    RunEvent,
)
from interfaces.recording.history import AnyTimeline, arm_timeline, sampled
from interfaces.recording.kinds import ARM
from interfaces.recording.recording import Recording
from interfaces.recording.rerun import Rerun, begun, rerun
from interfaces.recording.run_recorders import extras_of
from interfaces.recording.track import (
    ESTIMATED,
    GAP,
    MEASURED,
    SampleTrack,
)
from interfaces.runs.drive_run import DriveCase, DriveRun, facts_of, row_of
from interfaces.runs.summary import Attribution, Json, OffsetOutcome, summarize
from interfaces.runs.twin_run import ADAPTIVE, TwinRun, TwinSamples, carried_out, waits
from interfaces.teleop import Correction
from interfaces.teleop.architectures import Transport
from robots.mobile.robot import Collision
from robots.onboard.playout import PlayoutConfig
from vrs.comparison import PathMatch, match_paths, measured_rows, resample
from vrs.errors import FormatError, InvalidValueError
from vrs.ledger import Receipt, Status
from vrs.model import Array
from vrs.timeline import Timeline

MOST = 36_000
"""Samples of a recording that is matched at most: beyond that it takes too long, and nobody is told."""


FARTHEST = 50_000.0
"""Longest path that is matched [m]: what a recording's length allows at full speed, and no hostile one's."""


def matchable(postures: Array) -> bool:
    """Whether a virtual robot's path, (k, 3), isn't too long to be matched."""
    steps = np.linalg.norm(np.diff(postures[:, :2], axis=0), axis=1)
    return bool(steps.sum() <= FARTHEST)


class Pursuit:
    """How a real robot follows a virtual one's path: a recording's match, made when it's first asked for."""

    def __init__(self, recording: Recording) -> None:
        """Take a recording."""
        self._recording = recording
        self._match: PathMatch | None = None
        self._beside = self._reached = np.empty(0), np.empty(0)
        """Of what was measured: times and distances; when places along the path were reached, and those."""
        self._place: Array = np.empty(0)
        self._moments: Array = np.empty(0)
        self._until = -np.inf

    def prepare(self) -> None:
        """Match what the recording holds now."""
        until = self._recording.span[1]
        if until == self._until:
            return
        self._until, self._match = until, None
        track = self._recording.track(self._recording.kind.real)
        # A row without a measurement in each gap: nothing is known on either side of it.
        moments = np.union1d(track.t, track.gaps.mean(axis=1))
        real = track.on(moments, "q")
        real[~np.isin(moments, track.t)] = np.nan
        virtual = self._recording.virtual(moments)
        known = measured_rows(virtual)
        if not 2 <= np.count_nonzero(known) <= MOST or not matchable(virtual[known]):
            return
        t, leader = moments[known], virtual[known, :2]
        match = self._match = match_paths(t, leader, real[known, :2])
        seen, there = np.isfinite(match.distance), np.isfinite(match.t_follower)
        self._beside = match.t[seen], match.distance[seen]
        self._reached = match.t_follower[there], match.s[: len(there)][there]
        self._moments = t
        self._place = np.concatenate(([0.0], np.cumsum(np.linalg.norm(np.diff(leader, axis=0), axis=1))))

    def play(self, t: float) -> float | None:
        """When the virtual robot was last where the real one is at a time [s]; that time if it still is there."""
        self.prepare()
        match = self._match
        if match is None:
            return None
        reached, places = self._reached
        whole = len(match.t_follower) == len(match.s) and t >= match.t_follower[-1]
        s = self._place[-1] if whole or not len(reached) else float(np.interp(t, reached, places))
        after = int(np.searchsorted(self._place, s + 1e-9, side="right"))
        if after == len(self._place):
            return t
        before = after - 1
        share = (s - self._place[before]) / (self._place[after] - self._place[before])
        left = self._moments[before] + max(float(share), 0.0) * (self._moments[after] - self._moments[before])
        return min(t, float(left))

    def error(self, t: float, _q_real: Array, _play: float) -> float | None:
        """How far the real robot is beside the virtual one's path at a time [m]."""
        self.prepare()
        return None if self._match is None else float(np.interp(t, *self._beside))


MOST_ROWS = 1_000_000
"""Rows of a run's grid, at most."""


def summary(recording: Recording) -> Json:
    """The run's summary: of a whole recording of the laboratory the run's own, else with a list `missing`.

    Raises:
        FormatError: If the recording has too little of it.
    """
    return summary_of(figures(recording))


def summary_of(found: RunFigures | DriveFigures) -> Json:
    """A summary with what is missing."""
    return found.summary() | ({"missing": list(found.missing)} if found.missing else {})


def figures(recording: Recording) -> RunFigures | DriveFigures:
    """Everything that a run's summary and report are made of.

    Raises:
        FormatError: If the recording has too little of it: no model, no samples of the real robot.
    """
    return RunFigures(recording) if recording.kind is ARM else DriveFigures(recording)


class _Figures:
    """A run as its recording has it."""

    def __init__(self, recording: Recording) -> None:
        self.recording, self.begin, self.end = recording, recording.session, recording.end
        self._live = self.begin.driver == "live"
        self.missing: list[str] = []
        """What isn't in the recording, and what stands for it; nothing in a whole one of the laboratory."""
        self._damage()
        self._track = recording.track(recording.kind.real)

    def _damage(self) -> None:
        """Say what is missing from the file."""
        recording = self.recording
        if recording.damage:
            self.missing.append(f"the recording is damaged: {recording.damage}")
        if recording.dropped:
            counts = ", ".join(f"{count} of {topic}" for topic, count in sorted(recording.dropped.items()))
            self.missing.append(f"messages for which the disk was too slow: {counts}")

    def _fail(self, problem: str) -> FormatError:
        return FormatError(str(self.recording.path), problem)

    def _measured(self, t: Array) -> tuple[Array, Array, Array]:
        """Play time [s], (k,), of the real robot, what was measured, and what it was told, at times [s], (k,)."""
        track, rows = self._track, len(t)
        if np.array_equal(track.t[:rows], t):
            return track.play[:rows], track.q[:rows], track.reference[:rows]
        self.missing += track.not_measured(t)
        play, q, reference = (track.on(t, column) for column in ("play", "q", "reference"))
        q[track.unmeasured(t)] = np.nan
        if len(track.gaps) == len(track.t) - 1 or not np.isfinite(q).any():
            raise self._fail(f"holds no two samples of the real robot within {GAP} s")
        return np.maximum.accumulate(play), q, reference

    def _shown(self, again: Rerun, until: float) -> Sequence[AnyTimeline]:
        """The virtual robot's timelines: as the commands make them, which is exact, or by its recorded edits."""
        recording = self.recording
        if not again.missing and not again.difference:
            return again.drives
        why = again.difference or again.missing
        self.missing.append(f"the virtual robot is as its recorded edits have it, since {why}")
        if recording.certain < until:
            self.missing.append(f"edits of the virtual robot's timeline after {recording.certain:.3f} s")
        return recording.drives

    def _gap(self, t: Array) -> float:
        """For how long nothing was measured of the real robot, between its samples [s]."""
        return float(self._track.gap_lengths(t).sum())


class RunFigures(_Figures):
    """A run of an arm's twins as its recording has it, put together when it's made."""

    def __init__(self, recording: Recording) -> None:
        super().__init__(recording)
        self.run = self._run()
        self.attributions, self.offsets = self._extras()
        """Its measures split among causes, and what other offsets made of the network; none where not recorded."""

    def summary(self) -> Json:
        """The run's own summary."""
        return summarize(self.run, self.attributions, self.offsets)

    def _extras(self) -> tuple[tuple[Attribution, ...], tuple[OffsetOutcome, ...]]:
        extras = None if self.end is None else self.end.extras
        if extras is None:
            if not self._live:
                self.missing.append("what other runs say of the causes, and of other offsets")
            return (), ()
        return extras_of(extras, str(self.recording.path))

    def _run(self) -> TwinRun:
        """The run on its even grid."""
        recording, begin, track = self.recording, self.begin, self._track
        t = self._grid(track)
        play, q_real, q_reference = self._measured(t)
        measured = measured_rows(q_real)
        again = rerun(recording)
        shown = arm_timeline(self._shown(again, math.inf)[-1])
        corrections = self._corrections()
        alone = self._alone() if corrections else shown
        if not np.isfinite(q_reference).all():
            self.missing.append("the real robot's own references: the virtual robot's timeline stands for its")
            q_reference = np.where(np.isfinite(q_reference), q_reference, shown.sample(play))
        receipts = again.receipts if shown is again.timeline else recording.receipts("virtual")
        if begin.late is not None:
            # A command that was over when the recording began stands there for what may go on with it.
            newest = begin.late.newest
            receipts = tuple(r for r in receipts if r.command_id > newest or (r.end or -math.inf) > begin.t)
        answers, messages = recording.receipts("real"), recording.messages()
        return TwinRun(
            robot=recording.robot,
            session=begin,
            t=t,
            play=play,
            q_virtual=alone.sample(t),
            q_shown=shown.sample(t),
            q_matched=alone.sample(play),
            q_real=q_real,
            q_reference=q_reference,
            receipts_virtual=receipts,
            receipts_real=answers,
            packets=self._packets(answers, messages),
            messages=messages,
            corrections=corrections,
            events=self._events(t, play, q_reference, measured),
            gap_s=self._gap(t),
            samples=self._samples(track, alone, shown),
        )

    def _grid(self, track: SampleTrack) -> Array:
        """User times of the run [s], (k,): even ones."""
        step, known = self.begin.step, track.t
        if not len(known):
            raise self._fail("holds no samples of the real robot to compare with")
        start = 0.0
        if self.begin.sampled is not None:
            # Times of every other sample, but where the body was late.
            period = self.begin.sampled
            start = float(np.median(known - period * np.round((known - known[0]) / period)))
            step = 2 * period
            start %= step
        first = max(math.ceil((float(known[0]) - start) / step - 1e-6), 0)
        last = math.floor((float(known[-1]) - start) / step + 1e-6)
        if self.end is not None and not self._live:
            last = round(self.end.t / step)
        if last - first < 1:
            raise self._fail("holds less than two samples of the real robot")
        if last - first >= MOST_ROWS:
            raise self._fail(f"is longer than the {MOST_ROWS} samples that are compared")
        t: Array = start + step * np.arange(first, last + 1, dtype=np.float64)
        return t

    def _samples(self, track: SampleTrack, alone: Timeline, shown: Timeline) -> TwinSamples | None:
        """See `TwinRun.samples`; of very many, some."""
        if self.begin.sampled is None:
            return None
        every = -(-len(track.t) // MOST_ROWS)
        t, play, q, reference = (column[::every] for column in (track.t, track.play, track.q, track.reference))
        reference = np.where(np.isfinite(reference), reference, shown.sample(play))
        return TwinSamples(t, alone.sample(t), shown.sample(t), alone.sample(play), q, reference)

    def _corrections(self) -> tuple[Correction, ...]:
        anchors = (entry for entry in self.recording.commands if isinstance(entry, Anchor))
        return tuple(Correction(made.at, made.end, made.error, made.reason) for made in anchors)

    def _taken(self) -> list[tuple[CommandRecord, Receipt | None]]:
        """The commands that were carried out, with their receipts."""
        found = []
        for entry in self.recording.commands:
            if isinstance(entry, CommandRecord):
                receipt = entry.receipt
                if receipt is None or receipt.status is not Status.REJECTED:
                    found.append((entry, receipt))
        return found

    def _alone(self) -> Timeline:
        """What the commands alone make of the virtual robot."""
        sent = [(entry.at, entry.command, receipt) for entry, receipt in self._taken()]
        return carried_out(*begun(self.recording), sent)

    def _packets(self, answers: tuple[Receipt, ...], messages: Array) -> tuple[CommandPacket, ...]:
        if not self._live:
            if self.end is None:
                self.missing.append("what became of commands that weren't answered yet")
            return self.recording.packets
        # The operator's site doesn't know when a command reached the robot, but when it left the emulated link.
        messages = messages[np.argsort(messages[:, 0], kind="stable")]
        known = {receipt.command_id for receipt in answers}
        found = list[CommandPacket]()
        for entry, receipt in self._taken():
            if receipt is None:
                continue
            place = int(np.searchsorted(messages[:, 0], entry.at - 1e-9))
            arrivals = messages[place : place + 4, 1]
            there = arrivals[np.isfinite(arrivals)]
            answered = receipt.command_id in known
            found.append(
                CommandPacket(
                    len(found) + 1,
                    receipt.command_id,
                    entry.at,
                    float(there.min()) if answered and len(there) else None,
                    receipt.command_id if answered else None,
                    bool(len(arrivals) and not np.isfinite(arrivals[0])),
                )
            )
        return tuple(found)

    def _events(
        self, t: Array, play: Array, q_reference: Array, measured: NDArray[np.bool_]
    ) -> tuple[RunEvent, ...]:
        events = list(self.recording.events)
        # A whole recording of the laboratory has them.
        whole = self.end is not None and not self._live
        if not whole and self.begin.offset in {ADAPTIVE, OWN}:
            found = waits(t, play, q_reference, slowest=1.0 - PlayoutConfig().slew)
            events += [one for one in found if measured[np.searchsorted(t, one.t - 1e-9)]]
        return tuple(sorted(event for event in events if event.t <= t[-1]))


def differences(first: Any, second: Any, path: str = "") -> dict[str, float]:
    """By how much the second of two summaries' numbers is larger, by their paths; lists of equal length, too."""
    found: dict[str, float] = {}
    if isinstance(first, dict) and isinstance(second, dict):
        for name in sorted(first.keys() & second.keys()):
            found |= differences(first[name], second[name], f"{path}.{name}" if path else name)
    elif isinstance(first, list) and isinstance(second, list) and len(first) == len(second):
        for number, (a, b) in enumerate(zip(first, second, strict=True), start=1):
            if isinstance(a, int | float):
                found |= differences(a, b, f"{path}[{number}]")
    elif _is_number(first) and _is_number(second):
        found[path] = round(second - first, 9) + 0.0
    return found


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


SCHEMA = "vrs-drive/1"


class DriveFigures(_Figures):
    """A drive of a mobile robot as its recording has it, put together when it's made."""

    def __init__(self, recording: Recording) -> None:
        super().__init__(recording)
        t = self._grid()
        _, real, drives = self._measured(t)
        packets = [entry for entry in recording.link if entry.direction == "forward"]
        track, case = self._track, self._case()
        driven = self._facts.length or math.inf
        taken = [(e.sent, e.arrived - e.sent) for e in packets if e.arrived is not None and e.sent < driven]
        self.run = DriveRun(
            case=case,
            t=t,
            virtual=self._virtual(t),
            real=real,
            measured=_sampled(recording, MEASURED, t),
            estimated=_sampled(recording, ESTIMATED, t),
            drives=drives,
            offset=resample(track.t, (track.t - track.play)[:, None], t)[:, 0],
            delays=np.array(taken).reshape(-1, 2),
            touched=tuple(Collision(e.t, e.text) for e in recording.events if e.kind == COLLISION),
            sent_bytes=sum(entry.size for entry in packets),
            reported_bytes=sum(entry.size for entry in recording.link if entry.direction == "backward"),
            learned=(),
        )  # fmt: skip

    def summary(self) -> Json:
        """The run's own summary."""
        t = self.run.t
        return {
            "schema": SCHEMA,
            "title": self.begin.title,
            "duration_s": float(t[-1] - t[0]),
            "gap_s": self._gap(t),
            **facts_of(row_of(self.run)),
            # Live, nobody counts a packet's bytes.
            **({"sent_bytes": None} if self._live else {}),
        }

    @property
    def _facts(self) -> DriveFacts:
        facts = self.begin.drive
        assert facts is not None
        return facts

    def _case(self) -> DriveCase:
        begin, facts = self.begin, self._facts
        # Live, nothing is settled beforehand, and the robot alone knows what tells it where it is.
        named = ("architecture", "operator") if self._live else ("architecture", "operator", "length", "position")
        try:
            same = {name: getattr(facts, name) for name in named}
            same |= {"robot": facts.body, "known": self.recording.robot, "seed": begin.seed or 0}
            return DriveCase(transport=Transport(facts.transport), delay=begin.delay, **same)
        except InvalidValueError as error:
            raise self._fail(f"its beginning: {error}") from None

    def _grid(self) -> Array:
        """Times of the run [s], (k,): the samples' own where none is missing."""
        step, t = self.begin.step, self._track.t
        if len(t) < 2:
            raise self._fail("holds less than two samples of the real robot")
        if max(float(t[-1] - t[0]), abs(float(t[0]))) >= MOST_ROWS * step:
            raise self._fail(f"is longer than the {MOST_ROWS} samples that are compared")
        if self._live:
            unmet, *others = self.recording.drives
            # Until the robot was met, the virtual one stood somewhere else.
            met = others[0].start if others and not len(unmet) else t[0]
            # And a time in each gap, where nothing is known.
            moments: Array = np.union1d(t, self._track.gaps.mean(axis=1))
            return moments[moments >= met]
        first, last = round(float(t[0]) / step), round(float(t[-1]) / step)
        if last - first + 1 == len(t):
            return t
        even: Array = step * np.arange(first, last + 1, dtype=np.float64)
        return even

    def _virtual(self, t: Array) -> Array:
        """Postures of the virtual robot at times [s], (k, 3)."""
        virtual = sampled(self._shown(rerun(self.recording), float(t[-1])), t)
        if not matchable(virtual):
            raise self._fail(f"its virtual robot drives further than {FARTHEST:g} m")
        return virtual


def _sampled(recording: Recording, topic: str, t: Array) -> Array:
    """Postures of a channel at times [s], (k, 3); NaN where it has none."""
    track = recording.track(topic)
    return track.on(t, "q") if len(track.t) else np.full((len(t), 3), np.nan)
