"""RSP on sockets: thin shells around its cores."""

from interfaces.rsp.live.opening import opened, read_keys

__all__ = ["opened", "read_keys"]
