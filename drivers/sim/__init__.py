"""The simulated world: the room, who stands in it, and the physics of base, servos and camera."""
