"""Sweeps: many runs of one mission over seeds and variations, with success rate, times and causes of failure."""
