"""Section II-C: what a command may not do to the past, at the operator's end and at the robot's."""

from __future__ import annotations

from functools import partial
from typing import Final

import numpy as np

from interfaces import Designer
from interfaces.lab.claims import Claim, Findings, Study
from interfaces.lab.doulgeri.script import D_B, D_F, HOME, MODEL, ScriptedSite, script, target, twins
from interfaces.link import Conditions, ConstantDelay
from vrs import Engine, JointTarget, Lateness, ManualClock, MotionCommand, Status
from vrs.ledger import Receipt

II_C: Final = "Section II-C"
IV: Final = "Section IV"


def refused_before_issue() -> tuple[int, int]:
    """Commands with t_exec < t_iss that were rejected, and how many there were."""
    clock = ManualClock(5.0)
    engine = Engine(MODEL, q=HOME, clock=clock)
    asked = [5.0 - early for early in (1e-6, 0.1, 1.0, 4.9)]
    answers = [engine.execute(MotionCommand(JointTarget(HOME + 0.1), 5.0, t)) for t in asked]
    return sum(answer.status is Status.REJECTED for answer in answers), len(answers)


def late(lateness: Lateness) -> tuple[Receipt, float, float]:
    """A command for a time that has passed: receipt, end of the segment then active, change of the past."""
    clock = ManualClock(0.0)
    engine = Engine(MODEL, q=HOME, clock=clock, lateness=lateness)
    engine.execute(MotionCommand(JointTarget(HOME + 0.8), speed=0.4))
    clock.set(0.8)
    before = engine.timeline
    t = np.linspace(0.0, 0.8, 500)
    receipt = engine.execute(MotionCommand(JointTarget(HOME - 0.3), issued_at=0.4, execute_at=0.5))
    change = float(np.abs(engine.timeline.sample(t) - before.sample(t)).max())
    active = before.segment(before.index_at(0.8))
    return receipt, active.end, change


def over_a_link(D: float, seed: int, length: float) -> tuple[int, int, int]:
    """Commands in time by the transformed inequality, those it tells rightly, and how many there were."""
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
    in_time = [wait >= D_F + D - 1e-9 for wait in ahead]
    right = sum(
        status is (Status.ACCEPTED if ok else Status.POSTPONED)
        for status, ok in zip(statuses, in_time, strict=True)
    )
    return sum(in_time), right, len(ahead)


def both_sites(D: float, seed: int, length: float) -> tuple[int, int, int]:
    """Commands postponed at the operator's site and at the robot's, and how many both accepted or postponed."""
    rng = np.random.default_rng(seed)
    lab = twins(Conditions(delay=ConstantDelay("constant", D_F)), rng, D)
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
    """Measure each restriction."""
    rejected, asked = refused_before_issue()
    postponed, end, past = late(Lateness.POSTPONE)
    aborted, _, untouched = late(Lateness.REJECT)
    at = postponed.execute_at
    claims = [
        Claim(
            "t_exec < t_iss: commands rejected",
            f"{II_C}, 1)", f"{asked} of {asked}", f"{rejected} of {asked}", rejected == asked,
        ),
        Claim(
            "a command for the past, policy postpone: begins after the end of the active segment by [s]",
            f"{II_C}, 2)", 0.0, "never" if at is None else at - end,
            postponed.status is Status.POSTPONED and at is not None and abs(at - end) <= 1e-9,
        ),
        Claim(
            "the same, policy reject",
            f"{II_C}, 2)", "rejected", str(aborted.status), aborted.status is Status.REJECTED,
        ),
        Claim(
            "the past stays as it was: largest change [rad]",
            f"{II_C}, 2)", 0.0, max(past, untouched), max(past, untouched) == 0.0,
        ),
    ]  # fmt: skip
    for k, (D, name) in enumerate(((0.0, "0"), (-D_F, "−D_f"), (D_B, "+D_b"))):
        counted = [over_a_link(D, study.seed + 1000 * k + run, study.length) for run in range(study.runs)]
        total, right = sum(c[2] for c in counted), sum(c[1] for c in counted)
        text = f"D = {name}: commands are in time exactly if t_exec ≥ t_iss + D_f + D; told rightly, of {total}"
        holds = right == total and sum(c[0] for c in counted) > 0
        claims.append(Claim(text, f"{IV}, IV-A", total, right, holds))
    for D, name in ((-D_F, "−D_f"), (0.0, "0")):
        seen = [both_sites(D, study.seed + 5000 + run, study.length) for run in range(study.runs)]
        here, there, total = (sum(s[i] for s in seen) for i in range(3))
        wanted = "none at either end" if D else "none at the operator's end, some at the robot's"
        text = f"the same commands at the operator's virtual robot and at the real one, D = {name}: postponed"
        found = f"{here} there, {there} at the robot, of {total}"
        holds = here == 0 and (there == 0 if D else there > 0) and total > 0
        claims.append(Claim(text, f"{IV}, V", wanted, found, holds))
    return Findings(tuple(claims))
