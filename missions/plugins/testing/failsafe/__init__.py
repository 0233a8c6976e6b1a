"""Reactions of a base to faults, with the reasons, simulated with the classes that drive real bases."""
