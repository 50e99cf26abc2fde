"""Open problem (d): interactivity. What a user can do while the robot moves, and how soon it shows."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from interfaces import Designer, Viewer
from interfaces.clients.playhead import FASTEST, Mode
from interfaces.lab.claims import OWN_BAR, Claim, Counterfactual, Findings, Results, Study, Table, all_of, at_most
from interfaces.lab.doulgeri.agreement import AGREE, apart
from interfaces.lab.doulgeri.script import HOME, ScriptedSite, target
from interfaces.lab.output import BAD, MUTED, REAL, VIRTUAL, draw, legend
from interfaces.messages import ViewForm
from interfaces.runtime.laboratory import VirtualPart
from vrs import JointTarget, MotionCommand, Timeline
from vrs.commands import Cancel, Command, InsertVia, Resume, Retime, ScaleTime, Stop

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Canvas

D_F: Final = 0.15
"""Forward delay [s]."""
D_B: Final = 0.1
"""Backward delay [s]."""
RATE: Final = 50.0
"""Of the viewers [1/s]."""
STEP: Final = 0.005
"""How often it's looked whether something shows [s]."""
SOURCE: Final = f"Section VII, (d); {OWN_BAR}"
OVER: Final = 1e-6
EDITS: Final = ("retime", "cancel", "via", "pace", "stop", "resume", "undo")


class InteractiveSession:
    """A designer, viewers of both forms, and one who looks at the past, all far from the engine."""

    def __init__(self) -> None:
        self.joined = ScriptedSite(-D_F)
        self.joined.site.broadcast(RATE, lead=D_F + D_B)
        port = self.joined.connect(D_F, D_B)
        self.designer = Designer(port)
        self.viewers = {
            ViewForm.SEGMENTS: Viewer(port, rate=RATE, lead=D_F + D_B),
            ViewForm.FRAMES: Viewer(self.joined.connect(D_F, D_B), rate=RATE, form=ViewForm.FRAMES),
        }
        self.other = Viewer(self.joined.connect(D_F, D_B), rate=RATE)
        clients: tuple[VirtualPart, ...] = (self.designer, *self.viewers.values(), self.other)
        for client in clients:
            self.joined.add(client)
        self.issued = 0.0
        """When the newest command was given [s]."""
        self.joined.run(1.0)

    @property
    def now(self) -> float:
        """The user's time [s]."""
        return self.joined.now

    @property
    def known(self) -> Timeline:
        """The committed path, as the viewer of segments has it."""
        timeline = self.viewers[ViewForm.SEGMENTS].timeline
        assert timeline is not None
        return timeline

    def issue(self, command: Command | None) -> float:
        """Give a command, or take back the newest; how long it takes until the viewer has the path it makes [s]."""
        before, begin = self.joined.engine.timeline, self.now
        self.issued = begin
        if command is None:
            self.designer.undo(now=begin)
        else:
            self.designer.issue(command, now=begin)
        while self.now < begin + 5.0:
            self.joined.run(self.now + STEP)
            engine = self.joined.engine.timeline
            if engine is not before and apart(self.known, engine, self.now) <= AGREE:
                return self.now - begin
        return np.inf

    def whole(self) -> float:
        """How long after the newest command the viewer of frames has seen all of the path that it makes [s]."""
        end, viewer = self.joined.engine.timeline.end, self.viewers[ViewForm.FRAMES]
        while viewer.history[-1].t < end and self.now < self.issued + 60.0:
            self.joined.run(self.now + STEP)
        return self.now - self.issued

    def move(self, rng: np.random.Generator, wait: float) -> float:
        """A move that begins after a while."""
        return self.issue(MotionCommand(target(rng), execute_at=self.now + wait, speed=0.3))


def edits(rng: np.random.Generator, *, over: bool = False) -> dict[str, tuple[float, float]]:
    """Each kind of edit, a session each: how long until viewers of segments, and of frames, know the path [s].

    Args:
        rng: Of the moves.
        over: Whether the edit waits until the motion is over; else it's under way.
    """
    shown: dict[str, tuple[float, float]] = {}
    for kind in EDITS:
        session = InteractiveSession()
        session.move(rng, 0.0)
        session.issue(MotionCommand(target(rng), execute_at=session.joined.engine.timeline.end + 0.5, speed=0.3))
        if kind == "resume":
            session.issue(Stop())
            session.joined.run(session.now + 1.0)
        commands: dict[str, Command | None] = {
            "retime": Retime(2, (session.joined.engine.receipt(2).execute_at or 0.0) + 1.0),
            "cancel": Cancel(2),
            "via": InsertVia(2, JointTarget(HOME)),
            "pace": ScaleTime(0.7),
            "stop": Stop(),
            "resume": Resume(),
            "undo": None,
        }
        if over:
            session.joined.run(session.joined.engine.timeline.end + 1.0)
        seconds = session.issue(commands[kind])
        shown[kind] = seconds, np.inf if over else session.whole()
    return shown


def scrub(rng: np.random.Generator) -> Results:
    """Seek, pause and go live, while commands come."""
    session = InteractiveSession()
    for _ in range(8):
        session.move(rng, 0.0)
        session.joined.run(session.now + 1.0)
    seek = {}
    begin = session.now
    back = begin - 6.0
    for form, viewer in session.viewers.items():
        viewer.pause(now=session.now)
        viewer.seek(back, now=session.now)
        asked, seek[form] = session.now, np.inf
        while session.now < asked + 3.0:
            session.joined.run(session.now + STEP)
            if viewer.history and abs(viewer.history[-1].t - back) <= 0.5 / RATE:
                seek[form] = viewer.history[-1].shown_at - asked
                break
    viewer, there = session.viewers[ViewForm.SEGMENTS], session.other.history[-1].t
    for _ in range(3):
        session.move(rng, 0.0)
        session.joined.run(session.now + 0.5)
    dragged, stayed_live = abs(viewer.history[-1].t - back), session.other.history[-1].t - there
    gap = session.now - back
    asked = session.now
    viewer.go_live(now=asked)
    while viewer.mode is not Mode.LIVE and session.now < asked + 30.0:
        session.joined.run(session.now + STEP)
    took = session.now - asked
    session.joined.run(session.now + 1.0)
    step = _step(viewer, asked - 2.0 / RATE)
    ages, own = (
        np.ptp([shown.age for shown in one.history if shown.shown_at > 2.0]) for one in (session.other, viewer)
    )
    seen = [shown for shown in viewer.history if shown.shown_at >= begin - 1.0]
    return Results(
        seek=seek,  # by form: from a jump to the first frame of that time [s]
        dragged=dragged,  # how far the place of one who paused in the past moved while commands came [s]
        stayed_live=stayed_live,  # the same of one who didn't [s]
        live=(gap, took, step),  # the gap; how long going live took; the largest step of the time shown then [s]
        jumped=_jumped(session),  # the largest step of one who jumps to live from 6 s back [s]
        rewound=_rewound(
            session
        ),  # from 6 s ahead to the first frame of a time, by rewinding as fast as it goes [s]
        others=float(ages),  # largest change of another viewer's age [s]
        own=float(own),  # the same of the one who sought and went live [s]
        t=tuple(s.shown_at - begin for s in seen),  # [s]
        place=tuple(s.t - begin for s in seen),  # of the viewer of segments [s]
    )


def _step(viewer: Viewer, since: float) -> float:
    """Largest step from one frame to the next of the time that's shown, since a user's time [s]."""
    return float(np.abs(np.diff([shown.t for shown in viewer.history if shown.shown_at >= since])).max())


def _jumped(session: InteractiveSession) -> float:
    viewer = session.viewers[ViewForm.SEGMENTS]
    viewer.seek(session.now - 6.0, now=session.now)
    session.joined.run(session.now + 0.5)
    asked = session.now
    viewer.seek(asked, now=asked)
    session.joined.run(asked + 0.5)
    return _step(viewer, asked - 2.0 / RATE)


def _rewound(session: InteractiveSession) -> float:
    viewer = session.viewers[ViewForm.FRAMES]
    viewer.go_live(now=session.now)
    session.joined.run(session.now + 5.0)
    asked = session.now
    viewer.rewind(now=asked, rate=FASTEST)
    while viewer.history[-1].t > asked - 6.0 + 0.5 * FASTEST / RATE and session.now < asked + 5.0:
        session.joined.run(session.now + STEP)
    return session.now - asked


def work(study: Study, _case: str) -> Findings:
    """Measure what our interfaces do."""
    rng = np.random.default_rng((study.seed, 12))
    session = InteractiveSession()
    shown = []
    for _ in range(study.runs):
        shown.append(session.move(rng, 0.0))
        session.joined.run(session.now + 0.6)
    whole = session.whole()
    path = D_F + D_B
    shows = path + STEP
    slowest, quickest = max(shown), min(shown)
    edited, late, seen = edits(rng), edits(rng, over=True), scrub(rng)
    done, done_late = (sum(bool(np.isfinite(known)) for known, _ in x.values()) for x in (edited, late))
    gap, _, step = seen.live
    period = 1.0 / RATE
    frames = "frames instead of segments: the path is known when it's over"
    claims = (
        Claim(
            "from a command to the committed path that it makes, at a viewer of segments, at most [s]",
            SOURCE, f"≤ D_f + D_b + {STEP:g} = {shows:g}", slowest,
            path - OVER <= quickest and slowest <= shows + OVER,
            counterfactual=Counterfactual(frames, whole, whole <= shows + OVER),
        ),
        all_of(
            f"edits of a motion under way that are carried out and shown: {', '.join(EDITS)}",
            SOURCE, done, len(EDITS), ("given when the motion is over", done_late),
        ),
        at_most(
            "an edit shows after [s], at most", SOURCE, shows, max(known for known, _ in edited.values()),
            (frames, max(known for _, known in edited.values())), slack=OVER,
        ),
        at_most(
            "undo while live shows after [s]", SOURCE, shows, edited["undo"][0], (frames, edited["undo"][1]),
            slack=OVER,
        ),
        at_most(
            "a jump to another time, segments: first frame of it after [s]",
            SOURCE, period, seen.seek[ViewForm.SEGMENTS], ("frames instead", seen.seek[ViewForm.FRAMES]),
            slack=OVER, note=", a frame",
        ),
        at_most(
            "a jump to another time, frames: first frame of it after [s]",
            SOURCE, path + 2 * period, seen.seek[ViewForm.FRAMES],
            (f"rewinding {FASTEST:g} times as fast as time goes", seen.rewound), slack=OVER,
            note=", a round trip and two frames",
        ),
        at_most(
            "who paused in the past isn't dragged to live by commands: moved by [s]",
            SOURCE, 0, seen.dragged, ("one who didn't pause", seen.stayed_live), slack=OVER,
        ),
        at_most(
            f"going live from {gap:.2f} s back doesn't jump: largest step of the time shown between two frames [s]",
            SOURCE, FASTEST * period, step, ("a jump to live, from 6 s back", seen.jumped), slack=OVER,
        ),
        at_most(
            "meanwhile another viewer's frames keep their age, to [s]", SOURCE, period, seen.others,
            ("one play head for both", seen.own), slack=OVER,
        ),
    )  # fmt: skip
    rows = (("a move", slowest, whole), *((name, *seconds) for name, seconds in edited.items()))
    table = Table(
        "interactivity",
        f"(d) until the committed path shows it: D_f = {D_F} s, D_b = {D_B} s",
        ("what", "shows after s", "by frames, the whole path s"),
        rows,
    )
    picture = draw("d-interactivity", "(d) what a user does while the robot moves", _paint, rows, seen)
    return Findings(claims, (table,), (picture,))


def _paint(canvas: Canvas, rows: tuple[tuple[str, float, float], ...], seen: Results) -> None:
    left, right = canvas.subplots(1, 2, width_ratios=(1.0, 1.4))
    y = np.arange(len(rows))[::-1]
    left.barh(y, [1e3 * row[1] for row in rows], 0.6, color=VIRTUAL)
    left.axvline(1e3 * (D_F + D_B), color=BAD, linewidth=1.0)
    left.annotate(
        "D_f + D_b", (1e3 * (D_F + D_B), y[0] + 0.5), (-3, 0), textcoords="offset points", color=BAD, ha="right"
    )
    left.set_yticks(y, [row[0] for row in rows])
    left.set_ylim(-0.6, y[0] + 1.1)
    left.grid(visible=False, axis="y")
    left.set(xlabel="ms", title="until the committed path shows it")
    t = np.array(seen.t)
    right.plot(t, t, color=MUTED, linestyle=(0, (4, 3)), linewidth=1.0, label="live")
    right.plot(t, seen.place, ".", color=REAL, markersize=2.5, label="the viewer's frames")
    right.set(xlabel="user's time, s", ylabel="time shown, s", title="seek back while paused, then go live")
    legend(right, place="upper left")
