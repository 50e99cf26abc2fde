"""What every 3D view is made of: MeshCat's viewer."""

from __future__ import annotations

from functools import lru_cache
from importlib.util import find_spec
from pathlib import Path

from vrs.errors import FormatError


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
