"""The control condition: what it's worth that the operator sees a virtual robot, and not the real one, late."""
