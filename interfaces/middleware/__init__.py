"""Network middleware: a controller written for no delay drives a robot over a network, unchanged.

Source: Tipsuwan, Chow, *Model Predictive Path Tracking via Middleware for Networked Mobile Robot over IP Network*.
"""

from interfaces.middleware.action_agent import ActionAgent, ActionAgentConfig
from interfaces.middleware.messages import DriveFeedback, DriveSetpoint
from interfaces.middleware.middleware import Controller, GainSchedulingMiddleware, MiddlewareConfig
from interfaces.middleware.network import (
    Formulation,
    GainNetwork,
    Ranges,
    default_network,
    load_network,
    read_network,
)
from interfaces.middleware.performance import drive_measure, measure, optimal_gain, optimal_way
from interfaces.middleware.predictor import predicted
from interfaces.middleware.scheduler import GainScheduler, ScheduleCounts
from interfaces.middleware.training import Errors, TrainingConfig, train

__all__ = [
    "ActionAgent",
    "ActionAgentConfig",
    "Controller",
    "DriveFeedback",
    "DriveSetpoint",
    "Errors",
    "Formulation",
    "GainNetwork",
    "GainScheduler",
    "GainSchedulingMiddleware",
    "MiddlewareConfig",
    "Ranges",
    "ScheduleCounts",
    "TrainingConfig",
    "default_network",
    "drive_measure",
    "load_network",
    "measure",
    "optimal_gain",
    "optimal_way",
    "predicted",
    "read_network",
    "train",
]
