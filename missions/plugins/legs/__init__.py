"""Gaits on the command line: show, check and create them."""
