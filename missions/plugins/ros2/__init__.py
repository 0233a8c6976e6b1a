"""ROS 2 on the command line: nodes, places, and publishing of runs."""
