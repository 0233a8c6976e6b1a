"""Following of a target: fuzzy controllers, prediction, and the leaves."""
