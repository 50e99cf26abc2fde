"""A chassis as a PyBullet multibody: a box, two driven wheels, casters.

Wheels collide as spheres: PyBullet's cylinders wander by centimetres on a circle at any step. Casters with a trail
are a swivelling fork and a wheel; without, a ball that slides. All joints but the drives' have a small Coulomb
friction, which PyBullet's own joint motors make at speed 0.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robots.bullet.room_bodies import CHASSIS, FLOOR, THING, WHEEL
from robots.bullet.serial_arm import RigidLink, quaternion
from robots.bullet.world import World
from robots.ipr.chassis import Chassis
from robots.ipr.reality import MobileReality
from vrs.model import Array

DRIVES = (0, 1)
"""Joints of the driven wheels, right and left."""
_FREE_SPEED = 1e6
_BALL_FRICTION = 0.02
_BODY_FRICTION = 0.3
_FLAT = [0.0, 0.0, 0.0, 1.0]


@dataclass(frozen=True, slots=True, eq=False)
class Loaded:
    """A chassis in a world."""

    body: int
    """PyBullet's body id."""
    centre: Array
    """Centre of mass of the base [m], (3,), in the robot's frame."""
    R_CR: Array
    """Turns vectors from the robot's frame into the frame that PyBullet tells, along the principal axes; (3, 3)."""


@dataclass(slots=True)
class _Link:
    """One link, in PyBullet's terms."""

    mass: float
    radius: float
    """Of its sphere; 0 for none."""
    position: tuple[float, float, float]
    parent: int
    """0 is the base."""
    axis: tuple[float, float, float] | None
    """None is a fixed joint."""
    inertia: list[float]
    friction: float
    resistance: float
    """Coulomb friction of the joint [N m]."""
    centre: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Centre of mass, from the joint [m]."""


def _disc(mass: float, radius: float, width: float, rotor: float = 0.0) -> list[float]:
    """Principal inertias of a wheel that turns about y, with what a rotor adds to its spin [kg m²]."""
    across = mass * (3 * radius * radius + width * width) / 12
    return [across, mass * radius * radius / 2 + rotor, across]


def _links(chassis: Chassis, reality: MobileReality, radii: tuple[float, float], base: float) -> list[_Link]:
    rotor = chassis.gear**2 * chassis.rotor
    links = [
        _Link(
            chassis.wheel_mass,
            radius,
            (0.0, y, radius),
            0,
            (0.0, 1.0, 0.0),
            _disc(chassis.wheel_mass, radius, chassis.wheel_width, rotor),
            reality.friction,
            0.0,
        )
        for radius, y in zip(radii, (-base / 2, base / 2), strict=True)
    ]
    r, trail, half = chassis.caster_radius, chassis.caster_trail, chassis.caster_mass / 2
    resistance = reality.rolling * chassis.caster_rolling
    for x, y in chassis.casters:
        if trail == 0.0:
            sphere = [0.4 * chassis.caster_mass * r * r] * 3
            place = (x, y, r + chassis.caster_lift)
            links.append(_Link(chassis.caster_mass, r, place, 0, None, sphere, _BALL_FRICTION, 0.0))
            continue
        fork = [half * r * r] * 3
        links.append(_Link(half, 0.0, (x, y, 2 * r), 0, (0.0, 0.0, 1.0), fork, 0.0, resistance))
        place = (-trail, 0.0, chassis.caster_lift - r)
        axle = (0.0, 1.0, 0.0)
        links.append(_Link(half, r, place, len(links), axle, _disc(half, r, r), reality.friction, resistance))
    links += [
        # Held by its servo until somebody moves it.
        _Link(limb.mass, 0.0, limb.joint, 0, limb.axis, limb.inertia(), 0.0, limb.torque, limb.centre)
        for limb in chassis.limbs
    ]
    return links


def load_chassis(
    world: World,
    chassis: Chassis,
    reality: MobileReality,
    posture: tuple[float, float, float],
    radii: tuple[float, float],
    base: float,
) -> Loaded:
    """Put a chassis into a world, standing on the floor.

    Args:
        world: The world, with its floor.
        chassis: What to load.
        reality: Friction, payload and the casters' resistance.
        posture: Where, (x, y, θ).
        radii: True radii of the right and the left wheel [m].
        base: True wheel base [m].
    """
    bullet, client = world.bullet, world.client
    mass, centre, inertia = chassis.rigid()
    rigid = RigidLink(0.0, 0.0, 0.0, mass, centre, inertia)
    if (load := reality.payload) is not None:
        rigid = rigid.with_body(load.mass, load.centre, load.inertia)
    diagonal, R_principal = rigid.principal()
    height = chassis.height - chassis.ground_clearance
    box = bullet.createCollisionShape(
        bullet.GEOM_BOX,
        halfExtents=[chassis.length / 2, chassis.width / 2, height / 2],
        collisionFramePosition=[chassis.centre_x, 0.0, chassis.ground_clearance + height / 2],
        physicsClientId=client,
    )
    links = _links(chassis, reality, radii, base)
    shapes = [
        bullet.createCollisionShape(bullet.GEOM_SPHERE, radius=link.radius, physicsClientId=client)
        if link.radius
        else -1
        for link in links
    ]
    n = len(links)
    x, y, theta = posture
    body = bullet.createMultiBody(
        baseMass=rigid.mass,
        baseCollisionShapeIndex=box,
        basePosition=[x, y, 0.0],
        baseOrientation=[0.0, 0.0, float(np.sin(theta / 2)), float(np.cos(theta / 2))],
        baseInertialFramePosition=rigid.centre.tolist(),
        baseInertialFrameOrientation=quaternion(R_principal),
        linkMasses=[link.mass for link in links],
        linkCollisionShapeIndices=shapes,
        linkVisualShapeIndices=[-1] * n,
        linkPositions=[list(link.position) for link in links],
        linkOrientations=[_FLAT] * n,
        linkInertialFramePositions=[list(link.centre) for link in links],
        linkInertialFrameOrientations=[_FLAT] * n,
        linkParentIndices=[link.parent for link in links],
        linkJointTypes=[bullet.JOINT_FIXED if link.axis is None else bullet.JOINT_REVOLUTE for link in links],
        linkJointAxis=[[0.0, 0.0, 1.0] if link.axis is None else list(link.axis) for link in links],
        physicsClientId=client,
    )
    bullet.changeDynamics(
        body,
        -1,
        linearDamping=0.0,
        angularDamping=0.0,
        activationState=bullet.ACTIVATION_STATE_DISABLE_SLEEPING,
        physicsClientId=client,
    )
    bullet.changeDynamics(body, -1, maxJointVelocity=_FREE_SPEED, physicsClientId=client)
    # Not in one call with linearDamping or maxJointVelocity: with either, PyBullet takes the base for the link.
    for j in range(-1, n):
        bullet.changeDynamics(
            body,
            j,
            jointDamping=0.0,
            lateralFriction=_BODY_FRICTION if j < 0 else links[j].friction,
            spinningFriction=0.0,
            rollingFriction=0.0,
            restitution=0.0,
            localInertiaDiagonal=diagonal if j < 0 else links[j].inertia,
            physicsClientId=client,
        )
        group, mask = (CHASSIS, THING) if j < 0 else (WHEEL, FLOOR)
        bullet.setCollisionFilterGroupMask(body, j, group, mask, physicsClientId=client)
    turning = [j for j in range(n) if links[j].axis is not None]
    bullet.setJointMotorControlArray(
        body,
        turning,
        bullet.VELOCITY_CONTROL,
        forces=[links[j].resistance for j in turning],
        physicsClientId=client,
    )
    return Loaded(int(body), rigid.centre, R_principal.T)
