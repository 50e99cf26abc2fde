"""Streams of a hub over Zenoh: published once, and relayed to as many viewers as like (docs/howto/relays.md)."""
