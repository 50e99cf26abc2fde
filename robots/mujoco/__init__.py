"""Simulated bodies in MuJoCo, which is imported when a world is made."""
