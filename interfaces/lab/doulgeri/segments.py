"""Fig. 1: the segments of a move, and what a later command makes of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise, zip_longest
from typing import TYPE_CHECKING, Final

import numpy as np

from interfaces.lab.claims import Claim, Counterfactual, Findings, Results, Study, Table, at_most, none_of
from interfaces.lab.doulgeri.script import HOME, MODEL, target
from interfaces.lab.output import BAD, MUTED, VIRTUAL, draw, legend
from vrs import Engine, Insertion, JointTarget, MotionCommand, PolynomialSegment, Profile, Stop, Timeline
from vrs.model import Array, frozen_array

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Canvas

SAME: Final = 1e-9
"""Jumps [rad, rad/s] and time shifts that differ by less [s] count as none."""
MOVES: Final = 40
"""Moves and redirections of a run."""
STEP: Final = frozen_array((0.8, -0.5, 0.4, 0.3, 0.4, -0.6))
"""From home to the first command's target of Fig. 1 [rad]."""
GOAL: Final = frozen_array(HOME - 0.5 * STEP)
"""The second command's [rad]."""
FIG_1: Final = "Fig. 1, eq. (6)"
II_B: Final = "Section II-B"


def example() -> Results:
    """A move, and a second command in its linear segment; nothing is scheduled after it. Then the rivals."""
    first = MotionCommand(JointTarget(HOME + STEP), execute_at=0.5, speed=0.6)
    engine = planned(first)
    before = engine.timeline
    line = moving(before)[1]
    t_exec = line.start + 0.5 * line.duration
    second = MotionCommand(JointTarget(GOAL), execute_at=t_exec, speed=0.6)
    engine.execute(second)
    after = engine.timeline
    halted = planned(first)
    halted.execute(Stop(execute_at=t_exec))
    halted.execute(replace(second, execute_at=halted.timeline.end))
    by_way = planned(first)
    by_way.insert_via(1, second.target, execute_at=t_exec)
    early = planned(first, replace(second, execute_at=t_exec - 0.5 * moving(after)[2].duration))
    return Results(
        before=before,
        after=after,
        t_exec=t_exec,
        smooth=planned(replace(first, profile=Profile.JERK_LIMITED)).timeline,  # the first move, by another profile
        halted=halted.timeline,  # braked first, and begun anew from rest
        by_way=by_way.timeline,  # by the second target to the first, which is kept
        early=early.timeline,  # the blend lies about t_exec
    )


def planned(*commands: MotionCommand) -> Engine:
    """An engine that was given commands offline."""
    engine = Engine(MODEL, q=HOME, clock=None)
    for command in commands:
        engine.execute(command)
    return engine


def moving(timeline: Timeline) -> tuple[PolynomialSegment, ...]:
    """The segments of moves, without holds."""
    return tuple(segment for segment in timeline.segments if segment.command_id is not None)


def degree(segment: PolynomialSegment) -> int:
    """The highest power with a coefficient that isn't nought."""
    used = np.flatnonzero(np.abs(segment.coefficients).max(axis=1) > 0)
    return int(used[-1]) if len(used) else 0


def jumps(segments: Sequence[PolynomialSegment]) -> tuple[float, float]:
    """Largest jumps of position [rad] and velocity [rad/s] from one segment to the next."""
    worst = [0.0, 0.0]
    for a, b in pairwise(segments):
        for k in range(2):
            gap = np.abs(a.value(a.end, derivative=k) - b.value(b.start, derivative=k)).max()
            worst[k] = max(worst[k], float(gap))
    return worst[0], worst[1]


def splice(rng: np.random.Generator) -> Results:
    """Four moves, and a command somewhere in the first three, many times: what became of the moves after it.

    Beside it the rivals: a naive insertion, the tail planned anew, and a blend about t_exec.
    """
    seen, naive = [(0.0, 0.0)], [(0.0, 0.0)]
    kept, anew = Tail(), Tail()
    past, early_past = 0.0, 0.0
    for _ in range(MOVES):
        engine = Engine(MODEL, q=HOME, clock=None)
        profile = list(Profile)[rng.integers(2)]
        commands = []
        for _ in range(4):
            t = engine.timeline.end + rng.uniform(0.0, 0.5)
            commands.append(MotionCommand(target(rng), execute_at=t, speed=rng.uniform(0.3, 1.0), profile=profile))
            engine.execute(commands[-1])
        old = engine.timeline
        t_exec = float(rng.uniform(old.start, moving(old)[-1].start - 1e-3))
        command = MotionCommand(target(rng), execute_at=t_exec, speed=rng.uniform(0.3, 1.0))
        receipt = engine.execute(command)
        new = engine.timeline
        tail = {owner: commands[owner - 1] for owner in receipt.shifted}
        seen.append(jumps(new.segments))
        naive.append(jumps(naively(old, command, tuple(tail))))
        kept.compare(old, {owner: _of(new, owner) for owner in tail})
        anew.compare(old, planned_anew(old, command, tail))
        blend = next(s for s in new.segments if s.command_id == receipt.command_id).duration
        early = Engine(MODEL, timeline=old)
        early.execute(replace(command, execute_at=max(t_exec - 0.5 * blend, old.start)))
        t_past: Array = np.linspace(old.start, t_exec, 200)
        before = old.sample(t_past)
        past = max(past, float(np.abs(before - new.sample(t_past)).max()))
        early_past = max(early_past, float(np.abs(before - early.timeline.sample(t_past)).max()))
    return Results(
        jumps=tuple(max(column) for column in zip(*seen, strict=True)),  # of position [rad] and velocity [rad/s]
        naive=tuple(max(column) for column in zip(*naive, strict=True)),
        tail=kept,
        anew=anew,
        past=past,  # largest change before t_exec [rad]
        early=early_past,
    )


def naively(old: Timeline, command: MotionCommand, tail: Sequence[int]) -> list[PolynomialSegment]:
    """An insertion that knows neither velocity nor joining moves: the tail follows a move that begins at rest."""
    t = command.execute_at
    assert t is not None
    head = [replace(s, duration=min(s.end, t) - s.start) for s in old.segments if s.start < t]
    alone = Engine(MODEL, q=old.sample(t))
    alone.execute(command)
    made = list(moving(alone.timeline))
    rest = [s for s in old.segments if s.command_id in tail]
    shift = made[-1].end - rest[0].start if rest else 0.0
    return head + made + [replace(s, start=s.start + shift) for s in rest]


def planned_anew(
    old: Timeline, command: MotionCommand, tail: dict[int, MotionCommand]
) -> dict[int, list[PolynomialSegment]]:
    """The tail's moves where each is planned once more, as soon as the one before it is over."""
    engine = Engine(MODEL, timeline=old)
    engine.execute(replace(command, insertion=Insertion.REPLACE))
    made = {}
    for owner, again in tail.items():
        assert again.execute_at is not None
        t = max(again.execute_at, engine.timeline.end)
        receipt = engine.execute(replace(again, execute_at=t))
        made[owner] = _of(engine.timeline, receipt.command_id)
    return made


class Tail:
    """What became of the segments after an insertion."""

    def __init__(self) -> None:
        self.segments = 0
        """How many were compared."""
        self.changed = 0
        """Those whose coefficients or durations aren't the same bits, or that aren't there."""
        self.uneven = 0.0
        """Largest difference of the shifts within a tail [s]."""

    def compare(self, old: Timeline, new: dict[int, list[PolynomialSegment]]) -> None:
        """Compare moves, by their commands, with what they were."""
        shifts = []
        for owner, segments in new.items():
            for a, b in zip_longest(_of(old, owner), segments):
                self.segments += 1
                if a is None or b is None:
                    self.changed += 1
                    continue
                self.changed += a.duration != b.duration or a.coefficients.tobytes() != b.coefficients.tobytes()
                shifts.append(b.start - a.start)
        self.uneven = max(self.uneven, float(np.ptp(shifts)) if shifts else 0.0)


def _of(timeline: Timeline, owner: int) -> list[PolynomialSegment]:
    return [segment for segment in timeline.segments if segment.command_id == owner]


def work(study: Study, _case: str) -> Findings:
    """Measure the figure, and many like it."""
    fig = example()
    s, new = moving(fig.before), moving(fig.after)
    seen = [splice(np.random.default_rng((study.seed, 1, run))) for run in range(study.runs)]
    position, velocity = np.max([r.jumps for r in seen], axis=0).tolist()
    other_position, other_velocity = np.max([r.naive for r in seen], axis=0).tolist()
    tails = sum(r.tail.segments for r in seen)
    many = f"{study.runs * MOVES} random splices"
    naive = "a naive insertion: from rest, and no joining move"
    anew = "each move of the tail planned anew"
    centred = "a blend that lies about t_exec"
    cut, other_cut = (_head(fig, after) for after in (fig.after, fig.early))
    replaced, kept = (float(np.abs(after.sample(after.end) - GOAL).max()) for after in (fig.after, fig.by_way))
    claims = (
        _degrees(
            "a linear move with parabolic blends", s, "3: 2, 1, 2", "jerk-limited blends", moving(fig.smooth)
        ),
        _degrees(
            "a second command in the linear segment", new, "5: 2, 1, 2, 1, 2", "a stop first", moving(fig.halted)
        ),
        Claim(
            "s1 stays as it is, s2' is s2 cut short at t_exec, s3' begins there",
            FIG_1, "so", *cut, counterfactual=Counterfactual(centred, *other_cut),
        ),
        at_most(
            "with nothing scheduled after it the old target is replaced: distance of the end from the new [rad]",
            FIG_1, SAME, replaced, ("the old target kept, the new one on the way", kept),
        ),
        at_most(
            f"continuity, a⁰ of s(i+1) = p of s(i) at its end: largest jump [rad], {many}",
            "Section II, eq. (3)", SAME, position, (naive, other_position),
        ),
        at_most(
            f"velocity is continuous too: largest jump [rad/s], {many}", II_B, SAME, velocity,
            (naive, other_velocity),
        ),
        none_of(
            f"the tail's coefficients and durations stay the same bits: segments that changed, of {tails}",
            II_B, sum(r.tail.changed for r in seen), (anew, sum(r.anew.changed for r in seen)), of=tails,
        ),
        at_most(
            f"the tail is shifted as one: largest difference of shifts [s], {many}",
            II_B, SAME, max(r.tail.uneven for r in seen) if tails else np.inf,
            (anew, max(r.anew.uneven for r in seen)),
        ),
        at_most(
            f"a command modifies the trajectory only from t_exec on: largest change before it [rad], {many}",
            "Section II-B, eq. (5)", SAME, max(r.past for r in seen), (centred, max(r.early for r in seen)),
        ),
        at_most(
            "t_exec at or after the end of the last segment: new segments begin then, off by [s]", II_B, SAME,
            appended(Insertion.SPLICE),
            ("appended at once, whatever t_exec", appended(Insertion.APPEND, asked=False)),
        ),
    )  # fmt: skip
    columns = ("segment", "start s", "end s", "degree", "a0 deg", "a1 deg/s", "a2 deg/s²")
    rows = [_row(f"s{i + 1}", x) for i, x in enumerate(s)]
    rows += [_row(f"s{i + 1}'" if i else "s1", x) for i, x in enumerate(new)]
    table = Table("segments", "Fig. 1: joint 1 before and after the second command", columns, tuple(rows))
    picture = draw("fig1-segments", "Fig. 1: a second command in the linear segment", _paint, fig, height=3.6)
    return Findings(claims, (table,), (picture,))


def _degrees(
    what: str,
    segments: tuple[PolynomialSegment, ...],
    expected: str,
    rival: str,
    others: tuple[PolynomialSegment, ...],
) -> Claim:
    found, other = (f"{len(x)}: {', '.join(str(degree(segment)) for segment in x)}" for x in (segments, others))
    beside = Counterfactual(rival, other, other == expected)
    return Claim(
        f"{what}: segments, and their degrees", FIG_1, expected, found, found == expected, counterfactual=beside
    )


def _head(fig: Results, after: Timeline) -> tuple[str, bool]:
    """What became of the first two segments, and where the third begins; whether that's as in the figure."""
    old, new = moving(fig.before), moving(after)
    kept = old[0] == new[0]
    head = new[1].start == old[1].start and np.array_equal(new[1].coefficients, old[1].coefficients)
    late = new[2].start - fig.t_exec
    whole = bool(kept and head and abs(new[1].end - fig.t_exec) <= SAME and abs(late) <= SAME)
    return f"s1 {_kept(kept)}, s2' {_kept(head)}, s3' begins {late:.1e} s after t_exec", whole


def appended(how: Insertion, *, asked: bool = True) -> float:
    """How far from t_exec a move begins that comes after all others [s]; it may be given without t_exec."""
    engine = Engine(MODEL, q=HOME, clock=None)
    engine.execute(MotionCommand(JointTarget(HOME + 0.2), execute_at=0.5))
    t_exec = engine.timeline.end + 0.7
    command = MotionCommand(JointTarget(HOME), execute_at=t_exec if asked else None, insertion=how)
    receipt = engine.execute(command)
    return abs(_of(engine.timeline, receipt.command_id)[0].start - t_exec)


def _kept(kept: bool) -> str:
    return "kept" if kept else "changed"


def _row(name: str, segment: PolynomialSegment) -> tuple[str | float, ...]:
    a = np.zeros(3)
    a[: len(segment.coefficients)] = np.degrees(segment.coefficients[:3, 0])
    return (name, segment.start, segment.end, degree(segment), *a.tolist())


def _paint(canvas: Canvas, fig: Results) -> None:
    ax = canvas.add_subplot()
    old, new = moving(fig.before), moving(fig.after)
    for timeline, style, colour, name in (
        (fig.before, (0, (5, 3)), MUTED, "before the second command"),
        (fig.after, "-", VIRTUAL, "after it"),
    ):
        t = np.linspace(0.2, new[-1].end + 0.2, 600)
        ax.plot(t, np.degrees(timeline.sample(t)[:, 0]), linestyle=style, color=colour, label=name)
    for segments, colour, shift in ((old, MUTED, 8), (new[1:], VIRTUAL, -13)):
        for i, segment in enumerate(segments):
            k = i + 1 if segments is old else i + 2
            middle = segment.start + 0.5 * segment.duration
            text = f"s{k}" if segments is old else f"s{k}′"
            place = middle, float(np.degrees(segment.value(middle)[0]))
            aside = -12 if segments is old and k == 2 else 0
            ax.annotate(text, place, (aside, shift), textcoords="offset points", ha="center", color=colour)
            ends = np.array([segment.start, segment.end])
            ax.plot(ends, np.degrees(segment.value(ends)[:, 0]), "o", color=colour, markersize=3.5)
    ax.axvline(fig.t_exec, color=BAD, linewidth=0.9)
    ax.annotate("t exec", (fig.t_exec, ax.get_ylim()[1]), (4, -10), textcoords="offset points", color=BAD)
    ax.set(xlabel="time on the timeline, s", ylabel="joint 1, deg")
    legend(ax, place="lower left")
