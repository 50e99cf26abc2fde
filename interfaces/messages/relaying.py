"""What crosses between a hub and its relays beside the protocol's own messages."""

from __future__ import annotations

from typing import Annotated, Any

from msgspec import Meta

from interfaces.messages.fields import Word
from vrs.record import Count, Record

MOST_NODES = 100_000
"""Values of a scene, at most."""


class HubFacts(Record, frozen=True, omit_defaults=True, gc=False):
    """What a relay is told of a hub before anything else."""

    welcome: bytes
    """`welcome` or `mobile-welcome` as msgpack; what it says of a session is nobody's."""
    page: dict[str, Any]
    """What pages are told of the robot, see `interfaces.station.chain.described`."""
    address: Word
    """Of the hub's page, where control is to be had."""


class SceneValues(Record, frozen=True, omit_defaults=True, gc=False):
    """Some of the newest values of a 3D scene: what is newer than one version, up to another."""

    since: Count
    """All values after this version are here; 0: it's the whole scene."""
    version: Count
    """The newest one's."""
    values: Annotated[tuple[tuple[str, bytes], ...], Meta(max_length=MOST_NODES)]
    """[key, MeshCat's command as msgpack], the oldest first."""
