"""Cars on a Raspberry Pi: two motors on its pins or on a PCA9685, which may carry a pan/tilt, too."""
