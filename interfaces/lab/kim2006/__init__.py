"""Kim, Suh, Kim, Oh: *Internet-based Thin-client robot; Simulacrum-based approach*, reproduced."""

from interfaces.lab.kim2006.paper import PAPER

__all__ = ["PAPER"]
