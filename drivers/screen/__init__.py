"""The robot's face: its expression, its drawing, and the page that shows it on the robot's display."""
