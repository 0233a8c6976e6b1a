"""Set up a robot: look for its devices, make its file, calibrate it, know people."""
