"""Doulgeri, Zikos, Delopoulos: *Modelling and Interfacing Remote Virtual Robots*, reproduced."""

from interfaces.lab.doulgeri.paper import PAPER

__all__ = ["PAPER"]
