"""Rigid bodies that stand, walk and fall: a robot's links and servos on a floor, stepped by MuJoCo."""
