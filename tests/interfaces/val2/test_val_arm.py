"""ARM: VAL-II programs on a virtual PUMA, carried out, ended, and refused with a reason."""

from __future__ import annotations

import time

import numpy as np
import pytest

from interfaces.messages.jobs import ArmJob, Doing, JobList, JobStage, ListCommand, RobotTask, WaitJob
from interfaces.val2.val_arm import ValArm, in_a_thread, lasts
from robots import puma560
from tests.interfaces.teleop.rig import Rig

WAVE = """.PROGRAM other()
    TYPE "not this one"
.END
.PROGRAM wave()
    DRIVE 1, 20, 50
    DRIVE 1, -20, 50
    BREAK
.END
"""


def test_a_program_moves_the_arm_and_takes_its_time() -> None:
    arm = ValArm()
    assert arm.run("wave", WAVE, now=100.0) == ""
    end = lasts(ArmJob(1, "wave", WAVE))
    assert isinstance(end, float)
    assert 0.5 < end < 20.0
    assert arm.outcome(now=100.0) is None
    middle = arm.joints(100.0 + end / 2)
    assert middle is not None
    assert np.abs(middle - puma560.model().poses["nominal"]).max() > 0.1
    assert arm.outcome(now=100.0 + end - 0.01) is None
    assert arm.outcome(now=100.0 + end) == ""
    rest = arm.joints(1000.0)
    assert rest == pytest.approx(puma560.model().poses["nominal"], abs=1e-6)


def test_an_arm_that_is_ended_brakes_on_its_path_and_goes_on_from_there() -> None:
    arm = ValArm({"wave": WAVE})
    arm.run("wave", "", now=0.0)
    assert arm.outcome(now=0.0) is None
    arm.end(now=0.6)
    t = np.arange(0.0, 4.0, 0.002)
    q = np.array([arm.joints(float(now)) for now in t])
    limits = puma560.model().limits
    assert (np.abs(np.diff(q, axis=0)) / 0.002 <= limits.qd_max + 1e-6).all()
    assert (np.abs(np.diff(q, 2, axis=0)) / 0.002**2 <= limits.qdd_max * 1.01 + 1e-3).all()
    assert q[-1] == pytest.approx(q[-500], abs=0.0)
    assert abs(q[-1][0] - q[0][0]) > 0.01
    arm.run("wave", "", now=4.0)
    assert arm.outcome(now=4.0) is None
    assert arm.joints(4.0) == pytest.approx(q[-1], abs=1e-9)
    assert arm.joints(4.6) != pytest.approx(q[-1], abs=1e-3)


def test_a_live_robot_doesnt_wait_while_a_program_is_worked_out() -> None:
    arm = ValArm({"wave": WAVE}, in_a_thread())
    arm.run("wave", "", now=0.0)
    while arm.joints(0.0) is None:
        assert arm.outcome(now=0.0) is None
        time.sleep(0.001)
    assert arm.outcome(now=1000.0) == ""


@pytest.mark.parametrize(
    ("program", "source", "says"),
    [
        ("wave", "", "give its file"),
        ("dance", WAVE, "Undefined program name* dance; allowed: other, wave"),
        ("wave", ".PROGRAM wave()\n    DRIVE 1\n.END\n", "wave"),
        ("wave", ".PROGRAM wave()\n    WAIT SIG(1001)\n.END\n", "Waits for ever"),
        ("wave", ".PROGRAM wave()\n    MOVE TRANS(5000,0,0,0,0,0)\n.END\n", "out of range"),
    ],
)
def test_what_cant_be_carried_out_says_why(program: str, source: str, says: str) -> None:
    arm = ValArm()
    arm.run(program, source, now=0.0)
    outcome = arm.outcome(now=0.0)
    assert outcome
    assert says in outcome
    assert lasts(ArmJob(1, program, source)) == outcome


def test_it_is_a_job_among_others_and_can_be_aborted() -> None:
    rig = Rig(arm=ValArm())
    rig.begin()
    rig.operator.robot.order(
        RobotTask(jobs=JobList((ArmJob(1, "wave", WAVE), WaitJob(2, 0.5)))), RobotTask(do=ListCommand.RUN)
    )
    rig.run(1.0)
    assert rig.operator.robot.doing is Doing.JOBS
    rig.operator.robot.order(RobotTask(do=ListCommand.ABORT))
    rig.run(1.0)
    held = rig.hands.arm.joints(0.0)  # type: ignore[attr-defined]
    assert held is not None
    assert rig.operator.resume(now=rig.now) == ""
    rig.run(0.5)
    rig.operator.robot.order(RobotTask(do=ListCommand.RUN))
    rig.run(15.0)
    assert rig.operator.robot.tasks is not None
    assert rig.operator.robot.tasks.progress.stage is JobStage.DONE
