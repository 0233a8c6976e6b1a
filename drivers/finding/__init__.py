"""Detection of connected hardware: ports, cameras, sound cards and game pads, and the devices on the ports."""
