"""What the robot sees: from camera frames to people with a place and a time."""

__project__ = "missiontree"
