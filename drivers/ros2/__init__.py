"""Drivers of robots with ROS 2, over Zenoh, without a ROS installation."""
