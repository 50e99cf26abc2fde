"""Figs 4 to 6: what delays do to commands and frames, for each offset D of the engine's clock."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np

from interfaces import Designer, Viewer
from interfaces.lab.claims import Cell, Claim, Findings, Results, Study, Table, at_most
from interfaces.lab.doulgeri.script import D_B, D_F, PortLog, ScriptedSite, arrivals, target
from interfaces.lab.output import BAD, MUTED, REAL, VIRTUAL, draw, legend
from interfaces.lab.statistics import Estimate, bootstrap, interval_name
from interfaces.messages import Frame, FrameStatus, ViewForm
from vrs import MotionCommand
from vrs.checks import one_of

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
    made = [log.outcomes[i.number].made_at for i in designer.history]  # engine's time when each command came [s]
    return Results(
        # How late each command was when it came to the engine [s].
        lateness=tuple(there - i.issued_at for there, i in zip(made, designer.history, strict=True)),
        postponed=float(np.mean(postponed)) if postponed else 0.0,  # share of commands that were
        # Of frames when they came, by the user's clock: least, mean, largest [s].
        ages=(float(ages.min()), float(ages.mean()), float(ages.max())),
        shown=max(shown.age for shown in viewer.history),  # largest age of a frame when it was shown [s]
        falsified=float(np.mean([v is not None and v.status is FrameStatus.FALSIFIED for v in verdicts])),  # share
        foretold=foretold(busy, began),  # share of the frames in whose lead a command was carried out
        # For the timing diagrams: the users' time when a command was issued, the engine's when it came [s].
        commands=tuple(zip(issued.tolist(), made, strict=True)),
        # And the engine's time when a frame was made, the time it shows, and the users' when it came [s].
        frames=tuple((frame.made_at, frame.t, at) for frame, at in log.frames),
    )


def foretold(frames: list[Frame], began: np.ndarray) -> float:
    """Share of frames with a motion that began after they were made and before the time that they show."""
    if not len(frames):
        return 0.0
    made, shows = np.array([(frame.made_at, frame.t) for frame in frames]).T
    hits = np.searchsorted(began, shows - 1e-4) > np.searchsorted(began, made)
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
    claims: list[Claim] = []
    rows = []
    for setting, seen in zip(SETTINGS.values(), found, strict=False):
        claims += delay_claims(study, setting, seen)
        rows.append(_row(study, setting, seen))
    shares = np.array(found[-1])
    claims += lead_claims(study, shares)
    title = f"Figs 4 to 6: D_f = {D_F} s, D_b = {D_B} s, {COMMANDS:g} commands a second"
    timing = "Figs 4 to 6, from a run: a command and a frame under each clock offset"
    pictures = (
        draw("figs4-6-timing", timing, _paint, [runs[0] for runs in found[:-1]], height=7.0),
        draw("falsified", "Share of predicted frames that a command falsified", _paint_leads, study, shares),
    )
    return Findings(tuple(claims), (Table.of("delays", title, rows),), pictures)


def delay_claims(study: Study, setting: OffsetSetting, seen: list[Results]) -> list[Claim]:
    """What must hold of the runs at one setting of the offset."""
    late = np.concatenate([s.lateness for s in seen])
    off = float(np.abs(late - setting.lateness).max())
    low, high = min(s.ages[0] for s in seen), max(s.ages[2] for s in seen)
    age = float(np.mean([s.ages[1] for s in seen]))
    aged = abs(low - setting.age) <= NANOSECONDS and abs(high - setting.age) <= NANOSECONDS
    claims = [
        Claim(
            f"{setting.title}: commands to be carried out at once come late by [s]",
            setting.source, setting.lateness, float(late.mean()), off <= NANOSECONDS,
        ),
        Claim(
            f"{setting.title}: age of frames by the user's clock when they come [s]",
            setting.source, setting.age, age, aged,
        ),
    ]  # fmt: skip
    if setting.lateness == 0:
        most = max(s.postponed for s in seen)
        claims.append(Claim(f"{setting.title}: share of commands postponed", setting.source, 0.0, most, most == 0))
    share = bootstrap([s.falsified for s in seen], study.seed)
    if setting.lead:
        gap = max(abs(s.falsified - s.foretold) for s in seen)
        text = (
            "predicted frames are false exactly where a command is executed between t_c and t_c + D_f + D_b: "
            "largest difference of both shares in a run"
        )
        claims.append(at_most(text, setting.source, 0.01, gap))
        text = f"share of predicted frames falsified, {COMMANDS:g} commands/s: 1 − exp(−rate · lead)"
        claims.append(_share_claim(text, setting.source, setting.lead, share))
    else:
        text = f"{setting.title}: share of frames falsified, none being predicted"
        claims.append(Claim(text, setting.source, 0.0, share.value, share.value == 0))
    return claims


def _share_claim(text: str, source: str, lead: float, share: Estimate) -> Claim:
    """It holds if the interval holds what's expected, or both are within 10 %: then they're called equal."""
    expected = -float(np.expm1(-COMMANDS * lead))
    equal = share.low <= expected <= share.high or abs(share.value - expected) <= 0.1 * expected
    return Claim(text, source, expected, share.value, equal, share.interval)


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


def lead_claims(study: Study, shares: np.ndarray) -> list[Claim]:
    """What must hold of the shares of predicted frames that were falsified; shares: (runs, leads)."""
    text = "frames {:g} s ahead, {:g} commands/s: share falsified, 1 − exp(−rate · lead)"
    return [
        _share_claim(text.format(LEADS[k], COMMANDS), "Section IV-A", LEADS[k], bootstrap(shares[:, k], study.seed))
        for k in (1, 4, 6)
    ]


def _paint_leads(canvas: Canvas, study: Study, shares: np.ndarray) -> None:
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
