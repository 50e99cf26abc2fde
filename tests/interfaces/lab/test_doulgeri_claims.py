"""What is claimed of Doulgeri's paper follows from the figures, and fails where they do."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
import pytest

from interfaces.lab.claims import Claim, Figure, Results, Study, Verdict
from interfaces.lab.doulgeri import (
    agreement,
    causality,
    delays,
    dragging,
    encoding,
    interactivity,
    jitter,
    segments,
)
from interfaces.messages import ViewForm

STUDY = Study(seed=0, runs=2, length=4.0)


@pytest.fixture(autouse=True)
def _without_figures(monkeypatch: pytest.MonkeyPatch) -> None:
    for module in (agreement, delays, dragging, encoding, interactivity, jitter, segments):
        monkeypatch.setattr(module, "draw", lambda *_, **__: Figure("", "", ""))


def failed(claims: Iterable[Claim]) -> list[str]:
    return [claim.claim for claim in claims if not claim.met]


def only(claims: Iterable[Claim], *said: str) -> None:
    """Those claims fail, and no others."""
    found = failed(claims)
    assert len(found) == len(said), found
    assert all(any(word in claim for claim in found) for word in said), found


def but(seen: Results, **changes: Any) -> Results:
    """The same, with other figures."""
    assert changes.keys() <= vars(seen).keys()
    return Results(**vars(seen) | changes)


SHARE = 1.0 - math.exp(-0.8 * 0.5)
LATE = Results(
    lateness=(0.3, 0.3), postponed=1.0, ages=(0.2, 0.2, 0.2), shown=0.02, falsified=0.0, wrong=0.0, foretold=0.0,
    foretold_back=0.0,
)  # fmt: skip
PREDICTED = Results(
    lateness=(0.0, 0.0), postponed=0.0, ages=(0.0, 0.0, 0.0), shown=0.02, falsified=SHARE, wrong=SHARE,
    foretold=SHARE, foretold_back=0.15,
)  # fmt: skip
DELAYED = {
    "0": LATE,
    "-Df": but(LATE, lateness=(0.0, 0.0), postponed=0.0, ages=(0.5, 0.5, 0.5)),
    "-Df, predicted": PREDICTED,
    "+Db": but(LATE, lateness=(0.5, 0.5), ages=(0.0, 0.0, 0.0)),
}
SHARES = np.tile(-np.expm1(-0.8 * np.array(delays.LEADS)), (3, 1))


@pytest.mark.parametrize(
    ("case", "changes", "said"),
    [
        ("0", {}, []),
        ("-Df, predicted", {"lateness": (0.0, 1e-8)}, ["come late"]),
        ("-Df, predicted", {"ages": (0.0, 0.0, 1e-8)}, ["age of frames"]),
        ("+Db", {"ages": (-1e-8, 0.0, 0.0)}, ["age of frames"]),
        ("-Df", {"postponed": 0.1}, ["postponed"]),
        ("-Df, predicted", {"wrong": SHARE + 0.011}, ["largest difference"]),
        ("-Df, predicted", {"falsified": 0.5 * SHARE}, ["D_f + D_b: share falsified"]),
        ("-Df", {"wrong": 0.01}, ["foretell nothing"]),
    ],
)
def test_delays(case: str, changes: dict[str, Any], said: list[str]) -> None:
    runs = {name: [seen] * 2 for name, seen in DELAYED.items()}
    changed = runs | {case: [but(DELAYED[case], **changes)] * 2}
    only(delays.conclude(STUDY, (*changed.values(), list(SHARES))).claims, *said)


def test_shares_of_leads() -> None:
    found = delays.conclude(STUDY, (*([seen] * 2 for seen in DELAYED.values()), list(0.85 * SHARES)))
    only(found.claims, "0.1 s", "0.5 s", "1 s")


NOWHERE = np.zeros((1, 3))
HAND = Results(
    following=0.005, largest=0.02, lag=0.05, answered=0.0, limits=1.0, rejected=0, inputs=200, real=5e-4,
    real_lag=0.3, t=np.zeros(1), hand=NOWHERE, virtual=NOWHERE, robot=NOWHERE,
)  # fmt: skip


DRAGGED = {
    "ours": HAND,
    "proportional": but(HAND, following=0.02, largest=0.04, lag=0.3),
    "queue": but(HAND, answered=1.0),
    "jumps": but(HAND, limits=3.0),
    "postpones": but(HAND, real=0.01),
}


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"answered": 0.041}, ["an input moves"]),
        ({"lag": 0.11}, ["latency"]),
        ({"following": 0.0101}, ["following error"]),
        ({"largest": 0.031}, ["largest distance"]),
        ({"limits": 1.001}, ["limits"]),
        ({"real": 0.0011}, ["the real tool is off"]),
    ],
)
def test_dragging(changes: dict[str, Any], said: list[str]) -> None:
    only(dragging.conclude(STUDY, (DRAGGED, DRAGGED, {}, {})).claims)
    # One hand of two: of the interval's end a quarter of the resamples are that one alone.
    other = DRAGGED | {"ours": but(HAND, **changes)}
    only(dragging.conclude(STUDY, (DRAGGED, other, {}, {})).claims, *said)


def test_encoding() -> None:
    good = Results(
        frames=2400.0, frames_single=1200.0, segments=400.0, commands=100.0, between=1e-3, rebuilt=0.0,
        compact=400.0, compact_each=900.0, absolute=900.0, compact_error=1e-5, joined=1e-3, joined_few=1e-2,
    )  # fmt: skip
    only(encoding.conclude(STUDY, ([good] * 2,) * 3).claims)
    # One of the two is enough.
    for other in (but(good, segments=485.0), but(good, compact=485.0)):
        only(encoding.conclude(STUDY, ([good] * 2, [good, other], [good] * 2)).claims)
    both = but(good, frames=2000.0, segments=405.0, compact=405.0)
    only(encoding.conclude(STUDY, ([good] * 2, [good, both], [good] * 2)).claims, "the better of segments and")
    dear = but(good, frames=3000.0, segments=500.0, compact=435.0)
    only(
        encoding.conclude(STUDY, ([good] * 2, [good, dear], [good] * 2)).claims,
        "rates by hand, 50 inputs a second: the",
    )
    only(
        encoding.conclude(STUDY, ([good, but(good, rebuilt=1e-11)], [good] * 2, [good] * 2)).claims,
        "who has the segments",
    )
    only(
        encoding.conclude(STUDY, ([good, but(good, compact_error=1.1e-5)], [good] * 2, [good] * 2)).claims,
        "who gets compact frames",
    )
    said = encoding.conclude(
        STUDY, ([good, but(good, commands=121.0)], [good] * 2, [but(good, commands=2700.0)] * 2)
    )
    only(said.claims, "a move every 2 s: bytes", "twist by hand, 50 inputs a second: bytes")


def test_the_readers_of_an_encoding_have_the_motion() -> None:
    found = encoding.measure("rates", 1, 1.0)
    assert found.rebuilt <= 1e-12
    assert 1e-6 < found.compact_error <= 1e-5
    assert found.compact < 0.5 * found.absolute
    assert found.compact < found.compact_each < found.frames < found.segments


RUN = Results(
    mean=1e-5, p95=0.002, largest=0.004, time_difference=1.0, time_difference_max=2.0, progress=1.0, aside=0.0,
    bursts=0, limits=1.0, pace=1.05, postponed=0, moves=10, corrections=0, slowed=0,
)  # fmt: skip
OTHERS = {
    "postpones": [but(RUN, mean=0.02, aside=0.3, postponed=1)] * 2,
    "waits": [but(RUN, time_difference=3.0)] * 2,
    "waits, mean": [but(RUN, time_difference=3.0)] * 2,
    "jumps": [but(RUN, bursts=1, limits=9.0, pace=9.0)] * 2,
    "halts": [but(RUN, progress=0.3)] * 2,
}


def jittered(*ours: Results, **others: list[Results]) -> Sequence[Claim]:
    runs = {"adaptive": list(ours)} | OTHERS | others
    result = Results(D={}, runs=runs, traces=())
    return jitter.conclude(STUDY, (result,) * len(jitter.CASES)).claims


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"aside": 0.0011}, ["off the virtual"]),
        ({"bursts": 1}, ["bursts"]),
        ({"pace": 1.051}, ["pace"]),
        ({"limits": 1.001}, ["largest speed"]),
        ({"postponed": 1}, ["moves postponed at the robot"]),
        ({"progress": 0.96}, ["least share"]),
        ({"mean": 0.0011}, ["mean path error"]),
        ({"time_difference": 3.1}, ["mean time difference"]),
    ],
)
def test_jitter(changes: dict[str, Any], said: list[str]) -> None:
    only(jittered(RUN, RUN))
    only(jittered(RUN, but(RUN, **changes)), *said)


def test_a_gain_that_another_fixed_offset_has_too_isnt_shown() -> None:
    assert all(claim.holds for claim in jittered(RUN, RUN))
    quicker = jittered(RUN, RUN, **{"waits, mean": [RUN] * 2})
    assert [claim.claim[:20] for claim in quicker if claim.verdict is Verdict.NOT_SHOWN] == ["mean time difference"]


def test_a_burst_is_moves_that_begin_within_half_of_the_time_between_them() -> None:
    given = np.array([0.0, 1.0, 1.4, 3.4, 3.9])
    assert jitter.bursts(given, given + 2.0) == 0
    assert jitter.bursts(given, np.array([2.0, 2.51, 2.9, 3.91, 4.16])) == 0
    # What was given within half a second may come together.
    assert jitter.bursts(given, np.array([2.0, 2.49, 2.5, 3.49, 3.73])) == 3


AGREED = Results(
    agreed=1.0, noticed=0.3, corrections=(0.1,), durations=(0.5,), unlinked=0.1, jump=9.0, limits=1.0,
    t=np.zeros(1), apart=np.zeros(1),
)  # fmt: skip
QUIET = but(AGREED, corrections=(), durations=())


@pytest.mark.parametrize(
    ("case", "changes", "said"),
    [
        ("late", {"agreed": 10.1}, ["late by"]),
        ("blocked", {"agreed": math.inf}, ["blocked in a move: timelines agree"]),
        ("late", {"unlinked": 0.0}, []),
        ("late", {"limits": 1.001}, ["limits"]),
        ("blocked", {"noticed": 0.41}, ["turns to where"]),
        ("lossless", {"corrections": (0.1,)}, ["no losses: corrections"]),
        ("lossy", {"agreed": 11.0}, ["lost, 10 % twice: timelines"]),
    ],
)
def test_agreement(case: str, changes: dict[str, Any], said: list[str]) -> None:
    good = {"late": AGREED, "blocked": AGREED, "lossless": QUIET, "lossy": QUIET, "lossy, late": AGREED}
    bad = good | {case: but(good[case], **changes)}
    only(agreement.conclude(STUDY, tuple([seen] * 2 for seen in good.values())).claims)
    only(agreement.conclude(STUDY, tuple([good[name], bad[name]] for name in good)).claims, *said)


def tail(**figures: Any) -> segments.Tail:
    found = segments.Tail()
    vars(found).update({"segments": 5, "changed": 0, "uneven": 0.0} | figures)
    return found


SPLICED = Results(
    jumps=(0.0, 0.0), naive=(1.0, 1.0), tail=tail(), anew=tail(changed=5, uneven=1.0), past=0.0, early=0.1
)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"jumps": (2e-9, 0.0)}, ["largest jump [rad]"]),
        ({"jumps": (0.0, 2e-9)}, ["largest jump [rad/s]"]),
        ({"tail": tail(changed=1)}, ["segments that changed"]),
        ({"tail": tail(uneven=2e-9)}, ["difference of shifts"]),
        ({"past": 2e-9}, ["largest change before"]),
        ({"tail": tail(segments=0)}, ["segments that changed", "difference of shifts"]),
    ],
)
def test_segments(changes: dict[str, Any], said: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    seen = but(SPLICED, **changes)
    monkeypatch.setattr(segments, "splice", lambda _: seen)
    only(segments.work(STUDY, "").claims, *said)


def test_causality(monkeypatch: pytest.MonkeyPatch) -> None:
    def told(D: float, *_: object) -> tuple[dict[float, int], int]:
        return dict.fromkeys(causality.OFFSETS.values(), 5) | {D: 9 if D else 10}, 10

    monkeypatch.setattr(causality, "over_a_link", told)
    monkeypatch.setattr(causality, "both_sites", lambda *_: (0, 1, 10))
    only(causality.work(STUDY, "").claims, "D = −D_f: commands", "D = +D_b: commands", "D = −D_f: postponed")


SCRUBBED = Results(
    seek={ViewForm.SEGMENTS: 0.01, ViewForm.FRAMES: 0.28}, dragged=0.0, stayed_live=3.0, live=(8.0, 1.5, 0.19),
    jumped=6.0, rewound=0.6, others=0.0, own=8.0, t=(0.0,), place=(0.0,),
)  # fmt: skip


@pytest.mark.parametrize(
    ("edit", "changes", "said"),
    [
        ({}, {}, []),
        ({"stop": 0.26}, {}, ["an edit shows after"]),
        ({"undo": math.inf}, {}, ["carried out and shown", "an edit shows after", "undo while live"]),
        ({}, {"seek": {ViewForm.SEGMENTS: 0.021, ViewForm.FRAMES: 0.28}}, ["segments: first frame"]),
        ({}, {"seek": {ViewForm.SEGMENTS: 0.01, ViewForm.FRAMES: 0.291}}, ["frames: first frame"]),
        ({}, {"dragged": 0.01}, ["isn't dragged"]),
        ({}, {"live": (8.0, 1.5, 0.21)}, ["going live"]),
        ({}, {"others": 0.021}, ["keep their age"]),
    ],
)
def test_interactivity(
    edit: dict[str, float], changes: dict[str, Any], said: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    known = dict.fromkeys(interactivity.EDITS, 0.25) | edit

    def edits(_: object, *, over: bool = False) -> dict[str, tuple[float, float]]:
        return {kind: (math.inf if over else seconds, 5.0) for kind, seconds in known.items()}

    monkeypatch.setattr(interactivity, "edits", edits)
    monkeypatch.setattr(interactivity, "scrub", lambda _: but(SCRUBBED, **changes))
    only(interactivity.work(STUDY, "").claims, *said)
