"""Drivers of a robot that MissionTree does not know: a rover, and a periscope on an arm."""
