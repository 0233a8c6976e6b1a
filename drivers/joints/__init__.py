"""Joints with names: code shared by the drivers of arms, heads and legs, on serial buses and on ROS 2 topics."""
