"""A robot from a description: URDF, xacro or MJCF, with what stands beside it."""
