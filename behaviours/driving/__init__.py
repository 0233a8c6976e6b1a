"""Leaves that drive the base, closed over its odometry."""
