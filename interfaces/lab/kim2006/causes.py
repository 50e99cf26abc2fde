"""Why datagrams aren't shown to be better under some networks: the one cause that is suspected is taken away.

Where robots on TCP make little of the path, seeds differ much, and ten are too few: there are more of them. Where
the position that comes back is older than the way over which the robot is led back, nobody keeps the path: there
it's led back over a longer way. Everything else is as it was.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import Any, Final, NamedTuple

from interfaces.lab.claims import OWN_BAR, Findings, Results, Study, Table, at_most
from interfaces.lab.kim2006.following import RECOVERY, FollowingCase, run
from interfaces.lab.kim2006.links import EQUAL, compared, mean_of, nearness, pair

MORE: Final = 2
"""How many times as many seeds there are."""
FAR: Final = 1.0
"""λ, longer than what the robot makes in a round trip of 2.6 s [m]."""
SCHEMES: Final = ("rsp", "tcp", "stream")


class Cause(NamedTuple):
    """What is taken away under a network."""

    delay: str
    loss: float
    seeds: int = 1
    """How many times as many."""
    recovery: float = RECOVERY
    """λ [m]."""

    @property
    def said(self) -> str:
        """What is otherwise."""
        return f"{self.seeds} times as many seeds" if self.seeds > 1 else f"led back over {self.recovery:g} m"


CAUSES: Final = {
    f"{one.delay} {one.loss:g}": one
    for one in (
        *(Cause(*network, seeds=MORE) for network in (("country", 0.05), ("tue", 0.0), ("tue", 0.1), ("thu", 0.1))),
        *(Cause("lunar", loss, recovery=FAR) for loss in (0.05, 0.1)),
    )
}
CASES: Final = tuple(CAUSES)


def work(study: Study, case: str) -> Results:
    """All seeds of a network without its cause."""
    cause = CAUSES[case]
    following = FollowingCase("rsp", cause.delay, cause.loss, 0, study.length, "bare", recovery=cause.recovery)
    seeds = range(study.seed, study.seed + cause.seeds * study.runs)
    runs = {name: [run(replace(following, scheme=name, seed=seed)) for seed in seeds] for name in SCHEMES}
    return Results(
        pairs=pair(runs["rsp"], runs["tcp"]),
        streamed=pair(runs["stream"], runs["tcp"]),
        progress=[mean_of(runs[name]).progress for name in SCHEMES[:2]],
    )


def conclude(_study: Study, results: tuple[Any, ...]) -> Findings:
    """Without its cause RSP is nearer to the path than TCP with fixed packets."""
    claims, rows = [], []
    for case, found in zip(CASES, results, strict=True):
        cause = CAUSES[case]
        text = (
            f"{cause.delay}, loss {cause.loss:g}, {cause.said}: path error of RSP by that of TCP with fixed packets"
        )
        claim = partial(at_most, text, OWN_BAR, 1 - EQUAL)
        claims.append(compared(claim, found.pairs, "RSP's packets on TCP", found.streamed, text))
        ratio, both = nearness(found.pairs), len(found.pairs[0])
        ends = (None, None, None) if ratio is None else (ratio.value, *ratio.interval)
        rows.append((cause.delay, cause.loss, cause.said, *ends, both, *found.progress))
    columns = (
        "delay", "loss", "without its cause", "RSP by TCP", "from", "to", "seeds in which both moved",
        "of the path made by RSP", "by TCP",
    )  # fmt: skip
    return Findings(tuple(claims), (Table("causes", "One cause taken away", columns, tuple(rows)),))
