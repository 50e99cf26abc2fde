"""A hand and things in a PyBullet world of their own: fingers that press, friction, falls; and an arm that has it.

What is modelled: two fingers on prismatic joints that are geared together, each driven by a motor of limited force
and speed; Coulomb friction and contact of fingers, palm, things and floor; gravity. The arm takes the hand where it
goes, exactly: what the hand touches doesn't push the arm back, it goes through what is fixed. What it carries
weighs on the arm as a load at the flange, from when nothing else bears it. The fingers' own weight and inertia are
in neither: they're a part of the last link.

Friction has two directions in each contact, one of them upright where fingers close level: what pulls along both at
once is held up to √2 times too well.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from typing_extensions import override

from robots.bullet.world import LostError, World
from robots.chain import quaternion
from robots.robot import ArmBody, ArmMaker, Closing, Fingers, Gripper, Measured, Prepared, Robot
from robots.things import Scene, Thing, ThingPose
from vrs.errors import InvalidValueError
from vrs.model import Array, RobotModel

PALM: Final = 0.02
"""Thickness of the palm, from which the fingers reach out [m]."""
_HAND_MASS: Final = 1e4
"""Of the palm [kg]: the arm takes it along, whatever it touches."""
_FINGER_MASS: Final = 0.05
"""Of a finger [kg]."""
_GEAR: Final = 1e5
"""Force of what keeps both fingers equally far from the middle [N]."""
_STIFFNESS, _DAMPING = 1e5, 100.0
"""Of the fingers' pads, a point of contact [N/m, N s/m]: on rigid ones one point of four may bear all the force."""
_LOOK: Final = 10
"""Steps between two looks at what is held."""
_BORNE: Final = 5
"""Looks after which what is held counts as carried, or as let go: it may be knocking on what it lies on."""
_PRESSES: Final = 0.1
"""Share of its force with which a finger presses at least on what is held."""
_FARTHEST: Final = 100.0
"""A thing farther away has been lost [m]."""


class HandState(NamedTuple):
    """A hand and things, as they're measured."""

    opening: float
    """Between the fingers [m]."""
    goal: float
    """What they were told to go to, as far as they go [m]."""
    holds: int | None
    """Which of the things that move is between the fingers, pressed by both; None for none."""
    poses: tuple[ThingPose, ...]
    """Where the things are that move, in the scene's order."""


def moving(scene: Scene) -> tuple[Thing, ...]:
    """The things of a scene that move."""
    return tuple(thing for thing in scene.things if thing.mass is not None)


def finger_poses(gripper: Gripper, opening: float) -> Array:
    """Poses of palm and fingers in the hand's frame, (3, 4, 4), at an opening [m]."""
    fingers = gripper.fingers
    assert fingers is not None
    aside = 0.5 * (opening + fingers.thickness)
    local = np.tile(np.eye(4), (3, 1, 1))
    local[:, :3, 3] = [
        (0.0, 0.0, 0.5 * PALM),
        (aside, 0.0, 0.5 * fingers.length),
        (-aside, 0.0, 0.5 * fingers.length),
    ]
    return local


class GraspWorld(Closing):
    """The hand and the things. A step takes the hand to where the arm has it then."""

    def __init__(
        self, fingers: Fingers, scene: Scene, X: Array, *, gravity: float = 9.81, dt: float = 1e-3
    ) -> None:
        """Put all in its place, the hand open.

        Args:
            fingers: Of the hand.
            scene: What is there.
            X: Pose of the hand in the arm's base frame, (4, 4): fingers close along x, and reach out along z.
            gravity: Of free fall along -z [m/s²].
            dt: Step [s].
        """
        self._fingers, self._scene, self._gravity, self._dt = fingers, scene, gravity, dt
        self._steps = 0
        self._world = World(gravity=gravity, dt=dt)
        bullet = self._world.bullet
        # With PyBullet's cone of friction, what is held creeps.
        bullet.setPhysicsEngineParameter(
            deterministicOverlappingPairs=1, enableConeFriction=0, solverResidualThreshold=0.0
        )
        floor = bullet.createMultiBody(0.0, bullet.createCollisionShape(bullet.GEOM_PLANE), -1, [0, 0, scene.floor])
        bullet.changeDynamics(floor, -1, lateralFriction=1.0)
        self._fixed = [floor, *(self._put(thing) for thing in scene.things if thing.mass is None)]
        self._things = [self._put(thing) for thing in moving(scene)]
        self._hand = self._make_hand()
        # The arm isn't stopped by what doesn't move, so the hand can't be.
        for body in self._fixed:
            for link in (-1, 0, 1):
                bullet.setCollisionFilterPair(self._hand, body, link, -1, 0)
        self._at = X
        self.goal = fingers.stroke
        """Opening that the fingers go to [m]."""
        self.grip(math.inf)

    def _put(self, thing: Thing) -> int:
        bullet = self._world.bullet
        if thing.box is not None:
            shape = bullet.createCollisionShape(bullet.GEOM_BOX, halfExtents=thing.half)
        else:
            assert thing.cylinder is not None
            radius, height = thing.cylinder
            shape = bullet.createCollisionShape(bullet.GEOM_CYLINDER, radius=radius, height=height)
        pose = thing.pose
        body = bullet.createMultiBody(thing.mass or 0.0, shape, -1, pose[:3], pose[3:])
        bullet.changeDynamics(
            body, -1, lateralFriction=thing.friction, linearDamping=0.0, angularDamping=0.0,
            activationState=bullet.ACTIVATION_STATE_DISABLE_SLEEPING,
        )  # fmt: skip
        return int(body)

    def _make_hand(self) -> int:
        bullet, f = self._world.bullet, self._fingers
        half = [f.thickness / 2, f.width / 2, f.length / 2]
        finger = bullet.createCollisionShape(bullet.GEOM_BOX, halfExtents=half)
        broad = [f.stroke / 2 + f.thickness, f.width / 2, PALM / 2]
        palm = bullet.createCollisionShape(
            bullet.GEOM_BOX, halfExtents=broad, collisionFramePosition=[0.0, 0.0, PALM / 2]
        )
        level = [0.0, 0.0, 0.0, 1.0]
        hand = bullet.createMultiBody(
            _HAND_MASS,
            palm,
            linkMasses=[_FINGER_MASS] * 2,
            linkCollisionShapeIndices=[finger] * 2,
            linkVisualShapeIndices=[-1] * 2,
            linkPositions=[[side * f.thickness / 2, 0.0, f.length / 2] for side in (1, -1)],
            linkOrientations=[level] * 2,
            linkInertialFramePositions=[[0.0] * 3] * 2,
            linkInertialFrameOrientations=[level] * 2,
            linkParentIndices=[0] * 2,
            linkJointTypes=[bullet.JOINT_PRISMATIC] * 2,
            linkJointAxis=[[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0]],
        )
        undamped = {"linearDamping": 0.0, "angularDamping": 0.0, "lateralFriction": 1.0}
        awake = bullet.ACTIVATION_STATE_DISABLE_SLEEPING
        bullet.changeDynamics(hand, -1, activationState=awake, localInertiaDiagonal=[_HAND_MASS] * 3, **undamped)
        for joint in (0, 1):
            bullet.changeDynamics(
                hand, joint, jointLowerLimit=0.0, jointUpperLimit=f.stroke / 2, jointDamping=0.0,
                contactStiffness=_STIFFNESS, contactDamping=_DAMPING, **undamped,
            )  # fmt: skip
            bullet.resetJointState(hand, joint, f.stroke / 2)
        gear = bullet.createConstraint(hand, 0, hand, 1, bullet.JOINT_GEAR, [1, 0, 0], [0, 0, 0], [0, 0, 0])
        bullet.changeConstraint(gear, gearRatio=-1, erp=0.2, maxForce=_GEAR)
        return int(hand)

    def grip(self, opening: float) -> None:
        """Let the fingers go to an opening [m], as far as they go and what is between them lets them."""
        bullet, f = self._world.bullet, self._fingers
        self.goal = min(max(opening, 0.0), f.stroke)
        for joint in (0, 1):
            bullet.setJointMotorControl2(
                self._hand, joint, bullet.POSITION_CONTROL, targetPosition=self.goal / 2,
                force=f.force, maxVelocity=f.speed / 2,
            )  # fmt: skip

    def step(self, X: Array) -> None:
        """Let a step pass, at whose end the hand is at a pose, (4, 4).

        Raises:
            LostError: If a thing leaves every sensible range.
        """
        bullet, before, dt = self._world.bullet, self._at, self._dt
        v = (X[:3, 3] - before[:3, 3]) / dt
        # Falling a step is made good beforehand: the hand is borne.
        v[2] += self._gravity * dt
        turn = X[:3, :3] @ before[:3, :3].T
        w = np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]]) / (2.0 * dt)
        bullet.resetBasePositionAndOrientation(self._hand, before[:3, 3].tolist(), quaternion(before[:3, :3]))
        bullet.resetBaseVelocity(self._hand, v.tolist(), w.tolist())
        bullet.stepSimulation()
        self._at = X
        self._steps += 1

    def push(self, k: int, impulse: ArrayLike) -> None:
        """Give one of the things that move an impulse through its middle, (3,) [N s]."""
        bullet, body = self._world.bullet, self._things[k]
        middle = bullet.getBasePositionAndOrientation(body)[0]
        force = (np.asarray(impulse) / self._dt).tolist()
        bullet.applyExternalForce(body, -1, force, middle, bullet.WORLD_FRAME)

    @property
    def opening(self) -> float:
        """Between the fingers [m]."""
        states = self._world.bullet.getJointStates(self._hand, [0, 1])
        return max(float(states[0][0] + states[1][0]), 0.0)

    def poses(self) -> tuple[ThingPose, ...]:
        """Where the things are that move, in the scene's order.

        Raises:
            LostError: If one left every sensible range.
        """
        found = []
        for body in self._things:
            position, turn = self._world.bullet.getBasePositionAndOrientation(body)
            if not max(map(abs, position)) < _FARTHEST:
                raise LostError("thing", self._steps * self._dt, "was flung away")
            found.append((*position, *turn))
        return tuple(found)

    def held(self) -> int | None:
        """Which of the things that move both fingers press on; None for none."""
        bullet, least = self._world.bullet, _PRESSES * self._fingers.force
        for k, body in enumerate(self._things):
            sides = ((c[9] for c in bullet.getContactPoints(self._hand, body, link, -1)) for link in (0, 1))
            if all(sum(forces) >= least for forces in sides):
                return k
        return None

    def borne(self, k: int) -> bool:
        """Whether something else than the hand bears a thing: the floor, or another thing."""
        contacts = self._world.bullet.getContactPoints(self._things[k])
        return any(c[2] != self._hand and c[9] > 0.0 for c in contacts)

    @override
    def close(self) -> None:
        self._world.close()


class GraspingArm(Closing):
    """An arm's body with a hand that grasps things; what it carries weighs on the arm."""

    def __init__(self, arm: ArmBody, model: RobotModel, gripper: Gripper, scene: Scene, *, dt: float) -> None:
        """Give an arm its hand, open.

        Args:
            arm: The body; whoever made it closes it.
            model: Its kinematics.
            gripper: The hand; it has fingers.
            scene: What is there.
            dt: Step of the body [s].
        """
        assert gripper.fingers is not None
        self._arm, self._model = arm, model
        self._point = gripper.X_LH
        self._world = GraspWorld(gripper.fingers, scene, self._pose(), dt=dt)
        self._masses = [thing.mass or 0.0 for thing in moving(scene)]
        self._steps = self._looks = 0
        self._holds: int | None = None
        self._carries: int | None = None

    def _pose(self) -> Array:
        return np.asarray(self._model.forward(self._arm.q) @ self._point)

    @property
    def q(self) -> Array:
        """Where its joints truly are [rad], of prismatic joints [m], (n,)."""
        return self._arm.q

    def prepare(self, q_ref: ArrayLike, qd_ref: ArrayLike, qdd_ref: ArrayLike) -> Prepared:
        """Work out beforehand what `follow` needs."""
        return self._arm.prepare(q_ref, qd_ref, qdd_ref)

    def follow(self, prepared: Prepared) -> Measured:
        """Follow references; after each step the hand and the things go along.

        Raises:
            LostError: If a thing leaves every sensible range, or as the arm's body.
        """
        rows = []
        for i in range(len(prepared.q)):
            rows.append(self._arm.follow(prepared.row(i)))
            self._world.step(self._pose())
            self._steps += 1
            if self._steps % _LOOK == 0:
                self._look()
        if not rows:
            return self._arm.follow(prepared)
        q, qd, tau = (np.concatenate([getattr(row, name) for row in rows]) for name in ("q", "qd", "tau"))
        return Measured(q, qd, tau, np.sum([row.saturated for row in rows], axis=0))

    def _look(self) -> None:
        """See what is held, and let what nothing else bears weigh on the arm."""
        self._holds = held = self._world.held()
        carries = held if held is not None and not self._world.borne(held) else None
        if carries == self._carries:
            self._looks = 0
            return
        self._looks += 1
        if self._looks < _BORNE:
            return
        self._looks, self._carries = 0, carries
        if carries is None:
            self._arm.release()
        else:
            self._arm.attach(self._masses[carries])

    def attach(self, mass: float) -> None:
        """Take a load [kg] that isn't among the things."""
        self._arm.attach(mass)

    def release(self) -> None:
        """Drop it."""
        self._arm.release()

    def grip(self, opening: float) -> None:
        """Let the fingers go to an opening [m]; infinity opens as far as they go."""
        self._world.grip(opening)

    def state(self) -> HandState:
        """The hand and the things, as they're now."""
        return HandState(self._world.opening, self._world.goal, self._holds, self._world.poses())

    @override
    def close(self) -> None:
        self._world.close()


def grasping(make: ArmMaker, robot: Robot, scene: Scene) -> ArmMaker:
    """Make bodies with a hand, of what makes those without.

    Args:
        make: Makes the arm's body.
        robot: Whose.
        scene: What is there.

    Raises:
        InvalidValueError: If the robot has no hand with fingers.
    """
    gripper = fingered(robot)

    @contextmanager
    def maker(q: ArrayLike, *, friction: bool = True, dt: float = 1e-3) -> Iterator[ArmBody]:
        with make(q, friction=friction, dt=dt) as arm, GraspingArm(arm, robot.arm, gripper, scene, dt=dt) as body:
            yield body

    return maker


def fingered(robot: Robot) -> Gripper:
    """The hand of a robot that is to grasp things.

    Raises:
        InvalidValueError: If it has none with fingers, or PyBullet isn't installed.
    """
    if robot.hand is None:
        raise InvalidValueError("scene", robot.name, "of a robot whose gripper has fingers")
    if find_spec("pybullet") is None:
        raise InvalidValueError("scene", robot.name, "left out without PyBullet: pip install pybullet")
    return robot.hand
