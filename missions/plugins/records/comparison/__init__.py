"""Comparison of two runs of one mission."""
