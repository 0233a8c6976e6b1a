"""What the robot is asked: the missions, their language, and the executive that runs them."""

__project__ = "missiontree"
