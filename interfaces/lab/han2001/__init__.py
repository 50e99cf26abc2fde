"""Han, Kim, Kim, Kim: *Internet Control Architecture for Internet-Based Personal Robot*, reproduced."""

from interfaces.lab.han2001.paper import PAPER

__all__ = ["PAPER"]
