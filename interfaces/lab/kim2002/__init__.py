"""Kim, Han, Kim, Kim: *Internet-Based Personal Robot System using Map-Based Localization*, reproduced."""

from interfaces.lab.kim2002.paper import PAPER

__all__ = ["PAPER"]
