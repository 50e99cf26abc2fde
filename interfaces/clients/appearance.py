"""What every 3D view is made of: MeshCat's viewer, and the shapes of a robot's links."""

from __future__ import annotations

from functools import lru_cache
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

from numpy.typing import ArrayLike

from robots.ipr.model import Ipr
from vrs.errors import FormatError
from vrs.mobile import MobileModel
from vrs.model import Array, RobotModel

if TYPE_CHECKING:
    from robots.solids import LinkShape


@lru_cache(maxsize=1)
def viewer_bundle() -> tuple[str, str]:
    """Find MeshCat's viewer and its licence texts without importing MeshCat.

    Raises:
        FormatError: If it isn't installed or has no bundle.
    """
    spec = find_spec("meshcat")
    if spec is None or spec.origin is None:
        raise FormatError("meshcat", "not installed; every 3D view is its viewer bundle")
    root = Path(spec.origin).parent / "viewer"
    bundle = root / "dist" / "main.min.js"
    if not bundle.is_file():
        raise FormatError(str(bundle), "missing; reinstall meshcat")
    texts = [root / "LICENSE", root / "dist" / "main.min.js.LICENSE.txt"]
    licences = "\n\n".join(text.read_text(encoding="utf-8").strip() for text in texts if text.is_file())
    return bundle.read_text(encoding="utf-8"), licences


def link_shapes(model: RobotModel | MobileModel) -> tuple[LinkShape, ...]:
    """Shapes of the model's links, of a mobile robot those of its body, wheels and casters.

    None for a robot that has no shapes; an arm then shows as its traces.
    """
    if model.name == "puma560":
        from robots.puma560.shapes import shapes

        return shapes()
    if isinstance(model, Ipr):
        from robots.ipr.shapes import shapes as of_kind

        return of_kind(model.kind)
    return ()


def parts_at(model: MobileModel, posture: ArrayLike) -> Array:
    """Poses of a mobile robot's shapes in the world, (m, 4, 4), at a posture (x, y, θ) [m, m, rad], (3,).

    Raises:
        InvalidValueError: If the posture isn't finite or of that shape.
    """
    from robots.ipr.shapes import links

    return links(model.kind if isinstance(model, Ipr) else "ipr", posture)
