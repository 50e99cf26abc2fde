"""Fig. 1: the segments of a move, and what a later command makes of them."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING, Final

import numpy as np

from interfaces.lab.claims import Claim, Findings, Results, Study, Table, at_most, none_of
from interfaces.lab.doulgeri.script import HOME, MODEL, target
from interfaces.lab.output import BAD, MUTED, VIRTUAL, draw, legend
from vrs import Engine, JointTarget, MotionCommand, PolynomialSegment, Profile, Timeline
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
    """A move, and a second command in its linear segment; nothing is scheduled after it."""
    engine = Engine(MODEL, q=HOME, clock=None)
    engine.execute(MotionCommand(JointTarget(HOME + STEP), execute_at=0.5, speed=0.6))
    before = engine.timeline
    line = moving(before)[1]
    t_exec = line.start + 0.5 * line.duration
    engine.execute(MotionCommand(JointTarget(GOAL), execute_at=t_exec, speed=0.6))
    return Results(before=before, after=engine.timeline, t_exec=t_exec)


def moving(timeline: Timeline) -> tuple[PolynomialSegment, ...]:
    """The segments of moves, without holds."""
    return tuple(segment for segment in timeline.segments if segment.command_id is not None)


def degree(segment: PolynomialSegment) -> int:
    """The highest power with a coefficient that isn't nought."""
    used = np.flatnonzero(np.abs(segment.coefficients).max(axis=1) > 0)
    return int(used[-1]) if len(used) else 0


def jumps(timeline: Timeline) -> tuple[float, float]:
    """Largest jumps of position [rad] and velocity [rad/s] from one segment to the next."""
    worst = [0.0, 0.0]
    for a, b in pairwise(timeline.segments):
        for k in range(2):
            gap = np.abs(a.value(a.end, derivative=k) - b.value(b.start, derivative=k)).max()
            worst[k] = max(worst[k], float(gap))
    return worst[0], worst[1]


def splice(rng: np.random.Generator) -> Results:
    """Four moves, and a command somewhere in the first three, many times: what became of the moves after it."""
    worst, tails, changed, uneven, past = [0.0, 0.0], 0, 0, 0.0, 0.0
    for _ in range(MOVES):
        engine = Engine(MODEL, q=HOME, clock=None)
        profile = list(Profile)[rng.integers(2)]
        for _ in range(4):
            t = engine.timeline.end + rng.uniform(0.0, 0.5)
            engine.execute(MotionCommand(target(rng), execute_at=t, speed=rng.uniform(0.3, 1.0), profile=profile))
        old = engine.timeline
        t_exec = float(rng.uniform(old.start, moving(old)[-1].start - 1e-3))
        receipt = engine.execute(MotionCommand(target(rng), execute_at=t_exec, speed=rng.uniform(0.3, 1.0)))
        new = engine.timeline
        worst = [max(pair) for pair in zip(worst, jumps(new), strict=True)]
        shifts = []
        for owner in receipt.shifted:
            pairs = zip(_of(old, owner), _of(new, owner), strict=True)
            for a, b in pairs:
                tails += 1
                same = a.duration == b.duration and a.coefficients.tobytes() == b.coefficients.tobytes()
                changed += not same
                shifts.append(b.start - a.start)
        uneven = max(uneven, float(np.ptp(shifts)) if shifts else 0.0)
        early: Array = np.linspace(old.start, t_exec, 200)
        past = max(past, float(np.abs(old.sample(early) - new.sample(early)).max()))
    return Results(
        position_jump=worst[0],
        velocity_jump=worst[1],
        tails=tails,  # tail segments that were compared
        changed=changed,  # those whose coefficients or durations aren't the same bits
        uneven=uneven,  # largest difference of the shifts within a tail [s]
        past=past,  # largest change before t_exec [rad]
    )


def _of(timeline: Timeline, owner: int) -> list[PolynomialSegment]:
    return [segment for segment in timeline.segments if segment.command_id == owner]


def work(study: Study, _case: str) -> Findings:
    """Measure the figure, and many like it."""
    fig = example()
    s, new = moving(fig.before), moving(fig.after)
    kept = s[0] == new[0]
    head = new[1].start == s[1].start and np.array_equal(new[1].coefficients, s[1].coefficients)
    seen = [splice(np.random.default_rng((study.seed, 1, run))) for run in range(study.runs)]
    position, velocity = max(r.position_jump for r in seen), max(r.velocity_jump for r in seen)
    tails, changed = sum(r.tails for r in seen), sum(r.changed for r in seen)
    uneven, past = max(r.uneven for r in seen), max(r.past for r in seen)
    replaced = {segment.command_id for segment in new} == {1, 2} and new[-1].command_id == 2
    end = float(np.abs(fig.after.sample(fig.after.end) - fig.after.segments[-1].value(fig.after.end)).max())
    goal = float(np.abs(fig.after.sample(fig.after.end) - GOAL).max())
    later = _appended()
    many = f"{study.runs * MOVES} random splices"
    claims = (
        _degrees("a linear move with parabolic blends", s, "3: 2, 1, 2"),
        _degrees("a second command in the linear segment", new, "5: 2, 1, 2, 1, 2"),
        Claim(
            "s1 stays as it is, s2' is s2 cut short at t_exec, s3' begins there",
            FIG_1, "so",
            f"s1 {_kept(kept)}, s2' {_kept(head)}, s3' begins {new[2].start - fig.t_exec:.1e} s after t_exec",
            bool(kept and head and abs(new[1].end - fig.t_exec) <= SAME and abs(new[2].start - fig.t_exec) <= SAME),
        ),
        Claim(
            "with nothing scheduled after it the old target is replaced: distance of the end from the new [rad]",
            FIG_1, "≤ 1e-9", max(goal, end), bool(replaced and max(goal, end) <= SAME),
        ),
        at_most(
            f"continuity, a⁰ of s(i+1) = p of s(i) at its end: largest jump [rad], {many}",
            "Section II, eq. (3)", SAME, position,
        ),
        at_most(f"velocity is continuous too: largest jump [rad/s], {many}", II_B, SAME, velocity),
        none_of(
            f"the tail's coefficients and durations stay the same bits: segments that changed, of {tails}",
            II_B, changed, of=tails,
        ),
        Claim(
            f"the tail is shifted as one: largest difference of shifts [s], {many}",
            II_B, "≤ 1e-9", uneven, uneven <= SAME and tails > 0,
        ),
        at_most(
            f"a command modifies the trajectory only from t_exec on: largest change before it [rad], {many}",
            "Section II-B, eq. (5)", SAME, past,
        ),
        at_most(
            "t_exec at or after the end of the last segment: new segments begin then, off by [s]", II_B, SAME, later
        ),
    )  # fmt: skip
    columns = ("segment", "start s", "end s", "degree", "a0 deg", "a1 deg/s", "a2 deg/s²")
    rows = [_row(f"s{i + 1}", x) for i, x in enumerate(s)]
    rows += [_row(f"s{i + 1}'" if i else "s1", x) for i, x in enumerate(new)]
    table = Table("segments", "Fig. 1: joint 1 before and after the second command", columns, tuple(rows))
    picture = draw("fig1-segments", "Fig. 1: a second command in the linear segment", _paint, fig, height=3.6)
    return Findings(claims, (table,), (picture,))


def _degrees(what: str, segments: tuple[PolynomialSegment, ...], expected: str) -> Claim:
    found = f"{len(segments)}: {', '.join(str(degree(segment)) for segment in segments)}"
    return Claim(f"{what}: segments, and their degrees", FIG_1, expected, found, found == expected)


def _appended() -> float:
    """How far from t_exec a move begins that comes after all others [s]."""
    engine = Engine(MODEL, q=HOME, clock=None)
    engine.execute(MotionCommand(JointTarget(HOME + 0.2), execute_at=0.5))
    t_exec = engine.timeline.end + 0.7
    receipt = engine.execute(MotionCommand(JointTarget(HOME), execute_at=t_exec))
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
