"""Builds py_trees nodes from a plan, and ticks them safely."""
