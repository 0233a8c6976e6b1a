"""Driving by hand: keys of a terminal or a game pad in, commands to base and head out."""
