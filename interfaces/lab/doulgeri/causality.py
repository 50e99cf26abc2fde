"""Section II-C: what a command may not do to the past, at the operator's end and at the robot's."""

from __future__ import annotations

from functools import partial
from typing import Final

import numpy as np

from interfaces import Designer
from interfaces.lab.claims import Claim, Counterfactual, Findings, Study, all_of
from interfaces.lab.doulgeri.rivals import postponing
from interfaces.lab.doulgeri.script import D_B, D_F, HOME, MODEL, ScriptedSite, script, target, twins
from interfaces.link import Conditions, ConstantDelay
from vrs import Engine, JointTarget, Lateness, ManualClock, MotionCommand, Status
from vrs.ledger import Receipt

II_C: Final = "Section II-C"
IV: Final = "Section IV"
OFFSETS: Final = {"0": 0.0, "−D_f": -D_F, "+D_b": D_B}
"""Offsets of the engine's clock [s]."""
OFFLINE: Final = "no real-time clock"


def refused_before_issue(*, real_time: bool = True) -> tuple[int, int]:
    """Commands with t_exec < t_iss that were rejected, and how many there were."""
    engine = Engine(MODEL, q=HOME, clock=ManualClock(5.0) if real_time else None)
    asked = [5.0 - early for early in (1e-6, 0.1, 1.0, 4.9)]
    answers = [engine.execute(MotionCommand(JointTarget(HOME + 0.1), 5.0, t)) for t in asked]
    return sum(answer.status is Status.REJECTED for answer in answers), len(answers)


def late(lateness: Lateness, *, real_time: bool = True) -> tuple[Receipt, float, float]:
    """A command for a time that has passed: receipt, end of the segment then active, change of the past."""
    clock = ManualClock(0.0)
    engine = Engine(MODEL, q=HOME, clock=clock if real_time else None, lateness=lateness)
    engine.execute(MotionCommand(JointTarget(HOME + 0.8), execute_at=0.0, speed=0.4))
    clock.set(0.8)
    before = engine.timeline
    t = np.linspace(0.0, 0.8, 500)
    receipt = engine.execute(MotionCommand(JointTarget(HOME - 0.3), issued_at=0.4, execute_at=0.5))
    change = float(np.abs(engine.timeline.sample(t) - before.sample(t)).max())
    active = before.segment(before.index_at(0.8))
    return receipt, active.end, change


def over_a_link(D: float, seed: int, length: float) -> tuple[dict[float, int], int]:
    """Commands of which each offset's inequality tells rightly whether they're in time, and how many there were."""
    rng = np.random.default_rng(seed)
    joined = ScriptedSite(D)
    designer = Designer(joined.connect(D_F, D_B))
    joined.add(designer)
    ahead = []
    t = 0.5
    while t < length:
        joined.run(t)
        wait = float(rng.choice([D_F + D, D_F + D - 1e-3, *rng.uniform(0.0, 2 * (D_F + D_B), 2)]))
        ahead.append(max(wait, 0.0))
        designer.issue(MotionCommand(target(rng, 0.3)), now=joined.now, execute_in=ahead[-1])
        t += 0.4
    joined.run(length + 5.0)
    statuses = [None if issued.receipt is None else issued.receipt.status for issued in designer.history]
    right = {}
    for other in OFFSETS.values():
        told = [Status.ACCEPTED if wait >= D_F + other - 1e-9 else Status.POSTPONED for wait in ahead]
        right[other] = sum(status is says for status, says in zip(statuses, told, strict=True))
    return right, len(ahead)


def both_sites(D: float, seed: int, length: float) -> tuple[int, int, int]:
    """Commands postponed at the operator's site and at the robot's, and how many both accepted or postponed."""
    rng = np.random.default_rng(seed)
    lab = twins(Conditions(delay=ConstantDelay("constant", D_F)), rng, postponing(D))
    operator = lab.operator
    mine: dict[int, float] = {}

    def give(command: MotionCommand, now: float) -> None:
        receipt = operator.robot.execute(command, now=now)
        if isinstance(receipt, Receipt) and receipt.execute_at is not None:
            mine[receipt.command_id] = receipt.execute_at

    for act in script(rng, length):
        if isinstance(act.command, MotionCommand) and act.command.insertion != "append":
            lab.schedule(act.t, partial(give, act.command))
    lab.run(length + 10.0)
    theirs = {
        i: receipt.execute_at for i, receipt in operator.robot.receipts.items() if receipt.execute_at is not None
    }
    postponed = sum(theirs[i] > mine[i] + 1e-9 for i in theirs if i in mine)
    first = sum(receipt.status is Status.POSTPONED for receipt in operator.robot.engine.receipts)
    return first, postponed, len(theirs)


def work(study: Study, _case: str) -> Findings:
    """Measure each restriction, and what is so without it."""
    rejected, asked = refused_before_issue()
    postponed, end, past = late(Lateness.POSTPONE)
    aborted, _, untouched = late(Lateness.REJECT)
    silent, other_end, rewritten = late(Lateness.POSTPONE, real_time=False)
    begins, other_begins = (
        np.inf if receipt.execute_at is None else receipt.execute_at - over
        for receipt, over in ((postponed, end), (silent, other_end))
    )
    claims = [
        all_of("t_exec < t_iss: commands rejected", f"{II_C}, 1)", rejected, asked,
               (OFFLINE, refused_before_issue(real_time=False)[0])),
        Claim(
            "a command for the past, policy postpone: begins after the end of the active segment by [s]",
            f"{II_C}, 2)", 0.0, begins, abs(begins) <= 1e-9,
            counterfactual=Counterfactual(OFFLINE, other_begins, abs(other_begins) <= 1e-9),
        ),
        Claim(
            "the same, policy reject",
            f"{II_C}, 2)", "rejected", str(aborted.status), aborted.status is Status.REJECTED,
            counterfactual=Counterfactual(OFFLINE, str(silent.status), silent.status is Status.REJECTED),
        ),
        Claim(
            "the past stays as it was: largest change [rad]",
            f"{II_C}, 2)", 0.0, max(past, untouched), max(past, untouched) == 0.0,
            counterfactual=Counterfactual(OFFLINE, rewritten, rewritten == 0.0),
        ),
    ]  # fmt: skip
    for k, (name, D) in enumerate(OFFSETS.items()):
        counted = [over_a_link(D, study.seed + 1000 * k + run, study.length) for run in range(study.runs)]
        total = sum(c[1] for c in counted)
        other, its = ("D = 0", 0.0) if D else ("D = −D_f", -D_F)
        text = f"D = {name}: commands are in time exactly if t_exec ≥ t_iss + D_f + D; told rightly, of {total}"
        right, wrong = (sum(c[0][which] for c in counted) for which in (D, its))
        beside = f"told by the inequality of {other}"
        claims.append(all_of(text, f"{IV}, IV-A", right, total, (beside, wrong)))
    ours, unshifted = (
        [both_sites(D, study.seed + 5000 + run, study.length) for run in range(study.runs)] for D in (-D_F, 0.0)
    )
    total = sum(s[2] for s in ours)
    text = f"the same commands at the operator's virtual robot and at the real one, D = −D_f: postponed, of {total}"
    (found, met), (other_found, other_met) = _postponed(ours), _postponed(unshifted)
    claims.append(
        Claim(
            text, f"{IV}, V", "none at either end", found, met and total > 0,
            counterfactual=Counterfactual("D = 0", other_found, other_met),
        )
    )  # fmt: skip
    return Findings(tuple(claims))


def _postponed(seen: list[tuple[int, int, int]]) -> tuple[str, bool]:
    """How many commands were postponed at each end, and whether none was."""
    here, there = (sum(s[i] for s in seen) for i in range(2))
    return f"{here} there, {there} at the robot", here == there == 0
