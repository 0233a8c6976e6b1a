"""Byte transports: serial lines, ports, pipes to processes of ours, and loops that read them."""
