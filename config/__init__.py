"""What the robot is: robot files, gestures, controllers and worlds, read and checked."""

__project__ = "missiontree"
