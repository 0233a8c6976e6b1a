"""The robot's own face: how it looks, its drawing, and the page that shows it on the robot's display."""
