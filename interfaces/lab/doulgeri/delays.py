"""Figs 4 to 6: what delays do to commands and frames, for each offset D of the engine's clock."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np

from interfaces import Designer, Viewer
from interfaces.lab.claims import (
    OWN_BAR,
    Cell,
    Claim,
    Counterfactual,
    Findings,
    Results,
    Study,
    Table,
    at_most,
)
from interfaces.lab.doulgeri.script import D_B, D_F, PortLog, ScriptedSite, arrivals, target
from interfaces.lab.output import BAD, MUTED, REAL, VIRTUAL, draw, legend
from interfaces.lab.statistics import Estimate, bootstrap, interval_name
from interfaces.messages import Frame, FrameStatus, ViewForm
from vrs import MotionCommand
from vrs.checks import one_of
from vrs.model import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Canvas

RATE: Final = 50.0
"""Frames a second."""
COMMANDS: Final = 0.8
"""Commands a second, on average."""
LEADS: Final = (0.05, 0.1, 0.2, 0.35, 0.5, 0.75, 1.0, 1.5)
"""How far ahead frames are foretold [s]."""
NANOSECONDS: Final = 5e-9
"""The engine's clock reads whole nanoseconds [s]."""


class OffsetSetting(NamedTuple):
    """A clock offset, and how far ahead frames are."""

    title: str
    D: float
    lead: float
    source: str

    @property
    def lateness(self) -> float:
        """How late a command is that's to be carried out at once, by the paper's formulas [s]."""
        return max(D_F + self.D, 0.0)

    @property
    def age(self) -> float:
        """How old a frame is by the user's clock when it comes, by the paper's formulas [s]."""
        return D_B - self.D - self.lead


SETTINGS: Final = {
    "0": OffsetSetting("D = 0", 0.0, 0.0, "Fig. 4"),
    "-Df": OffsetSetting("D = −D_f", -D_F, 0.0, "Fig. 5"),
    "-Df, predicted": OffsetSetting("D = −D_f, frames for t_c + D_f + D_b", -D_F, D_F + D_B, "Section IV-A"),
    "+Db": OffsetSetting("D = +D_b", D_B, 0.0, "Fig. 6"),
}
CASES: Final = (*SETTINGS, "leads")
WITHOUT: Final = {
    "0": ("-Df", "-Df"),
    "-Df": ("0", "0"),
    "-Df, predicted": ("0", "-Df"),
    "+Db": ("0", "0"),
}
"""What stands beside a setting: for the lateness of commands, for the age of frames."""
PREDICTED: Final = "-Df, predicted"
WRONG: Final = 1e-9
"""A frame that's further from where the robot then was [rad] is wrong."""


def run(setting: OffsetSetting, seed: int, length: float) -> Results:
    """Commands that come at random, each to be carried out at once, over constant delays."""
    rng = np.random.default_rng(seed)
    joined = ScriptedSite(setting.D)
    broadcaster = joined.site.broadcast(RATE, lead=setting.lead)
    port = joined.connect(D_F, D_B)
    designer, viewer = Designer(port), Viewer(port, rate=RATE, form=ViewForm.FRAMES)
    log = PortLog(port)
    joined.add(designer)
    joined.add(viewer)
    joined.run(1.0)
    issued = arrivals(rng, COMMANDS, 1.0, 1.0 + length)
    for t in issued:
        joined.run(float(t))
        designer.issue(MotionCommand(target(rng), speed=0.3), now=joined.now, execute_in=0.0)
    joined.run(1.0 + length + 3.0)
    postponed = [i.receipt is not None and i.late > 0 for i in designer.history]
    began = np.array(
        [i.receipt.execute_at for i in designer.history if i.receipt is not None and i.receipt.q is not None]
    )
    ages = np.array([at - frame.t for frame, at in log.frames])
    # While commands come: before and after there's nothing that could falsify.
    busy = [f for f, _ in log.frames if 1.0 + setting.lead <= f.t - setting.D <= 1.0 + length]
    verdicts = [broadcaster.status(frame.number) for frame in busy]
    was = joined.engine.timeline.sample(np.array([frame.t for frame in busy]))
    off = np.abs(np.array([frame.q for frame in busy]).reshape(was.shape) - was).max(axis=1)
    made = [log.outcomes[i.number].made_at for i in designer.history]  # engine's time when each command came [s]
    return Results(
        # How late each command was when it came to the engine [s].
        lateness=tuple(there - i.issued_at for there, i in zip(made, designer.history, strict=True)),
        postponed=float(np.mean(postponed)) if postponed else 0.0,  # share of commands that were
        # Of frames when they came, by the user's clock: least, mean, largest [s].
        ages=(float(ages.min()), float(ages.mean()), float(ages.max())),
        shown=max(shown.age for shown in viewer.history),  # largest age of a frame when it was shown [s]
        falsified=float(np.mean([v is not None and v.status is FrameStatus.FALSIFIED for v in verdicts])),  # share
        wrong=float(np.mean(off > WRONG)),  # share of frames that show another place than where the robot then was
        foretold=foretold(busy, began),  # share of the frames in whose lead a command was carried out
        foretold_back=foretold(busy, began, D_B),  # the same if only the way back counted
        # For the timing diagrams: the users' time when a command was issued, the engine's when it came [s].
        commands=tuple(zip(issued.tolist(), made, strict=True)),
        # And the engine's time when a frame was made, the time it shows, and the users' when it came [s].
        frames=tuple((frame.made_at, frame.t, at) for frame, at in log.frames),
    )


def foretold(frames: list[Frame], began: Array, lead: float | None = None) -> float:
    """Share of frames with a motion that began after they were made and before the time that they show.

    Args:
        frames: What was sent.
        began: When motions began [s], ascending.
        lead: How long after it was made a frame counts [s]; up to the time that it shows unless given.
    """
    if not len(frames):
        return 0.0
    made, shows = np.array([(frame.made_at, frame.t) for frame in frames]).T
    until = shows if lead is None else made + lead
    hits = np.searchsorted(began, until - 1e-4) > np.searchsorted(began, made)
    return float(hits.mean())


def leads(seed: int, length: float) -> tuple[float, ...]:
    """Share of falsified frames for each lead, all broadcast at once, D = −D_f."""
    rng = np.random.default_rng(seed)
    joined = ScriptedSite(-D_F)
    broadcasters = [joined.site.broadcast(RATE, lead=lead) for lead in LEADS]
    designer = Designer(joined.connect(D_F, D_B))
    joined.add(designer)
    for t in arrivals(rng, COMMANDS, 0.0, length):
        joined.run(float(t))
        designer.issue(MotionCommand(target(rng), speed=0.3), now=joined.now, execute_in=0.0)
    joined.run(length)
    return tuple(broadcaster.share_falsified or 0.0 for broadcaster in broadcasters)


def work(study: Study, case: str) -> list[Any]:
    """Measure a setting, or all leads."""
    if case == "leads":
        return [leads(study.seed + 300 + k, study.length) for k in range(study.runs)]
    setting = SETTINGS[one_of("case", case, CASES)]
    return [run(setting, study.seed + k, study.length) for k in range(study.runs)]


def conclude(study: Study, found: tuple[list[Any], ...]) -> Findings:
    """Compare with what the paper's formulas say."""
    runs, shares = dict(zip(SETTINGS, found, strict=False)), np.array(found[-1])
    claims = [claim for case in SETTINGS for claim in delay_claims(case, runs)]
    claims += [*frame_claims(runs), *lead_claims(study, runs, shares)]
    rows = [_row(study, SETTINGS[case], seen) for case, seen in runs.items()]
    title = f"Figs 4 to 6: D_f = {D_F} s, D_b = {D_B} s, {COMMANDS:g} commands a second"
    timing = "Figs 4 to 6, from a run: a command and a frame under each clock offset"
    pictures = (
        draw("figs4-6-timing", timing, _paint, [seen[0] for seen in found[:-1]], height=7.0),
        draw("falsified", "Share of predicted frames that a command falsified", _paint_leads, study, shares),
    )
    return Findings(tuple(claims), (Table.of("delays", title, rows),), pictures)


def delay_claims(case: str, runs: dict[str, list[Results]]) -> list[Claim]:
    """What must hold of the runs at one setting of the offset, beside what is so at another."""
    setting, seen = SETTINGS[case], runs[case]
    other_late, other_aged = WITHOUT[case]
    claims = [
        _exactly(
            f"{setting.title}: commands to be carried out at once come late by [s]",
            setting.source, setting.lateness, _lateness(seen),
            SETTINGS[other_late].title, _lateness(runs[other_late]),
        ),
        _exactly(
            f"{setting.title}: age of frames by the user's clock when they come [s]",
            setting.source, setting.age, _ages(seen), SETTINGS[other_aged].title, _ages(runs[other_aged]),
        ),
    ]  # fmt: skip
    if setting.lateness == 0:
        most, other = (max(s.postponed for s in x) for x in (seen, runs[other_late]))
        claims.append(
            at_most(
                f"{setting.title}: share of commands postponed", setting.source, 0, most,
                (SETTINGS[other_late].title, other),
            )
        )  # fmt: skip
    return claims


def _exactly(text: str, source: str, expected: float, found: Array, beside: str, other: Array) -> Claim:
    """A claim that every value is as expected, to what the engine's clock reads."""
    met, other_met = (bool(np.abs(x - expected).max() <= NANOSECONDS) for x in (found, other))
    counterfactual = Counterfactual(beside, float(other.mean()), other_met)
    return Claim(text, source, expected, float(found.mean()), met, counterfactual=counterfactual)


def _lateness(seen: list[Results]) -> Array:
    return np.concatenate([s.lateness for s in seen])


def _ages(seen: list[Results]) -> Array:
    return np.array([s.ages for s in seen])


def frame_claims(runs: dict[str, list[Results]]) -> list[Claim]:
    """Which frames show another place than the one where the robot then was."""
    predicted = runs[PREDICTED]
    plain = max(s.wrong for case, seen in runs.items() if not SETTINGS[case].lead for s in seen)
    gap, back = (
        max(abs(s.wrong - getattr(s, which)) for s in predicted) for which in ("foretold", "foretold_back")
    )
    text = (
        "predicted frames are false exactly where a command is executed between t_c and t_c + D_f + D_b: "
        "largest difference of both shares in a run"
    )
    return [
        at_most(
            "frames that foretell nothing show where the robot then was, under each offset: share that's false",
            "Section IV-A", 0, plain, (SETTINGS[PREDICTED].title, max(s.wrong for s in predicted)),
        ),
        at_most(text, "Section IV-A", 0.01, gap, ("between t_c and t_c + D_b", back)),
    ]  # fmt: skip


def _row(study: Study, setting: OffsetSetting, seen: list[Results]) -> tuple[tuple[str, Cell], ...]:
    late = np.concatenate([s.lateness for s in seen])
    share = bootstrap([100 * s.falsified for s in seen], study.seed)
    return (
        ("clock", setting.title),
        ("lateness, paper s", setting.lateness),
        ("measured s", float(late.mean())),
        ("postponed %", 100 * float(np.mean([s.postponed for s in seen]))),
        ("age, paper s", setting.age),
        ("measured s", float(np.mean([s.ages[1] for s in seen]))),
        ("shown at most s", max(s.shown for s in seen)),
        ("falsified %", share.value),
        (interval_name(study.runs), f"{share.low:.1f} to {share.high:.1f}"),
        ("foretold by commands %", 100 * float(np.mean([s.foretold for s in seen])) if setting.lead else 0.0),
    )


def lead_claims(study: Study, runs: dict[str, list[Results]], shares: Array) -> list[Claim]:
    """What must hold of the shares of predicted frames that were falsified; shares: (runs, leads)."""
    measured = {lead: bootstrap(shares[:, k], study.seed) for k, lead in enumerate(LEADS)}
    whole = bootstrap([s.falsified for s in runs[PREDICTED]], study.seed)
    law = f"share falsified of {COMMANDS:g} commands a second at random, 1 − exp(−rate · lead)"
    return [
        _share_claim(f"{SETTINGS[PREDICTED].title}: {law}", D_F + D_B, whole, D_B, measured),
        *(
            _share_claim(f"frames {lead:g} s ahead: {law}", lead, measured[lead], other, measured)
            for lead, other in ((0.1, 0.2), (0.5, 0.2), (1.0, 0.5))
        ),
    ]


def _share_claim(text: str, lead: float, share: Estimate, other: float, measured: dict[float, Estimate]) -> Claim:
    """It holds if the interval holds what's expected, or both are within 10 %: then they're called equal."""
    expected = -float(np.expm1(-COMMANDS * lead))

    def equal(share: Estimate) -> bool:
        return share.low <= expected <= share.high or abs(share.value - expected) <= 0.1 * expected

    beside = measured[other]
    counterfactual = Counterfactual(f"frames {other:g} s ahead", beside.value, equal(beside), beside.interval)
    source = f"Section IV-A; {OWN_BAR}"
    return Claim(text, source, expected, share.value, equal(share), share.interval, counterfactual)


def _paint_leads(canvas: Canvas, study: Study, shares: Array) -> None:
    ax = canvas.add_subplot()
    x = np.linspace(0.0, 1.6, 200)
    ax.plot(x, -100 * np.expm1(-COMMANDS * x), color=MUTED, label="1 − exp(−rate · lead)")
    points = [bootstrap(100 * column, study.seed) for column in shares.T]
    y = np.array([p.value for p in points])
    error = np.array([[p.value - p.low for p in points], [p.high - p.value for p in points]])
    ax.errorbar(
        LEADS,
        y,
        error,
        fmt="o",
        color=REAL,
        markersize=4,
        capsize=3,
        label=f"measured, {points[0].name} over seeds",
    )
    ax.set(xlabel="lead, s", ylabel="falsified, %", ylim=(0.0, 100.0))
    legend(ax, place="upper left")


def _paint(canvas: Canvas, first: list[Results]) -> None:
    rows = canvas.subplots(len(first), 1, sharex=True)
    for ax, setting, sent in zip(rows, SETTINGS.values(), first, strict=True):
        _timing(ax, setting, sent)
    rows[-1].set_xlabel("time from the issue of the command, s")


def _timing(ax: Axes, setting: OffsetSetting, sent: Results) -> None:
    """A command from the user's line to the engine's, and a frame back; each line has its own clock."""
    issued, came = sent.commands[0]
    arrived = came - setting.D - issued
    made, shows, back = next(frame for frame in sent.frames if frame[0] - setting.D >= issued + arrived + 0.2)
    x_made, x_back = made - setting.D - issued, back - issued
    for y, name in ((1.0, "user"), (0.0, "engine")):
        ax.axhline(y, color=MUTED, linewidth=1.0)
        ax.annotate(name, (-0.24, y), (0, 3), textcoords="offset points", color=MUTED)
    arrow = {"arrowstyle": "-|>", "linewidth": 1.4, "shrinkA": 0, "shrinkB": 0}
    ax.annotate("", (arrived, 0.0), (0.0, 1.0), arrowprops={**arrow, "color": VIRTUAL})
    ax.annotate("", (x_back, 1.0), (x_made, 0.0), arrowprops={**arrow, "color": REAL})
    late = came - issued
    verdict = "in time" if late <= NANOSECONDS else f"{late:.2f} s late"
    age = back - shows
    how: dict[str, Any] = {"textcoords": "offset points", "ha": "center"}
    ax.annotate("command for t = 0", (0.0, 1.0), (0, 5), color=VIRTUAL, **how)
    ax.annotate(
        f"clock reads {abs(late):.2f}:\n{verdict}",
        (arrived, 0.0),
        (0, -24),
        color=VIRTUAL if late <= NANOSECONDS else BAD,
        **how,
    )
    ax.annotate(
        f"frame for t = {shows - issued:.2f}\nmade at {made - issued:.2f}",
        (x_made, 0.0),
        (18, -24),
        color=REAL,
        **how,
    )
    ax.annotate(f"clock reads {back - issued:.2f}: {abs(age):.2f} s old", (x_back, 1.0), (0, 5), color=REAL, **how)
    ax.set(title=f"{setting.source}: {setting.title}", ylim=(-0.75, 1.45), xlim=(-0.25, 1.0))
    ax.set_yticks([])
    ax.grid(visible=False, axis="y")
    ax.spines["left"].set_visible(False)
