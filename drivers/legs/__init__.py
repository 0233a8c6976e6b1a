"""Legs: a humanoid's body, its kinematics, its gaits, and a base that walks on them."""
