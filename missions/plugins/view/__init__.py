"""Live view of a run on a terminal: the tree, the variables, the parts of the robot."""
