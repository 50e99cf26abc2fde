"""Ways to send commands and positions, for comparison with RSP on the same links."""

from interfaces.rsp.schemes.ends import LocalEnd, RobotEnd
from interfaces.rsp.schemes.scheme import SCHEMES, Scheme, scheme

__all__ = ["SCHEMES", "LocalEnd", "RobotEnd", "Scheme", "scheme"]
