"""Dynamixel servos as named joints, over dynamixel-sdk."""
