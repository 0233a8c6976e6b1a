"""Shared code of pan/tilt heads: motion profile, two axes, a head made of two joints."""
