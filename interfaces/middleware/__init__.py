"""Network middleware: a controller written for no delay drives a robot over a network, unchanged.

Source: Tipsuwan, Chow, *Model Predictive Path Tracking via Middleware for Networked Mobile Robot over IP Network*.
"""

from interfaces.middleware.middleware import (
    ActionAgent,
    Controller,
    DriveFeedback,
    DriveSetpoint,
    GainScheduler,
    GainSchedulingMiddleware,
    MiddlewareConfig,
    predicted,
)
from interfaces.middleware.network import (
    Formulation,
    GainNetwork,
    TrainingConfig,
    default_network,
    load_network,
    train,
)
from interfaces.middleware.performance import drive_measure, optimal_way

__all__ = [
    "ActionAgent",
    "Controller",
    "DriveFeedback",
    "DriveSetpoint",
    "Formulation",
    "GainNetwork",
    "GainScheduler",
    "GainSchedulingMiddleware",
    "MiddlewareConfig",
    "TrainingConfig",
    "default_network",
    "drive_measure",
    "load_network",
    "optimal_way",
    "predicted",
    "train",
]
