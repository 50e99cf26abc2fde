"""Why datagrams aren't shown to be better under some networks: the one cause that is suspected is taken away.

Where nobody makes much of the path, only its first centimetres are compared: there the path is four times as long.
Where the position that comes back is older than the way over which the robot is led back, nobody keeps the path:
there it's led back over a longer way. Everything else is as it was.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any, Final, NamedTuple

from interfaces.lab.claims import OWN_BAR, Findings, Results, Study, Table, at_most
from interfaces.lab.kim2006.following import FollowingCase, run
from interfaces.lab.kim2006.links import EQUAL, compared, nearness, pair

TIMES: Final = 4.0
"""How much longer the path is."""
FAR: Final = 1.0
"""λ that is longer than what the robot makes in a round trip of 2.6 s [m]."""
SCHEMES: Final = ("rsp", "tcp", "stream")


class Cause(NamedTuple):
    """What is taken away under a network."""

    delay: str
    loss: float
    what: str
    take_away: Callable[[FollowingCase], FollowingCase]


def _longer(case: FollowingCase) -> FollowingCase:
    return replace(case, length=TIMES * case.length)


def _led_further(case: FollowingCase) -> FollowingCase:
    return replace(case, recovery=FAR)


CAUSES: Final = {
    f"{delay} {loss:g}": Cause(delay, loss, what, take_away)
    for what, take_away, those in (
        (f"a path {TIMES:g} times as long", _longer, (("country", 0.05), ("tue", 0.0), ("tue", 0.1), ("thu", 0.1))),
        (f"led back over {FAR:g} m", _led_further, (("lunar", 0.05), ("lunar", 0.1))),
    )
    for delay, loss in those
}
CASES: Final = tuple(CAUSES)


def work(study: Study, case: str) -> Results:
    """All seeds of a network, with its cause and without it."""
    delay, loss, _, take_away = CAUSES[case]
    found = {}
    for taken in (False, True):
        for name in SCHEMES:
            cases = (
                FollowingCase(name, delay, loss, study.seed + k, study.length, "bare") for k in range(study.runs)
            )
            found[name, taken] = [run(take_away(one) if taken else one) for one in cases]
    return Results(
        before=pair(found["rsp", False], found["tcp", False]),
        after=pair(found["rsp", True], found["tcp", True]),
        streamed=pair(found["stream", True], found["tcp", True]),
        # Centimetres that both robots made, a run.
        common=[
            [min(len(a.arrivals), len(b.arrivals)) for a, b in zip(found["rsp", k], found["tcp", k], strict=True)]
            for k in (False, True)
        ],
    )


def conclude(_study: Study, results: tuple[Any, ...]) -> Findings:
    """Without its cause RSP is nearer to the path than TCP with fixed packets."""
    claims, rows = [], []
    for case, found in zip(CASES, results, strict=True):
        delay, loss, what, _ = CAUSES[case]
        text = f"{delay}, loss {loss:g}, {what}: path error of RSP by that of TCP with fixed packets"
        claim = partial(at_most, text, OWN_BAR, 1 - EQUAL)
        claims.append(compared(claim, found.after, "RSP's packets on TCP", found.streamed, text))
        for how, pairs, common in (
            ("as it was", found.before, found.common[0]),
            (what, found.after, found.common[1]),
        ):
            ratio = nearness(pairs)
            low, high = (None, None) if ratio is None else ratio.interval
            rows.append((
                delay, loss, how, None if ratio is None else ratio.value, low, high, min(common),
                sorted(common)[len(common) // 2],
            ))  # fmt: skip
    columns = (
        "delay", "loss", "how", "RSP by TCP", "from", "to", "path that both made, least [cm]", "median [cm]",
    )  # fmt: skip
    return Findings(tuple(claims), (Table("causes", "One cause taken away", columns, tuple(rows)),))
