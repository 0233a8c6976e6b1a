"""The commands that try missions in simulated time."""
