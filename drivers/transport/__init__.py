"""Byte transports: serial ports, pipes to worker processes, and the loops that read them."""
