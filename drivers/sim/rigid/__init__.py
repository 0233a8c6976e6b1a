"""Rigid-body physics of a robot: links and servos on a floor, simulated by MuJoCo."""
