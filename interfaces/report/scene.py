"""What the report's 3D view needs, as one JSON value: shapes, kinematic chain, joint samples, markers."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from itertools import product
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from interfaces.runs.twin_run import TwinRun
from interfaces.station.chain import screws
from interfaces.stream.meshcat.meshes import rod_of
from vrs.model import Array, RobotModel

if TYPE_CHECKING:
    from robots.solids import LinkShape

MAX_SAMPLES: Final = 24_000
"""Most samples of a twin that a page carries; longer runs are thinned."""

_THICK: Final = 0.02
"""Half of the thickness of a knob [m]."""
Json = dict[str, Any]


def scene(run: TwinRun) -> Json:
    """Describe both twins for the viewer.

    Returns:
        A JSON value: `links` (meshes in link frames), the chain (see `chain_of`), `t`,
         `q_virtual`, `q_real` (NaN where nothing was measured), `behind` (−D; base64 of little-endian
        float32), `floor`, `box` and `markers`.

    Raises:
        InvalidValueError: If the model isn't a chain of revolute and prismatic joints.
    """
    stride = max(1, -(-len(run.t) // MAX_SAMPLES))
    shapes = run.robot.shapes() or rods(run.model)
    floor = min((float(shape.vertices[:, 2].min()) for shape in shapes[:1]), default=0.0)
    low, high = _box(run, floor)
    return {
        "links": [_mesh(shape) for shape in shapes],
        **chain_of(run.model),
        "t": _packed(run.t[::stride] - run.t[0]),
        "t_start": float(run.t[0]),
        "t_end": float(run.t[::stride][-1]),
        "q_virtual": _packed(run.q_shown[::stride]),
        "q_real": _packed(run.q_real[::stride]),
        "behind": _packed(-run.D[::stride]),
        "floor": floor,
        "box": [low, high],
        "markers": markers(run),
    }


def chain_of(model: RobotModel) -> Json:
    """A model's kinematics, as the page's script takes them.

    Returns:
        `base` and `chain`, constant transforms, column-major, so that X_i = X_(i-1) Rz(q_i) A_i; where the model
        doesn't move so, `home` and `chain` from `interfaces.station.chain.screws`.

    Raises:
        InvalidValueError: If the model isn't a chain of revolute and prismatic joints.
    """
    n = model.limits.dof
    rest = np.asarray(model.links(np.zeros(n)))
    A = np.linalg.inv(rest[:-1]) @ rest[1:]
    q = 0.3 + 0.4 * np.arange(n)
    X = rest[0]
    for i, angle in enumerate(q):
        turn = np.eye(4)
        turn[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
        X = X @ turn @ A[i]
        if not np.allclose(X, np.asarray(model.links(q))[i + 1], atol=1e-9):
            home, S = screws(model)
            return {"home": [_column_major(X) for X in home], "chain": S.tolist()}
    return {"base": _column_major(rest[0]), "chain": [_column_major(X) for X in A]}


def rods(model: RobotModel) -> tuple[LinkShape, ...]:
    """What an arm without shapes is drawn as: a knob a link, a rod from the one before where that's constant."""
    from robots.solids import Builder, hull

    corners = _THICK * np.array(list(product((-1.0, 1.0), repeat=3)))
    found = []
    for i in range(model.limits.dof + 1):
        build = Builder(f"link {i}", (0.62, 0.64, 0.67))
        build.add(hull(corners))
        before = rod_of(model, i) if i else None
        if before is not None and np.linalg.norm(before) > _THICK:
            build.add(hull(np.vstack([0.4 * corners, before + 0.4 * corners])))
        found.append(build.shape())
    return tuple(found)


def markers(run: TwinRun) -> list[Json]:
    """What the time slider marks, by time: commands as the operator gave them, losses, events."""
    out: list[Json] = []
    for receipt in run.receipts_virtual:
        text = f"command {receipt.command_id}: {receipt.status}"
        if receipt.reason:
            text += f" ({receipt.reason})"
        out.append({"t": receipt.issued_at, "kind": str(receipt.status), "text": text})
    known_lost = {event.t for event in run.events if event.kind == "lost"}
    out.extend(
        {"t": packet.sent, "kind": "lost", "text": f"command {packet.command_id}: message lost"}
        for packet in run.packets
        if packet.lost and packet.sent not in known_lost
    )
    out.extend({"t": event.t, "kind": event.kind, "text": event.text} for event in run.events)
    return sorted(out, key=lambda marker: (marker["t"], marker["kind"], marker["text"]))


def _box(run: TwinRun, floor: float) -> tuple[list[float], list[float]]:
    """Corners of what the camera must see: the pedestal, every link origin of both twins, some margin."""
    stride = max(1, len(run.t) // 400)
    q = np.concatenate([run.q_shown[::stride], run.q_real[run.measured][::stride]])
    points = np.asarray(run.model.links(q))[:, :, :3, 3].reshape(-1, 3)
    low = np.minimum(points.min(axis=0), (-0.2, -0.2, floor)) - 0.05
    high = np.maximum(points.max(axis=0), (0.2, 0.2, 0.15)) + 0.05
    low[2] = floor
    return [float(x) for x in low], [float(x) for x in high]


def _mesh(shape: LinkShape) -> Json:
    palette, index = np.unique(shape.face_colours, axis=0, return_inverse=True)
    return {
        "name": shape.name,
        "vertices": _packed(shape.vertices),
        "faces": _base64(np.asarray(shape.faces, dtype="<u4")),
        "colours": _base64(index.astype(np.uint8)),
        "palette": [[float(x) for x in colour] for colour in palette],
    }


def _column_major(X: Array) -> list[float]:
    return [float(x) for x in X.T.ravel()]


def _packed(values: Array | Sequence[float]) -> str:
    return _base64(np.asarray(values, dtype="<f4"))


def _base64(values: NDArray[Any]) -> str:
    return base64.b64encode(np.ascontiguousarray(values).tobytes()).decode("ascii")
