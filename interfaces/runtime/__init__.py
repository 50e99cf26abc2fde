"""The drivers that run twins, and what a run leaves behind."""

from interfaces.runtime.run import Event, Packet, TwinRun

__all__ = ["Event", "Packet", "TwinRun"]
