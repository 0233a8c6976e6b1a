"""Twins: in-process stand-ins for a robot's devices, on a simulated clock, without wire, thread or waiting."""
