"""Finds and loads missions, robots, worlds, leaves, drivers and plug-ins by name."""
