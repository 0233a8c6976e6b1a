"""ROS 2 on the command line: nodes, places, and what a run announces there."""
