"""Robots that speak ROS 2, over Zenoh, with no ROS installed."""
