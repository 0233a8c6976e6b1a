"""Leaves that drive the base in closed loop over its odometry."""
