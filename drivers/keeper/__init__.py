"""Keepers: what holds two actuators for a driver, and lets them rest when that falls silent."""
