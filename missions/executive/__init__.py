"""From a plan to py_trees nodes, and the loop that ticks them safely."""
