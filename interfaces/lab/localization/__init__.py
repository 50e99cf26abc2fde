"""Localization in the laboratory: rooms, drives, searches, and how well the robot knew where it was."""
