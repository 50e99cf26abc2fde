"""The PUMA 560 arm: parameters, kinematics, model."""

from robots.puma560.arm import Puma560, model
from robots.puma560.batch import inverse_batch

__all__ = ["Puma560", "inverse_batch", "model"]
