"""The robot side: models, kinematics, simulated bodies, and what runs on board. `from robots import puma560`."""
