"""What the report's 3D view needs, as one JSON value: shapes, kinematic chain, joint samples, markers."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from interfaces.runs.twin_run import TwinRun
from interfaces.station.chain import described
from vrs.model import Array

if TYPE_CHECKING:
    from robots.solids import LinkShape

MAX_SAMPLES: Final = 24_000
"""Most samples of a twin that a page carries; longer runs are thinned."""

Json = dict[str, Any]


def scene(run: TwinRun) -> Json:
    """Describe both twins for the viewer.

    Returns:
        A JSON value: `links` (meshes in link frames), `chain` (see `interfaces.station.chain.described`), `t`,
         `q_virtual`, `q_real` (NaN where nothing was measured), `behind` (−D; base64 of little-endian
        float32), `floor`, `box` and `markers`.

    Raises:
        InvalidValueError: If the model isn't a chain of revolute and prismatic joints.
    """
    stride = max(1, -(-len(run.t) // MAX_SAMPLES))
    shapes = run.robot.shapes()
    floor = min((float(shape.vertices[:, 2].min()) for shape in shapes[:1]), default=0.0)
    low, high = _box(run, floor)
    return {
        "links": [_mesh(shape) for shape in shapes],
        "chain": described(run.model, np.array(run.robot.tool)),
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


def _packed(values: Array | Sequence[float]) -> str:
    return _base64(np.asarray(values, dtype="<f4"))


def _base64(values: NDArray[Any]) -> str:
    return base64.b64encode(np.ascontiguousarray(values).tobytes()).decode("ascii")
