"""Dynamixel servos of protocol 1.0 and 2.0: their bus, their control tables, and an arm of them as named joints."""
