"""MeshCat's commands as the bytes that its viewer takes: one msgpack map each."""

from __future__ import annotations

from typing import Any

import msgspec

from vrs.model import Array

Json = dict[str, Any]


def set_transform(path: str, X: Array) -> bytes:
    """Put a node at X, (4, 4), in its parent's frame; the bytes are those of `meshcat.commands.SetTransform`."""
    return _encoder.encode({"type": "set_transform", "path": path, "matrix": X.T.ravel().tolist()})


def set_object(path: str, lowered: Json) -> bytes:
    """Show an object at a node, in place of the one that's there.

    Args:
        path: The node; its children and its transform stay.
        lowered: The object as MeshCat's classes lower it: `geometries`, `materials`, `object`.
    """
    return _encoder.encode({"type": "set_object", "object": lowered, "path": path})


def set_property(path: str, name: str, value: Any) -> bytes:
    """Set a property of a node; the viewer keeps those that it doesn't know with the node."""
    return _encoder.encode({"type": "set_property", "path": path, "property": name, "value": value})


def delete(path: str) -> bytes:
    """Take a node away, and all below it; where there's none, nothing happens."""
    return _encoder.encode({"type": "delete", "path": path})


def _ext(value: Any) -> msgspec.msgpack.Ext:
    """MeshCat's typed arrays are extensions of its own msgpack library."""
    return msgspec.msgpack.Ext(value.type, value.data)


_encoder = msgspec.msgpack.Encoder(enc_hook=_ext)
