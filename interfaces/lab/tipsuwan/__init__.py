"""Tipsuwan, Chow: *Model Predictive Path Tracking via Middleware for Networked Mobile Robot over IP Network*."""

from interfaces.lab.tipsuwan.paper import PAPER

__all__ = ["PAPER"]
