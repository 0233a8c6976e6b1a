"""Simulated world: room, people, objects and light, and the physics of base, servos and camera."""
