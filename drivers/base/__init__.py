"""Shared code of mobile bases: arbitration, reflexes, limits, dead reckoning, and drivers of two-wheeled bases."""
