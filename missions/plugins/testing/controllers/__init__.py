"""Comparison, plots and tuning of tracking controllers in simulated time."""
