"""What the robot can do: the leaves of a mission, a module for each part of the robot."""

__project__ = "missiontree"
