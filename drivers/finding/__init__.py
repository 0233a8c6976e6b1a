"""What is plugged in: ports, cameras, sound and game pads, who holds them, and which device answers on a port."""
