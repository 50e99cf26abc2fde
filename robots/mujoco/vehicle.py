"""A vehicle in MuJoCo; see `robots.vehicle.RigidVehicle`.

MuJoCo's own motors are forces, which at a good servo's stiffness fight with the tyres' friction. Here a servo is a
clutch: a shaft beside the vehicle turns as it's told, and a tendon with friction drags the joint along, with the
servo's torque at most. The solver finds that torque together with the contacts' forces, as PyBullet does.

Wheels collide as spheres, as in PyBullet. What meets with which friction is said pair by pair: of two coefficients
MuJoCo would take the larger one, not the product.
"""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np
from typing_extensions import override

from robots.chain import quaternion, rotation
from robots.mujoco.chain import load_mujoco, w_first
from robots.robot import Closing
from robots.rooms import Block, Room, Standing, moves, pose_at, solid
from robots.vehicle import (
    BODY_FRICTION,
    DRIVES,
    FLOOR_FRICTION,
    GAP,
    HOLD_TIME,
    LIMB_GAIN,
    THING_FRICTION,
    Cargo,
    Pair,
    Point,
    Posture,
    Vehicle,
    Wheel,
)
from vrs.model import Array

_SHAFT: Final = 1e3
"""A shaft's inertia, as a multiple of the vehicle's at its wheels: the vehicle must not drag what drags it."""
_IMPEDANCE: Final = [0.9999, 0.9999, 1e-3, 0.5, 2.0]
"""Of constraints, whatever their depth: as hard as MuJoCo's can be."""
_ALONE: Final[dict[str, Any]] = {"contype": 0, "conaffinity": 0}
"""Of a geometry that meets only what a pair says."""
_PUSH: Final = 5.0
"""In so many steps the box makes way for what comes into it."""
_TOUCH: Final = 1e-3
"""What the box is so near to is touched [m]: a box that spinning wheels press against something trembles."""
_BOX, _THING = 1, 2
"""Bits of what meets: the vehicle's box meets things, things don't meet each other."""
_SEEN: Final = np.array([0, 1, 0, 0, 0, 0], dtype=np.uint8)
"""Groups of geometries that rays meet: things alone."""
_BEHIND: Final = 1e-6
"""A ray that begins in a thing goes on so far behind its back [m]."""


class MujocoVehicle(Closing):
    """Servos that turn wheels and limbs, and nothing else."""

    def __init__(self, vehicle: Vehicle, room: Room, posture: Posture, *, gravity: float, dt: float) -> None:
        """Put a vehicle into a room at a posture, with free fall along -z [m/s²] and a fixed step [s]."""
        self._mujoco = mujoco = load_mujoco()
        self._vehicle, self._gravity, self._dt, self._gain = vehicle, gravity, dt, -math.expm1(-dt / HOLD_TIME)
        # What's lacking is made up for in two steps, the fastest that's stable; more softly where people walk into
        # the box, who go on in jumps: they'd throw it ahead, and touch it again and again.
        self._held = {"solref": [2.0 * dt, 1.0], "solimp": _IMPEDANCE}
        self._pushed = {"solref": [_PUSH * dt, 1.0], "solimp": _IMPEDANCE}
        self._dragged = {"solref_friction": [2.0 * dt, 1.0], "solimp_friction": _IMPEDANCE}
        self._spec = spec = mujoco.MjSpec()
        option = spec.option
        option.timestep, option.gravity = dt, [0.0, 0.0, -gravity]
        option.integrator, option.cone = mujoco.mjtIntegrator.mjINT_EULER, mujoco.mjtCone.mjCONE_ELLIPTIC
        # Islands have copies of what `_keep_down` changes.
        option.disableflags |= mujoco.mjtDisableBit.mjDSBL_ISLAND
        spec.worldbody.add_geom(name="floor", type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0.0, 0.0, 1.0], **_ALONE)
        first = len(vehicle.wheels)
        self._clutched = *DRIVES, *range(first, first + len(vehicle.limbs))
        self._add_vehicle(posture)
        for k, thing in enumerate(room.standing):
            self._add_thing(f"thing {k}", thing)
        self._goals: list[tuple[float, float] | None] = [None] * len(vehicle.limbs)
        self._cargo: list[str] = []
        self._model = self._spec.compile()
        self._data = mujoco.MjData(self._model)
        self._compiled()
        self._names = {self._model.geom(f"thing {k}").id: thing.name for k, thing in enumerate(room.standing)}
        self._moving = [thing for thing in room.standing if moves(thing)]

    def _add_vehicle(self, posture: Posture) -> None:
        mujoco, spec, vehicle = self._mujoco, self._spec, self._vehicle
        x, y, theta = posture
        box = spec.worldbody.add_body(name="vehicle", pos=[x, y, 0.0], quat=_upright(theta))
        box.add_freejoint()
        size = [length / 2 for length in vehicle.size]
        kind, meets = mujoco.mjtGeom.mjGEOM_BOX, self._meets(_BOX, _THING)
        box.add_geom(name="box", type=kind, size=size, pos=vehicle.middle, **meets)
        bodies = [box]
        inertia = vehicle.rigid.mass * vehicle.wheels[0].radius ** 2
        for k, part in enumerate(vehicle.parts):
            body = bodies[part.parent].add_body(name=f"part {k}", pos=part.position)
            bodies.append(body)
            if part.radius:
                name, size = f"tyre {k}", [part.radius, 0.0, 0.0]
                body.add_geom(name=name, type=mujoco.mjtGeom.mjGEOM_SPHERE, size=size, **_ALONE)
                self._pair("floor", name, part.friction * FLOOR_FRICTION)
            if part.axis is None:
                continue
            resistance = 0.0 if k in self._clutched else part.resistance
            body.add_joint(name=f"joint {k}", axis=part.axis, frictionloss=resistance, **self._dragged)
            if k in self._clutched:
                shaft = spec.worldbody.add_body(name=f"shaft {k}", mass=1e-6, inertia=[1e-9, 1e-9, 1e-9])
                shaft.add_joint(name=f"shaft {k}", armature=_SHAFT * inertia)
                torque = vehicle.torque if k in DRIVES else part.resistance
                clutch = spec.add_tendon(name=f"clutch {k}", frictionloss=torque, **self._dragged)
                clutch.wrap_joint(f"joint {k}", 1.0)
                clutch.wrap_joint(f"shaft {k}", -1.0)
        for body in bodies:
            # For the check of its inertia, which wheels with what rotors add to their spin wouldn't pass.
            body.mass, body.inertia, body.explicitinertial = 1.0, [1.0, 1.0, 1.0], True

    def _add_thing(self, name: str, thing: Standing) -> None:
        mujoco, block = self._mujoco, solid(thing)
        if isinstance(block, Block):
            kind, size = mujoco.mjtGeom.mjGEOM_BOX, [block.length / 2, block.width / 2, block.height / 2]
        else:
            kind, size = mujoco.mjtGeom.mjGEOM_CYLINDER, [block.radius, block.height / 2, 0.0]
        *place, angle = pose_at(thing, 0.0)
        body = self._spec.worldbody.add_body(name=name, pos=place, quat=_upright(angle), mocap=moves(thing))
        body.add_geom(name=name, type=kind, size=size, group=1, **self._meets(_THING, _BOX))

    def _meets(self, kind: int, others: int) -> dict[str, Any]:
        """What the box and things have for their contacts with each other."""
        friction = [BODY_FRICTION * THING_FRICTION, 0.0, 0.0]
        near = {"gap": 0.5 * _TOUCH}
        return {"contype": kind, "conaffinity": others, "friction": friction, **near, **self._pushed}

    def _pair(self, one: str, other: str, friction: float) -> None:
        """Let two geometries meet that otherwise meet nothing."""
        sliding_turning_rolling = [friction, friction, 0.0, 0.0, 0.0]
        pair = {"condim": 3, "friction": sliding_turning_rolling, **self._held}
        self._spec.add_pair(geomname1=one, geomname2=other, **pair)

    def _compiled(self) -> None:
        """Complete the model."""
        mujoco, model, data, vehicle = self._mujoco, self._model, self._data, self._vehicle
        diagonal, axes = vehicle.rigid.principal()
        box = model.body("vehicle")
        box.mass, box.ipos, box.inertia = vehicle.rigid.mass, vehicle.rigid.centre, diagonal
        box.iquat = w_first(quaternion(axes))
        for k, part in enumerate(vehicle.parts):
            body = model.body(f"part {k}")
            body.mass, body.ipos, body.inertia = part.mass, part.centre, part.inertia
        # With it the state is that of the reference.
        q, qd = data.qpos.copy(), data.qvel.copy()
        mujoco.mj_setConst(model, data)
        data.qpos, data.qvel = q, qd
        # What the solver takes for small is a share of this; shafts don't count.
        model.stat.meaninertia = vehicle.rigid.mass
        mujoco.mj_kinematics(model, data)
        self._joints = [model.joint(f"joint {k}").qposadr[0] for k in self._clutched]
        self._turning = [model.joint(f"joint {k}").dofadr[0] for k in self._clutched]
        self._shafts = [model.joint(f"shaft {k}").dofadr[0] for k in self._clutched]
        self._box, self._tyres = model.geom("box").id, [model.geom(f"tyre {k}").id for k in DRIVES]
        # Views of its memory: asking for one takes time.
        self._q, self._qd, self._forces = data.qpos, data.qvel, data.qfrc_constraint

    def step(self, angles: Pair, speeds: Pair) -> None:
        """Go on by a step, the servos turning the wheels."""
        q, qd, joints, shafts, dt = self._q, self._qd, self._joints, self._shafts, self._dt
        for k in DRIVES:
            qd[shafts[k]] = speeds[k] + self._gain * (angles[k] - q[joints[k]]) / dt
        for k, goal in enumerate(self._goals, start=len(DRIVES)):
            speed = 0.0
            if goal is not None:
                angle, most = goal
                speed = min(max(LIMB_GAIN * (angle - q[joints[k]]) / dt, -most), most)
            qd[shafts[k]] = speed
        self._mujoco.mj_step1(self._model, self._data)
        self._keep_down()
        self._mujoco.mj_step2(self._model, self._data)

    def _keep_down(self) -> None:
        """Take back the lift that MuJoCo's friction gives to what slides.

        In its convex model a contact that slides goes apart by μ times the sliding that friction couldn't stop, and
        wheels hop. What friction is asked to stop, less the μ g that it can, is known before.

        Source: Anitescu, Optimization-based simulation of nonsmooth rigid multibody dynamics, 2006; Todorov, Convex
        and analytically-invertible dynamics with contacts and constraints, 2014.
        """
        data = self._data
        first = data.ne + data.nf + data.nl
        if data.nefc > first:
            apart, *sliding = data.efc_aref[first:].reshape(-1, 3).T
            friction = data.contact.friction[data.contact.efc_address >= 0, 0]
            apart -= friction * np.maximum(np.hypot(*sliding) - friction * self._gravity, 0.0)

    def pose(self) -> tuple[Array, Array]:
        """Where the vehicle's frame is, and how it's turned."""
        w, x, y, z = self._q[3:7].tolist()
        return self._q[:3].copy(), rotation((x, y, z, w))

    def velocity(self) -> tuple[Array, Array]:
        """Velocity of the frame's origin, and angular velocity."""
        _, R = self.pose()
        return self._qd[:3].copy(), R @ self._qd[3:6]

    def angles(self) -> Pair:
        """What the driven wheels have turned by."""
        right, left = (float(self._q[self._joints[k]]) for k in DRIVES)
        return right, left

    def drives(self) -> tuple[Wheel, Wheel]:
        """What the right and the left wheel do."""
        loads = dict.fromkeys(self._tyres, 0.0)
        force = np.zeros(6)
        for k, contact in enumerate(self._data.contact):
            for geometry in set(contact.geom.tolist()) & loads.keys():
                self._mujoco.mj_contactForce(self._model, self._data, k, force)
                loads[geometry] += float(force[0])
        right, left = (
            Wheel(float(self._qd[self._turning[k]]), -float(self._forces[self._shafts[k]]), loads[self._tyres[k]])
            for k in DRIVES
        )
        return right, left

    def place(self, posture: Posture) -> None:
        """Turn the vehicle about the vertical and shift it to a posture, where it's at rest."""
        _, R = self.pose()
        x, y, theta = posture
        turn = _upright(theta - math.atan2(R[1, 0], R[0, 0]))
        self._mujoco.mju_mulQuat(self._q[3:7], np.array(turn), self._q[3:7].copy())
        self._q[:2], self._qd[:6] = (x, y), 0.0

    def rewind(self) -> None:
        """Take the driven wheels' angles for 0, and stop them."""
        for k in DRIVES:
            self._q[self._joints[k]] = self._qd[self._turning[k]] = 0.0

    @property
    def changing(self) -> bool:
        """Whether anything in the room ever moves, comes or goes."""
        return bool(self._moving)

    def at(self, t: float) -> None:
        """Bring everything in the room to where it is at a time [s]."""
        for k, thing in enumerate(self._moving):
            *place, angle = pose_at(thing, t)
            self._data.mocap_pos[k], self._data.mocap_quat[k] = place, _upright(angle)
        # For the rays.
        self._mujoco.mj_kinematics(self._model, self._data)

    def touched(self) -> set[str]:
        """What the box touches."""
        found: set[str] = set()
        for contact in self._data.contact:
            pair = set(contact.geom.tolist())
            if self._box in pair and contact.dist <= _TOUCH:
                found |= {self._names[other] for other in pair & self._names.keys()}
        return found

    def cast(self, origins: Array, directions: Array, height: float, reach: float) -> Array:
        """How far level rays go to what's in the room."""
        level = np.full((len(origins), 1), height)
        starts, ways = np.hstack([origins, level]), np.hstack([directions, 0.0 * level])
        return np.array([self._ray(start, way, reach) for start, way in zip(starts, ways, strict=True)])

    def _ray(self, start: Array, way: Array, reach: float) -> float:
        """How far a ray goes, inf if beyond reach."""
        gone, normal, cast = 0.0, np.zeros(3), self._mujoco.mj_ray
        while True:
            far = cast(self._model, self._data, start + gone * way, way, _SEEN, 1, -1, None, normal)
            if far < 0.0 or gone + far > reach:
                return math.inf
            gone += float(far)
            if normal @ way < 0.0:
                return gone
            # From inside of a thing, whose back it met.
            gone += _BEHIND

    def load(self, cargo: Cargo, at: Point, heading: float) -> None:
        """Let a piece of cargo go above a place on the box's top."""
        name, (x, y, z) = f"cargo {len(self._cargo)}", at
        half = [cargo.length / 2, cargo.width / 2, cargo.height / 2]
        body = self._spec.worldbody.add_body(name=name, pos=[x, y, z + half[2] + GAP], quat=_upright(heading))
        body.add_freejoint()
        body.add_geom(name=name, type=self._mujoco.mjtGeom.mjGEOM_BOX, size=half, mass=cargo.mass, **_ALONE)
        self._pair("box", name, cargo.friction * BODY_FRICTION)
        self._pair("floor", name, cargo.friction * FLOOR_FRICTION)
        self._cargo.append(name)
        self._model, self._data = self._spec.recompile(self._model, self._data)
        self._compiled()

    def cargo(self) -> list[Array]:
        """Where the middle of each piece is."""
        first = [self._model.jnt_qposadr[self._model.body(name).jntadr[0]] for name in self._cargo]
        return [self._q[k : k + 3].copy() for k in first]

    def swing(self, limb: int, angle: float, speed: float) -> None:
        """Let a limb's servo go to an angle, at most at a speed, from now on."""
        self._goals[limb] = angle, speed

    def limbs(self) -> tuple[float, ...]:
        """Angles of the limbs."""
        return tuple(float(self._q[k]) for k in self._joints[len(DRIVES) :])

    @override
    def close(self) -> None:
        """Nothing is held."""


def _upright(angle: float) -> list[float]:
    """A turn about the vertical [rad] as MuJoCo has it."""
    return [math.cos(angle / 2), 0.0, 0.0, math.sin(angle / 2)]
