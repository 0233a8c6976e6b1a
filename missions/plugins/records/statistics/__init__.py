"""Figures of recorded runs: how often, how long, how late."""
