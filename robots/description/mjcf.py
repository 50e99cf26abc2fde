"""MJCF as a description, by the library mujoco."""

from __future__ import annotations

import math
from collections import defaultdict
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Final

import numpy as np

from robots.description import meshes
from robots.description.description import Description, Joint, JointKind, Link, Mimic
from robots.description.urdf import LARGEST_NUMBER, MOST
from robots.solids import LinkShape
from vrs.errors import FormatError
from vrs.model import Array


def read_mjcf(path: Path) -> Description:
    """Return what an MJCF file says, compiled.

    Args:
        path: Where it is.

    Raises:
        FormatError: If mujoco isn't installed, or refuses the file.
    """
    if find_spec("mujoco") is None:
        raise FormatError(str(path), "MJCF needs mujoco: pip install vrs-teleop[mujoco]")
    import mujoco

    # Warnings would go to the terminal, and into a file in the working directory.
    before = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(lambda _: None)
    try:
        model = mujoco.MjModel.from_xml_path(str(path))
    except (ValueError, mujoco.FatalError) as error:
        raise FormatError(str(path), " ".join(str(error).split())) from None
    finally:
        mujoco.set_mju_user_warning(before)
    if not 1 <= model.nbody <= MOST:
        raise FormatError(str(path), f"must have 1 to {MOST} bodies; has {model.nbody}")
    for name in _NUMBERS:
        numbers = np.abs(getattr(model, name))
        if not (numbers <= LARGEST_NUMBER).all():
            raise FormatError(str(path), f"{name}: numbers must be within ±{LARGEST_NUMBER:g}")
    return _Compiled(model, path).description()


_NUMBERS: Final = (
    "body_pos", "body_quat", "body_ipos", "body_iquat", "body_mass", "body_inertia", "jnt_pos", "jnt_axis",
    "jnt_range", "jnt_actfrcrange", "qpos0", "key_qpos", "dof_armature", "dof_damping", "dof_frictionloss",
    "geom_pos", "geom_quat", "geom_size", "geom_rgba", "mat_rgba", "mesh_vert", "eq_data", "actuator_gear",
    "actuator_gainprm",
)  # fmt: skip
"""What is read of a compiled model."""


class _Compiled:
    """A compiled model that is being read, with what there is to say of it."""

    def __init__(self, model: Any, path: Path) -> None:
        import mujoco

        self._mujoco, self._m, self._path = mujoco, model, path
        self._hinge, self._slide = int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE)
        self._geom = mujoco.mjtGeom
        self._count: dict[str, list[str]] = defaultdict(list)
        self._joints: list[Joint] = []
        self._links: dict[str, Link] = {}
        self._frames: dict[int, Array] = {}
        """Where each body's own frame is in that of the link that stands for it."""
        self._mimics = self._equalities()
        self._efforts = self._actuated()

    def description(self) -> Description:
        """Return all of it."""
        for body in range(self._m.nbody):
            self._add(body)
        notes = tuple(what.replace("{}", ", ".join(of)) for what, of in self._count.items())
        names = self._m.names[: self._m.names.index(b"\0")].decode()
        weightless = self._m.opt.disableflags & int(self._mujoco.mjtDisableBit.mjDSBL_GRAVITY)
        gravity = 0.0 if weightless else min(max(-float(self._m.opt.gravity[2]), 0.0), 100.0)
        return Description(names, self._links, tuple(self._joints), self._keyframes(), gravity=gravity, notes=notes)

    def _name(self, kind: str, k: int) -> str:
        return str(getattr(self._m, kind)(k).name) or f"{kind}_{k}"

    def _add(self, body: int) -> None:
        """Add a body, its joints, and links without mass between them where it has several."""
        m, name = self._m, self._name("body", body)
        X_BL: Array = np.eye(4)
        if body:
            parent = int(m.body_parentid[body])
            above, X = self._name("body", parent), self._frames[parent] @ _pose(m.body_pos[body], m.body_quat[body])
            first, count = int(m.body_jntadr[body]), int(m.body_jntnum[body])
            moving = [j for j in range(first, first + count) if self._moves(j)]
            for k, j in enumerate(moving):
                last = k == len(moving) - 1
                child = name if last else f"{name}/{self._name('joint', j)}"
                anchor = _moved(m.jnt_pos[j])
                self._joints.append(self._joint(j, above, child, X @ anchor))
                X, X_BL, above = _moved(-m.jnt_pos[j]), anchor, child
                if not last:
                    self._links[child] = Link(child)
            if not moving:
                self._joints.append(Joint(f"{name}/fixed", JointKind.FIXED, above, name, X))
        self._frames[body] = X_LB = _moved(-X_BL[:3, 3])
        X_LI = X_LB @ _pose(m.body_ipos[body], m.body_iquat[body])
        inertia = X_LI[:3, :3] @ np.diag(m.body_inertia[body]) @ X_LI[:3, :3].T
        shapes, collisions = self._shapes(body, name, X_LB)
        self._links[name] = Link(name, float(m.body_mass[body]), X_LI[:3, 3], inertia, shapes, collisions)

    def _moves(self, j: int) -> bool:
        if self._m.jnt_type[j] in (self._hinge, self._slide):
            return True
        self._count["{}: joints that are free or balls are taken as fixed."].append(self._name("joint", j))
        return False

    def _joint(self, j: int, parent: str, child: str, X: Array) -> Joint:
        """Read a joint, which stands at X in the link above, (4, 4), where the model does when it's made."""
        m, name = self._m, self._name("joint", j)
        slides = m.jnt_type[j] == self._slide
        dof, q_0 = int(m.jnt_dofadr[j]), float(m.qpos0[m.jnt_qposadr[j]])
        axis = np.array(m.jnt_axis[j])
        X = X @ _motion(axis, -q_0, slides)
        low, high = m.jnt_range[j].tolist() if m.jnt_limited[j] else (None, None)
        kind = JointKind.PRISMATIC if slides else JointKind.REVOLUTE if m.jnt_limited[j] else JointKind.CONTINUOUS
        return Joint(
            name, kind, parent, child, X, axis, q_min=low, q_max=high, effort=self._efforts.get(j),
            damping=float(np.ravel(m.dof_damping[dof])[0]), friction=float(m.dof_frictionloss[dof]),
            armature=float(m.dof_armature[dof]) or None,
            mimic=self._mimics.get(j),
        )  # fmt: skip

    def _shapes(self, body: int, name: str, X_LB: Array) -> tuple[tuple[LinkShape, ...], tuple[LinkShape, ...]]:
        """What a body looks like, and what it touches with."""
        m = self._m
        seen, touching = [], []
        first = int(m.body_geomadr[body])
        for g in range(first, first + int(m.body_geomnum[body])):
            surface = self._surface(g)
            if surface is None:
                continue
            X = X_LB @ _pose(m.geom_pos[g], m.geom_quat[g])
            material = int(m.geom_matid[g])
            colour = m.geom_rgba[g] if material < 0 else m.mat_rgba[material]
            touches = bool(m.geom_contype[g] or m.geom_conaffinity[g])
            if colour[3] > 0.0:
                seen.append((touches, meshes.shape(name, surface, X, colour[:3])))
            if touches and (made := meshes.hull(name, surface, X)) is not None:
                touching.append(made)
        # Models with a mesh for the eye have coarser ones for contacts, which aren't drawn then.
        drawn = [shape for touches, shape in seen if not touches] or [shape for _, shape in seen]
        return tuple(drawn), tuple(touching)

    def _surface(self, g: int) -> meshes.Surface | None:
        m, kinds = self._m, self._geom
        kind, size = int(m.geom_type[g]), m.geom_size[g]
        if kind == int(kinds.mjGEOM_SPHERE):
            return meshes.ellipsoid(np.repeat(size[0], 3))
        if kind == int(kinds.mjGEOM_CAPSULE):
            return meshes.capsule(float(size[0]), 2 * float(size[1]))
        if kind == int(kinds.mjGEOM_ELLIPSOID):
            return meshes.ellipsoid(size)
        if kind == int(kinds.mjGEOM_CYLINDER):
            return meshes.cylinder(float(size[0]), 2 * float(size[1]))
        if kind == int(kinds.mjGEOM_BOX):
            return meshes.box(2 * size)
        if kind == int(kinds.mjGEOM_MESH):
            return self._mesh(int(m.geom_dataid[g]))
        return None

    def _mesh(self, k: int) -> meshes.Surface:
        import trimesh

        m = self._m
        first, corners = int(m.mesh_vertadr[k]), int(m.mesh_vertnum[k])
        face, faces = int(m.mesh_faceadr[k]), int(m.mesh_facenum[k])
        vertices = np.array(m.mesh_vert[first : first + corners], dtype=np.float64)
        triangles = np.array(m.mesh_face[face : face + faces], dtype=np.int64)
        return meshes.Surface(trimesh.Trimesh(vertices, triangles, process=False), None)

    def _equalities(self) -> dict[int, Mimic]:
        """Joints that follow others along a line."""
        import mujoco

        m, found = self._m, {}
        for k in range(m.neq):
            j, other = int(m.eq_obj1id[k]), int(m.eq_obj2id[k])
            if m.eq_type[k] != int(mujoco.mjtEq.mjEQ_JOINT) or other < 0:
                continue
            offset, multiplier = m.eq_data[k][:2].tolist()
            y_0, x_0 = (float(m.qpos0[m.jnt_qposadr[one]]) for one in (j, other))
            found[j] = Mimic(self._name("joint", other), multiplier, y_0 + offset - multiplier * x_0)
        return found

    def _actuated(self) -> dict[int, float]:
        """Largest torques and forces of joints that actuators drive, where something limits them."""
        import mujoco

        m, found = self._m, {}
        for j in range(m.njnt):
            if m.jnt_actfrclimited[j]:
                found[j] = float(np.abs(m.jnt_actfrcrange[j]).max())
        for k in range(m.nu):
            if m.actuator_trntype[k] != int(mujoco.mjtTrn.mjTRN_JOINT):
                continue
            j, gear = int(m.actuator_trnid[k][0]), abs(float(m.actuator_gear[k][0]))
            if m.actuator_forcelimited[k]:
                found.setdefault(j, gear * float(np.abs(m.actuator_forcerange[k]).max()))
            elif m.actuator_ctrllimited[k] and m.actuator_biastype[k] == int(mujoco.mjtBias.mjBIAS_NONE):
                most = float(np.abs(m.actuator_ctrlrange[k]).max() * abs(m.actuator_gainprm[k][0]))
                found.setdefault(j, gear * most)
        return {j: effort for j, effort in found.items() if math.isfinite(effort) and effort > 0.0}

    def _keyframes(self) -> dict[str, dict[str, float]]:
        m = self._m
        turning = [j for j in range(m.njnt) if m.jnt_type[j] in (self._hinge, self._slide)]
        return {
            self._name("key", k): {self._name("joint", j): float(m.key_qpos[k][m.jnt_qposadr[j]]) for j in turning}
            for k in range(m.nkey)
        }


def _moved(by: Array) -> Array:
    """The pose that is moved by a vector, (4, 4)."""
    X = np.eye(4)
    X[:3, 3] = by
    return X


def _pose(position: Array, quaternion: Array) -> Array:
    """The pose at a position with a quaternion (w, x, y, z), (4, 4)."""
    from scipy.spatial.transform import Rotation

    X = np.eye(4)
    w, x, y, z = quaternion.tolist()
    X[:3, :3], X[:3, 3] = Rotation.from_quat([x, y, z, w]).as_matrix(), position
    return X


def _motion(axis: Array, q: float, slides: bool) -> Array:
    """What a joint does at q, (4, 4)."""
    from scipy.spatial.transform import Rotation

    X = np.eye(4)
    if slides:
        X[:3, 3] = q * axis
    else:
        X[:3, :3] = Rotation.from_rotvec(q * axis).as_matrix()
    return X
