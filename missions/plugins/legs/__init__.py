"""Gaits on the command line: look at them, check them, make new ones."""
