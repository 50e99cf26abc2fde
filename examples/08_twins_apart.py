"""Both sites over a bad link: the robot plays as far as it knows the plan to be complete, and never bursts."""

from __future__ import annotations

import numpy as np

from interfaces.link import BernoulliLoss, Conditions, LinkConditions, delay_profile
from interfaces.runtime.laboratory import Laboratory
from interfaces.teleop import FollowingArm, OperatorSite, VirtualArm
from robots import puma560
from vrs import JointTarget, MotionCommand

model = puma560.model()
home = model.poses["nominal"]
operator = OperatorSite(VirtualArm(model, home, now=0.0))
robot = FollowingArm(model, home, now=0.0)
conditions = Conditions(delay=delay_profile("mon@0.2"), loss=BernoulliLoss(0.2))
lab = Laboratory(operator, robot, LinkConditions.symmetric(conditions), np.random.default_rng(1))

for k, step in enumerate([0.5, -0.4, 0.3, -0.2, 0.4, 0.0]):
    command = MotionCommand(JointTarget(home + step), speed=0.6)
    lab.schedule(1.0 + 1.5 * k, lambda now, command=command: operator.robot.execute(command, now=now))
lab.run(60.0)

play = lab.play
behind = play[:, 0] - play[:, 1]
away = np.abs(operator.robot.engine.joints(play[:, 1]) - lab.reference.q).max()
same = robot.engine.timeline == operator.robot.engine.timeline
print(f"the robot has the operator's timeline to the bit: {same}")
print(f"it was never off the virtual robot's path: {away:.1e} rad")
print(f"its fastest pace was {play[:, 2].max():.2f}; it was at most {behind.max():.2f} s behind")
for stretch in robot.playout.stretches if robot.playout else []:
    print(f"messages were late: from {stretch.begin:.2f} to {stretch.end:.2f} s it slowed down and waited")
