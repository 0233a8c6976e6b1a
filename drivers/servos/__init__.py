"""Dynamixel (protocol 1.0, 2.0) and Feetech servos: bus, control tables, and an arm of them as named joints."""
