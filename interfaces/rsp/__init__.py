"""RSP, the robot simulacrum protocol."""
