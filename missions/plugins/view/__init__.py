"""A run as it goes on, on a terminal: the tree, the variables, the parts of the robot."""
