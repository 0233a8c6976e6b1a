"""Driving by hand: keys of a terminal or a game pad in, commands to base and head out."""

FIRST_PAD = "first"
"""Stands for the game pad that is found first, in the place of a device."""
