"""Cars on a Raspberry Pi: two motors on its pins or on a PCA9685, and optionally a pan/tilt head."""
