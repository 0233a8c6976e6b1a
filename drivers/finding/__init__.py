"""Detection of connected hardware: serial ports, cameras, sound cards, game pads, and the devices on the ports."""
