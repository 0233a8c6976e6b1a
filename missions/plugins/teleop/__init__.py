"""Teleoperation: keys of a terminal or a game pad drive base and head."""

FIRST_PAD = "first"
"""Device name that stands for the first game pad found."""
