"""What every pan/tilt head shares: motion profile, two axes, a head made of two joints."""
